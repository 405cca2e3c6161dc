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

from .curves import Curve, joined, Map
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
    ins, outs = ([_first_piece(curve, k, period) for k in range(period)]
                 for curve in (stable, unstable))
    # Shortest stable sides first.
    for most in range(0, int(stable.impacts.max()) + 1, period):
        near = joined([piece[piece.impacts <= most + period - 1] for piece in ins])
        sides = {k: side for k, out in enumerate(outs)
                 if (side := _side(points[k], out, near, period))}
        if len({end for end, _ in sides.values()}) == period:
            cells = _polygons(sides, [int(out.walls[0]) for out in outs])
            if are_trapping(cells, map_on):
                return cells
    return []


def _first_piece(curve: Curve, branch: int, period: int) -> Curve:
    mine = curve[curve.impacts % period == branch]
    return mine[:int(np.argmax(np.append(mine.begins[1:], True))) + 1]


def _side(point: FloatArray, out: Curve, near: Curve, period: int
          ) -> tuple[int, FloatArray] | None:
    # From one point of the orbit along both manifolds to another.
    met = first_crossing(out, near)
    if met is None:
        return None
    i, j, corner = met
    branch = int(near.impacts[j]) % period
    back = near.points[:j][near.impacts[:j] % period == branch]
    # Backwards the orbit is passed in the other direction.
    return -branch % period, np.concatenate([[point], out.points[:i], [corner], back[::-1]])


def _polygons(sides: dict[int, tuple[int, FloatArray]], walls: list[int]) -> list[Cell]:
    # Each side leads from the point of its number to another, all of them in cycles.
    cells = []
    while sides:
        first = k = min(sides)
        outline = []
        while k in sides:
            k, side = sides.pop(k)
            outline.append(side)
        path = np.concatenate(outline)
        path[:, 0] = path[0, 0] + np.append(0.0, np.cumsum(turn(np.diff(path[:, 0]))))
        cells.append(Cell(walls[first], path, 2 * len(outline)))
    return cells


def are_trapping(cells: list[Cell], map_on: Map) -> bool:
    """Whether the image of cells lies in them."""
    inside = []
    for cell in cells:
        low, high = cell.outline.min(axis=0), cell.outline.max(axis=0)
        points = low + (high - low) * np.random.default_rng(1).random((SAMPLES, 2))
        walls = np.full(SAMPLES, cell.wall, np.int64)
        mine = cell.contains(walls, points)
        images = map_on(walls[mine], points[mine], 1)
        inside.append(np.any([each.contains(*images) for each in cells], axis=0))
    found = np.concatenate(inside)
    return bool(np.sum(found) >= WITHIN * len(found) > 0.0)


def first_crossing(curve: Curve, other: Curve) -> tuple[int, int, FloatArray] | None:
    """Find the first step of a curve that crosses another: which ones end there, and where."""
    i, j, part = cross(curve.walls, curve.points, curve.begins, other.walls, other.points,
                       other.begins)
    return (i, j, curve.points[i - 1] + part * curve.steps[i - 1]) if i > 0 else None


@kernel
def cross(walls: IntArray, points: FloatArray, begins: npt.NDArray[np.bool_],
          other_walls: IntArray, others: FloatArray, other_begins: npt.NDArray[np.bool_]
          ) -> tuple[int, int, float]:
    """Find the points at which both steps end, and the part of the first [1]; -1 for none."""
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
            turned = dx * ey - dy * ex
            here, there = ox * ey - oy * ex, ox * dy - oy * dx
            if turned < 0.0:
                turned, here, there = -turned, -here, -there
            if 0.0 < here <= turned and 0.0 < there <= turned:
                return i, j, here / turned
    return -1, -1, 0.0
