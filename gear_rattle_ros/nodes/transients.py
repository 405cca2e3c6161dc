"""Where transients end: periodic orbits and rest, found in the stream."""

from collections.abc import Mapping
import functools
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray

from .base.dds_room import bound_backlog
from .base.event_input import EventInput
from .base.node import ReportingNode
from .base.process import run_node
from ..core.flight.simulation import Simulation
from ..core.model import EventArray, Parameters, State
from ..core.stream.report_values import transient_values
from ..core.stream.transients import TransientDetector
from ..messages import diagnostic_array
from ..qos import LATCHED


class Transients(ReportingNode):
    """Feeds the stream to a TransientDetector and publishes every change."""

    def __init__(self, **options: Any) -> None:
        super().__init__('transients', bound_backlog, **options)
        self._tolerance = self.number('tolerance')
        # Compile the kernels before the first batch.
        TransientDetector(self._tolerance).update(
            Simulation(Parameters(), State()).advance(100, 0.0, 400))
        self._detector = TransientDetector(self._tolerance)
        self._publisher = self.create_publisher(DiagnosticArray, 'transient', LATCHED)
        self._input = EventInput(
            self, self._detector.guard, self._take, 'the search for an orbit begins again')
        self.get_logger().info('ready')

    def report(self) -> tuple[str, str, Mapping[str, object]]:
        return self._input.report(
            regime=self._detector.report.describe(), impacts=self._detector.impacts)

    def close(self) -> None:
        self._input.drain()

    def _take(self, events: EventArray) -> None:
        changes = self._detector.update(events)
        # A hole is logged before what follows from it.
        self._input.health.log()
        for change in changes:
            words, values = change.describe_attractor(), transient_values(change)
            if change.letter:
                values['letter'] = change.letter
            self._publisher.publish(diagnostic_array(
                f'{self.get_name()}: trajectory', self.get_fully_qualified_name(), 'ok', words,
                values | {'tolerance': self._tolerance}, self._input.stamp))
            self.get_logger().info(words)


main = functools.partial(run_node, 'transients', Transients)
