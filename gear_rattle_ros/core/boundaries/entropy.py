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

"""The entropy of basins in boxes of a grid, and what it says of their boundary."""

from collections.abc import Callable
import math
from typing import Final, NamedTuple

import numpy as np

from ..arrays import FloatArray, IntArray

# What boundary boxes have on average where the boundary is a straight line through a disc.
SMOOTH: Final = 0.4395093
# By how much the cells of a disc raise it, times the radius [cells].
COARSE: Final = 0.224
# Parts along each edge of the grid, from whose scatter errors are estimated.
PARTS: Final = 5
# Standard errors that decide.
SIGNIFICANT: Final = 3.0


class Entropy(NamedTuple):
    """Mean entropy of boxes of a grid [1], natural logarithm, with its standard error."""

    edge: int  # of a box [cells]; 0 stands for infinitely many
    mean: float
    mean_error: float
    boundary: float  # the mean over the boxes with several labels alone, nan where there is none
    boundary_error: float

    @property
    def exceeds_ln_2(self) -> bool:
        """Whether it shows a fractal: along a smooth boundary nearly every box has two labels."""
        return self.boundary - SIGNIFICANT * self.boundary_error > math.log(2.0)


def basin_entropies(labels: IntArray, edges: tuple[int, ...]) -> list[Entropy]:
    """Measure the entropy of boxes of some edges, and extrapolate to infinitely many cells."""
    # By a straight line in 1/edge: boxes of few cells miss a boundary that cuts off a corner.
    line = np.linalg.pinv(np.vander(1.0 / np.array(edges), min(2, len(edges))))[-1]

    def means(sums: FloatArray) -> FloatArray:
        ratios = sums[:, 1] / sums.T[::2]
        return np.column_stack([ratios, ratios @ line])

    parts = [part for rows in np.array_split(labels, PARTS)
             for part in np.array_split(rows, PARTS, axis=1)]
    results = np.stack(_jackknife(np.array([[_sums(part, edge) for edge in edges]
                                            for part in parts]), means), axis=-1)
    return [Entropy(edge, *results[:, k].ravel().tolist()) for k, edge in enumerate((*edges, 0))]


def disc_entropy(labels: IntArray, radius: int, count: int, rng: np.random.Generator
                 ) -> tuple[float, float]:
    """Return the mean entropy of random discs with several labels, and its standard error."""
    reach = np.arange(-radius, radius + 1)
    down, right = np.nonzero(reach[:, None]**2 + reach**2 <= radius**2)
    corner = [rng.integers(0, size - 2 * radius, count) for size in labels.shape]
    entropies = _entropies(labels[corner[0][:, None] + down, corner[1][:, None] + right])
    # Discs overlap: those of one part of the grid together count as one measurement.
    row, column = (PARTS * c // (size - 2 * radius)
                   for c, size in zip(corner, labels.shape, strict=True))
    sums = np.zeros((PARTS**2, 2))
    np.add.at(sums, PARTS * row + column, np.column_stack([entropies, entropies > 0.0]))
    mean, error = _jackknife(sums, lambda totals: totals[0] / totals[1])
    return float(mean), float(error)


def is_smooth(mean: float, error: float, radius: float) -> bool:
    """Whether the boundary may be one smooth line in discs of a radius [cells]."""
    # Cells add a little to it. Of several lines in a disc it has any value.
    excess = mean - SMOOTH
    return -SIGNIFICANT * error <= excess <= COARSE / radius + SIGNIFICANT * error


def _sums(labels: IntArray, edge: int) -> tuple[int, float, int]:
    """Return the number of boxes, the sum of their entropies, and the boxes on the boundary."""
    rows, columns = (size // edge for size in labels.shape)
    boxes = labels[:rows * edge, :columns * edge].reshape(rows, edge, columns, edge)
    entropies = _entropies(boxes.swapaxes(1, 2).reshape(rows * columns, edge**2))
    return len(entropies), float(np.sum(entropies)), int(np.count_nonzero(entropies))


def _entropies(boxes: IntArray) -> FloatArray:
    """Return the entropy of every row of labels."""
    total = np.zeros(len(boxes))
    for label in np.unique(boxes):
        share = np.mean(boxes == label, axis=1)
        total -= share * np.log(np.where(share > 0.0, share, 1.0))
    return total


def _jackknife(parts: FloatArray, estimate: Callable[[FloatArray], FloatArray]
               ) -> tuple[FloatArray, FloatArray]:
    """Return an estimate from the sum of all parts, and its error from leaving each out."""
    total = np.sum(parts, axis=0)
    with np.errstate(invalid='ignore', divide='ignore'):
        without = np.array([estimate(total - part) for part in parts])
        n = len(parts)
        return estimate(total), np.sqrt((n - 1) / n * np.sum(
            (without - np.mean(without, axis=0))**2, axis=0))
