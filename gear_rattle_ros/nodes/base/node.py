# Copyright 2026 The gear_rattle_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The node: its parameters, its safe services, its diagnostics."""

import abc
from collections.abc import Callable, Iterable, Mapping
import copy
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription
from rclpy.timer import Timer

from .errors import UserError
from .services import harden
from ...core.words import shown
from ...messages import diagnostic_array, SECTION_FRAME
from ...parameters import declare, given_to, TABLES, Value
from ...qos import check_overrides, OVERRIDABLE, OVERRIDING

# The system clock when the process began, by the clock that nobody sets [s].
_BEGAN = time.time() - time.monotonic()


def set_back() -> float:
    """Return by how much the system clock was set back since the start [s], 0 below 1 s."""
    back = _BEGAN - time.time() + time.monotonic()
    return back if back >= 1.0 else 0.0


class BaseNode(Node):
    """A node with its table of parameters declared; `options` are those of `rclpy.node.Node`."""

    def __init__(self, name: str, **options: Any) -> None:
        self._kind = name
        try:
            super().__init__(name, automatically_declare_parameters_from_overrides=True, **options)
        except RuntimeError as error:
            # Errors of rcl: a name that is not valid, or DDS that does not start.
            raise UserError(' '.join(str(error).split())) from error
        harden(self)
        self.given = given = given_to(self)
        if name in OVERRIDABLE:
            check_overrides(given, {place: [self.resolve_topic_name(topic) for topic in topics]
                                    for place, topics in OVERRIDABLE[name].items()})
        for each in given:
            if each.startswith('qos_overrides.'):
                # Declared again, read-only, with the publisher or subscription.
                self.undeclare_parameter(each)
        self.values = declare(self, TABLES[name], self.defaults(given))

    def defaults(self, given: Mapping[str, Any]) -> Mapping[str, Value]:
        """Return defaults of parameters that depend on what is given."""
        return {}

    def frame(self) -> str:
        """Return the frame of the section: the parameter, or one in the namespace of the node."""
        return str(self.values['frame']) or f'{self.get_namespace()}/{SECTION_FRAME}'.lstrip('/')

    def create_publisher(self, msg_type: Any, topic: str, qos_profile: Any,
                         **options: Any) -> Publisher:
        """Create a publisher whose quality of service may be overridden by parameters."""
        return super().create_publisher(
            msg_type, topic, copy.copy(qos_profile),
            **self._overriding('publisher', topic) | options)

    def create_subscription(self, msg_type: Any, topic: str, callback: Callable[..., Any],
                            qos_profile: Any, **options: Any) -> Subscription:
        """Create a subscription whose quality of service may be overridden by parameters."""
        return super().create_subscription(
            msg_type, topic, callback, copy.copy(qos_profile),
            **self._overriding('subscription', topic) | options)

    def _overriding(self, place: str, topic: str) -> dict[str, Any]:
        topics = OVERRIDABLE.get(self._kind, {}).get(place, ())
        return {'qos_overriding_options': OVERRIDING} if topic in topics else {}

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

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
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
