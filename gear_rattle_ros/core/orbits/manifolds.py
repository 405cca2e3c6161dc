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
How far the unstable manifold of one saddle stays from the stable manifold of another.

A crisis is their tangency (Grebogi, Ott & Yorke 1983): an unstable manifold bounds the attractor,
a stable one its basin or the part of it that the attractor has not entered. Points of the unstable
manifold are mapped until they come near the other saddle, or back to the same one; there the
unstable coordinate, pulled back to where they came in, is the signed distance across the stable
manifold.
"""

import dataclasses
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from .impact_map import next_impact
from .orbit import fire, Orbit
from .section import turn_of
from ..arrays import FloatArray, IntArray
from ..compiled import kernel
from ..flight.closed_form import NO_WALL
from ..flight.elementary import exp_minus, logarithm
from ..model import Model
from ..words import counted

# The unstable manifold is straight this far from the saddle [1], to the square of this.
SEED_DISTANCE: Final = 1e-6
# A return is seen this near to the saddle, across the stable manifold and along it [1].
ACROSS: Final = 0.03
ALONG: Final = 0.3
# Turns near the saddle after which a return counts: the coordinate is then exact.
TURNS: Final = 2
NEVER: Final = -1e9
# Refining a maximum: samples of a bracket, the factor by which it shrinks, and how often.
SAMPLES: Final = 17
SHRINK: Final = 5.0
ROUNDS: Final = 10


@dataclasses.dataclass(frozen=True)
class Saddle:
    """A saddle orbit and one side of it."""

    orbit: Orbit
    unstable: FloatArray  # unit vector (phase, velocity) at the first impact, towards the side
    rows: FloatArray  # give the unstable and the stable coordinate, shape (2, 2)

    @property
    def turns(self) -> int:
        """Periods of the orbit after which a trajectory is on the same side again."""
        return 1 if self.orbit.multipliers[0].real > 0.0 else 2

    @property
    def impacts(self) -> int:
        """Impacts in these periods."""
        return self.turns * self.orbit.impacts

    @property
    def expansion(self) -> float:
        """Multiplier outside the unit circle over these periods [1]."""
        return float(self.orbit.multipliers[0].real**self.turns)

    @property
    def contraction(self) -> float:
        """Multiplier inside it [1]."""
        return float(self.orbit.multipliers[1].real**self.turns)

    @property
    def other_side(self) -> 'Saddle':
        """Return the same saddle, with its other side."""
        return dataclasses.replace(self, unstable=-self.unstable, rows=self.rows * [[-1.0], [1.0]])


@dataclasses.dataclass(frozen=True)
class Edge:
    """The return of an unstable manifold that comes nearest to crossing a stable one."""

    distance: float  # across the stable manifold [1]; positive beyond it
    place: float  # on the unstable manifold, in periods of its saddle from `SEED_DISTANCE` on [1]
    impacts: int  # from there to the return


def saddle_of(orbit: Orbit, side: FloatArray | None = None) -> Saddle:
    """Find the directions of a saddle, its side nearest to a vector; of growing phase without."""
    shot = fire(orbit.walls, orbit.points, orbit.parameters)
    first, second = orbit.multipliers
    if shot is None or first.imag != 0.0 or not abs(first) > 1.0 > abs(second) > 0.0:
        raise ValueError(f'alpha = {orbit.parameters.alpha:g}: the orbit of '
                         f'{counted(orbit.impacts, "impact")} is not a saddle')
    values, vectors = np.linalg.eig(shot.derivative())
    vectors = np.real(vectors[:, np.argsort(-np.abs(values))])
    vectors[:, 0] *= math.copysign(1.0, vectors[0, 0] if side is None else side @ vectors[:, 0])
    return Saddle(orbit, vectors[:, 0], np.linalg.inv(vectors))


@kernel
def returns(places: FloatArray, seed: float, wall: int, point: FloatArray, unstable: FloatArray,
            expansion: float, target_wall: int, target: FloatArray, rows: FloatArray,
            target_expansion: float, period: int, impacts: int, whole: bool,
            model: Model) -> tuple[FloatArray, IntArray]:
    """
    Map points of an unstable manifold on and find their farthest return to a saddle.

    Places are in periods of the saddle that they leave [1], from the distance `seed` on. Returns
    how far beyond the stable manifold of the `target`, whose period is in impacts, they come [1]
    (NEVER without a return), and after how many impacts. With `whole`, only returns after whole
    periods count.
    """
    distances = np.full(len(places), NEVER)
    numbers = np.full(len(places), -1)
    entered = np.empty(period, np.int64)
    crossed = np.empty(period)
    rate = logarithm(target_expansion)
    for i in range(len(places)):
        entered[:] = -1
        aside = seed * exp_minus(-places[i] * logarithm(expansion))
        phase = point[0] + aside * unstable[0]
        velocity = point[1] + aside * unstable[1]
        here = wall
        away = False
        for n in range(1, impacts + 1):
            here, _, phase, velocity, _ = next_impact(here, phase, velocity, model)
            if here == NO_WALL:
                break
            c = n % period
            if whole and c:
                continue
            turn = turn_of(phase - target[0])
            climb = velocity - target[1]
            across = rows[0, 0] * turn + rows[0, 1] * climb
            along = rows[1, 0] * turn + rows[1, 1] * climb
            near = here == target_wall and abs(across) < ACROSS and abs(along) < ALONG
            if not away:
                away = c == 0 and not near
            elif near:
                if entered[c] < 0:
                    entered[c] = n
                crossed[c] = across * exp_minus((n - entered[c]) / period * rate)
            elif entered[c] >= 0:
                if n - entered[c] > TURNS * period and crossed[c] > distances[i]:
                    distances[i] = crossed[c]
                    numbers[i] = entered[c]
                entered[c] = -1
        # What is still near lies so close to the stable manifold that it stays for long.
        for c in range(period):
            if entered[c] >= 0 and impacts - entered[c] > (TURNS + 1) * period:
                if crossed[c] > distances[i]:
                    distances[i] = crossed[c]
                    numbers[i] = entered[c]
    return distances, numbers


def find_edge(source: Saddle, target: Saddle, *, samples: int = 20_000, impacts: int = 80,
              candidates: int = 12, near: float | None = None, seed: float = SEED_DISTANCE,
              offset: float = 0.0, whole: bool = False) -> Edge:
    """
    Find where the unstable manifold of `source` comes nearest to crossing a stable one.

    `samples` points over one period of the side of `source`, from the distance `seed` on [1] and
    shifted by `offset` of their spacing, are mapped for `impacts`; the `candidates` largest maxima
    are refined. With `near`, only a hundredth of a period about this place is searched. Beyond is
    the side of `target`. Without any return `distance` is `NEVER`. With `whole`, only returns
    after whole periods of `target` count.
    """
    def look(places: FloatArray) -> tuple[FloatArray, npt.NDArray[np.int64]]:
        leaves, meets = source.orbit, target.orbit
        return returns(places, seed, int(leaves.walls[0]), leaves.points[0], source.unstable,
                       source.expansion, int(meets.walls[0]), meets.points[0], target.rows,
                       target.expansion, target.impacts, impacts, whole,
                       leaves.parameters.model)

    places = (np.arange(samples) + offset) / samples
    if near is not None:
        places = near + np.linspace(-0.005, 0.005, samples // 10)
    spacing = float(places[1] - places[0])
    distances, _ = look(places)
    tops = np.flatnonzero((distances >= np.roll(distances, 1))
                          & (distances >= np.roll(distances, -1)) & (distances > NEVER))
    best = Edge(NEVER, 0.0, -1)
    for top in tops[np.argsort(-distances[tops])][:candidates]:
        place, width = float(places[top]), spacing
        for _ in range(ROUNDS):
            closer = place + np.linspace(-width, width, SAMPLES)
            distances, numbers = look(closer)
            k = int(np.argmax(distances))
            place, width = float(closer[k]), width / SHRINK
            if distances[k] > best.distance:
                best = Edge(float(distances[k]), place, int(numbers[k]))
    return best
