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

"""The choice of an unstable orbit and of the law that holds it, with a trial before it is used."""

from collections.abc import Callable
import dataclasses
import functools
import math
from typing import Final, TypeAlias

import numpy as np

from .orbits import find_orbits
from ..catalogue import go_on, others_where
from ..finding import find_attractors
from ..plane import Plane
from ...core.arrays import FloatArray, IntArray
from ...core.flight.lanes import make_initial_conditions
from ...core.flight.law import Acts, Law
from ...core.flight.simulation import Simulation
from ...core.many.chaotic_sets import BRIEF
from ...core.many.recorded import record_impacts
from ...core.many.settling import UNSETTLED
from ...core.model import ALPHA_MAXIMUM, EVENT, Parameters, State
from ...core.orbits.branches import follow
from ...core.orbits.control import held_multipliers, law_of
from ...core.orbits.letters import followed_to
from ...core.orbits.listing import OrbitList
from ...core.orbits.orbit import NEAR, Orbit
from ...core.orbits.section import distances
from ...core.path import Path
from ...core.stream.hold import RunningHold
from ...core.words import counted

# Impacts of the longest orbits that are sought without their number, and points of the section.
LONGEST: Final = 8
POINTS: Final = (256, 2048)
# Impacts that settle the trajectory, and those that show to which orbits it comes near.
SETTLES: Final = 2_000
SHOWN: Final = 20_000
# Trial runs of a law, drive periods of each, and those between their beginnings.
TRIALS: Final = 24
TRIED: Final = 1_500
APART: Final = 61
# Random initial conditions of the search for attractors, and its `hold`.
DRAWN: Final = 256
HOLD: Final = 2_000
# Steps in which alpha goes to the end of the limit, drive periods of each, and those at the end.
STEPS: Final = 20
STEP_PERIODS: Final = 20
END_PERIODS: Final = 1_000
# States that may leave a long transient, besides twice as many as do so in any case.
FEW: Final = 3
# How far from an orbit trajectories that leave it begin, in units of the velocity.
NUDGE: Final = 1e-6
# The largest limit that does no harm is not sought below this [1].
LEAST: Final = 1e-6


@dataclasses.dataclass(frozen=True)
class Plan:
    """An orbit, the law that holds it, and what trial runs show of it."""

    orbit: Orbit
    law: Law
    caught: int  # of TRIALS
    impacts: float  # until they were caught, median

    @property
    def exponent(self) -> float:
        """Return the largest exponent per impact under control [1]."""
        return math.log(max(abs(held_multipliers(self.orbit, self.law)[0]), 1e-300)
                        ) / self.orbit.impacts

    def describe(self) -> str:
        """Describe it in one line."""
        caught = (f'{self.caught} of {TRIALS} trial runs of {TRIED} drive periods caught it'
                  + (f', half of them within {counted(round(self.impacts), "impact")}'
                     if self.caught else '; let noise or a reset bring the trajectory near it'))
        acts = self.law.acts.name.lower()
        return f'{self.orbit.key}, {acts}, limit {self.law.limit:g}: {caught}'


class Planner:
    """Plans the control of orbits; what it has found at some parameters serves the next plan."""

    def __init__(self) -> None:
        self._found: OrbitList | None = None

    def plan(self, parameters: Parameters, state: State, wanted: str, acts: Acts, limit: float,
             check: Callable[[], None] = go_on) -> Plan:
        """
        Choose an orbit and the law that holds it.

        `wanted` is a key, a letter, a number of impacts, or <N for the longest with fewer than N.
        Of several the trajectory from `state` comes nearest to the one that is taken. ValueError
        is one line on why there is none, or why it cannot be held. `check` raises to give up.
        """
        # Rounding alone may keep it on an orbit that was held.
        state = dataclasses.replace(state, velocity=state.velocity * (1.0 + NUDGE))
        free = make_initial_conditions(
            parameters, state.phase, state.displacement, [state.velocity])
        rows, _ = record_impacts(free, SETTLES, SHOWN)
        orbit = self._choose(parameters, wanted, np.column_stack(
            [rows[0]['phase'], rows[0]['velocity']]), check)
        law = law_of(orbit, acts, limit)
        return self._tried(orbit, law, state, check)

    def _choose(self, parameters: Parameters, wanted: str, impacts: FloatArray,
                check: Callable[[], None]) -> Orbit:
        lettered = followed_to(parameters).get(wanted)
        if lettered is not None:
            return lettered
        digits = wanted.removeprefix('<').removeprefix('orbit-').split('-')[0]
        if not digits.isdecimal() or not 1 <= int(digits) <= 64:
            raise ValueError(f'orbit = {wanted!r} is no letter here, no key such as '
                             'orbit-2-1-U5.6316+0.9679, and no number of impacts from 1 to 64')
        number, is_below = int(digits), wanted.startswith('<')
        unstable = self._unstable(parameters, min(number - 1, LONGEST) if is_below else number,
                                  check)
        if wanted.isdecimal():
            unstable = [orbit for orbit in unstable if orbit.impacts == number]
        elif is_below:
            near = [orbit for orbit in unstable if _approach(orbit, impacts) < NEAR]
            most = max((orbit.impacts for orbit in near), default=0)
            unstable = [orbit for orbit in near if orbit.impacts == most]
        else:
            unstable = [orbit for orbit in unstable
                        if wanted.removeprefix('orbit-') == orbit.name]
        if not unstable:
            raise ValueError(f'no unstable orbit {wanted} at alpha = {parameters.alpha:g}; '
                             'gear_rattle orbits lists them')
        return min(unstable, key=lambda orbit: _approach(orbit, impacts))

    def _unstable(self, parameters: Parameters, longest: int, check: Callable[[], None]
                  ) -> list[Orbit]:
        known = self._found
        if known is None or known.parameters != parameters or known.longest < longest:
            self._found = known = find_orbits(
                parameters, max(longest, 1), first=POINTS[0], most=POINTS[1], threads=1,
                reached=lambda *_: check())
        return [orbit for orbit in known.unstable if orbit.impacts <= longest]

    def _tried(self, orbit: Orbit, law: Law, state: State, check: Callable[[], None]) -> Plan:
        """Try a law; ValueError where its limit is too large, with the largest that is not."""
        trial = _Trial(orbit, state, check)
        harm, times = trial.harm(law)
        if not harm:
            return Plan(orbit, law, len(times), float(np.median(times or [math.nan])))
        low, high = 0.0, law.limit
        while high > LEAST:
            # Of two digits, so that it can be typed.
            middle = float(f'{0.5 * (low + high):.2g}')
            if middle in (low, high):
                break
            found, _ = trial.harm(dataclasses.replace(law, limit=middle))
            low, high, harm = (low, middle, found) if found else (middle, high, harm)
        remedy = f'at most {low:g} is fine' if low else 'choose another orbit, for none is fine'
        raise ValueError(f'limit = {law.limit:g} is too large: {harm}; {remedy}')


# States of a trajectory, the attractor on which it is, and how many of them may leave that.
_Group: TypeAlias = tuple[list[State], int, int]


class _Trial:
    """Finds what the limit of a law does to the orbit, and to the attractors about it."""

    def __init__(self, orbit: Orbit, state: State, check: Callable[[], None]) -> None:
        self._orbit, self._check, self._parameters = orbit, check, orbit.parameters
        self._catalogue = find_attractors(
            self._parameters, Plane().draw(self._parameters, DRAWN, 1), hold=HOLD, threads=1,
            effort=BRIEF, check=check)
        # On either side of the orbit, which may belong to another attractor, or bound it.
        phase, velocity = orbit.points[0]
        self._groups = [self._along(one) for one in (state, *(State(
            0, phase, -float(orbit.walls[0]),
            -self._parameters.restitution * velocity * (1.0 + side)) for side in (-NUDGE, NUDGE)))]
        # The side on which harm was found last is the first one to be looked at.
        self._sides = [-1.0, 1.0]

    def harm(self, law: Law) -> tuple[str, list[float]]:
        """Return what a law does that it must not, in words, and the impacts until it caught."""
        if law.acts is not Acts.PULSES:
            alpha = self._parameters.alpha
            for side in tuple(self._sides):
                end = min(max(alpha + side * law.limit, 0.0), ALPHA_MAXIMUM)
                words = '' if end == alpha else self._turned(end) or next(filter(None, (
                    self._lost(group, functools.partial(self._returned, end),
                               f'at alpha = {end:g}') for group in self._groups)), '')
                if words:
                    self._sides = [side, -side]
                    return words, []
        times: list[float] = []

        def tried(state: State) -> State:
            held, hold = Simulation(self._parameters, state), RunningHold(
                law, self._parameters.alpha)
            held.control(law)
            hold.update(_follow(held, TRIED))
            if hold.report.is_caught:
                times.append(hold.report.catch_impacts)
            return held.state

        return self._lost(self._groups[0], tried, 'under control'), times

    def _along(self, state: State) -> _Group:
        """Return states of a trajectory, their label, and how many may lose it."""
        simulation, states = Simulation(self._parameters, state), []
        _follow(simulation, SETTLES)
        for _ in range(TRIALS):
            _follow(simulation, APART)
            states.append(simulation.state)
        labels = self._labels(states)
        if np.any(labels != labels[0]):
            return states, UNSETTLED, len(states)
        if labels[0] != UNSETTLED:
            return states, int(labels[0]), 0
        # A long transient ends now and then without a change of alpha, too.
        stayed = self._labels([self._returned(self._parameters.alpha, each) for each in states])
        return states, UNSETTLED, FEW + 2 * int(np.count_nonzero(stayed != UNSETTLED))

    def _labels(self, states: list[State]) -> IntArray:
        return np.asarray(self._catalogue.label(make_initial_conditions(
            self._parameters, *np.transpose([(each.phase, each.displacement, each.velocity)
                                             for each in states])), threads=1)['label'])

    def _turned(self, end: float) -> str:
        """Return where the orbit changes on the way to an alpha, in words."""
        alpha = self._parameters.alpha
        low, high = sorted((alpha, end))
        branch = follow(self._orbit, Path.over(self._parameters, alpha=(low, high)),
                        math.copysign(1.0, end - alpha), low, high, to_first_turn=True)
        return next((f'the orbit has its {turn.change.value} at alpha = {turn.value:g}'
                     for turn in branch.turns if low <= turn.value <= high), '')

    def _returned(self, end: float, state: State) -> State:
        """Go slowly to another alpha and back, from a state."""
        simulation = Simulation(self._parameters, state)
        there = np.linspace(self._parameters.alpha, end, STEPS + 1).tolist()
        for number, alpha in enumerate((*there[1:], *there[-2::-1]), 1):
            simulation.retune(dataclasses.replace(self._parameters, alpha=alpha))
            _follow(simulation, END_PERIODS if number == STEPS else STEP_PERIODS)
        return simulation.state

    def _lost(self, group: _Group, move: Callable[[State], State], where: str) -> str:
        """Return where states go from their attractor when they are moved, in words."""
        states, label, few = group
        moved = []
        for state in states:
            self._check()
            moved.append(move(state))
        after = self._labels(moved)
        lost = after[(after != label) & (after != UNSETTLED)]
        if len(lost) <= few:
            return ''
        titles = {each.label: each.title for each in (
            *others_where(bool), *self._catalogue.attractors)} | {UNSETTLED: 'a long transient'}
        return f'{where} the gear goes from {titles[label]} to {titles[lost[0]]}'


def _approach(orbit: Orbit, impacts: FloatArray) -> float:
    """Return how near impacts (phase, velocity) come to every point of an orbit [1]."""
    return max(float(np.min(distances(impacts[:, 1], impacts[:, 0], velocity, phase), initial=9.0))
               for phase, velocity in orbit.points)


def _follow(simulation: Simulation, periods: int) -> np.ndarray:
    end, parts = simulation.moment[0] + periods, [np.zeros(0, EVENT)]
    while simulation.moment < (end, 0.0):
        parts.append(simulation.advance(end, 0.0, 4096))
    return np.concatenate(parts)
