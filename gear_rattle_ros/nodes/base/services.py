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

"""Protection from what others send: a malformed request or message must not end a node."""

from collections.abc import Callable
import re
from typing import Any, Final

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile

# Different reasons that are logged for one topic.
REASONS_MOST: Final = 20
_TYPES: Final = {int(kind.value) for kind in Parameter.Type}


def listen(node: Node, kind: type, topic: str, take: Callable[[Any], None],
           qos: QoSProfile | int) -> None:
    """Subscribe with a callback; skip what it cannot understand, and log each reason once."""
    logged: set[str] = set()

    def guarded(message: Any) -> None:
        try:
            take(message)
        except Exception as error:
            reason = f'{error!r:.200}'
            if reason not in logged and len(logged) < REASONS_MOST:
                logged.add(reason)
                node.get_logger().warning(f'refused a message on {topic}: {reason}')
    node.create_subscription(kind, topic, guarded, qos)


def harden(node: Node) -> None:
    """Make every service of a node refuse what it cannot understand, with a reason in the log."""
    for service in node.services:
        service.callback = _guarded(node, service.callback)


def _guarded(node: Node, answer: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    def guarded(request: Any, response: Any) -> Any:
        # rclpy raises at an unknown type, and accepts any value for a parameter without a name.
        for parameter in getattr(request, 'parameters', ()):
            if parameter.value.type not in _TYPES:
                return _refused(request, response,
                                f'{parameter.name!r} has the unknown type {parameter.value.type}')
            if not parameter.name:
                return _refused(request, response, 'a parameter has no name')
        try:
            return _named(request, answer(request, response))
        except Exception as error:
            node.get_logger().warning(f'refused a request: {error!r:.500}')
            return _refused(request, type(response)(), repr(error))
    return guarded


def _refused(request: Any, response: Any, reason: str) -> Any:
    refusal = SetParametersResult(successful=False, reason=reason)
    if hasattr(response, 'results') and hasattr(request, 'parameters'):
        response.results = [refusal for _ in request.parameters]
    elif hasattr(response, 'result') and hasattr(request, 'parameters'):
        response.result = refusal
    return response


def _named(request: Any, response: Any) -> Any:
    # rclpy does not always name the parameter that it refuses.
    given = getattr(request, 'parameters', ())
    results = getattr(response, 'results', ())
    if hasattr(response, 'result') and len(given) == 1:
        results = [response.result]
    for parameter, result in zip(given, results, strict=False):
        if isinstance(result, SetParametersResult) and not result.successful and (
                not re.search(rf'\b{re.escape(parameter.name)}\b', result.reason)):
            result.reason = f'{parameter.name[:80]}: {result.reason}'
    return response
