"""Running Lyapunov exponents of the stream."""

from collections.abc import Mapping
import dataclasses

from rclpy.duration import Duration
from sensor_msgs.msg import JointState

from .base.dds_room import ReadingNode
from .base.node import EventInput, HoleLog, run_node
from ..core.flight.simulation import Simulation
from ..core.model import EventArray, Parameters, State
from ..core.stream.lyapunov import LyapunovReport, RunningLyapunov
from ..core.stream.report_values import infinite_in_words, lyapunov_values
from ..messages import named_values, stamp_from_nanoseconds
from ..parameters import LYAPUNOV
from ..qos import STREAM

# How long the last estimate may take to arrive when the node ends [s].
LAST_WORD = 0.2


class Lyapunov(ReadingNode):
    """Feeds the stream to a RunningLyapunov and publishes its estimate at a steady rate."""

    def __init__(self) -> None:
        super().__init__('lyapunov', LYAPUNOV)
        window = int(self.values['window'])
        RunningLyapunov(window).update(Simulation(Parameters(), State()).advance(10, 0.0, 100))
        self._running = RunningLyapunov(window)
        self._stamp = 0
        self._published: LyapunovReport | None = None
        self._was_infinite = False
        self._holes = HoleLog(self, self._running.guard, 'a new average begins')
        self._publisher = self.create_publisher(JointState, 'lyapunov', STREAM)
        self._input = EventInput(self, self._take)
        self.every(1.0 / self.number('publish_rate'), self._publish)
        self.get_logger().info('ready')

    def report(self) -> tuple[str, str, Mapping[str, object]]:
        """Return the estimate and what was lost."""
        now = self._running.report
        level, message = self._holes.status()
        return level, message, {
            **self._input.counts(), **self._holes.counts(), **dataclasses.asdict(now),
            'infinite': infinite_in_words(dataclasses.asdict(now)) or 'none'}

    def close(self) -> None:
        """Publish the last word."""
        self._input.drain()
        self._publish()
        self._publisher.wait_for_all_acked(Duration(seconds=LAST_WORD))

    def _take(self, events: EventArray, stamp: int) -> None:
        self._stamp = stamp
        self._running.update(events)
        self._holes.speak()

    def _publish(self) -> None:
        now = self._running.report
        if now.index == 0 and now.impacts == 0 or now == self._published:
            return
        self._published = now
        values = lyapunov_values(now)
        infinite = infinite_in_words(values)
        # Said where it begins, not in every epoch of a ramp.
        if infinite and not self._was_infinite:
            self.get_logger().info(infinite)
        self._was_infinite = bool(infinite)
        self._publisher.publish(named_values(values, stamp_from_nanoseconds(self._stamp)))


def main(arguments: list[str] | None = None) -> int:
    """Run the node; the exit status is 0, or 2 where it cannot start."""
    return run_node('lyapunov', Lyapunov, arguments)
