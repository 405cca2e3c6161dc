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

"""The simulator: publishes impact events; its parameters can be changed while it runs."""

from collections.abc import Mapping
import dataclasses
import functools
import math
import time
from typing import Any

from builtin_interfaces.msg import Time
import numpy as np
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, PointCloud2
from std_srvs.srv import SetBool, Trigger

from .base.dds_room import make_room
from .base.node import ReportingNode
from .base.pacing import AcknowledgedPace, ClockPace
from .base.process import run_node
from .. import messages
from ..core.flight.fingerprint import fingerprint
from ..core.flight.law import Law
from ..core.flight.noise import jittered, Noise
from ..core.flight.simulation import ramp_step, Simulation
from ..core.gears import Gears
from ..core.model import EventArray, Model, Parameters, State
from ..core.words import counted
from ..gear_pairs import pair_of
from ..parameters import BELOW_TWO_PI, guard, SIMULATOR, SPEEDS, Value
from ..qos import CLOCK, STREAM
from ..scenes import find_scene, Performance

# Most records in one batch, 62 KB: Fast DDS cuts what is beyond 64 KB into fragments, and delivers
# torn messages where it drops one on its way.
LARGEST_BATCH = 640
# With rate = 0, batches made in one callback: going through the executor takes longer.
BATCHES_AT_ONCE = 8
# With rate = 0, most drive periods in a batch, which may hold no impact at all.
LONGEST_BATCH = 4096
INITIAL = ('initial_phase', 'initial_displacement', 'initial_velocity')
# A ramp updates the parameter alpha at these intervals [s].
RAMP_SHOWN_EVERY = 0.25
# A wait for readers is logged at these intervals [s].
WAIT_LOGGED_EVERY = 10.0
# A scene looks at these intervals whether its next step is due [s].
SCENE_EVERY = 0.05
# Pause at rate = 0 when there is nothing to do [s].
IDLE = 0.005


class Simulator(ReportingNode):
    """Advances one trajectory in ticks, and publishes one batch of events a tick."""

    _pair: Gears | None = None
    # Pitch radius of the driven gear in units of that of the driver [1].
    _ratio = 1.0

    def __init__(self, **options: Any) -> None:
        super().__init__('simulator', **options)
        values = self.values
        self._omega, self._rate = self.number('omega'), self.number('rate')
        self._ramp = (self.number('alpha_target'), self.number('alpha_rate'))
        self._paused = False
        self._awaited = int(values['wait_for_readers'])
        began = time.monotonic()
        # In force but for jitter and control.
        self._model = Parameters.of(values)
        self._simulation = Simulation(
            self._model, self._initial(values), noise=self.number('noise'),
            seed=int(values['seed']), kind=_kind_in(values))
        self._law: Law | None = None
        # Compile or load every kernel before anybody waits for the first event.
        fingerprint()
        self._outbox: list[EventArray] = []
        self._start = time.time_ns()
        self._frame = self.frame()
        self._impacts = self.create_publisher(PointCloud2, 'impacts', STREAM)
        self._joints = self.create_publisher(JointState, 'joint_states', STREAM)
        self._clock_output = (
            self.create_publisher(Clock, '/clock', CLOCK) if values['publish_clock'] else None)
        self._acknowledged = AcknowledgedPace(self._impacts)
        self._by_clock = ClockPace(longest=max(10 * self.number('tick'), 0.5))
        self._setting = False
        self._validate(values)
        self._control(Law.of_text(str(values['control'])))
        self._ramp_shown = 0.0
        self._counted = (time.monotonic(), 0)
        self._waiting_since = self._wait_logged = time.monotonic()
        guard(self, SIMULATOR, self._validate, self._apply)
        self.create_service(Trigger, '~/reset', self._reset)
        self.create_service(SetBool, '~/pause', self._pause)
        if self.number('display_rate') > 0.0:
            self.every(1.0 / self.number('display_rate'), self._publish_joints)
        self._timer = self.every(self._period(), self._tick)
        name = str(values['scene'])
        self._scene = Performance(find_scene(name).steps if name else ())
        # The simulation has begun with the first step.
        self._scene.due(0.0, math.nan)
        self._played, self._looked = 0.0, time.monotonic()
        if name:
            self.every(SCENE_EVERY, self._play)
        self.get_logger().info(
            f'ready in {time.monotonic() - began:.1f} s: {_words(self._model)}')

    def defaults(self, given: Mapping[str, Any]) -> Mapping[str, Value]:
        name, pair = given.get('scene'), pair_of(given)
        values = find_scene(str(name)).steps[0].parameters if name else {}
        if pair is None:
            return values
        for line in pair.warnings():
            self.get_logger().warning(line)
        self._pair, self._ratio = pair, pair.driven_radius_m / pair.driver_radius_m
        return {**values, **pair.given, **dataclasses.asdict(pair.parameters), 'omega': pair.omega,
                'backlash_angle': pair.backlash_m / pair.driven_radius_m}

    def report(self) -> tuple[str, str, Mapping[str, object]]:
        now, impacts = time.monotonic(), self._simulation.impacts
        since, before = self._counted
        self._counted = (now, impacts)
        waiting = self._acknowledged.waiting_since
        level, message = 'ok', 'running'
        if self._awaited:
            message = f'waiting for {counted(self._awaited, "reader")}'
        elif self._paused:
            message = 'paused'
        elif self._rate == 0.0 and waiting is not None and now - waiting > 1.0:
            level, message = 'warn', f'waiting {now - waiting:.0f} s for a reader'
        elif self._rate > 0.0 and self._by_clock.lag > 0.0:
            level, message = 'warn', 'slower than the requested rate'
        elif self._simulation.is_permanently_at_rest:
            message = 'permanently at rest on a wall'
        return level, message, {
            'impacts': impacts, 'impacts_per_second': (impacts - before) / (now - since),
            'epoch': self._simulation.epoch, 'cycle': self._simulation.state.cycle,
            'readers': self._impacts.get_subscription_count(),
            **dataclasses.asdict(self._model), 'noise': self._simulation.noise,
            'noise_kind': self._simulation.kind.name.lower(),
            'control': self._law.acts.name.lower() if self._law else 'none',
            'rate': self._rate, 'kernels': fingerprint()}

    def close(self) -> None:
        self._flush()
        # How long the last batches may take to arrive.
        self._impacts.wait_for_all_acked(Duration(seconds=0.3))

    def _keeps_waiting(self) -> bool:
        # A reader that has ended at its start would be waited for without a word.
        if self._impacts.get_subscription_count() >= self._awaited:
            self.get_logger().info(f'{counted(self._awaited, "reader")} joined')
            return False
        now, longest = time.monotonic(), self.number('wait_at_most')
        is_over = 0.0 < longest <= now - self._waiting_since
        if is_over or now - self._wait_logged > WAIT_LOGGED_EVERY:
            self._wait_logged = now
            there = self.get_subscriptions_info_by_topic(self._impacts.topic_name)
            names = ', '.join(sorted(each.node_name for each in there)) or 'nobody'
            self.get_logger().warning(
                f'after {now - self._waiting_since:.0f} s {len(there)} of '
                f'{counted(self._awaited, "reader")} of impacts are there ({names}); '
                + ('it begins without the others' if is_over else 'it waits'))
        return not is_over

    def _play(self) -> None:
        """Begin the next step of the scene, whose time stands still in a pause."""
        now = time.monotonic()
        self._played += 0.0 if self._paused or self._awaited else now - self._looked
        self._looked = now
        step = self._scene.due(self._played, self._model.alpha)
        if step is not None:
            result = self.set_parameters_atomically([
                Parameter(name, value=value) for name, value in step.parameters.items()])
            if not result.successful:
                self.get_logger().warning(f'a step of the scene is left out: {result.reason}')
            if step.reset:
                self._reset(Trigger.Request(), Trigger.Response())

    def _period(self) -> float:
        return 0.0 if self._rate == 0.0 else self.number('tick')

    def _tick(self) -> None:
        periods = self._by_clock.due(self._rate)
        if self._awaited and not self._keeps_waiting():
            self._awaited = 0
        if self._awaited:
            time.sleep(IDLE)
        elif self._paused:
            self._flush()
            time.sleep(IDLE if self._rate == 0.0 else 0.0)
        elif self._rate > 0.0:
            self._advance(periods)
        else:
            for _ in range(BATCHES_AT_ONCE):
                if not self._acknowledged.may_publish() or not self._run_batch():
                    break

    def _run_batch(self) -> bool:
        """Advance by one full batch, whatever the time; return whether it holds any event."""
        room = LARGEST_BATCH
        first = self._simulation.moment[0]
        while room > 0 and self._simulation.moment[0] < first + LONGEST_BATCH:
            room -= self._collect(first + LONGEST_BATCH, 0.0, room)
        if not self._outbox:
            time.sleep(IDLE)
            return False
        self._flush()
        return True

    def _advance(self, periods: float) -> None:
        """Advance by a number of drive periods, as far as the tick allows."""
        deadline = time.monotonic() + self.number('tick')
        cycle, phase = self._simulation.moment
        whole, fraction = divmod(phase / (2.0 * math.pi) + periods, 1.0)
        target = (cycle + int(whole), min(fraction * 2.0 * math.pi, BELOW_TWO_PI))
        while self._simulation.moment < target and time.monotonic() < deadline:
            self._collect(*target, LARGEST_BATCH)
            if sum(map(len, self._outbox)) >= LARGEST_BATCH:
                self._flush()
        self._flush()

    @property
    def _jitters(self) -> bool:
        return self._simulation.kind is Noise.JITTER and self._simulation.noise > 0.0

    def _collect(self, cycle: int, phase: float, most: int) -> int:
        """Advance to a moment, or by `most` records; what changes by the period does so there."""
        changing = self._ramp[1] > 0.0 or self._jitters
        period_end = (self._simulation.moment[0] + 1, 0.0)
        target = min((cycle, phase), period_end) if changing else (cycle, phase)
        events = self._simulation.advance(*target, most)
        if len(events):
            self._outbox.append(events)
        if changing and self._simulation.moment == period_end:
            self._end_period()
        return len(events)

    def _end_period(self) -> None:
        (target, rate), alpha = self._ramp, self._model.alpha
        if rate > 0.0:
            alpha = ramp_step(alpha, target, rate)
            self._model = dataclasses.replace(self._model, alpha=alpha)
        self._retune(self._model if not self._jitters else dataclasses.replace(
            self._model, alpha=jittered(alpha, self._simulation.noise, self._simulation.seed,
                                        self._simulation.moment[0])))
        done = rate > 0.0 and alpha == target
        if done or (rate > 0.0 and time.monotonic() - self._ramp_shown > RAMP_SHOWN_EVERY):
            self._ramp_shown = time.monotonic()
            self._show({'alpha': alpha} | ({'alpha_rate': 0.0} if done else {}))
        if done:
            self._ramp = (target, 0.0)
            self.get_logger().info(f'the ramp has reached alpha = {alpha:g}')

    def _retune(self, parameters: Parameters) -> None:
        """Put parameters in force where they differ, which ends control."""
        if parameters == self._simulation.parameters:
            return
        self._outbox.append(self._simulation.retune(parameters))
        if self._law is not None:
            self._law = None
            self._show({'control': ''})
            self.get_logger().info('control has ended: a parameter of the model has changed')

    def _control(self, law: Law | None) -> None:
        records = self._simulation.control(law)
        if len(records):
            self._outbox.append(records)
        self._law = law

    def _show(self, values: Mapping[str, Value]) -> None:
        """Set ROS parameters to the values in force."""
        self._setting = True
        try:
            self.set_parameters([Parameter(name, value=value) for name, value in values.items()])
        finally:
            self._setting = False

    def _flush(self) -> None:
        stamp = self._stamp()
        if self._outbox:
            events, self._outbox = np.concatenate(self._outbox), []
            for first in range(0, len(events), LARGEST_BATCH):
                self._acknowledged.publish(
                    messages.cloud_from_events(
                        events[first:first + LARGEST_BATCH], stamp, self._frame))
        if self._clock_output is not None:
            self._clock_output.publish(Clock(clock=stamp))

    def _stamp(self) -> Time:
        # Of ROS, so that its tools see no delay; or the time that this node publishes itself.
        if self._clock_output is None:
            return self.get_clock().now().to_msg()
        return messages.stamp_from_nanoseconds(
            self._start + messages.drive_time_nanoseconds(*self._simulation.moment, self._omega))

    def _publish_joints(self) -> None:
        state = self._simulation.state
        alpha = self._simulation.parameters.alpha
        gap = np.array([state.displacement, state.velocity])
        # s = driven - driver: the driver vibrates and hits the driven gear.
        driver = -alpha * np.array([math.sin(state.phase), math.cos(state.phase)])
        scale = self.number('backlash_angle') * np.array([1.0, self._omega])
        self._joints.publish(messages.joint_state({
            'driver_gear': self._ratio * scale * driver, 'driven_gear': scale * (gap + driver),
            'backlash': scale * gap}, self._stamp()))

    def _validate(self, values: dict[str, Value]) -> None:
        if not self._setting:
            Parameters.of(dataclasses.asdict(self._model) | self._at_speed(values)[1])
            given = {name: values.get(name, self.get_parameter(name).value)
                     for name in ('noise', 'noise_kind')}
            if Law.of_text(str(values.get('control', ''))) is not None and (
                    given['noise'] and _kind_in(given) is Noise.JITTER):
                raise ValueError('control needs an alpha that stays; noise_kind = jitter changes '
                                 'it in every drive period, choose gaussian or uniform')
        self._initial(values)

    def _at_speed(self, values: dict[str, Value]) -> tuple[Gears | None, dict[str, Value]]:
        """Return the gear pair, and what is asked for with the beta and gamma of a new speed."""
        pair = self._pair
        speeds = {name: float(values[name]) for name in SPEEDS if name in values
                  and values[name] != (getattr(pair, name, None) or 0.0)}
        if not speeds:
            return pair, values
        if pair is None or not speeds.keys() <= pair.given.keys():
            raise ValueError(f'{next(iter(speeds))} is not what the speed of a gear pair here is '
                             'given by; begin with gears that have it')
        if self._clock_output is not None:
            raise ValueError('with publish_clock the frequency stays, as simulated time is '
                             'tau/omega')
        pair = pair.with_parameters(self._model).at(**speeds)
        return pair, {'beta': pair.parameters.beta, 'gamma': pair.parameters.gamma} | values

    def _initial(self, values: Mapping[str, Value]) -> State:
        """Return the initial condition from some parameters and those in force."""
        return State(0, *(float(values.get(name, self.get_parameter(name).value))
                          for name in INITIAL))

    def _apply(self, values: dict[str, Value]) -> None:
        if self._setting:
            return
        pair, values = self._at_speed(values)
        before = self._model
        self._model = after = dataclasses.replace(
            before, **{name: float(values[name]) for name in Model._fields if name in values})
        if 'noise' in values:
            self._simulation.noise = float(values['noise'])
        if 'noise_kind' in values:
            self._simulation.kind = _kind_in(values)
        if after != before or not self._jitters:
            if 'control' in values:
                # What is asked for with new parameters takes the place of what they end.
                self._control(None)
            self._retune(after)
        if pair is not self._pair and pair is not None:
            self._pair, self._omega = pair, pair.omega
            self._show({'beta': after.beta, 'gamma': after.gamma})
        if after != before:
            self.get_logger().info(_words(after))
        if 'control' in values:
            self._control(Law.of_text(str(values['control'])))
            self.get_logger().info(
                f'control of an orbit of {counted(len(self._law.points), "impact")}'
                if self._law else 'no control')
        target = float(values.get('alpha_target', self._ramp[0]))
        ramp_rate = float(values.get('alpha_rate', 0.0 if 'alpha' in values else self._ramp[1]))
        if self._ramp[1] and not ramp_rate and 'alpha_rate' not in values:
            self._show({'alpha_rate': 0.0})
        self._ramp = (target, ramp_rate)
        if 'rate' in values and float(values['rate']) != self._rate:
            self._rate = float(values['rate'])
            self._by_clock.due(0.0)
            self._timer.timer_period_ns = round(self._period() * 1e9)

    def _reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        state = self._initial({})
        self._simulation.seed = int(self.get_parameter('seed').value)
        self._outbox.append(
            self._simulation.reset(state.phase, state.displacement, state.velocity))
        now = self._simulation.state
        return self._done(
            response, f'reset in drive period {now.cycle} at phase {now.phase:g} to s = '
            f'{now.displacement:g}, v = {now.velocity:g}; epoch {self._simulation.epoch}')

    def _pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._paused = bool(request.data)
        return self._done(response, 'paused' if self._paused else 'running')

    def _done(self, response: Any, message: str) -> Any:
        response.success, response.message = True, message
        self.get_logger().info(message)
        return response


def _kind_in(values: Mapping[str, Value]) -> Noise:
    return Noise[str(values['noise_kind']).upper()]


def _words(parameters: Parameters) -> str:
    return ', '.join(f'{name} = {value:g}' for name, value in dataclasses.asdict(
        parameters).items())


main = functools.partial(run_node, 'simulator', Simulator, room=make_room)
