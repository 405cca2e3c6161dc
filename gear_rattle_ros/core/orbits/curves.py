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
Stable and unstable manifolds as curves.

A fundamental segment close to the saddle is mapped on, for a stable manifold backwards. Points are
inserted where the image is coarse, and are mapped from the segment themselves, so that all lie on
the manifold.
"""

from collections.abc import Callable, Iterator, Sequence
import dataclasses
import functools
import math
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from .impact_map import next_impact
from .manifolds import Saddle, saddle_of, SEED_DISTANCE
from .orbit import Orbit
from .section import turn
from ..arrays import FloatArray, IntArray, Record, RecordArray
from ..compiled import kernel
from ..flight import lanes
from ..flight.closed_form import NO_WALL, sticks, wall_of
from ..flight.elementary import TWO_PI
from ..flight.inverse import previous_impact
from ..flight.lanes_step import LANES
from ..model import Model

#: Maps points (phase, velocity) at walls on, each that many times; NO_WALL where there is no more.
Map: TypeAlias = Callable[[IntArray, FloatArray, int], tuple[IntArray, FloatArray]]
# Up to here a manifold is straight, to the square of it [1]: a segment reaches no farther.
STRAIGHT: Final = 1e-5
# Neighbours are at most this many tolerances apart.
LONGEST: Final = 30.0
# Places on the segment that are nearer than this are one point but for rounding.
RESOLUTION: Final = 1e-9
# Points that the segment begins with, and that replace an interval at most.
FIRST: Final = 9
PARTS: Final = 16
ROUNDS: Final = 200
# Steps of the lanes at once; fewer points would leave them empty, and are mapped one by one.
STEPS: Final = 4
FEW: Final = 2 * LANES


@dataclasses.dataclass(frozen=True)
class Segment:
    """A piece of a manifold close to a saddle that reaches from a point to its image."""

    wall: int
    point: FloatArray  # of the saddle: phase and velocity [rad, 1]
    vector: FloatArray  # unit vector along the manifold, to the side
    factor: float  # by which the distance to the saddle grows in these impacts
    impacts: int

    def at(self, places: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the points at places from 0 to 1."""
        distance = min(SEED_DISTANCE, STRAIGHT / self.factor) * self.factor**places
        return (np.full(len(places), self.wall, np.int64),
                self.point + distance[:, None] * self.vector)


@dataclasses.dataclass(frozen=True)
class Curve:
    """
    One side of a manifold, or both where the multiplier is negative.

    Points follow each other along the curve, for each point of the saddle from near it on. Pieces
    end where the image of neighbours differs by a whole impact: at a grazing.
    """

    walls: IntArray
    points: FloatArray  # phase and velocity before the impact [rad, 1], shape (n, 2)
    impacts: IntArray  # made since the segment
    places: FloatArray  # on the segment
    begins: npt.NDArray[np.bool_]  # whether a piece begins
    grazes: npt.NDArray[np.bool_]  # whether a piece ends, or begins, as its flight grazes a wall

    @property
    def steps(self) -> FloatArray:
        """Differences from each point to the next of its piece [rad, 1]; nan at the last."""
        steps = np.full(self.points.shape, math.nan)
        joined = ~self.begins[1:]
        steps[:-1][joined] = _steps(self.points)[joined]
        return steps

    @property
    def length(self) -> float:
        """Sum of the distances between neighbours [1]."""
        return float(np.nansum(np.hypot(*self.steps.T)))

    def __getitem__(self, rows: Any) -> 'Curve':
        return Curve(*(values[rows] for values in vars(self).values()))


def segments_of(saddle: Saddle) -> list[tuple[str, Segment, bool]]:
    """List the sides of both manifolds: name, segment, whether it is mapped backwards."""
    # The side + is that of growing phase, or of growing velocity where the phase stays.
    stable = np.array(np.linalg.inv(saddle.rows)[:, 1], np.float64)
    stable *= math.copysign(1.0, stable @ (1.0, 1e-9)) / math.hypot(*stable)
    # One segment leads to both sides where the multipliers are negative.
    sides = {' +': 1.0, ' -': -1.0} if saddle.turns == 1 else {'': 1.0}
    return [(name + side, Segment(int(saddle.orbit.walls[0]), saddle.orbit.points[0],
                                  sign * vector, factor, saddle.impacts), name == 'stable')
            for name, vector, factor in (('unstable', saddle.unstable, saddle.expansion),
                                         ('stable', stable, 1.0 / saddle.contraction))
            for side, sign in sides.items()]


@kernel
def carry(walls: IntArray, points: FloatArray, times: int, backwards: bool, fastest: float,
          model: Model) -> None:
    """Map points on in place; NO_WALL where one sticks, flies on, or is faster than that."""
    for i in range(len(walls)):
        wall, phase, velocity = walls[i], points[i, 0], points[i, 1]
        for _ in range(times):
            if wall == NO_WALL:
                break
            if backwards:
                wall, phase, velocity, _ = previous_impact(wall, phase, velocity, model)
            else:
                wall, _, phase, velocity, _ = next_impact(wall, phase, velocity, model)
            if abs(velocity) > fastest:
                wall = NO_WALL
        walls[i], points[i, 0], points[i, 1] = wall, phase, velocity


@kernel
def carry_in_lanes(tile: Record, initial: RecordArray, numbers: IntArray, walls: IntArray,
                   points: FloatArray, times: int, fastest: float) -> None:
    """Map points of these numbers on from their initial conditions, forwards, as `carry` does."""
    impacts = lanes.new_impacts(STEPS)
    walls[numbers] = NO_WALL
    following = 0
    while True:
        following = lanes.refill(tile, initial, following, float(times))
        if not lanes.is_busy(tile):
            return
        lanes.advance(tile, impacts, STEPS)
        for i in range(LANES):
            if tile.number[i] == lanes.EMPTY:
                continue
            n, model, ends = numbers[tile.number[i]], lanes.model_in(tile, i), tile.left[i] <= 0.0
            for k in range(tile.count[i]):
                one = impacts[i, k]
                last = ends and tile.end[i] == lanes.RUNS and k == tile.count[i] - 1
                fast = abs(one.velocity) > fastest
                if last or fast or sticks(one.velocity, one.phase, model):
                    points[n, 0], points[n, 1] = one.phase, one.velocity
                    walls[n] = wall_of(one.velocity) if last and not fast else NO_WALL
                    ends = True
                    break
            if ends:
                lanes.release(tile, i)


def impact_map(model: Model, *, backwards: bool = False, fastest: float = math.inf,
               check: Callable[[], None] = lambda: None) -> Map:
    """Return the map from impact to impact, or its inverse, up to a speed [1]."""
    # `check` is called each time, and raises to give up.
    def map_on(walls: IntArray, points: FloatArray, times: int) -> tuple[IntArray, FloatArray]:
        check()
        walls, points = walls.copy(), points.copy()
        turned = np.mod(points[:, 0], TWO_PI)
        points[:, 0] = np.where(turned >= TWO_PI, 0.0, turned)
        # The bounds of the lanes hold for no negative damping, so they do not go backwards.
        if backwards or not times or len(walls) < FEW:
            carry(walls, points, times, backwards, fastest, model)
            return walls, points
        numbers = np.flatnonzero(walls != NO_WALL)
        initial = np.zeros(len(numbers), lanes.INITIAL)
        initial['phase'], initial['displacement'] = points[numbers, 0], -1.0 * walls[numbers]
        initial['velocity'] = -model.restitution * points[numbers, 1]
        for name, value in model._asdict().items():
            initial[name] = value
        carry_in_lanes(lanes.new_tiles(1)[0], initial, numbers, walls, points, times, fastest)
        return walls, points

    return map_on


@dataclasses.dataclass
class _Generation:
    """The image of a segment after some impacts."""

    places: FloatArray
    walls: IntArray
    points: FloatArray
    torn: npt.NDArray[np.bool_]  # between each point and the next

    @functools.cached_property
    def alive(self) -> npt.NDArray[np.bool_]:
        return self.walls != NO_WALL


def grow(segment: Segment, map_on: Map, *, length: float = math.inf, impacts: int = 1000,
         tolerance: float = 1e-3, most: int = 1_000_000) -> Curve:
    """
    Map a segment on until the curve has a length, or for some impacts.

    `map_on` is the inverse map for a stable manifold. The curve ends after the impact at which it
    has the `length` [1], or before the one that would need more points than the `most`.
    Neighbours are at most 30 times the `tolerance` apart; their distance times the angle at which
    the curve turns there is at most that [1].
    """
    places = np.linspace(0.0, 1.0, FIRST)
    now = _Generation(places, *segment.at(places), np.zeros(FIRST - 1, np.bool_))
    # Of each impact: the image, and which of its points are ends at a grazing.
    images: list[tuple[_Generation, npt.NDArray[np.bool_]]] = []
    lengths: list[float] = []
    count = 0
    for n in range(impacts + 1):
        if n:
            now = _Generation(now.places, *map_on(now.walls, now.points, 1), now.torn)
        old = now.places[:-1][now.torn]
        refined = _refine(segment, map_on, now, n, tolerance, most - count)
        if refined is None:
            break
        now = refined
        new = now.torn & ~np.isin(now.places[:-1], old) & now.alive[1:] & now.alive[:-1]
        images.append((now, np.append(new, False) | np.insert(new, 0, False)))
        lengths.append(float(np.sum(np.hypot(*_steps(now.points)[~now.torn].T))))
        count += len(now.places)
        # A curve that shrinks has come to an attractor.
        shrinks = n >= segment.impacts and lengths[n] < min(
            tolerance, lengths[n - segment.impacts])
        if sum(lengths) >= length or shrinks or not now.alive.any():
            break
    return _curve_of(images, segment.impacts)


def _steps(points: FloatArray) -> FloatArray:
    return np.column_stack([turn(np.diff(points[:, 0])), np.diff(points[:, 1])])


def _refine(segment: Segment, map_on: Map, now: _Generation, n: int, tolerance: float, most: int
            ) -> _Generation | None:
    # None where it would take more points.
    for _ in range(ROUNDS):
        alive = now.alive
        differ = now.walls[1:] != now.walls[:-1]
        steps = _steps(now.points)
        gaps = np.hypot(steps[:, 0], steps[:, 1])
        angles = np.zeros(len(gaps) + 1)
        x, y = steps[:-1], steps[1:]
        angles[1:-1] = np.abs(np.arctan2(x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0],
                                         np.sum(x * y, axis=1)))
        # No curve passes where it is torn.
        apart = now.torn | differ
        angles[1:-1][apart[1:] | apart[:-1]] = 0.0
        bends = gaps * np.maximum(angles[1:], angles[:-1])
        parts = np.ceil(np.maximum(gaps / (LONGEST * tolerance), np.sqrt(bends / tolerance)))
        parts[differ] = 2.0
        parts[now.torn | ~(alive[1:] | alive[:-1])] = 1.0
        coarse = parts > 1.0
        widths = np.diff(now.places)
        final = coarse & (widths < RESOLUTION)
        torn = now.torn | final & (differ | (gaps > tolerance))
        coarse &= ~final
        now = dataclasses.replace(now, torn=torn)
        if not coarse.any():
            return now
        parts = np.where(coarse, np.minimum(np.maximum(parts, 2.0), PARTS), 1.0).astype(np.int64)
        if parts.sum() > most:
            return None
        # The k-th of the parts of each interval.
        owner = np.repeat(np.arange(len(parts)), parts)
        k = np.arange(len(owner)) - np.repeat(np.cumsum(parts) - parts, parts)
        places = now.places[owner] + k / parts[owner] * widths[owner]
        inserted = k > 0
        # Rounding may make two of them one.
        walls, points = now.walls[owner], now.points[owner]
        walls[inserted], points[inserted] = map_on(*segment.at(places[inserted]), n)
        now = _Generation(np.append(places, now.places[-1]), np.append(walls, now.walls[-1]),
                          np.concatenate([points, now.points[-1:]]),
                          now.torn[owner] & ~coarse[owner])
    return now


def pieces(points: FloatArray, begins: npt.NDArray[np.bool_]) -> FloatArray:
    """Return the lines between neighbours of a curve, shape (n, 2, 2), none round the circle."""
    points = np.column_stack([np.mod(points[:, 0], TWO_PI), points[:, 1]])
    drawn = ~begins[1:] & (np.abs(np.diff(points[:, 0])) < math.pi)
    return np.stack([points[:-1][drawn], points[1:][drawn]], axis=1)


def joined(parts: Sequence[Curve]) -> Curve:
    """Return curves one after the other as one."""
    return Curve(*map(np.concatenate, zip(*(vars(part).values() for part in parts), strict=True)))


def sides_of(orbit: Orbit, *, fastest: float, check: Callable[[], None] = lambda: None,
             **how: Any) -> Iterator[tuple[str, Curve]]:
    """Grow the sides of both manifolds of a saddle one after the other: its name, the curve."""
    for name, segment, backwards in segments_of(saddle_of(orbit)):
        yield name, grow(segment, impact_map(orbit.parameters.model, backwards=backwards,
                                             fastest=fastest, check=check), **how)


def _curve_of(images: list[tuple[_Generation, npt.NDArray[np.bool_]]], period: int) -> Curve:
    # The end of an image is the beginning of that a period later.
    parts = []
    for branch in range(min(period, len(images))):
        for n in range(branch, len(images), period):
            image, grazes = images[n]
            begins = np.insert(image.torn, 0, n == branch or not images[n - period][0].alive[-1])
            dead = np.insert(~image.alive[:-1], 0, False)
            keep = image.alive.copy()
            keep[0] &= n == branch
            parts.append(Curve(image.walls, image.points, np.full(len(keep), n), image.places,
                               begins | dead, grazes)[keep])
    return joined(parts)
