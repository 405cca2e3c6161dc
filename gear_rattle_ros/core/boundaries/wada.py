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

"""Whether three basins or more share one boundary, as lakes of Wada do: three tests."""

import itertools
from typing import Final

import numpy as np
import numpy.typing as npt

from .uncertainty import Label, Window
from ..arrays import FloatArray, IntArray

Mask = npt.NDArray[np.bool_]
# Where an unstable manifold begins, and its points that are labelled on either side [1].
BESIDE: Final = 1e-7
POINTS: Final = 2000


def merge_basins(labels: IntArray, basins: list[int], reach: int) -> list[float]:
    """
    Compare the boundaries of each basin against all others together: of Wada's they are one.

    Element r is the least share of one of these boundaries that has every other one within r
    cells, for r up to `reach` or until it is 1. There is none for fewer than three basins.
    """
    if len(basins) < 3:
        return []
    edges = grown = [_boundary(labels == label) for label in basins]
    within: list[float] = []
    while not within or (within[-1] < 1.0 and len(within) <= reach):
        if within:
            # The eight neighbours of each cell are added.
            grown = [np.asarray(np.lib.stride_tricks.sliding_window_view(
                np.pad(each, 1), (3, 3)).any(axis=(2, 3))) for each in grown]
        within.append(min(float(np.mean(wide[edge])) for (edge, _), (_, wide) in
                          itertools.permutations(zip(edges, grown, strict=True), 2)))
    return within


def _boundary(inside: Mask) -> Mask:
    wide = np.pad(inside, 1, 'edge')
    return np.any([part != inside for part in (
        wide[2:, 1:-1], wide[:-2, 1:-1], wide[1:-1, 2:], wide[1:-1, :-2])], axis=0)


def refine_boundary(label: Label, window: Window, labels: IntArray, basins: list[int],
                    halvings: int, most: int, rng: np.random.Generator) -> list[float]:
    """
    Look for all basins between neighbouring cells in different ones, by halving intervals.

    Element q is the share of the pairs, `most` of all, between which 2^q intervals have shown all
    basins. There is none for fewer than three basins.
    """
    if len(basins) < 3:
        return []
    # Row and column of the first cell, and the step to the other.
    pairs = np.concatenate([
        np.insert(np.argwhere((a != b) & np.isin(a, basins) & np.isin(b, basins)), [2, 2], step,
                  axis=1)
        for a, b, step in ((labels[:, :-1], labels[:, 1:], [0, 1]),
                           (labels[:-1], labels[1:], [1, 0]))])
    cells, steps = np.split(pairs[rng.permutation(len(pairs))[:most]], 2, axis=1)
    seen = np.any([labels[tuple(ends.T)][:, None] == basins for ends in (cells, cells + steps)],
                  axis=0)
    shares: list[float] = []
    for q in range(halvings + 1):
        left = np.flatnonzero(~seen.all(axis=1))
        if q and len(left):
            between = (2.0 * np.arange(2**(q - 1)) + 1.0) / 2**q
            at = cells[left, None] + steps[left, None] * between[:, None] + 0.5
            y, x = (low + (high - low) * at[..., k] / labels.shape[k]
                    for k, (low, high) in enumerate(window[::-1]))
            new = label(x.ravel(), y.ravel()).reshape(x.shape)
            seen[left] |= (new[..., None] == basins).any(axis=1)
        shares.append(float(np.mean(seen.all(axis=1))) if len(pairs) else 0.0)
    return shares


def follow_unstable(label: Label, point: FloatArray, direction: FloatArray, expansion: float,
                    basins: list[int]) -> list[float]:
    """
    Return the share of each basin along the unstable manifold of a saddle.

    If that of the orbit accessible from a basin meets all others, each point of this basin's
    boundary is one of theirs, too (Nusse & Yorke 1996). Labels do not change under the map, so
    those of one period, as far as the `expansion` [1], are those of the whole curve.
    """
    places = (np.arange(POINTS) + 0.5) / POINTS
    beside = np.outer(BESIDE * abs(expansion)**places, [1.0, -1.0]).ravel()
    labels = label(*(point + beside[:, None] * direction).T)
    return [float(np.mean(labels == basin)) for basin in basins]
