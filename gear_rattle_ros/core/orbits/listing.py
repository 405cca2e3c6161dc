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
from typing import Any, Final, TypeAlias

import numpy as np

from .impact_map import derivatives, next_impact
from .newton import close_ring
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
# Orbits for which more room is made at once.
ROOM: Final = 1000

# Walls, points, and how many seeds led there.
Row: TypeAlias = tuple[IntArray, FloatArray, int]


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


class Rings:
    """Closed sequences of impacts, a row of arrays for each, and how many seeds led to it."""

    def __init__(self, found: OrbitList) -> None:
        self.parameters, self.longest = found.parameters, found.longest
        self._arrays = (
            np.zeros((0, self.longest), np.int64), np.zeros((0, self.longest, 2)),
            np.zeros(0, np.int64), np.zeros(0, np.int64))
        self._make_room(len(found.orbits))
        walls, rings, impacts, seeds = self._arrays
        for row, orbit in enumerate(found.orbits):
            walls[row, :orbit.impacts], rings[row, :orbit.impacts] = orbit.walls, orbit.points
            impacts[row] = orbit.impacts
        self.known = len(found.orbits)
        seeds[:self.known] = found.seeds

    def add(self, seeds: IntArray, new: list[Row]) -> None:
        """Add seeds of the first sequences, and sequences that may be there."""
        self._arrays[-1][:len(seeds)] += seeds
        for on_walls, points, count in new:
            self._make_room(self.known + 1)
            self.known = keep(on_walls, points, *self._arrays, count, self.known)

    def seek(self, first: int, count: int) -> tuple[IntArray, list[Row]]:
        """Find what seeds from some points of the section lead to; return it for `add`."""
        known, before = self.known, self._arrays[-1][:self.known].copy()
        p = self.parameters
        # An orbit has a flight no faster than q impacts in a drive period; the other velocities
        # differ by what the forces can do in a period.
        fastest = self.longest / TWO_PI + 2.0 * p.alpha + TWO_PI * abs(p.gamma) + p.beta
        end = first + count
        while first < end:
            self._make_room(self.known + 1)
            first, self.known = seek(first, end, fastest, *self._arrays, self.known, p.model)
        return self._arrays[-1][:known] - before, self.rows()[known:]

    def splice(self) -> None:
        """Add what two orbits lead to that come near each other, one after the other."""
        # This finds orbits that few trajectories approach.
        whole = min(self.known, PARTS)
        for i in range(whole):
            self._make_room(self.known + whole * self.longest)
            self.known = splice(i, whole, *self._arrays, self.known, self.parameters.model)

    def rows(self) -> list[Row]:
        """List walls, points and seeds of each."""
        walls, points, impacts, seeds = self._arrays
        return [(walls[i, :q], points[i, :q], int(seeds[i]))
                for i, q in enumerate(impacts[:self.known])]

    def listed(self, rounds: tuple[tuple[int, int], ...], points: int) -> OrbitList:
        """List the orbits after one more round."""
        closed = [(orbit.canonical(), seeds) for walls, ring, seeds in self.rows()
                  if (orbit := orbit_at(walls, ring, self.parameters))]
        closed.sort(key=lambda one: (one[0].impacts, one[0].drive_periods, one[0].key))
        return OrbitList(self.parameters, self.longest, tuple(orbit for orbit, _ in closed),
                         tuple(seeds for _, seeds in closed), (*rounds, (points, len(closed))))

    def _make_room(self, rows: int) -> None:
        more = rows - len(self._arrays[0])
        if more > 0:
            larger: Any = tuple(np.pad(each, [(0, more + ROOM), *[(0, 0)] * (each.ndim - 1)])
                                for each in self._arrays)
            self._arrays = larger


@kernel
def seek(first: int, end: int, fastest: float, walls: IntArray, rings: FloatArray,
         impacts: IntArray, seeds: IntArray, known: int, model: Model) -> tuple[int, int]:
    """Close near returns from points of the section; return the next point, and what is known."""
    # It stops before the point for which there may be no room.
    longest = rings.shape[1]
    length = FOLLOWED + longest
    path, on_walls = np.zeros((length + 1, 2)), np.zeros(length + 1, np.int64)
    tangents = np.zeros((length, 4))
    ring, carried = np.zeros((longest, 2)), np.zeros((longest, 8))
    aim = np.zeros(2)
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
                k = find_ring(on_walls[n], aim, q, SAME + AIMED * step, OFTEN, walls, rings,
                              impacts, seeds, known)
                if k >= 0:
                    seeds[k] += 1
                    settled |= step < SETTLED and abs(a + d) < 1.0 + (a * d - b * c) < 2.0
                    continue
                ring[:q] = path[n:n + q]
                if close_ring(on_walls[n:n + q], ring[:q], carried, REACH, model):
                    if known == len(impacts):
                        return number, known
                    known = keep(on_walls[n:n + q], ring[:q], walls, rings, impacts, seeds, 1,
                                 known)
            n += 1
    return end, known


@kernel
def splice(i: int, whole: int, walls: IntArray, rings: FloatArray, impacts: IntArray,
           seeds: IntArray, known: int, model: Model) -> int:
    """Close orbit i followed by another, from where they are nearest on; return the known."""
    longest = rings.shape[1]
    ring, carried = np.zeros((longest, 2)), np.zeros((longest, 8))
    on_walls = np.zeros(longest, np.int64)
    for j in range(i, whole):
        q = impacts[i] + impacts[j]
        if q > longest:
            continue
        here, there, nearest = -1, -1, SPLICED
        for k in range(impacts[i]):
            for n in range(impacts[j]):
                apart = max(abs(turn_of(rings[i, k, 0] - rings[j, n, 0])),
                            abs(rings[i, k, 1] - rings[j, n, 1]))
                if walls[j, n] == walls[i, k] and apart < nearest and (i != j or k < n):
                    here, there, nearest = k, n, apart
        if here < 0:
            continue
        for one in range(q):
            row, at = (i, here + one) if one < impacts[i] else (j, there + one - impacts[i])
            at %= impacts[row]
            on_walls[one] = walls[row, at]
            ring[one] = rings[row, at]
        if close_ring(on_walls[:q], ring[:q], carried, REACH, model):
            known = keep(on_walls[:q], ring[:q], walls, rings, impacts, seeds, 1, known)
    return known


@kernel
def find_ring(wall: int, point: FloatArray, q: int, near: float, least: int, walls: IntArray,
              rings: FloatArray, impacts: IntArray, seeds: IntArray, known: int) -> int:
    """Return the orbit of q impacts, or a part of q, that has a point; -1 for none."""
    # Of those to which at least the `least` seeds have led.
    for i in range(known):
        if seeds[i] >= least and q % impacts[i] == 0:
            for k in range(impacts[i]):
                if is_at(wall, point, walls[i, k], rings[i, k], near):
                    return i
    return -1


@kernel
def keep(on_walls: IntArray, ring: FloatArray, walls: IntArray, rings: FloatArray,
         impacts: IntArray, seeds: IntArray, count: int, known: int) -> int:
    """Count seeds of a closed sequence, of a new one where it is; return how many there are."""
    q = len(on_walls)
    for k in range(q):
        if abs(ring[k, 1]) < SLOWEST:
            return known
    for p in range(1, q):
        # Of a sequence that goes round twice, half is found, too.
        if q % p == 0 and is_at(on_walls[p], ring[p], on_walls[0], ring[0], SAME):
            return known
    i = find_ring(on_walls[0], ring[0], q, SAME, 0, walls, rings, impacts, seeds, known)
    if i >= 0:
        seeds[i] += count
        return known
    impacts[known], seeds[known] = q, count
    walls[known, :q], rings[known, :q] = on_walls, ring
    return known + 1


@kernel
def is_at(wall: int, point: FloatArray, other_wall: int, other: FloatArray, near: float) -> bool:
    return (wall == other_wall and abs(point[1] - other[1]) < near
            and abs(turn_of(point[0] - other[0])) < near)
