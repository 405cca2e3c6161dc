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

"""Whether three basins or more share one boundary, as lakes of Wada do: two tests."""

import dataclasses

import numpy as np
import numpy.typing as npt

from .uncertainty import Label, Window
from ..arrays import FloatArray, IntArray

Mask = npt.NDArray[np.bool_]


@dataclasses.dataclass(frozen=True)
class Merging:
    """
    The boundaries of each basin against all others together: they are one where it is Wada.

    `within[r]` is the least share of one of these boundaries that has every other one within r
    cells; nan for fewer than three basins.
    """

    within: tuple[float, ...]

    @property
    def distance(self) -> int:
        """Return within how many cells of each other all boundaries are, -1 if farther apart."""
        return next((r for r, share in enumerate(self.within) if share >= 1.0), -1)


def merge_basins(labels: IntArray, basins: list[int], reach: int) -> Merging:
    """Compare the boundaries of basins on a grid, up to a distance of `reach` cells."""
    if len(basins) < 3:
        return Merging(())
    edges = [_boundary(labels == label) for label in basins]
    grown, within = list(edges), []
    for _ in range(reach + 1):
        within.append(min(float(np.mean(wide[edge])) for k, edge in enumerate(edges)
                          for j, wide in enumerate(grown) if j != k))
        if within[-1] >= 1.0:
            break
        grown = [_grown(each) for each in grown]
    return Merging(tuple(within))


def _boundary(inside: Mask) -> Mask:
    edge = np.zeros_like(inside)
    down, across = inside[1:] != inside[:-1], inside[:, 1:] != inside[:, :-1]
    for part in (edge[1:], edge[:-1]):
        part |= down
    for part in (edge[:, 1:], edge[:, :-1]):
        part |= across
    return edge


def _grown(cells: Mask) -> Mask:
    """Add the eight neighbours of all cells."""
    for _ in range(2):
        wide = cells.copy()
        wide[1:] |= cells[:-1]
        wide[:-1] |= cells[1:]
        cells = wide.T
    return cells


@dataclasses.dataclass(frozen=True)
class Refinement:
    """
    Pairs of neighbouring cells in different basins, with ever more points between them.

    `shares[q]` is the share of the `pairs` between which 2^q intervals have shown all basins.
    """

    pairs: int
    shares: tuple[float, ...]


def refine_boundary(label: Label, window: Window, labels: IntArray, basins: list[int],
                    halvings: int, most: int, rng: np.random.Generator) -> Refinement:
    """Look for all basins between neighbouring cells in different ones, by halving intervals."""
    if len(basins) < 3:
        return Refinement(0, ())
    (x_low, x_high), (y_low, y_high) = window
    rows, columns = labels.shape
    numbers = np.full(int(labels.max() - labels.min()) + 1, 0, np.int64)
    for bit, basin in enumerate(basins):
        numbers[basin - labels.min()] = 1 << bit
    seen = numbers[labels - labels.min()]
    pairs = np.concatenate([_pairs(seen, 0, 1), _pairs(seen, 1, 0)])
    pairs = pairs[rng.permutation(len(pairs))[:most]]
    row, column = pairs[:, 0], pairs[:, 1]
    other = row + pairs[:, 2], column + pairs[:, 3]
    found = seen[row, column] | seen[other]

    def centre(at_row: FloatArray, at_column: FloatArray) -> tuple[FloatArray, FloatArray]:
        return (x_low + (x_high - x_low) * (at_column + 0.5) / columns,
                y_low + (y_high - y_low) * (at_row + 0.5) / rows)

    everything, shares = (1 << len(basins)) - 1, [0.0]
    shares[0] = float(np.mean(found == everything)) if len(pairs) else 0.0
    for q in range(1, halvings + 1):
        left = np.flatnonzero(found != everything)
        between = (2.0 * np.arange(2**(q - 1)) + 1.0) / 2**q
        if len(left):
            x, y = centre(row[left, None] + pairs[left, 2, None] * between,
                          column[left, None] + pairs[left, 3, None] * between)
            new = label(x.ravel(), y.ravel()) - labels.min()
            known = (new >= 0) & (new < len(numbers))
            bits = np.where(known, numbers[np.where(known, new, 0)], 0).reshape(x.shape)
            found[left] |= np.bitwise_or.reduce(bits, axis=1)
        shares.append(float(np.mean(found == everything)) if len(pairs) else 0.0)
    return Refinement(len(pairs), tuple(shares))


def _pairs(seen: IntArray, down: int, right: int) -> IntArray:
    """List neighbours in different basins: row, column, and the step to the other."""
    a, b = seen[:seen.shape[0] - down, :seen.shape[1] - right], seen[down:, right:]
    at = np.argwhere((a != b) & (a > 0) & (b > 0))
    return np.column_stack([at, np.full(len(at), down), np.full(len(at), right)])
