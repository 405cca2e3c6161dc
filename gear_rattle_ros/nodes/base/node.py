"""What all nodes have in common: start, diagnostics, reading the stream, a quiet end."""

import abc
from collections.abc import Callable, Mapping, Sequence
import gc
import signal
import sys
import time
from types import FrameType

from diagnostic_msgs.msg import DiagnosticArray
import rclpy
from rclpy._rclpy_pybind11 import RCLError, UnknownROSArgsError
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.logging_severity import LoggingSeverity
from rclpy.logging import get_logger_level, set_logger_level
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.timer import Timer
from rclpy.utilities import remove_ros_args, try_shutdown
from sensor_msgs.msg import PointCloud2

from .arguments import (
    can_be_read_again,
    explained,
    misspelt_sections,
    refuse_large_files,
    refuse_plain,
    split_arguments,
)
from .services import harden
from ...core.model import EventArray
from ...core.stream.guard import StreamGuard
from ...core.words import counted
from ...messages import diagnostic_array, events_from_cloud, nanoseconds_from_stamp
from ...parameters import declare, shown, Specification
from ...qos import STREAM_INPUT

# A signal is seen between two callbacks, or after so long without one [s].
STOP_SEEN_WITHIN = 0.1
# A node that ends takes in what has arrived, for so long at the most [s].
DRAIN_WITHIN = 0.5
# Batches taken at one go, as going through the executor costs more than taking them.
TAKEN_AT_ONCE = 16
# Holes named in one line of the log; the others are counted in it.
SAID_AT_ONCE = 20
STREAM_TYPE = 'sensor_msgs/msg/PointCloud2'


class StartError(Exception):
    """A node cannot start, for a reason that its user can mend."""


class GivenNode(Node):
    """A node with whatever it is given declared; ValueError names a parameter without a value."""

    def __init__(self, name: str) -> None:
        try:
            super().__init__(name, automatically_declare_parameters_from_overrides=True)
        except (ParameterException, ValueError) as error:
            # rclpy does not say which of them is empty.
            for given in self._parameter_overrides.values():
                if given.type_ == Parameter.Type.NOT_SET:
                    raise ValueError(f'{shown(given.name)} has no value') from error
            raise


class ShellNode(GivenNode, abc.ABC):
    """A node with a table of parameters and diagnostics once a second; ends when finished."""

    def __init__(self, name: str, table: Sequence[Specification]) -> None:
        super().__init__(name)
        harden(self)
        self.values = declare(self, table)
        self.is_finished = False
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self.every(1.0, self._publish_diagnostics)

    def every(self, seconds: float, callback: Callable[[], None]) -> Timer:
        """Call back at intervals of wall time: with use_sim_time, too, nothing stands still."""
        return self.create_timer(seconds, callback, clock=self._steady)

    def number(self, name: str) -> float:
        """Return the start value of a numeric parameter."""
        return float(self.values[name])

    @abc.abstractmethod
    def report(self) -> tuple[str, str, Mapping[str, object]]:
        """Return level (ok, warn, error), message and values for the diagnostics."""

    def close(self) -> None:
        """Finish what is open; called once, before the node is destroyed."""

    def _publish_diagnostics(self) -> None:
        level, message, values = self.report()
        name = f'{self.get_name()}: {self.get_name()}'
        self._diagnostics.publish(diagnostic_array(
            name, self.get_fully_qualified_name(), level, message, values,
            self.get_clock().now().to_msg()))


class EventInput:
    """Subscription to the stream that counts what it gets and refuses what is no EVENT batch."""

    def __init__(self, node: Node, take: Callable[[EventArray, int], None]) -> None:
        self.batches = 0
        self.events = 0
        self.refused = 0
        self.last_refusal = ''
        self._node = node
        self._take = take
        self._since = time.monotonic()
        self._seen = 0
        self._subscription = node.create_subscription(
            PointCloud2, 'impacts', self._receive_some, STREAM_INPUT)

    def counts(self) -> dict[str, object]:
        """Return what has come in, for the diagnostics, and the rate since the last call."""
        now = time.monotonic()
        rate = (self.events - self._seen) / max(now - self._since, 1e-9)
        self._since, self._seen = now, self.events
        return {
            'batches': self.batches,
            'events': self.events,
            'events_per_second': rate,
            'refused_batches': self.refused,
        }

    def drain(self) -> None:
        """Take in what has arrived: it has been acknowledged, nobody else keeps it for us."""
        deadline = time.monotonic() + DRAIN_WITHIN
        while time.monotonic() < deadline and self._take_one():
            pass

    def _receive_some(self, cloud: PointCloud2) -> None:
        self._receive(cloud)
        for _ in range(TAKEN_AT_ONCE - 1):
            if not self._take_one():
                return

    def _take_one(self) -> bool:
        handle = self._subscription.handle
        with handle:
            taken = handle.take_message(PointCloud2, False)
        if taken is None:
            return False
        self._receive(taken[0])
        return True

    def _receive(self, cloud: PointCloud2) -> None:
        try:
            events = events_from_cloud(cloud)
        except ValueError as error:
            self.refused += 1
            if str(error) != self.last_refusal:
                self.last_refusal = str(error)
                self._node.get_logger().warning(f'a batch is refused: {error}')
            return
        self.batches += 1
        self.events += len(events)
        self._take(events, nanoseconds_from_stamp(cloud.header.stamp))


class HoleLog:
    """Says what a guard has found: where a reader comes in, and every hole by its numbers."""

    def __init__(self, node: Node, guard: StreamGuard, consequence: str) -> None:
        self._node = node
        self._guard = guard
        self._consequence = consequence
        self._said = (0, 0)
        self._joined = False

    def speak(self) -> None:
        """Log what is new."""
        guard = self._guard
        # Both are only ever counted up, by another thread in the recorder.
        gaps, restarts = guard.gaps, guard.restarts
        if not self._joined and guard.first_index is not None:
            self._joined = True
            self._node.get_logger().info(f'the stream is here at impact {guard.first_index}')
        fresh = gaps - self._said[0]
        if fresh:
            latest = list(guard.holes)[-fresh:]
            words = '; '.join(hole.describe() for hole in latest[:SAID_AT_ONCE])
            rest = fresh - min(len(latest), SAID_AT_ONCE)
            more = f'; and {counted(rest, "more gap")}' if rest else ''
            self._node.get_logger().warning(f'lost: {words}{more}; {self._consequence}')
        if restarts != self._said[1]:
            self._node.get_logger().info(f'the stream has begun anew; {self._consequence}')
        self._said = (gaps, restarts)

    def status(self) -> tuple[str, str]:
        """Return level and message for the diagnostics."""
        publishers = self._node.get_publishers_info_by_topic(
            self._node.resolve_topic_name('impacts'))
        for publisher in publishers:
            if publisher.topic_type != STREAM_TYPE:
                return 'warn', (f'{publisher.node_name} publishes impacts as '
                                f'{publisher.topic_type}, not {STREAM_TYPE}')
        if len(publishers) > 1:
            return 'warn', f'{len(publishers)} publishers on impacts: their streams are mixed'
        if not self._joined:
            return 'ok', 'no impacts yet'
        if self._guard.gaps:
            return 'warn', (f'{counted(self._guard.lost, "impact")} lost in '
                            f'{counted(self._guard.gaps, "gap")}')
        return 'ok', 'whole'

    def counts(self) -> dict[str, object]:
        """Return what was lost, for the diagnostics."""
        guard = self._guard
        return {
            'gaps': guard.gaps,
            'lost_impacts': guard.lost,
            'restarts': guard.restarts,
            **({'last_hole': guard.holes[-1].describe()} if guard.holes else {}),
        }


class Stop:
    """SIGINT and SIGTERM: they interrupt a start, and end the spinning between two callbacks."""

    def __init__(self) -> None:
        self.asked = False
        self.spinning = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._handle)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        self.asked = True
        if not self.spinning:
            raise KeyboardInterrupt


def begin(ros: list[str]) -> None:
    """Begin ROS with its arguments; StartError or ValueError names one that it cannot take."""
    refuse_large_files(ros)
    try:
        if can_be_read_again(ros):
            _try_quietly(ros)
        rclpy.init(args=ros, signal_handler_options=SignalHandlerOptions.NO)
    except UnknownROSArgsError as error:
        raise StartError(f'ROS does not know the arguments {error}') from error
    except RCLError as error:
        raise StartError(explained(error)) from error


def _try_quietly(ros: list[str]) -> None:
    """Let rcl take arguments with its log shut: of one it refuses it says less than we do."""
    level = get_logger_level('rcl')
    set_logger_level('rcl', LoggingSeverity.FATAL)
    try:
        remove_ros_args(ros)
    finally:
        set_logger_level('rcl', level)


def initialise(name: str, arguments: list[str] | None) -> None:
    """Begin ROS with the arguments of a node; StartError or ValueError names one nobody reads."""
    plain, ros = split_arguments(sys.argv[1:] if arguments is None else arguments)
    refuse_plain(name, plain)
    begin(ros)
    for line in misspelt_sections(name, ros):
        print(f'{name}: {line}', file=sys.stderr, flush=True)


def run_node(name: str, make: Callable[[], ShellNode], arguments: list[str] | None) -> int:
    """Spin a node until it is told to stop; exit status 0, or 2 where it cannot start."""
    # rclpy's own handlers would invalidate the context under a callback that publishes.
    stop = Stop()
    node = None
    try:
        try:
            initialise(name, arguments)
            node = make()
        except (StartError, ValueError, RCLError) as error:
            print(f'{name}: {explained(error)}', file=sys.stderr)
            return 2
        stop.spinning = True
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        while not (stop.asked or node.is_finished):
            executor.spin_once(timeout_sec=STOP_SEEN_WITHIN)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        # From here on a second Ctrl-C must not cut what is being written.
        stop.spinning = True
        if node is not None:
            node.close()
            node.destroy_node()
        else:
            # One that was made in part holds shared memory, which would outlive the process.
            gc.collect()
        try_shutdown()
    return 0
