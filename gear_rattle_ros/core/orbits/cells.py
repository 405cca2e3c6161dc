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
Where manifolds cross, and the cells that they bound.

A cell of Nusse & Yorke (Science 271, 1376, 1996) is a polygon whose sides are in turn the first
pieces of the unstable and of the stable manifold of one periodic orbit. It is a basin cell if its
image lies in it: all of it is then in one basin.
"""

import dataclasses
from typing import Final

import numpy as np
import numpy.typing as npt

from .curves import Curve, Map
from .section import turn
from ..arrays import FloatArray, IntArray
from ..compiled import kernel
from ..flight.elementary import TWO_PI

# Points of a cell whose images are sought, and the share of them that must lie in a cell: what is
# lacking is the width of a polygon's chords.
SAMPLES: Final = 4000
WITHIN: Final = 0.999


@dataclasses.dataclass(frozen=True)
class Cell:
    """A polygon bounded by manifolds."""

    wall: int
    outline: FloatArray  # phase, beyond 2 pi where it goes on, and velocity [rad, 1]
    sides: int

    def contains(self, walls: IntArray, points: FloatArray) -> npt.NDArray[np.bool_]:
        """Whether points lie in it."""
        middle = 0.5 * (self.outline.min(axis=0) + self.outline.max(axis=0))
        x = middle[0] + turn(points[:, 0] - middle[0])
        return (walls == self.wall) & enclosed(x, points[:, 1], self.outline)

    def samples(self, seed: int = 1) -> FloatArray:
        """Draw points in it."""
        low, high = self.outline.min(axis=0), self.outline.max(axis=0)
        drawn = low + (high - low) * np.random.default_rng(seed).random((SAMPLES, 2))
        return drawn[enclosed(drawn[:, 0], drawn[:, 1], self.outline)]


@kernel
def enclosed(x: FloatArray, y: FloatArray, outline: FloatArray) -> npt.NDArray[np.bool_]:
    """Whether points lie inside a closed polygon, by the sides that a ray from them crosses."""
    found = np.zeros(len(x), np.bool_)
    for i in range(len(x)):
        for j in range(len(outline)):
            x0, y0 = outline[j - 1]
            x1, y1 = outline[j]
            if (y0 > y[i]) != (y1 > y[i]) and x[i] < x0 + (x1 - x0) * (y[i] - y0) / (y1 - y0):
                found[i] = not found[i]
    return found


def find_cells(points: FloatArray, unstable: Curve, stable: Curve, map_on: Map) -> list[Cell]:
    """
    Find the basin cells that one side of each manifold of an orbit with these points bounds.

    The multipliers are positive.
    """
    period = len(points)
    pieces = [_first_piece(stable, k, period) for k in range(period)]
    # Shortest stable sides first.
    for most in range(0, int(stable.impacts.max()) + 1, period):
        near = np.concatenate([each[stable.impacts[each] <= most + period - 1]
                               for each in pieces])
        sides = [_side(points, k, unstable, stable, near) for k in range(period)]
        met = [side for side in sides if side is not None]
        if len(met) == period and len({end for end, _ in met}) == period:
            cells = _polygons(met, stable.walls[[each[0] for each in pieces]], period)
            if are_trapping(cells, map_on):
                return cells
    return []


def _side(points: FloatArray, k: int, unstable: Curve, stable: Curve, near: IntArray
          ) -> tuple[int, FloatArray] | None:
    # From one point of the orbit along both manifolds to another.
    out = _first_piece(unstable, k, len(points))
    mine = unstable.points[out]
    i, j, part = first_crossing(unstable.walls[out], mine, unstable.begins[out],
                                stable.walls[near], stable.points[near], stable.begins[near])
    if i < 0:
        return None
    corner = mine[i - 1] + part * unstable.steps[out][i - 1]
    branch = int(stable.impacts[near[j]]) % len(points)
    back = near[:j][stable.impacts[near[:j]] % len(points) == branch]
    # Backwards the orbit is passed in the other direction.
    return (-branch) % len(points), np.concatenate([
        points[k:k + 1], mine[:i], corner[None], stable.points[back][::-1]])


def _polygons(sides: list[tuple[int, FloatArray]], walls: IntArray, period: int) -> list[Cell]:
    # Each side leads from the point of its number to another, all of them in cycles.
    cells, left = [], set(range(period))
    while left:
        first = k = min(left)
        outline = []
        while k in left:
            left.remove(k)
            end, side = sides[k]
            outline.append(side)
            k = end
        path = np.concatenate(outline)
        path[:, 0] = path[0, 0] + np.append(0.0, np.cumsum(turn(np.diff(path[:, 0]))))
        cells.append(Cell(int(walls[-first % period]), path, 2 * len(outline)))
    return cells


def _first_piece(curve: Curve, branch: int, period: int) -> IntArray:
    # Up to the first cut of a branch.
    mine = np.flatnonzero(curve.impacts % period == branch)
    cuts = np.flatnonzero(curve.begins[mine][1:])
    return mine[:cuts[0] + 1] if len(cuts) else mine


def are_trapping(cells: list[Cell], map_on: Map) -> bool:
    """Whether the image of cells lies in them."""
    inside, drawn = 0, 0
    for cell in cells:
        points = cell.samples()
        walls, images = map_on(np.full(len(points), cell.wall, np.int64), points, 1)
        inside += int(np.count_nonzero(np.any(
            [each.contains(walls, images) for each in cells], axis=0)))
        drawn += len(points)
    return drawn > 0 and inside >= WITHIN * drawn


@kernel
def first_crossing(walls: IntArray, points: FloatArray, begins: npt.NDArray[np.bool_],
                   other_walls: IntArray, others: FloatArray, other_begins: npt.NDArray[np.bool_]
                   ) -> tuple[int, int, float]:
    """
    Find the first step of a curve that crosses another, and which step of it.

    Each is numbered by the point that it ends at; the third result is the part of the step [1].
    -1 where none does.
    """
    for i in range(1, len(points)):
        if begins[i]:
            continue
        x, y = points[i - 1]
        dx, dy = points[i, 0] - x, points[i, 1] - y
        dx -= TWO_PI * np.rint(dx / TWO_PI)
        for j in range(1, len(others)):
            low, high = others[j - 1, 1], others[j, 1]
            if (other_begins[j] or other_walls[j] != walls[i] or max(low, high) < min(y, y + dy)
                    or min(low, high) > max(y, y + dy)):
                continue
            ex, ey = others[j, 0] - others[j - 1, 0], high - low
            ex -= TWO_PI * np.rint(ex / TWO_PI)
            ox, oy = others[j - 1, 0] - x, low - y
            ox -= TWO_PI * np.rint(ox / TWO_PI)
            cross = dx * ey - dy * ex
            here, there = ox * ey - oy * ex, ox * dy - oy * dx
            if cross < 0.0:
                cross, here, there = -cross, -here, -there
            if 0.0 < here <= cross and 0.0 < there <= cross:
                return i, j, here / cross
    return -1, -1, 0.0
