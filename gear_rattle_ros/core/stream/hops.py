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

"""
Orbits seen through noise larger than the tolerance, and the hops between them.

Kicks hide how impacts recur, but neither the order of the walls nor the mean of the rounds: closed
by Newton's method the mean gives the orbit without noise. A stable one is known from then on by
its core. The trajectory is on the orbit whose core it visited last, as in the tool `hopping`.
"""

from collections import Counter
import dataclasses
import functools
import math
from typing import Final

import numpy as np

from ..arrays import Record, RecordArray
from ..compiled import kernel
from ..flight.elementary import TWO_PI
from ..model import Parameters
from ..orbits.cores import BALL, radius_of
from ..orbits.letters import letter_of
from ..orbits.orbit import close_orbit, Orbit, same_orbit
from ..orbits.section import distance, distances, turn

# Last impacts in which an orbit is looked for, the share of them that must lie in its core, and
# its longest period [impacts].
SOUGHT: Final = 24
INSIDE: Final = 0.1
LONGEST: Final = 12
# Impacts until the next look, or an eighth of those without a core; looks between hops, and
# impacts that allow one more, as each takes a millisecond; impacts without a core after which an
# orbit is left.
AGAIN: Final = 8
LOOKS: Final = 100
RARELY: Final = 200
AWAY: Final = 1000
# Orbits that are known at once at the most.
KNOWN_MOST: Final = 32
SAME: Final = 1e-6

# Impacts in the core of an orbit, and their distances from it.
TALLY: Final = np.dtype([('inside', np.int64), ('squares', np.float64), ('largest', np.float64)],
                        align=True)


@kernel
def visited(balls: RecordArray, tallies: RecordArray, impact: Record) -> int:
    """Return the orbit in whose core an impact is, and count it there; -1 outside all."""
    for ball in balls:
        apart = distance(impact.velocity, impact.phase, ball.velocity, ball.phase)
        if apart <= ball.radius:
            tally = tallies[ball.label]
            tally.inside += 1
            tally.squares += apart * apart
            tally.largest = max(tally.largest, apart)
            return int(ball.label)
    return -1


@kernel
def visits(balls: RecordArray, tallies: RecordArray, impacts: RecordArray) -> tuple[int, int]:
    """Count impacts in cores; return how many impacts ago the first and the last of them were."""
    first = last = 0
    for k in range(len(impacts)):
        if visited(balls, tallies, impacts[k]) >= 0:
            last = len(impacts) - 1 - k
            first = max(first, last)
    return first, last


@dataclasses.dataclass(frozen=True, eq=False)
class Known:
    """An orbit that is recognised by its core."""

    orbit: Orbit
    points: RecordArray  # as impacts of the history
    radius: float  # of the balls round its points [1]

    @functools.cached_property
    def name(self) -> str:
        """Letter, or key without one; a letter takes long to find."""
        return letter_of(self.orbit) or self.orbit.key


class Hops:
    """The orbits known since the last retune, reset or hole, and the hops between them."""

    def __init__(self) -> None:
        self.known: list[Known] = []
        self._met: list[Known] = []
        self.balls = np.zeros(0, BALL)
        self.tallies = np.zeros(KNOWN_MOST, TALLY)
        self.counts: Counter[tuple[int, int]] = Counter()  #: Hops, from one orbit to another.
        self.stays: Counter[int] = Counter()  #: Impacts of the stays on each that have ended.
        self.home = -1  #: The orbit whose core was visited last; -1 for none.
        self.since = 0  #: Number of the first impact of the present stay.
        self.begun = 0  #: Number of the impact at which the first orbit was entered.

    def learn(self, orbit: Orbit, points: RecordArray, past: RecordArray, tolerance: float
              ) -> bool:
        """Know an orbit from now on, if it is new and the last impacts lie in its core."""
        if len(self.known) == KNOWN_MOST:
            return False
        found = next((each for each in self._met if same_orbit(each.orbit, orbit, SAME)), None)
        if found is None:
            # To try balls takes a good part of a second.
            found = Known(orbit, points, radius_of(orbit, tolerance))
            self._met.append(found)
        apart = np.min([distances(past['velocity'], past['phase'], velocity, phase)
                        for phase, velocity in orbit.points], axis=0)
        if found in self.known or np.mean(apart <= found.radius) < INSIDE:
            return False
        balls = np.zeros(orbit.impacts, BALL)
        balls['phase'], balls['velocity'] = orbit.points.T
        balls['radius'], balls['label'] = found.radius, len(self.known)
        self.balls = np.concatenate([self.balls, balls])
        self.known.append(found)
        return True

    def enter(self, owner: int, number: int) -> None:
        """Go to another orbit, or none, at the impact of a number."""
        if self.home >= 0:
            self.stays[self.home] += (number - self.since) % 2**32
            self.counts[self.home, owner] += 1
        elif not self.stays and not self.counts:
            self.begun = number
        self.home, self.since = owner, number

    def spread(self, owner: int) -> tuple[float, float]:
        """Return the largest distance of impacts in a core from the orbit, and the rms."""
        tally = self.tallies[owner]
        return (float(tally['largest']), math.sqrt(float(tally['squares']) / int(tally['inside']))
                if tally['inside'] else math.nan)


def sought(past: RecordArray, parameters: Parameters) -> tuple[Orbit, RecordArray] | None:
    """Find the stable orbit about which impacts with noise scatter, and it as impacts."""
    for period in range(1, LONGEST + 1):
        rounds = past[-(len(past) // period) * period:].reshape(-1, period)
        turns = float(np.sum(rounds['flight_time'])) / TWO_PI / len(rounds)
        if (np.any(rounds['wall'] != rounds['wall'][0]) or np.any(rounds['sticks'])
                or round(turns) < 1 or abs(turns - round(turns)) * len(rounds) > 0.5):
            continue
        mean = mean_round(rounds)
        orbit = close_orbit(
            mean['wall'], np.column_stack([mean['phase'], mean['velocity']]), parameters)
        if orbit and orbit.impacts == period and orbit.is_stable and (
                orbit.drive_periods == round(turns)):
            mean['phase'], mean['velocity'] = orbit.points.T
            mean['flight_time'] = orbit.flight_times
            return orbit, mean
    return None


def mean_round(rounds: RecordArray) -> RecordArray:
    """Return the mean of rounds of impacts of an orbit, one round in each row."""
    mean = rounds[-1].copy()
    away = np.mean(turn(rounds['phase'] - mean['phase']), axis=0)
    mean['phase'] = np.mod(mean['phase'] + away, TWO_PI)
    for name in ('velocity', 'flight_time'):
        mean[name] = np.mean(rounds[name], axis=0)
    return mean
