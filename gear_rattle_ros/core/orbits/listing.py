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


"""All periodic orbits up to a number of impacts, stable or not, as far as seeds show them."""

import dataclasses
from typing import Final, NamedTuple

import numpy as np

from .impact_map import close_ring, derivatives, next_impact
from .orbit import Orbit, orbit_at
from .section import turn_of
from ..arrays import FloatArray, IntArray
from ..compiled import kernel
from ..flight.closed_form import NO_WALL
from ..flight.elementary import TWO_PI
from ..model import Model, Parameters
from ..words import counted

# The additive recurrence that fills a square evenly (Roberts 2018).
STEPS: Final = (0.7548776662466927, 0.5698402909980532)
# Impacts for which a point of the section is followed, each of which begins seeds; how far a point
# of a seed may move onto its orbit [rad, 1].
FOLLOWED: Final = 64
REACH: Final = 0.5
# Orbits are put together where they come this near to each other [rad, 1].
SPLICED: Final = 0.1
# Orbits that are put together, at the most: the pairs are half of their square.
PARTS: Final = 1000
# An orbit to which this many seeds have led is well known. One step of Newton's method that leads
# to it but for this part of the step is enough; beside a fold, where two orbits are near each
# other, no step comes so near to either.
OFTEN: Final = 50
AIMED: Final = 0.05
# This near to a stable orbit, a trajectory has nothing more to show [1].
SETTLED: Final = 1e-3
# Two orbits are one where they agree to this [rad, 1].
SAME: Final = 1e-7
# A contact that is slower is no impact [1].
SLOWEST: Final = 1e-9
# Orbits for which room is made at once.
ROOM: Final = 1000


class Rings(NamedTuple):
    """Closed sequences of impacts, and how many seeds led to each, as kernels take them."""

    walls: IntArray  # shape (n, longest)
    points: FloatArray  # phase and velocity before each impact [rad, 1], shape (n, longest, 2)
    impacts: IntArray
    seeds: IntArray


@dataclasses.dataclass(frozen=True)
class OrbitList:
    """
    The periodic orbits of at most `longest` impacts, none of which sticks.

    `seeds` is how many seeds led to each orbit; `rounds` has the points of the section used in
    all and the orbits known, after each round.
    """

    parameters: Parameters
    longest: int
    orbits: tuple[Orbit, ...] = ()
    seeds: tuple[int, ...] = ()
    rounds: tuple[tuple[int, int], ...] = ()

    @property
    def points(self) -> int:
        """Points of the section that are done."""
        return self.rounds[-1][0] if self.rounds else 0

    @property
    def unstable(self) -> tuple[Orbit, ...]:
        """Those that attract nothing."""
        return tuple(orbit for orbit in self.orbits if not orbit.is_stable)

    @property
    def is_complete(self) -> bool:
        """Whether the last doubling of the seeds added no orbit: complete as far as they show."""
        return len(self.rounds) > 1 and self.rounds[-1][1] == self.rounds[-2][1]

    @property
    def unseen(self) -> float:
        """Orbits that no seed has reached, at least, by the bound of Chao (1984)."""
        once, twice = (self.seeds.count(number) for number in (1, 2))
        return once * (once - 1) / (2.0 * (twice + 1))

    def statement(self) -> str:
        """State how complete the list is."""
        points = counted(self.points, 'point')
        if self.is_complete:
            return (f'complete as far as seeds show: the last doubling, to {points} of the '
                    'section, added no orbit')
        done = (f'the last doubling, to {points} of the section, added '
                f'{counted(self.rounds[-1][1] - self.rounds[-2][1], "orbit")}'
                if len(self.rounds) > 1 else f'there was one round alone, of {points}')
        return f'not complete: {done}; about {self.unseen:.0f} more are to be expected'

    @property
    def rings(self) -> Rings:
        """Return the orbits as kernels take them."""
        n, q = len(self.orbits), self.longest
        rings = Rings(np.zeros((n, q), np.int64), np.zeros((n, q, 2)), np.array(
            [orbit.impacts for orbit in self.orbits], np.int64), np.array(self.seeds, np.int64))
        for k, orbit in enumerate(self.orbits):
            rings.walls[k, :orbit.impacts] = orbit.walls
            rings.points[k, :orbit.impacts] = orbit.points
        return rings

    @property
    def fastest(self) -> float:
        """Highest velocity from which seeds are taken [1]."""
        # An orbit has a flight no faster than q impacts in a drive period; the other velocities
        # differ by what the forces can do in a period.
        p = self.parameters
        return self.longest / TWO_PI + 2.0 * p.alpha + TWO_PI * abs(p.gamma) + p.beta

    def after(self, points: int, rings: Rings) -> 'OrbitList':
        """Return the list after one more round."""
        closed = [(orbit.canonical(), int(seeds)) for walls, ring, q, seeds in zip(
            *rings, strict=True) if (orbit := orbit_at(walls[:q], ring[:q], self.parameters))]
        closed.sort(key=lambda one: (one[0].impacts, one[0].drive_periods, one[0].key))
        return dataclasses.replace(
            self, orbits=tuple(orbit for orbit, _ in closed),
            seeds=tuple(seeds for _, seeds in closed),
            rounds=(*self.rounds, (points, len(closed))))


@kernel
def seek(first: int, end: int, fastest: float, rings: Rings, model: Model
         ) -> tuple[IntArray, Rings]:
    """Close near returns from points of the section: seeds of each known ring, and new rings."""
    old, longest = len(rings.impacts), rings.walls.shape[1]
    rings, known = Rings(rings.walls, rings.points, rings.impacts, rings.seeds.copy()), old
    before = rings.seeds.copy()
    length = FOLLOWED + longest
    path, on_walls = np.zeros((length + 1, 2)), np.zeros(length + 1, np.int64)
    tangents = np.zeros((length, 4))
    ring, aim = np.zeros((longest, 2)), np.zeros(2)
    for number in range(first, end):
        path[0, 0] = TWO_PI * ((0.5 + STEPS[0] * number) % 1.0)
        path[0, 1] = fastest * ((0.5 + STEPS[1] * number) % 1.0) * (1.0 - 2.0 * (number % 2))
        on_walls[0] = number % 2
        made, n, settled = 0, 0, False
        while n < FOLLOWED and not settled:
            while made < n + longest:
                hit, _, phase, velocity, time = next_impact(
                    on_walls[made], path[made, 0], path[made, 1], model)
                if hit == NO_WALL or velocity == 0.0:
                    break
                one = derivatives(path[made, 0], path[made, 1], time, phase, velocity, model)
                tangents[made, 0], tangents[made, 1] = one[0], one[1]
                tangents[made, 2], tangents[made, 3] = one[2], one[3]
                made += 1
                path[made, 0], path[made, 1], on_walls[made] = phase, velocity, hit
            if made <= n:
                break
            a, b, c, d = 1.0, 0.0, 0.0, 1.0
            for q in range(1, min(longest, made - n) + 1):
                t = tangents[n + q - 1]
                a, b, c, d = (t[0] * a + t[1] * c, t[0] * b + t[1] * d, t[2] * a + t[3] * c,
                              t[2] * b + t[3] * d)
                if on_walls[n + q] != on_walls[n]:
                    continue
                # Where the first step of Newton's method goes far, there is no orbit near.
                off_phase = turn_of(path[n + q, 0] - path[n, 0])
                off_velocity = path[n + q, 1] - path[n, 1]
                determinant = (a - 1.0) * (d - 1.0) - b * c
                by_phase = (b * off_velocity - (d - 1.0) * off_phase) / determinant
                by_velocity = (c * off_phase - (a - 1.0) * off_velocity) / determinant
                step = max(abs(by_phase), abs(by_velocity))
                if not step < REACH:
                    continue
                # Where it leads to an orbit that is well known, the others would do so, too.
                aim[0], aim[1] = path[n, 0] + by_phase, path[n, 1] + by_velocity
                k = find_ring(on_walls[n], aim, q, SAME + AIMED * step, OFTEN, rings, known)
                if k >= 0:
                    rings.seeds[k] += 1
                    settled |= step < SETTLED and abs(a + d) < 1.0 + (a * d - b * c) < 2.0
                    continue
                for k in range(q):
                    ring[k, 0], ring[k, 1] = path[n + k, 0], path[n + k, 1]
                if close_ring(on_walls[n:n + q], ring[:q], REACH, model):
                    rings, known = keep(on_walls[n:n + q], ring[:q], 1, rings, known)
            n += 1
    return rings.seeds[:old] - before, slice_of(rings, old, known)


@kernel
def join(rings: Rings, seeds: IntArray, new: Rings) -> Rings:
    """Add seeds of the first rings, and rings that may be there."""
    rings, known = slice_of(rings, 0, len(rings.impacts)), len(rings.impacts)
    for i in range(len(seeds)):
        rings.seeds[i] += seeds[i]
    for i in range(len(new.impacts)):
        q = new.impacts[i]
        rings, known = keep(new.walls[i, :q], new.points[i, :q], new.seeds[i], rings, known)
    return slice_of(rings, 0, known)


@kernel
def splice(rings: Rings, model: Model) -> Rings:
    """Add what two orbits lead to, one after the other from where they are nearest on."""
    # This finds orbits that few trajectories approach.
    known, longest = len(rings.impacts), rings.walls.shape[1]
    whole = min(known, PARTS)
    ring, on_walls = np.zeros((longest, 2)), np.zeros(longest, np.int64)
    for i in range(whole):
        for j in range(i, whole):
            p, q = rings.impacts[i], rings.impacts[i] + rings.impacts[j]
            if q > longest:
                continue
            here, there, nearest = -1, -1, SPLICED
            for k in range(p):
                for n in range(q - p):
                    apart = max(abs(turn_of(rings.points[i, k, 0] - rings.points[j, n, 0])),
                                abs(rings.points[i, k, 1] - rings.points[j, n, 1]))
                    if (rings.walls[j, n] == rings.walls[i, k] and apart < nearest
                            and (i != j or k < n)):
                        here, there, nearest = k, n, apart
            if here < 0:
                continue
            for one in range(q):
                row, at = (i, here + one) if one < p else (j, there + one - p)
                at %= rings.impacts[row]
                on_walls[one] = rings.walls[row, at]
                ring[one, 0], ring[one, 1] = rings.points[row, at, 0], rings.points[row, at, 1]
            if close_ring(on_walls[:q], ring[:q], REACH, model):
                rings, known = keep(on_walls[:q], ring[:q], 1, rings, known)
    return slice_of(rings, 0, known)


@kernel
def find_ring(wall: int, point: FloatArray, q: int, near: float, least: int, rings: Rings,
              known: int) -> int:
    """Return the orbit of q impacts, or a part of q, that has a point; -1 for none."""
    # Of those to which at least the `least` seeds have led.
    for i in range(known):
        if rings.seeds[i] >= least and q % rings.impacts[i] == 0:
            for k in range(rings.impacts[i]):
                if is_at(wall, point, rings.walls[i, k], rings.points[i, k], near):
                    return i
    return -1


@kernel
def keep(on_walls: IntArray, ring: FloatArray, count: int, rings: Rings, known: int
         ) -> tuple[Rings, int]:
    """Count seeds of a closed sequence, of a new one where it is; return all, and how many."""
    q = len(on_walls)
    for k in range(q):
        if abs(ring[k, 1]) < SLOWEST:
            return rings, known
    for p in range(1, q):
        # Of a sequence that goes round twice, half is found, too.
        if q % p == 0 and is_at(on_walls[p], ring[p], on_walls[0], ring[0], SAME):
            return rings, known
    i = find_ring(on_walls[0], ring[0], q, SAME, 0, rings, known)
    if i >= 0:
        rings.seeds[i] += count
        return rings, known
    if known == len(rings.impacts):
        rings = slice_of(rings, 0, known + ROOM)
    rings.impacts[known], rings.seeds[known] = q, count
    for k in range(q):
        rings.walls[known, k] = on_walls[k]
        rings.points[known, k, 0], rings.points[known, k, 1] = ring[k, 0], ring[k, 1]
    return rings, known + 1


@kernel
def slice_of(rings: Rings, first: int, end: int) -> Rings:
    """Copy some rings, with room for those that there are not yet."""
    n, q, old = end - first, rings.walls.shape[1], min(end, len(rings.impacts))
    copy = Rings(np.zeros((n, q), np.int64), np.zeros((n, q, 2)), np.zeros(n, np.int64),
                 np.zeros(n, np.int64))
    # Item by item: to copy whole arrays takes seconds to compile.
    for i in range(old - first):
        copy.impacts[i], copy.seeds[i] = rings.impacts[first + i], rings.seeds[first + i]
        for k in range(q):
            copy.walls[i, k] = rings.walls[first + i, k]
            copy.points[i, k, 0] = rings.points[first + i, k, 0]
            copy.points[i, k, 1] = rings.points[first + i, k, 1]
    return copy


@kernel
def is_at(wall: int, point: FloatArray, other_wall: int, other: FloatArray, near: float) -> bool:
    return (wall == other_wall and abs(point[1] - other[1]) < near
            and abs(turn_of(point[0] - other[0])) < near)
