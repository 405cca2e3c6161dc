"""The node: its parameters, its safe services, its diagnostics."""

import abc
from collections.abc import Callable, Iterable, Mapping
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.timer import Timer

from .errors import UserError
from .services import harden
from ...core.words import shown
from ...messages import diagnostic_array
from ...parameters import declare, TABLES

# The system clock when the process began, by the clock that nobody sets [s].
_BEGAN = time.time() - time.monotonic()


def set_back() -> float:
    """Return by how much the system clock was set back since the start [s], 0 below 1 s."""
    back = _BEGAN - time.time() + time.monotonic()
    return back if back >= 1.0 else 0.0


class BaseNode(Node):
    """A node with its table of parameters declared; `options` are those of `rclpy.node.Node`."""

    def __init__(self, name: str, **options: Any) -> None:
        try:
            super().__init__(name, automatically_declare_parameters_from_overrides=True, **options)
        except RuntimeError as error:
            # Errors of rcl: a name that is not valid, or DDS that does not start.
            raise UserError(' '.join(str(error).split())) from error
        harden(self)
        self.values = declare(self, TABLES[name])

    def declare_parameters(self, namespace: str, parameters: Iterable[tuple[Any, ...]],
                           ignore_override: bool = False) -> list[Parameter]:
        """Declare parameters; unlike rclpy, name one that is given without a value."""
        parameters = list(parameters)
        for name, *rest in parameters:
            if rest and rest[0] is None:
                raise ValueError(f'{shown(name)} has no value')
        return list(super().declare_parameters(namespace, parameters, ignore_override))

    def number(self, name: str) -> float:
        """Return the first value of a numeric parameter."""
        return float(self.values[name])


class ReportingNode(BaseNode, abc.ABC):
    """A node that reports on itself once a second; `run_node` ends it when it is finished."""

    exit_status = 0
    is_finished = False

    def __init__(self, name: str, room: Callable[[], str] = str, **options: Any) -> None:
        # DDS is asked for room for the stream before the first node is made, or never.
        lacking = room()
        super().__init__(name, **options)
        if lacking:
            self.get_logger().warning(lacking)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self.every(1.0, self._publish_diagnostics)

    def every(self, seconds: float, callback: Callable[[], None]) -> Timer:
        """Call back at intervals of wall time, which passes with use_sim_time too."""
        return self.create_timer(seconds, callback, clock=self._steady)

    @abc.abstractmethod
    def report(self) -> tuple[str, str, Mapping[str, object]]:
        """Return level (ok, warn, error), message and values for the diagnostics."""

    def close(self) -> None:
        """Finish what is open; called once, before the node is destroyed."""

    def _publish_diagnostics(self) -> None:
        level, message, values = self.report()
        if back := set_back():
            level = 'warn' if level == 'ok' else level
            message += f'; the system clock was set back by {back:,.0f} s: DDS may stand still'
        self._diagnostics.publish(diagnostic_array(
            f'{self.get_name()}: {self.get_name()}', self.get_fully_qualified_name(), level,
            message, values, self.get_clock().now().to_msg()))
