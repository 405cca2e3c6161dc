"""Where transients end: periodic orbits and rest, found in the stream."""

from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticArray

from .shell import EventInput, HoleLog, run_node, ShellNode
from ..core.model import EventArray, Parameters, State
from ..core.orbits import Regime, TransientDetector, TransientReport
from ..core.simulation import Simulation
from ..messages import diagnostic_array, stamp_from_nanoseconds
from ..parameters import TRANSIENTS
from ..qos import LATCHED


class Transients(ShellNode):
    """Feeds the stream to a TransientDetector and publishes every change."""

    def __init__(self) -> None:
        super().__init__('transients', TRANSIENTS)
        tolerance = self.number('tolerance')
        TransientDetector(tolerance).update(
            Simulation(Parameters(), State()).advance(100, 0.0, 400))
        self._detector = TransientDetector(tolerance)
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
        before = self._detector.report
        changes = self._detector.update(events)
        self._holes.speak()
        for change in changes:
            self._publisher.publish(diagnostic_array(
                f'{self.get_name()}: trajectory', self.get_fully_qualified_name(), 'ok',
                change.describe(), transient_values(change), stamp_from_nanoseconds(stamp)))
            if change.regime is not Regime.TRANSIENT or before.regime is not Regime.TRANSIENT:
                self.get_logger().info(change.describe())
            before = change


def transient_values(report: TransientReport) -> dict[str, object]:
    """Return a report as key and value; an orbit's points are numbered from 0."""
    values: dict[str, object] = {
        'state': report.regime.value,
        'epoch': report.epoch,
        'index': report.index,
        'start': report.start,
    }
    if report.lifetime is not None:
        values['lifetime'] = report.lifetime
    if report.regime is Regime.ORBIT:
        values['period_impacts'] = report.period_impacts
        values['period_drive'] = report.period_drive
        values['multiplier'] = report.multiplier
        for number, point in enumerate(report.points):
            side = 'upper' if point.side == 1 else 'lower'
            values[f'point_{number}'] = (
                f'{side} wall, phase {point.phase!r}, velocity {point.velocity!r}')
    return values


def main(arguments: list[str] | None = None) -> int:
    """Run the node; the exit status is 0, or 2 where it cannot start."""
    return run_node('transients', Transients, arguments)
