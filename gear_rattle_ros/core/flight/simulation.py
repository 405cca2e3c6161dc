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

"""A trajectory as a stream of events: advance, retune in flight, reset."""

import dataclasses
import math
import numbers
from typing import Final

import numpy as np

from .closed_form import (
    displace,
    displace_leg,
    elapsed,
    later,
    LEG,
    LEG_PERIODS,
    model_of,
    NO_WALL,
    rebound,
    release_delay,
    rests,
    stays_clear,
    UPPER,
)
from .elementary import sine_cosine, TWO_PI
from .first_impact import search_along
from .law import correction, LAW, Law, PULSES
from .noise import draw, JITTER, Noise
from .stretches import stretches_of
from ..arrays import Record, RecordArray, Whole
from ..compiled import kernel
from ..model import (
    ALPHA_MAXIMUM,
    EVENT,
    EventArray,
    EventKind,
    Parameters,
    require_finite,
    State,
)

IMPACT, STICK, RELEASE, RETUNE, RESET = (int(kind) for kind in EventKind)
NOISE_MAXIMUM: Final = 10.0
SEED_MAXIMUM: Final = 2**63 - 1

# The trajectory from its last event on, and the next impact where it has been found.
TRAJECTORY: Final = np.dtype([
    ('cycle', np.int64), ('phase', np.float64), ('displacement', np.float64),
    ('velocity', np.float64), ('rests', np.bool_), ('searched', np.float64), ('effort', np.int64),
    ('wall', np.int64), ('impact_velocity', np.float64), ('index', np.int64), ('epoch', np.int64),
    ('alpha', np.float64), ('beta', np.float64), ('gamma', np.float64),
    ('restitution', np.float64), ('noise', np.float64), ('noise_kind', np.int64),
    ('seed', np.uint64), *LAW,
], align=True)


@kernel
def write_event(record: Record, kind: int, trajectory: Record, velocity: float) -> None:
    """Write the record of an event, with the velocity before it, just after it was applied."""
    e, t = record, trajectory
    e.kind = kind
    e.index, e.epoch, e.cycle = t.index & 0xFFFFFFFF, t.epoch & 0xFFFFFFFF, t.cycle & 0xFFFFFFFF
    e.phase, e.displacement, e.velocity, e.velocity_after = (
        t.phase, t.displacement, velocity, t.velocity)
    e.alpha, e.beta, e.gamma, e.restitution = t.alpha, t.beta, t.gamma, t.restitution


@kernel
def settle(trajectory: Record) -> None:
    """Decide whether a trajectory rests or flies, and forget the search for its next impact."""
    t = trajectory
    t.searched, t.effort, t.wall = 0.0, 0, NO_WALL
    t.rests = rests(t.displacement, t.velocity, t.phase, model_of(t))


@kernel
def run(trajectory: Record, events: RecordArray, cycle: int, phase: float) -> int:
    """Follow a trajectory to a moment (cycle, phase [rad]); return how many events it writes."""
    # Fewer than fit into `events` means that the moment was reached.
    t, model = trajectory, model_of(trajectory)
    stretches = stretches_of(model)
    count = 0
    while count < len(events):
        if t.waits:
            # The law acts just after an impact.
            t.waits = False
            t.alpha = t.wanted
            t.epoch += 1
            settle(t)
            write_event(events[count], RETUNE, t, t.velocity)
            model = model_of(t)
            stretches = stretches_of(model)
            count += 1
            continue
        left = elapsed(cycle - t.cycle, t.phase, phase)
        if t.rests:
            delay = release_delay(t.displacement, t.phase, model)
            if delay > left:
                break
            periods, t.phase = later(t.phase, delay)
            t.cycle += periods
            t.rests = False
            write_event(events[count], RELEASE, t, 0.0)
            count += 1
            continue
        if t.wall == NO_WALL and t.searched < LEG:
            t.searched, t.effort, t.impact_velocity, t.wall = search_along(
                t.searched, t.effort, min(left, LEG), t.phase, t.displacement, t.velocity,
                model, stretches)
        if t.wall == NO_WALL:
            if t.searched < LEG or left < LEG:
                break
            sine, cosine = sine_cosine(t.phase)
            t.displacement, t.velocity = displace_leg(cosine, t.displacement, t.velocity, model)
            t.cycle += LEG_PERIODS
            t.effort = 0
            # Free motion may never end: legs that need no search take a thousandth of the time.
            is_clear = stays_clear(sine, cosine, t.displacement, t.velocity, model)
            t.searched = LEG if is_clear else 0.0
            continue
        if t.searched > left:
            break
        before = t.impact_velocity
        periods, t.phase = later(t.phase, t.searched)
        t.cycle += periods
        t.index += 1
        change = correction(t, t.phase, before) if t.points > 0 else 0.0
        kick = change if t.acts_on == PULSES else 0.0
        if t.noise > 0.0 and t.noise_kind != JITTER:
            kick += t.noise * draw(t.noise_kind, t.seed, t.index)
        t.velocity = rebound(before, t.phase, model, kick)
        t.displacement = 0.0 if t.wall == UPPER else -1.0
        settle(t)
        write_event(events[count], STICK if t.rests else IMPACT, t, before)
        count += 1
        if t.points > 0 and t.acts_on != PULSES:
            t.wanted = min(max(t.alpha_free + change, 0.0), ALPHA_MAXIMUM)
            t.waits = t.wanted != t.alpha
    return count


@kernel
def state_at(trajectory: Record, cycle: Whole, phase: float) -> tuple[float, float]:
    """Return s and s' [1] at a moment (cycle, phase [rad]) before the next event."""
    t = trajectory
    if t.rests:
        return t.displacement, 0.0
    d = max(elapsed(cycle - t.cycle, t.phase, phase), 0.0)
    if d == 0.0:
        return t.displacement, t.velocity
    sine, cosine = sine_cosine(t.phase)
    moved, velocity, _, _ = displace(d, sine, cosine, t.velocity, model_of(t))
    return min(max(t.displacement + moved, -1.0), 0.0), velocity


def ramp_step(alpha: float, target: float, rate: float) -> float:
    """Go from an alpha towards a target, by the rate of a ramp at the most [1]."""
    return alpha + math.copysign(min(rate, abs(target - alpha)), target - alpha)


class Simulation:
    """
    One trajectory of the gear-rattling oscillator, advanced event by event.

    Parameters
    ----------
    parameters : Parameters
        In force initially.
    initial : State
        The initial condition; the displacement must be between the walls.
    noise : float
        Standard deviation of the Gaussian kick that an impact adds to the velocity [1].
    seed : int
        Seed of the noise; every impact has its own draw. Out of range, both raise ValueError.
    kind : Noise
        Whether kicks are Gaussian or uniform; with JITTER there are none, for it is made by
        retunes.

    Notes
    -----
    The first record of the stream is the RESET that sets the initial state. The stream depends on
    the parameters, the state, the seed and the moments of retunes and resets, not on how it is
    cut by `advance`.

    """

    def __init__(self, parameters: Parameters, initial: State, *, noise: float = 0.0,
                 seed: int = 0, kind: Noise = Noise.GAUSSIAN) -> None:
        self._trajectory = np.zeros(1, TRAJECTORY)
        t = self._trajectory[0]
        t['cycle'], t['phase'] = initial.cycle, initial.phase
        t['displacement'], t['velocity'] = initial.displacement, initial.velocity
        self._cycle, self._phase = initial.cycle, initial.phase
        self._write_parameters(parameters)
        self.noise = noise
        self.seed = seed
        self.kind = kind
        settle(t)
        self._waiting = self._record(EventKind.RESET, initial.velocity)

    @property
    def parameters(self) -> Parameters:
        """Parameters in force, but for what a law changes."""
        return self._parameters

    @property
    def noise(self) -> float:
        """Return the standard deviation of the kick at impacts [1]."""
        return float(self._trajectory[0]['noise'])

    @noise.setter
    def noise(self, value: float) -> None:
        self._trajectory[0]['noise'] = require_finite('noise', value, 0.0, NOISE_MAXIMUM)

    @property
    def seed(self) -> int:
        """Seed of the noise."""
        return int(self._trajectory[0]['seed'])

    @seed.setter
    def seed(self, value: int) -> None:
        if not isinstance(value, numbers.Integral) or not 0 <= value <= SEED_MAXIMUM:
            raise ValueError(f'seed = {value!r} is not a whole number from 0 to {SEED_MAXIMUM}')
        self._trajectory[0]['seed'] = value

    @property
    def kind(self) -> Noise:
        """Return what is random."""
        return Noise(int(self._trajectory[0]['noise_kind']))

    @kind.setter
    def kind(self, value: Noise) -> None:
        self._trajectory[0]['noise_kind'] = value

    def control(self, law: Law | None) -> EventArray:
        """
        Put a law in force, or end the one that is, as `retune` does, too.

        Returns an array of EVENT: a RETUNE record where alpha returns to that of `parameters`,
        after any records not yet returned.
        """
        t = self._trajectory[0]
        records = self._waiting[:0]
        if t['points'] and t['alpha'] != self._parameters.alpha:
            records = self.retune(self._parameters)
        t['points'], t['waits'] = 0, False
        if law is not None:
            law.write(t, self._parameters.alpha)
        return records

    @property
    def impacts(self) -> int:
        """Impacts so far."""
        return int(self._trajectory[0]['index'])

    @property
    def epoch(self) -> int:
        """Retunes and resets so far."""
        return int(self._trajectory[0]['epoch'])

    @property
    def moment(self) -> tuple[int, float]:
        """Whole drive periods and phase [rad] up to which the trajectory has been advanced."""
        return self._cycle, self._phase

    @property
    def state(self) -> State:
        """Return the state at the moment up to which the trajectory has been advanced."""
        displacement, velocity = self._now()
        return State(self._cycle, self._phase, displacement, velocity)

    @property
    def is_permanently_at_rest(self) -> bool:
        """Whether the driven gear rests on a wall that it never leaves at these parameters."""
        t = self._trajectory[0]
        return bool(t['rests']) and math.isinf(release_delay(
            t['displacement'], t['phase'], self._parameters.model))

    def advance(self, cycle: int, phase: float, most: int) -> EventArray:
        """
        Go forward to a moment.

        Parameters
        ----------
        cycle, phase : int, float
            The moment: whole drive periods and phase [rad]. Going back is refused.
        most : int
            Most events to return, positive; if there are more, it stands at the last of these.

        Returns
        -------
        ndarray of EVENT, shape (n,)
            The events on the way, in order.

        Raises
        ------
        ValueError
            If the moment lies before the present one, or `most` is not positive.

        """
        if most < 1:
            raise ValueError(f'most = {most!r} must be positive')
        if not 0.0 <= phase < TWO_PI:
            raise ValueError(f'phase = {phase!r} is outside [0, 2 pi)')
        if (cycle, phase) < (self._cycle, self._phase):
            raise ValueError(
                f'cycle {cycle}, phase {phase!r} lies before the present, cycle {self._cycle}, '
                f'phase {self._phase!r}')
        waiting = self._waiting[:most]
        self._waiting = self._waiting[most:]
        room = np.zeros(most - len(waiting), EVENT)
        trajectory = self._trajectory[0]
        count = run(trajectory, room, cycle, phase)
        if count == len(room):
            # The moment may not have been reached: the last event is as far as this goes.
            base = (int(trajectory['cycle']), float(trajectory['phase']))
            self._cycle, self._phase = max((self._cycle, self._phase), base)
        else:
            self._cycle, self._phase = cycle, phase
        return np.concatenate([waiting, room[:count]]) if len(waiting) else room[:count]

    def retune(self, parameters: Parameters) -> EventArray:
        """
        Change the parameters now; displacement and velocity are continuous.

        Returns an array of EVENT: the RETUNE record, after any records not yet returned.
        """
        displacement, velocity = self._now()
        t = self._trajectory[0]
        self._move_to_present()
        t['displacement'], t['velocity'] = displacement, velocity
        self._write_parameters(parameters)
        return self._begin_epoch(EventKind.RETUNE)

    def reset(self, phase: float, displacement: float, velocity: float) -> EventArray:
        """
        Set the state at the next moment that has a given drive phase; time never goes back.

        Phase is in rad, in [0, 2 pi), the others [1]. Returns an array of EVENT: the RESET record,
        after any records not yet returned. Raises ValueError if the state is out of range.
        """
        state = State(0, phase, displacement, velocity)
        self._move_to_present()
        self._cycle += 1 if state.phase < self._phase else 0
        self._phase = state.phase
        t = self._trajectory[0]
        t['cycle'], t['phase'] = self._cycle, self._phase
        t['displacement'], t['velocity'] = state.displacement, state.velocity
        return self._begin_epoch(EventKind.RESET)

    def _now(self) -> tuple[float, float]:
        return state_at(self._trajectory[0], self._cycle, self._phase)

    def _move_to_present(self) -> None:
        # By rounding, the last event may lie an ulp beyond the moment asked for.
        t = self._trajectory[0]
        t['cycle'], t['phase'] = max(
            (self._cycle, self._phase), (int(t['cycle']), float(t['phase'])))
        self._cycle, self._phase = int(t['cycle']), float(t['phase'])

    def _begin_epoch(self, kind: EventKind) -> EventArray:
        t = self._trajectory[0]
        t['waits'] = False
        if kind is EventKind.RETUNE:
            t['points'] = 0
        t['epoch'] += 1
        settle(t)
        records = np.concatenate([self._waiting, self._record(kind, t['velocity'])])
        self._waiting = records[:0]
        return records

    def _record(self, kind: EventKind, velocity: float) -> EventArray:
        records = np.zeros(1, EVENT)
        write_event(records[0], int(kind), self._trajectory[0], velocity)
        return records

    def _write_parameters(self, parameters: Parameters) -> None:
        self._parameters = parameters
        for name, value in dataclasses.asdict(parameters).items():
            self._trajectory[0][name] = value
