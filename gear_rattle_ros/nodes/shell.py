"""What all nodes have in common: start, diagnostics, reading the stream, a quiet end."""

import abc
from collections.abc import Callable, Mapping, Sequence
import signal
import sys
import time

from diagnostic_msgs.msg import DiagnosticArray
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2

from ..core.model import EventArray
from ..messages import diagnostic_array, events_from_cloud, nanoseconds_from_stamp
from ..parameters import declare, Specification
from ..qos import STREAM_INPUT


class StartError(Exception):
    """A node cannot start, for a reason that its user can mend."""


class ShellNode(Node, abc.ABC):
    """A node with a table of parameters and diagnostics once a second."""

    def __init__(self, name: str, table: Sequence[Specification]) -> None:
        super().__init__(name, automatically_declare_parameters_from_overrides=True)
        self.values = declare(self, table)
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self.create_timer(1.0, self._publish_diagnostics)

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
            PointCloud2, 'impacts', self._receive, STREAM_INPUT)

    def rate(self) -> float:
        """Return events per second since the last call."""
        now = time.monotonic()
        rate = (self.events - self._seen) / max(now - self._since, 1e-9)
        self._since, self._seen = now, self.events
        return rate

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


def run_node(name: str, make: Callable[[], ShellNode], arguments: list[str] | None) -> int:
    """Spin a node until it is told to stop; exit status 0, or 2 where it cannot start."""
    node = None
    try:
        rclpy.init(args=arguments)
        node = make()
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except (StartError, ValueError) as error:
        if node is not None:
            raise
        print(f'{name}: {error}', file=sys.stderr)
        return 2
    except Exception as error:
        # Arguments that rcl itself refuses; the first line says which.
        if rclpy.ok() or node is not None:
            raise
        print(f'{name}: {str(error).splitlines()[0]}', file=sys.stderr)
        return 2
    finally:
        # A second Ctrl-C must not cut what is being written.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        if node is not None:
            node.close()
            node.destroy_node()
        rclpy.try_shutdown()
    return 0
