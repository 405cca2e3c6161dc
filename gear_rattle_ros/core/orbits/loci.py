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

"""Curves in a plane of two parameters on which periodic orbits fold, double or graze."""

from collections.abc import Iterator, Mapping, Sequence
import dataclasses
import enum
import functools
import math
from typing import Final, NamedTuple

import numpy as np

from .branches import Change, is_own_image, Turn
from .impact_map import derivatives
from .section import turn as turned, turn_of
from ..arrays import FloatArray, IntArray
from ..compiled import kernel
from ..flight.closed_form import displace, is_pressed, LEG
from ..flight.elementary import sine_cosine
from ..flight.first_impact import search_impact
from ..model import Model

# What an orbit on a curve fulfils: a multiplier is +1, or -1, or an impact has no speed.
PLUS, MINUS, TOUCHES = range(3)
# A step of Newton's method that is the last [rad, 1], and how many there may be; the step of the
# differences that make up its matrix.
CLOSED: Final = 1e-12
ROUNDING: Final = 1e-10
CORRECTIONS: Final = 12
DIFFERENCE: Final = 1e-6
# Steps along a curve [rad, 1]: the first, the shortest, and the farthest a correction may lead, in
# steps; the most of them.
FIRST_STEP: Final = 1e-3
SHORTEST_STEP: Final = 1e-7
STRAY: Final = 0.3
MOST: Final = 4000
HALVINGS: Final = 40
# A flight that ends so much before its time has met a wall; slower it touches one [1].
EARLY: Final = 1e-7
TOUCH: Final = 1e-5
# An impact slower than this is about to be lost where a branch ends [1]; samples of a flight.
SLOW: Final = 1e-2
SAMPLES: Final = 400
# Halves of an orbit nearer than this are nearly one [rad, 1], and curves nearer than this are [1].
ALIKE: Final = 1e-2
SAME: Final = 3e-4
# Condition of the equations of two curves beyond which they do not cross.
PARALLEL: Final = 1e9


class Mark(enum.Enum):
    """What happens at a point of a curve."""

    CUSP = 'cusp'  # two folds meet and end
    GRAZING = 'grazing'  # the curve meets that of a grazing and ends with the orbit
    DOUBLING = 'doubling'  # a fold of the doubled orbit ends on the curve of the doubling
    STICKING = 'sticking'  # a grazing ends, as the gear would stick there
    CROSSING = 'crossing'  # two curves cross


@dataclasses.dataclass(frozen=True)
class Locus:
    """A curve in the plane of two parameters."""

    ring: 'Ring'
    solutions: FloatArray  # of its equations, in order
    marks: tuple[tuple[Mark, float, float], ...] = ()

    @functools.cached_property
    def points(self) -> FloatArray:
        """Return both parameters and the speed of the fastest impact [1], shape (n, 3)."""
        # So an orbit and its mirror image have one curve without a load.
        return np.column_stack([self.solutions[:, -2:],
                                np.abs(self.solutions[:, 1:-2:3]).max(axis=1)])

    def holds(self, other: 'Locus') -> bool:
        """Whether the middle of a curve lies on this one."""
        if self.ring.title != other.ring.title or len(self.points) < 2:
            return False
        a, way = self.points[:-1], np.diff(self.points, axis=0)
        point = other.points[len(other.points) // 2]
        along = np.clip(np.sum((point - a) * way, axis=1) / np.sum(way * way, axis=1), 0.0, 1.0)
        return bool(np.min(np.linalg.norm(a + along[:, None] * way - point, axis=1)) < SAME)


class Kind(NamedTuple):
    """What makes a closed sequence of impacts an orbit on a curve."""

    walls: IntArray
    base: Model  # what the parameters are but for two, numbers x and y
    x: int
    y: int
    # Half of an orbit that is its own mirror image closes in the image of its first impact.
    is_half: bool
    test: int
    place: int  # of the impact without speed


@kernel
def model_at(z: FloatArray, kind: Kind) -> Model:
    """Return the numbers of the model, with two of them from a sequence."""
    base = kind.base
    numbers = np.array([base.alpha, base.beta, base.gamma, base.restitution])
    numbers[kind.x], numbers[kind.y] = z[-2], z[-1]
    return Model(numbers[0], numbers[1], numbers[2], numbers[3])


@kernel
def residual(z: FloatArray, kind: Kind) -> FloatArray:
    """Return by how much a closed sequence is no orbit on the curve; zero where it is."""
    # z is phase, velocity before the impact and flight time to the next of each impact, and both
    # parameters. Flights are not searched for walls, so that all is smooth through a grazing.
    walls, model, q = kind.walls, model_at(z, kind), len(kind.walls)
    found = np.zeros(3 * q + 1)
    a, b, c, d = 1.0, 0.0, 0.0, 1.0
    for k in range(q):
        phase, velocity, time = z[3 * k], z[3 * k + 1], z[3 * k + 2]
        n = (k + 1) % q
        image = kind.is_half and n == 0
        sign = -1.0 if image else 1.0
        sine, cosine = sine_cosine(phase)
        moved, after, _, _ = displace(time, sine, cosine, -model.restitution * velocity, model)
        wall = 1 - walls[n] if image else walls[n]
        found[3 * k] = moved + wall - walls[k]
        found[3 * k + 1] = turn_of(phase + time - z[3 * n] - (math.pi if image else 0.0))
        found[3 * k + 2] = after - sign * z[3 * n + 1]
        if kind.test != TOUCHES:
            one = derivatives(phase, velocity, time, phase + time, after, model)
            a, b, c, d = (one[0] * a + one[1] * c, one[0] * b + one[1] * d,
                          sign * (one[2] * a + one[3] * c), sign * (one[2] * b + one[3] * d))
    trace = a + d if kind.test == MINUS else -a - d
    found[3 * q] = (z[3 * kind.place + 1] if kind.test == TOUCHES else
                    1.0 + trace + (a * d - b * c))
    return found


@kernel
def jacobian(z: FloatArray, kind: Kind) -> FloatArray:
    """Differentiate `residual` by central differences: Newton's method needs no more."""
    matrix = np.zeros((len(z) - 1, len(z)))
    for k in range(len(z)):
        beside = z.copy()
        beside[k] = z[k] + DIFFERENCE
        above = residual(beside, kind)
        beside[k] = z[k] - DIFFERENCE
        below = residual(beside, kind)
        # Item by item: to subtract whole arrays takes seconds to compile.
        for j in range(len(below)):
            matrix[j, k] = (above[j] - below[j]) / (2.0 * DIFFERENCE)
    return matrix


@kernel
def is_real(z: FloatArray, kind: Kind) -> int:
    """Whether the gear goes from impact to impact: 1, 0 if it meets a wall before, -1 sticks."""
    walls, model = kind.walls, model_at(z, kind)
    for k in range(len(walls)):
        phase, velocity, time = z[3 * k], z[3 * k + 1], z[3 * k + 2]
        wall = 1.0 - 2.0 * walls[k]
        if kind.test == TOUCHES and k == kind.place:
            velocity = 0.0
            if is_pressed(-1.0 * walls[k], phase % (2.0 * math.pi), model):
                return -1
        elif velocity * wall <= 0.0:
            return 0
        met, _, speed, _ = search_impact(0.0, 0, LEG, phase, -1.0 * walls[k],
                                         -model.restitution * velocity, model)
        if time <= 0.0 or met < time - EARLY and abs(speed) > TOUCH:
            return 0
    return 1


@dataclasses.dataclass(frozen=True)
class Ring:
    """The equations of a curve."""

    change: Change
    kind: Kind
    drive_periods: int

    @property
    def title(self) -> tuple[str, int, int]:
        """Return what happens to the orbit, and its impacts and drive periods."""
        kind = self.kind
        impacts = len(kind.walls) * (2 if kind.is_half else 1) - (kind.test == TOUCHES)
        return self.change.value, impacts, self.drive_periods

    def tangent(self, z: FloatArray, ahead: FloatArray | None = None) -> FloatArray:
        tangent = np.linalg.svd(jacobian(z, self.kind))[2][-1]
        return np.asarray(tangent if ahead is None or tangent @ ahead >= 0.0 else -tangent)

    def correct(self, z: FloatArray, tangent: FloatArray, reach: float) -> FloatArray | None:
        """Return to the curve at right angles to a tangent; None where it is not near."""
        start, shortest = z, math.inf
        for _ in range(CORRECTIONS):
            off = residual(z, self.kind)
            try:
                change = np.linalg.solve(np.vstack([jacobian(z, self.kind), tangent]),
                                         np.append(off, 0.0))
            except np.linalg.LinAlgError:
                return None
            z = z - change
            size = float(np.max(np.abs(change)))
            if not np.max(np.abs(z - start)) <= reach:
                return None
            if size < CLOSED or size >= shortest and np.max(np.abs(off)) < ROUNDING:
                return z
            shortest = min(shortest, size)
        return None

    def ending(self, z: FloatArray) -> Mark:
        """Return why a curve ends: for its orbit is twice another one, or grazes a wall."""
        q = len(self.kind.walls)
        apart = z[:-2].reshape(q, 3) - np.roll(z[:-2].reshape(q, 3), q // 2, axis=0)
        apart[:, 0] = turned(apart[:, 0])
        if q % 2 == 0 and not self.kind.is_half and np.max(np.abs(apart)) < ALIKE:
            return Mark.DOUBLING
        return Mark.GRAZING


def trace_locus(turn: Turn, windows: Mapping[str, tuple[float, float]],
                known: Sequence[Locus] = (), *, longest: float = 0.02) -> Locus | None:
    """Follow a change of an orbit through windows of two parameters."""
    # None where a curve that is `known` goes through it, or none is found. `longest` bounds a step
    # in all coordinates together [rad, 1].
    names, limits = (*windows,), (*windows.values(),)
    begun = _begin(turn, names)
    if begun is None:
        return None
    ring, z = begun
    first = ring.tangent(z)
    z0 = ring.correct(z, first, 10.0 * SLOW)
    if z0 is None or is_real(z0, ring.kind) < 1 or any(
            one.holds(Locus(ring, z0[None])) for one in known):
        return None
    sides, marks = [], []
    for sign in (-1.0, 1.0):
        solutions, some = _follow(ring, z0, sign * ring.tangent(z0, first), limits, longest)
        sides.append(solutions)
        marks += some
    return Locus(ring, np.array([*sides[0][:0:-1], *sides[1]]), tuple(marks))


def crossings(one: Locus, other: Locus) -> Iterator[tuple[float, float]]:
    """Find the parameters at which two curves cross."""
    a, b = one.points[:, :2], other.points[:, :2]
    apart, ways = b[:-1] - a[:-1, None], (np.diff(a, axis=0)[:, None], np.diff(b, axis=0))
    with np.errstate(all='ignore'):
        shares = np.stack([_area(apart, way) for way in ways[::-1]]) / _area(*ways)
    for places in np.argwhere(((shares >= 0.0) & (shares < 1.0)).all(axis=0)).tolist():
        begun, reach = [], 0.0
        for locus, k, share in zip((one, other), places, shares[:, places[0], places[1]],
                                   strict=True):
            way = locus.solutions[k + 1] - locus.solutions[k]
            begun.append(locus.solutions[k] + share * way)
            reach = max(reach, float(np.linalg.norm(way)))
        found = _meet((one.ring, other.ring), begun, reach)
        if found is not None:
            yield found


def _area(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _meet(rings: tuple['Ring', 'Ring'], begun: list[FloatArray], reach: float
          ) -> tuple[float, float] | None:
    # Both orbits at once by Newton's method. What touches, or is one curve found twice, does not
    # cross.
    first, n = np.concatenate(begun), len(begun[0])
    z, matrix = first, np.zeros((len(first), len(first)))
    matrix[-2:, n - 2:n], matrix[-2:, -2:] = np.eye(2), -np.eye(2)
    for _ in range(CORRECTIONS):
        (one, a), (other, b) = zip(rings, (z[:n], z[n:]), strict=True)
        matrix[:n - 1, :n], matrix[n - 1:-2, n:] = (jacobian(a, one.kind),
                                                    jacobian(b, other.kind))
        if np.linalg.cond(matrix) > PARALLEL:
            return None
        change = np.linalg.solve(matrix, np.concatenate([
            residual(a, one.kind), residual(b, other.kind), a[-2:] - b[-2:]]))
        z = z - change
        if np.max(np.abs(z - first)) > reach:
            return None
        if np.max(np.abs(change)) < ROUNDING:
            return float(z[-2]), float(z[-1])
    return None


def _follow(ring: Ring, z: FloatArray, tangent: FloatArray,
            windows: tuple[tuple[float, float], ...], longest: float
            ) -> tuple[list[FloatArray], list[tuple[Mark, float, float]]]:
    start, step = z, FIRST_STEP
    solutions = [z]
    marks: list[tuple[Mark, float, float]] = []
    for number in range(MOST):
        reached = ring.correct(z + step * tangent, tangent, STRAY * step + ROUNDING)
        real = 0 if reached is None else is_real(reached, ring.kind)
        if reached is None or real < 1:
            step *= 0.5
            if step >= SHORTEST_STEP:
                continue
            mark = Mark.STICKING if real < 0 else ring.ending(z)
            return solutions, [*marks, (mark, *z[-2:].tolist())]
        following = ring.tangent(reached, tangent)
        if tangent[-2:] @ following[-2:] < 0.0:
            cusp = _cusp(ring, z, tangent, step)
            marks.append((Mark.CUSP, *cusp[-2:].tolist()))
            solutions.append(cusp)
        z, tangent = reached, following
        solutions.append(z)
        inside = all(low <= value <= high for value, (low, high) in zip(
            z[-2:], windows, strict=True))
        closed = number > 10 and float(np.linalg.norm(z - start)) < step
        if not inside or closed:
            break
        step = min(1.4 * step, longest)
    return solutions, marks


def _cusp(ring: Ring, z: FloatArray, tangent: FloatArray, step: float) -> FloatArray:
    # Where the parameters turn round.
    low, high, ahead, found = 0.0, step, tangent[-2:], z
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        reached = ring.correct(z + middle * tangent, tangent, STRAY * step + ROUNDING)
        if reached is None:
            break
        if ring.tangent(reached, tangent)[-2:] @ ahead > 0.0:
            low = middle
        else:
            high = middle
        found = reached
    return found


def _begin(turn: Turn, names: tuple[str, ...]) -> tuple[Ring, FloatArray] | None:
    orbit, change = turn.orbit, turn.change
    is_half = 'gamma' not in names and is_own_image(orbit) and change is not Change.GRAZING
    test = {Change.FOLD: PLUS, Change.GRAZING: TOUCHES}.get(change, MINUS)
    if change is Change.PITCHFORK and not is_half:
        return None
    walls, points = orbit.walls, orbit.points
    times, place = np.roll(orbit.flight_times, -1), int(np.argmin(np.abs(orbit.velocities)))
    if change is Change.GRAZING and abs(orbit.velocities[place]) > SLOW:
        k, time, wall = _nearest(orbit.parameters.model, walls, points, times)
        place = k + 1
        walls = np.insert(walls, place, wall)
        points = np.insert(points, place, (points[k, 0] + time, 0.0), axis=0)
        times = np.insert(times, place, times[k] - time)
        times[k] = time
    size = len(walls) // 2 if is_half else len(walls)
    fields = tuple(vars(orbit.parameters))
    x, y = (fields.index(name) for name in names)
    z = np.column_stack([points, times])[:size].ravel()
    kind = Kind(np.ascontiguousarray(walls[:size], np.int64), orbit.parameters.model, x, y,
                is_half, test, place)
    return Ring(change, kind, orbit.drive_periods), np.append(
        z, [getattr(orbit.parameters, name) for name in names])


def _nearest(model: Model, walls: IntArray, points: FloatArray, times: FloatArray
             ) -> tuple[int, float, int]:
    # The flight, time and wall of the least distance from a wall between impacts.
    best = math.inf, 0, 0.0, 0
    for k, (phase, velocity) in enumerate(points):
        sine, cosine = sine_cosine(phase)
        at = np.linspace(0.0, times[k], SAMPLES)
        s = np.array([displace(t, sine, cosine, -model.restitution * velocity, model)[0]
                      for t in at]) - walls[k]
        for wall, gap in ((0, -s), (1, 1.0 + s)):
            for n in 1 + np.flatnonzero((gap[1:-1] <= gap[:-2]) & (gap[1:-1] <= gap[2:])):
                best = min(best, (float(gap[n]), k, float(at[n]), wall))
    return best[1:]
