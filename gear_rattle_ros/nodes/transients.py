"""Where transients end: periodic orbits and rest, found in the stream."""

from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticArray

from .base.dds_room import ReadingNode
from .base.node import EventInput, HoleLog, run_node
from ..core.flight.simulation import Simulation
from ..core.model import EventArray, Parameters, State
from ..core.stream.report_values import transient_values
from ..core.stream.transients import TransientDetector
from ..messages import diagnostic_array, stamp_from_nanoseconds
from ..parameters import TRANSIENTS
from ..qos import LATCHED


class Transients(ReadingNode):
    """Feeds the stream to a TransientDetector and publishes every change."""

    def __init__(self) -> None:
        super().__init__('transients', TRANSIENTS)
        self._tolerance = self.number('tolerance')
        TransientDetector(self._tolerance).update(
            Simulation(Parameters(), State()).advance(100, 0.0, 400))
        self._detector = TransientDetector(self._tolerance)
        self._holes = HoleLog(self, self._detector.guard, 'the search begins afresh')
        self._publisher = self.create_publisher(DiagnosticArray, 'transient', LATCHED)
        self._input = EventInput(self, self._take)
        self.get_logger().info('ready')

    def report(self) -> tuple[str, str, Mapping[str, object]]:
        """Return the present regime and what was lost."""
        level, message = self._holes.status()
        return level, message, {
            **self._input.counts(), **self._holes.counts(),
            'regime': self._detector.report.describe(), 'impacts': self._detector.impacts}

    def close(self) -> None:
        """Say the last word."""
        self._input.drain()

    def _take(self, events: EventArray, stamp: int) -> None:
        changes = self._detector.update(events)
        self._holes.speak()
        for change in changes:
            self._publisher.publish(diagnostic_array(
                f'{self.get_name()}: trajectory', self.get_fully_qualified_name(), 'ok',
                change.describe(), transient_values(change) | {'tolerance': self._tolerance},
                stamp_from_nanoseconds(stamp)))
            self.get_logger().info(change.describe())


def main(arguments: list[str] | None = None) -> int:
    """Run the node; the exit status is 0, or 2 where it cannot start."""
    return run_node('transients', Transients, arguments)
