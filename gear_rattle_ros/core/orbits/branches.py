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

"""Families of periodic orbits followed along a path, and the orbits that leave them."""

from collections.abc import Callable
import dataclasses
import enum
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from .newton import CLOSED
from .orbit import fire, Orbit, orbit_at, same_orbit, Shot, solve_ring
from .section import turn as turned
from ..arrays import FloatArray
from ..flight.elementary import TWO_PI
from ..model import Parameters
from ..path import Path

FIRST_STEP: Final = 2e-3
SHORTEST_STEP: Final = 1e-10
CORRECTIONS: Final = 10
# Largest distance of the corrected point from the predicted one, in steps.
STRAY: Final = 0.3
# No change is claimed to be located better than this [1]: Newton's method ends at 1e-12.
ROUNDING: Final = 2e-10
ROOT_STEPS: Final = 100
# Steps tried from a change to the orbit that is born there, all coordinates together [1].
ASIDE: Final = (1e-3, 3e-4, 1e-4, 3e-5)
# Orbits that diverge at a change are distinguished beyond this [rad, 1].
APART: Final = 1e-6
# Where a branch is born is first known to this: in the parameters [1], and in the orbit that it
# left [rad, 1].
NEAR: Final = 1e-3
MIDDLE: Final = 0.1


class Change(enum.Enum):
    """What happens to an orbit on its branch."""

    # A pair of multipliers never reaches the unit circle: its product is below 1 along the branch.
    FOLD = 'fold'  # the branch turns round on the path
    PITCHFORK = 'pitchfork'  # a multiplier is +1 though it does not turn round
    DOUBLING = 'doubling'  # a multiplier is -1
    GRAZING = 'grazing'  # the orbit ends, as an impact would be lost or gained


@dataclasses.dataclass(frozen=True)
class Turn:
    """A place on a branch where the orbit changes."""

    change: Change
    value: float  # the coordinate of the path [1]
    uncertainty: float  # of it [1]
    orbit: Orbit  # there, or the last one before


@dataclasses.dataclass(frozen=True)
class Branch:
    """A family of orbits, and where it changes, in order along the branch."""

    orbits: tuple[Orbit, ...]
    turns: tuple[Turn, ...]


@dataclasses.dataclass(frozen=True)
class _Point:
    walls: npt.NDArray[np.int64]
    x: FloatArray
    path: Path
    value: float
    parameters: Parameters
    # Whether to stay among orbits that are their own mirror image: where others leave them,
    # they are regular only so.
    mirrored: bool = False

    @property
    def vector(self) -> FloatArray:
        return np.append(self.x.ravel(), self.value)

    @property
    def shot(self) -> Shot | None:
        return fire(self.walls, self.x, self.parameters)

    @property
    def orbit(self) -> Orbit | None:
        return orbit_at(self.walls, self.x, self.parameters)

    def at(self, vector: FloatArray) -> '_Point | None':
        value = float(vector[-1])
        try:
            parameters = self.path.at(value)
        except ValueError:
            return None
        return dataclasses.replace(self, x=vector[:-1].reshape(-1, 2), value=value,
                                   parameters=parameters)

    def solve(self, shot: Shot, defects: FloatArray, row: FloatArray, right: float) -> FloatArray:
        return self.kept(solve_ring(shot, self.path.direction, defects, row, right))

    def kept(self, change: FloatArray) -> FloatArray:
        if not self.mirrored:
            return change
        points = change[:-1].reshape(-1, 2)
        image = np.roll(points, len(points) // 2, axis=0) * (1.0, -1.0)
        return np.append(0.5 * (points + image), change[-1])


def follow(orbit: Orbit, path: Path, direction: float, low: float = -math.inf,
           high: float = math.inf, *, longest: float = 0.02, most: int = 2000,
           to_first_turn: bool = False) -> Branch:
    """Follow a periodic orbit along a path by pseudo-arclength, through folds."""
    # `direction` is the sign of the first step. It stops outside [low, high] on the path, after
    # `most` orbits, or at the first change; `longest` bounds a step [1] in all coordinates
    # together.
    here = _Point(orbit.walls, orbit.points, path, path.of(orbit.parameters), orbit.parameters,
                  'gamma' not in path.varied and is_own_image(orbit))
    ahead = np.zeros(len(here.vector))
    ahead[-1] = direction
    tangent = _tangent(here, ahead)
    orbits, turns = [orbit], []
    step = min(FIRST_STEP, longest)
    while len(orbits) < most:
        reached = _correct(here, tangent, step)
        found = None if reached is None else reached.orbit
        if reached is None or found is None:
            step *= 0.5
            if step >= SHORTEST_STEP:
                continue
            beyond = here.at(here.vector + 100.0 * SHORTEST_STEP * tangent)
            if beyond is not None and beyond.shot is None:
                turns.append(Turn(Change.GRAZING, here.value, 10.0 * SHORTEST_STEP, orbits[-1]))
            break
        following = _tangent(reached, tangent)
        folds = tangent[-1] * following[-1] < 0.0
        ends = tangent, step, orbits[-1], found, following
        # A multiplier is +1 at a fold as well. Where it is so alone, a branch leaves; where the
        # branch turns round alone, it was born from another.
        one = _passes(orbits[-1], found, 1.0)
        if folds:
            fold = _locate(Change.FOLD, here, *ends)
            turns.append(fold if one else _birth(path, fold))
        elif one:
            turns.append(_locate(Change.PITCHFORK, here, *ends))
        if _passes(orbits[-1], found, -1.0):
            turns.append(_locate(Change.DOUBLING, here, *ends))
        orbits.append(found)
        here, tangent = reached, following
        step = min(1.4 * step, longest)
        if not low <= here.value <= high or to_first_turn and turns:
            break
    return Branch(tuple(orbits), tuple(turns))


def leaving(path: Path, turn: Turn) -> list[Orbit]:
    """Find the orbits that leave a branch at a doubling or a pitchfork, close to it."""
    # That is one of twice the period, or two that are mirror images of each other, on the side
    # where they exist; stable ones if there are any.
    old = turn.orbit
    turns = 2 if turn.change is Change.DOUBLING else 1
    shot = fire(old.walls, old.points, old.parameters)
    assert shot is not None
    values, vectors = np.linalg.eig(shot.derivative())
    nearest = int(np.argmin(np.abs(values - (1.0 if turns == 1 else -1.0))))
    aside, moved = np.real(vectors[:, nearest]), []
    q = old.impacts
    for k in range(turns * q):
        moved.append(aside)
        aside = shot.blocks[k % q] @ aside
    tangent = np.append(np.ravel(moved), 0.0)
    tangent /= np.linalg.norm(tangent)
    there = _Point(np.tile(old.walls, turns), np.tile(old.points, (turns, 1)), path, turn.value,
                   old.parameters)
    best: list[Orbit] = []
    for step in ASIDE:
        # Half a period on, the doubled orbit lies on the other side: it is one and the same.
        reached = [_correct(there, sign * tangent, step) for sign in (1.0, -1.0)[:3 - turns]]
        found = [orbit for orbit in (None if point is None else point.orbit for point in reached)
                 if orbit is not None and (turns == 2 or not same_orbit(orbit, old, APART))]
        if found and (not best or not best[0].is_stable and found[0].is_stable):
            best = found
    return best


def is_own_image(orbit: Orbit) -> bool:
    """Whether s -> -1 - s, tau -> tau + pi maps an orbit to itself; never under a load."""
    points = np.roll(orbit.points, orbit.impacts // 2, axis=0) * (1.0, -1.0)
    points[:, 0] = np.mod(points[:, 0] + math.pi, TWO_PI)
    image = dataclasses.replace(orbit, walls=1 - np.roll(orbit.walls, orbit.impacts // 2),
                                points=points)
    return orbit.parameters.gamma == 0.0 and same_orbit(orbit, image, 1e3 * CLOSED)


def _tangent(point: _Point, ahead: FloatArray) -> FloatArray:
    shot = point.shot
    assert shot is not None
    try:
        tangent = point.solve(shot, np.zeros(len(ahead) - 1), ahead, 1.0)
    except np.linalg.LinAlgError:
        # The first direction may lie across the branch.
        along = shot.by_parameters @ point.path.direction
        tangent = np.linalg.svd(np.column_stack([shot.jacobian, along]))[2][-1]
        tangent = point.kept(tangent if tangent @ ahead >= 0.0 else -tangent)
    return np.asarray(tangent / np.linalg.norm(tangent))


def _correct(point: _Point, tangent: FloatArray, step: float, room: float = 0.0) -> _Point | None:
    # Back to the branch at right angles to the step; regular at a fold too (Keller 1977).
    predicted = point.vector + step * tangent
    vector = predicted
    for _ in range(CORRECTIONS):
        moved = point.at(vector)
        shot = None if moved is None else moved.shot
        if shot is None:
            return None
        try:
            change = point.solve(shot, shot.defects, tangent, 0.0)
        except np.linalg.LinAlgError:
            return None
        vector = vector - change
        if np.max(np.abs(vector - predicted)) > STRAY * step + room + 1e3 * CLOSED:
            return None
        if np.max(np.abs(change)) < CLOSED:
            return point.at(vector)
    return None


def _test(orbit: Orbit, sign: float) -> float:
    # Zero where a multiplier is +1 or -1.
    first, second = orbit.multipliers
    return float(((sign - first) * (sign - second)).real)


def _passes(before: Orbit, after: Orbit, sign: float) -> bool:
    return _test(before, sign) * _test(after, sign) < 0.0


def _birth(path: Path, turn: Turn) -> Turn:
    # Here an orbit nearly covers the one that it left, or is nearly its own mirror image.
    orbit, half = turn.orbit, turn.orbit.impacts // 2
    ahead = np.roll(orbit.points, -half, axis=0)
    image = ahead * (1.0, -1.0) - (math.pi, 0.0)
    at_value = np.append(np.zeros(orbit.points.size), 1.0)
    for other, length in ((ahead, half), (image, 2 * half))[:1 if 'gamma' in path.varied else 2]:
        apart = other - orbit.points
        apart[:, 0] = turned(apart[:, 0])
        guess = _Point(orbit.walls[:length], (orbit.points + 0.5 * apart)[:length],
                       path, turn.value, orbit.parameters, other is image)
        reached = _correct(guess, at_value[-2 * length - 1:], 0.0, MIDDLE)
        parent = None if reached is None else reached.orbit
        if parent is None or other is image and not is_own_image(parent):
            continue
        for direction in (1.0, -1.0):
            near = NEAR * path.unit
            branch = follow(parent, path, direction, turn.value - near, turn.value + near,
                            to_first_turn=True)
            for found in branch.turns:
                if abs(found.value - turn.value) < near and found.change is not Change.FOLD:
                    return found
    return turn


def _locate(change: Change, here: _Point, tangent: FloatArray, step: float, before: Orbit,
            after: Orbit, following: FloatArray) -> Turn:
    sign = -1.0 if change is Change.DOUBLING else 1.0

    def look(at: float) -> tuple[float, float, Orbit] | None:
        reached = _correct(here, tangent, at)
        orbit = None if reached is None else reached.orbit
        if reached is None or orbit is None:
            return None
        value = (float(_tangent(reached, tangent)[-1]) if change is Change.FOLD
                 else _test(orbit, sign))
        return value, reached.value, orbit

    ends = ((float(tangent[-1]), float(following[-1])) if change is Change.FOLD
            else (_test(before, sign), _test(after, sign)))
    path = here.path
    uncertainty, value, at = _root(look, (0.0, ends[0], here.value), (
        step, ends[1], path.of(after.parameters), after))
    return Turn(change, value, max(uncertainty, ROUNDING * path.unit), at)


def _root(look: Callable[[float], tuple[float, float, Orbit] | None],
          low: tuple[float, float, float], high: tuple[float, float, float, Orbit]
          ) -> tuple[float, float, Orbit]:
    # Regula falsi, halving the value at an end that stays (Illinois); what is left on the path.
    (a, fa, before), (b, fb, after, orbit) = low, high
    seen = fb, after, orbit
    rate = (after - before) / (fb - fa)
    side = 0
    for _ in range(ROOT_STEPS):
        middle = (a * fb - b * fa) / (fb - fa)
        if not a < middle < b:
            break
        found = look(middle)
        if found is None:
            break
        if found[0] != seen[0]:
            rate = (found[1] - seen[1]) / (found[0] - seen[0])
        seen = found
        if seen[0] * fb > 0.0:
            b, fb, fa, side = middle, seen[0], fa * (0.5 if side > 0 else 1.0), 1
        else:
            a, fa, fb, side = middle, seen[0], fb * (0.5 if side < 0 else 1.0), -1
        if abs(seen[0]) < CLOSED:
            break
    return abs(seen[0] * rate), *seen[1:]
