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
import math
from typing import Final

import numpy as np

from .catalogue import go_on
from .finding import find_attractors
from .orbits import find_orbits
from .plane import Plane
from ..core.arrays import FloatArray
from ..core.flight.lanes import make_initial_conditions
from ..core.flight.law import Acts, Law
from ..core.flight.simulation import Simulation
from ..core.many.chaotic_sets import BRIEF
from ..core.many.recorded import record_impacts
from ..core.model import EVENT, Parameters, State
from ..core.orbits.control import held_multipliers, law_of
from ..core.orbits.letters import followed_to
from ..core.orbits.listing import OrbitList
from ..core.orbits.orbit import NEAR, Orbit
from ..core.orbits.section import distances
from ..core.stream.hold import RunningHold
from ..core.words import counted

# Impacts of the longest orbits that are sought without their number, and points of the section.
LONGEST: Final = 8
POINTS: Final = (256, 2048)
# Impacts that settle the trajectory, and those that show to which orbits it comes near.
SETTLES: Final = 2_000
SHOWN: Final = 20_000
# Trial runs of a law, and drive periods of each.
TRIALS: Final = 24
TRIED: Final = 1_500
# Random initial conditions of the search for attractors, and its `hold`.
DRAWN: Final = 256
HOLD: Final = 2_000


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
        """Try a law from states of the present trajectory; ValueError where it leads elsewhere."""
        parameters = orbit.parameters
        catalogue = find_attractors(
            parameters, Plane().draw(parameters, DRAWN, 1), hold=HOLD, threads=1, effort=BRIEF,
            check=check)
        free, ends, catches = Simulation(parameters, state), [], []
        _follow(free, SETTLES)
        begun = []
        for _ in range(TRIALS):
            check()
            _follow(free, 7)
            begun.append(free.state)
            held, hold = Simulation(parameters, free.state), RunningHold(law, parameters.alpha)
            held.control(law)
            hold.update(_follow(held, TRIED))
            ends.append(held.state)
            if hold.report.is_caught:
                catches.append(hold.report.catch_impacts)
        before, after = (catalogue.label(make_initial_conditions(
            parameters, *np.transpose([(s.phase, s.displacement, s.velocity) for s in states])),
            threads=1)['label'] for states in (begun, ends))
        own = np.unique(before)
        others = after[(after != own[0]) & (after >= 0)]
        if len(own) == 1 and own[0] >= 0 and len(others):
            titles = {each.label: each.title for each in catalogue.attractors}
            raise ValueError(
                f'limit = {law.limit:g} moves the trajectory from {titles[own[0]]} to '
                f'{titles[others[0]]}; choose a smaller one')
        return Plan(orbit, law, len(catches), float(np.median(catches or [math.nan])))


def _approach(orbit: Orbit, impacts: FloatArray) -> float:
    """Return how near impacts (phase, velocity) come to every point of an orbit [1]."""
    return max(float(np.min(distances(impacts[:, 1], impacts[:, 0], velocity, phase), initial=9.0))
               for phase, velocity in orbit.points)


def _follow(simulation: Simulation, periods: int) -> np.ndarray:
    end, parts = simulation.moment[0] + periods, [np.zeros(0, EVENT)]
    while simulation.moment < (end, 0.0):
        parts.append(simulation.advance(end, 0.0, 4096))
    return np.concatenate(parts)
