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

"""The client of a simulator: asks for its parameters, sets them, resets and pauses it."""

from collections import deque
from collections.abc import Callable, Iterable, Mapping
import itertools
import math
import shlex
import time
from typing import Any, Final, TypeAlias

from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
import rclpy
from rclpy.client import Client
from rclpy.context import Context
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

from .errors import UserError
from ...places import typed
from ...scenes import Step

GET, PUT, RESET, PAUSE = 'get_parameters', 'set_parameters_atomically', 'reset', 'pause'
SHORTER, LET_GO = 'shorter', 'let_go'
# Of each kind of node that is steered; the last is one that no other kind has.
SERVICES: Final[Mapping[str, Mapping[str, Any]]] = {
    'simulator': {GET: GetParameters, PUT: SetParametersAtomically, PAUSE: SetBool,
                  RESET: Trigger},
    'control': {GET: GetParameters, PUT: SetParametersAtomically, SHORTER: Trigger,
                LET_GO: Trigger}}
_TYPES: Final = (ParameterType.PARAMETER_DOUBLE, ParameterType.PARAMETER_INTEGER,
                 ParameterType.PARAMETER_STRING, ParameterType.PARAMETER_BOOL)
# How long a simulator may take to be found and to answer, even on a busy machine [s].
WITHIN: Final = 8.0
# A service may not know yet where to send its answer when it is discovered: ask again after [s].
AGAIN: Final = 2.0
Then: TypeAlias = Callable[[str], object]


class ClientError(UserError):
    """A simulator is absent, ambiguous or silent, or refuses; the message is one line."""


class RefusalError(ClientError):
    """The simulator is there but refuses."""


class SimulatorClient:
    """Makes one request after the other; where one fails, those that wait are dropped."""

    def __init__(self, node: Node, simulator: str, services: Iterable[str] = (),
                 kind: str = 'simulator') -> None:
        self._node, self._kind = node, kind
        known = SERVICES[kind]
        *_, self._mark = known
        self._clients: dict[str, Client] = {
            name: node.create_client(known[name], f'{simulator}/{name}')
            for name in services or known}
        self.name = node.resolve_service_name(f'{simulator}/{RESET}').removesuffix(f'/{RESET}')
        self._requests: deque[tuple[Client, Any, Callable[[Any], object]]] = deque()
        # The answers awaited for the first request: several where it was repeated.
        self._answers: list[Future] = []
        self._since = 0.0

    @property
    def count(self) -> int:
        return self._node.count_services(f'{self.name}/{self._mark}')

    @property
    def is_busy(self) -> bool:
        return bool(self._requests)

    def get(self, names: Iterable[str], take: Callable[[dict[str, Any]], object]) -> None:
        """Ask for parameters that are no arrays."""
        names = list(names)

        def taken(answer: GetParameters.Response) -> None:
            values = dict(itertools.zip_longest(names, answer.values))
            for name, value in values.items():
                # There are no values at all where a parameter is not known.
                if value is None or value.type not in _TYPES:
                    raise ClientError(f'{self.name} is not a gear rattling {self._kind}: it '
                                      f'has no parameter {name}')
            take({name: parameter_value_to_python(value) for name, value in values.items()})

        self._ask(GET, GetParameters.Request(names=names), taken)

    def put(self, values: Mapping[str, float | str], then: Then = bool) -> None:
        """Set parameters, all or none."""
        self._ask(PUT, SetParametersAtomically.Request(parameters=[
            Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]),
            lambda answer: self._judge(answer.result.successful, answer.result.reason, then))

    def begin(self, step: Step, then: Then = bool) -> None:
        """Set the parameters of a step of a scene, and reset the state where the step does."""
        if step.parameters:
            self.put(step.parameters)
        if step.reset:
            self.reset(then)

    def reset(self, then: Then = bool) -> None:
        """Reset the state to the initial condition; `then` is given the simulator's answer."""
        self.trigger(RESET, then)

    def trigger(self, service: str, then: Then = bool) -> None:
        self._ask(service, Trigger.Request(), then=then)

    def pause(self, paused: bool, then: Then = bool) -> None:
        self._ask(PAUSE, SetBool.Request(data=paused), then=then)

    def tick(self) -> None:
        """Make the next request, or take its answer; ClientError where that fails."""
        done = [future for future in self._answers if future.done()]
        try:
            if done:
                take = self._requests[0][2]
                self._drop()
                take(done[0].result())
            elif self._requests:
                self._urge()
        except ClientError:
            self.forget()
            raise

    def finish(self, executor: Executor, within: float = math.inf) -> None:
        """Wait for all answers, or some time [s]; ClientError where one fails."""
        end = time.monotonic() + within
        while self._requests and time.monotonic() < end:
            self.tick()
            executor.spin_once(timeout_sec=0.02)

    def forget(self) -> None:
        while self._requests:
            self._drop()

    def _ask(self, service: str, message: Any, take: Callable[[Any], object] | None = None,
             then: Then = bool) -> None:
        if not self._requests:
            self._since = time.monotonic()
        self._requests.append((self._clients[service], message, take or (
            lambda answer: self._judge(answer.success, answer.message, then))))

    def _judge(self, is_done: bool, words: str, then: Then) -> None:
        if not is_done:
            raise RefusalError(f'{self.name} refused: {words}')
        then(words)

    def _urge(self) -> None:
        client, message, _ = self._requests[0]
        count, passed = self.count, time.monotonic() - self._since
        if passed > WITHIN:
            raise ClientError(
                f'no {self._kind} answers as {self.name}; start one with: '
                + shlex.join(typed(self._kind)) if not count else
                f'{self.name} has not answered for {WITHIN:g} s' if count == 1 else
                f'{count} {self._kind}s answer as {self.name}; end all but one, or rename one '
                'with -r __node:=NAME')
        if count == 1 and client.service_is_ready() and passed >= AGAIN * len(self._answers):
            self._answers.append(client.call_async(message))

    def _drop(self) -> None:
        client = self._requests.popleft()[0]
        for future in self._answers:
            client.remove_pending_request(future)
        self._answers, self._since = [], time.monotonic()


class Visitor(SimulatorClient):
    """A client for a program without a node: it has a node and a context of its own."""

    def __init__(self, name: str, simulator: str, services: Iterable[str] = (),
                 kind: str = 'simulator') -> None:
        self._context = Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        node = rclpy.create_node(
            name, context=self._context, enable_rosout=False, start_parameter_services=False)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(node)
        super().__init__(node, simulator, services, kind)

    def wait(self) -> None:
        self.finish(self._executor)

    def close(self) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()
