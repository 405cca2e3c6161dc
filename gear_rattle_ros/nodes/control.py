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

"""Holds unstable orbits of a running simulator, and publishes how well."""

from collections.abc import Mapping
import dataclasses
import functools
import queue
import threading
import time
from typing import Any, Final, NamedTuple

from rclpy.duration import Duration
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from .base.client import ClientError, GET, PUT, SimulatorClient
from .base.dds_room import bound_backlog
from .base.event_input import EventInput
from .base.node import ReportingNode
from .base.process import run_node
from ..attractors.skeleton.holding import LONGEST, Plan, Planner
from ..core.flight.law import Acts
from ..core.model import EventArray, Model, Parameters, State
from ..core.stream.guard import StreamGuard
from ..core.stream.hold import RunningHold
from ..core.words import shown
from ..messages import named_values
from ..parameters import CONTROL, guard, Value
from ..qos import STREAM

# Intervals at which requests go on, and at which the simulator's parameters are read [s].
TURN: Final = 0.02
LOOK_EVERY: Final = 0.25
# How long the simulator may take to let go when this node ends [s].
ENDS_WITHIN: Final = 2.0


class Wanted(NamedTuple):
    """What is to be held, and where."""

    parameters: Parameters
    orbit: str
    acts: Acts
    limit: float


class Dropped(Exception):
    """The plan is no longer wanted."""


class Control(ReportingNode):
    """Plans a law in a thread, sets it on the simulator in one call, and judges it."""

    def __init__(self, **options: Any) -> None:
        super().__init__('control', **options)
        self._asked: dict[str, Value] = {
            name: self.values[name] for name in ('orbit', 'acts', 'limit')}
        self._planner = Planner()
        # Compile the kernels before the first batch.
        self._planner.plan(Parameters(alpha=0.57), State(velocity=-1.0), 'B', Acts.DRIVE, 0.002)
        self._wanted: Wanted | None = None
        self._job: threading.Thread | None = None
        self._plans: queue.SimpleQueue[tuple[Wanted, Plan | str]] = queue.SimpleQueue()
        # The plan for what is wanted, its text, and how well it works where it is in force.
        self._plan: Plan | str = ''
        self._text = ''
        self._hold: RunningHold | None = None
        self._level, self._words = 'ok', 'nothing to hold'
        self._guard = StreamGuard()
        self._state: State | None = None
        self._looked = 0.0
        self.simulator = SimulatorClient(self, str(self.values['simulator']), (GET, PUT))
        self._publisher = self.create_publisher(JointState, 'control', STREAM)
        self._input = EventInput(
            self, self._guard, self._take, 'impacts under control are missing')
        guard(self, CONTROL, lambda values: None, self._asked.update)
        self.create_service(Trigger, '~/shorter', self._shorter)
        self.create_service(Trigger, '~/let_go', self._let_go)
        self.every(TURN, self._turn)
        self.every(1.0 / self.number('publish_rate'), self._publish)
        self.get_logger().info('ready')

    def report(self) -> tuple[str, str, Mapping[str, object]]:
        level, message, values = self._input.report(**self._values())
        return (level, message, values) if level != 'ok' else (self._level, self._words, values)

    def close(self) -> None:
        self._wanted = None
        self._take_back()
        self._input.drain()
        self._publish()
        # How long the last message may take to arrive.
        self._publisher.wait_for_all_acked(Duration(seconds=0.2))

    def _take_back(self) -> None:
        """Take the law out of the simulator, unless another one has replaced it."""
        def take(values: dict[str, Any]) -> None:
            if values['control'] == self._text:
                self.simulator.put({'control': ''})

        if self._text and self.simulator.count and self.executor is not None:
            self.simulator.get(('control',), take)
            try:
                self.simulator.finish(self.executor, ENDS_WITHIN)
            except ClientError as error:
                self.get_logger().warning(f'the law stays in the simulator: {error}')

    def _take(self, events: EventArray) -> None:
        self._guard.split(events)
        if self._hold is not None:
            self._hold.update(events)
        if len(events):
            last = events[-1]
            self._state = State(0, float(last['phase']), float(last['displacement']),
                                float(last['velocity_after']))

    def _turn(self) -> None:
        while not self._plans.empty():
            wanted, plan = self._plans.get()
            self._job = None
            if wanted == self._wanted:
                self._plan = plan
                self._text = plan.law.to_text() if isinstance(plan, Plan) else ''
                self._say('ok' if self._text else 'warn',
                          plan.describe() if isinstance(plan, Plan) else plan)
        try:
            self.simulator.tick()
        except (ClientError, TypeError, ValueError) as error:
            # Another node may answer for a simulator with anything.
            self._say('warn', shown(error))
        now = time.monotonic()
        if self.simulator.count and not self.simulator.is_busy and (
                now > self._looked + LOOK_EVERY):
            self._looked = now
            self.simulator.get((*Model._fields, 'control'), self._look)

    def _look(self, values: dict[str, Any]) -> None:
        """Compare what the simulator does with what it is to do."""
        wanted = Wanted(Parameters.of(values), str(self._asked['orbit']), Acts[
            str(self._asked['acts']).upper()], float(self._asked['limit']))
        if wanted != self._wanted:
            if values['control'] and values['control'] == self._text:
                self._put('')
            elif self._hold is not None:
                self.get_logger().info('control has ended with a change of parameters')
            self._wanted, self._plan, self._text, self._hold = wanted, '', '', None
            self._level, self._words = 'ok', (
                f'looking for {wanted.orbit}' if wanted.orbit else 'nothing to hold')
        elif not wanted.orbit or self._job is not None or self._state is None:
            return
        elif not self._plan:
            # Parameters have stayed for one look.
            self._job = threading.Thread(
                target=self._work, args=(wanted, self._state), name='plan', daemon=True)
            self._job.start()
        elif self._text and values['control'] != self._text:
            self._put(self._text)

    def _work(self, wanted: Wanted, state: State) -> None:
        def check() -> None:
            if wanted != self._wanted:
                raise Dropped

        try:
            self._plans.put((wanted, self._planner.plan(
                wanted.parameters, state, wanted.orbit, wanted.acts, wanted.limit, check)))
        except Exception as error:
            # Whatever went wrong, the node continues with what is wanted next.
            self._plans.put((wanted, str(error) or repr(error)))

    def _put(self, text: str) -> None:
        self._hold = None
        self.simulator.put({'control': text}, lambda _: self._begin(text))

    def _begin(self, text: str) -> None:
        if text and text == self._text and isinstance(self._plan, Plan):
            self._hold = RunningHold(self._plan.law, self._plan.orbit.parameters.alpha)

    def _say(self, level: str, words: str) -> None:
        # Each in a line of its own: a logger keeps the severity of a line.
        if words != self._words and level == 'ok':
            self.get_logger().info(words)
        elif words != self._words:
            self.get_logger().warning(words)
        self._level, self._words = level, words

    def _values(self) -> dict[str, float]:
        if self._hold is None or not isinstance(self._plan, Plan):
            return {}
        return dataclasses.asdict(self._hold.report) | {
            'exponent': self._plan.exponent, 'exponent_free': self._plan.orbit.exponents[0],
            'orbit_impacts': self._plan.orbit.impacts, 'limit': self._plan.law.limit}

    def _publish(self) -> None:
        values = self._values()
        if values.get('impacts'):
            self._publisher.publish(named_values(values, self._input.stamp))

    def _shorter(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        held = self._plan.orbit.impacts if isinstance(self._plan, Plan) else LONGEST + 1
        return self._ask(f'<{held}', response)

    def _let_go(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return self._ask('', response)

    def _ask(self, orbit: str, response: Any) -> Any:
        self.set_parameters([Parameter('orbit', value=orbit)])
        response.success = True
        response.message = f'looking for {orbit}' if orbit else 'let go'
        return response


main = functools.partial(run_node, 'control', Control, room=bound_backlog)
