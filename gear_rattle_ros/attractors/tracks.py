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

"""Numbers for the attractors of an orbit diagram, the same at every alpha where one exists."""

from typing import Final

import numpy as np
import numpy.typing as npt

from .matching import follow, Trace
from ..core.arrays import FloatArray
from ..core.orbits.letters import LETTERS

# Columns over which an attractor may be missed: few may reach it, and windows interrupt chaos.
GAP: Final = 5
GAP_OF_CHAOS: Final = 40


def track(keys: npt.NDArray[np.str_], points: FloatArray, chaotic: npt.NDArray[np.bool_],
          is_attractor: npt.NDArray[np.bool_], letters: npt.NDArray[np.str_]
          ) -> npt.NDArray[np.int64]:
    """Give the attractors of an orbit diagram numbers from 0 on, and -1 where there is none."""
    # The arrays are (sweep, alpha, slot ...). At one alpha the same key is the same attractor;
    # `points` are wall, phase [rad] and velocity [1] of impacts, nan for fewer. One with a letter
    # has its number; of the others the one that is seen over most columns comes first.
    numbers = np.full(keys.shape, -1, np.int64)
    first = count = len(LETTERS) if np.any(letters != '') else 0
    for number, letter in enumerate(LETTERS):
        numbers[letters == letter] = number
    # What rests has no impacts: its name identifies it at every alpha.
    resting = is_attractor & ~np.isfinite(points[..., 0, 0])
    for key in np.unique(keys[resting]):
        numbers[resting & (keys == key)] = count
        count += 1
    for s in range(len(keys)):
        seen: dict[int, tuple[int, Trace]] = {}
        for c in range(keys.shape[1]):
            # The same alpha in another sweep is surer than a neighbour.
            here = {keys[place][c][slot]: int(numbers[place, c, slot])
                    for place, slot in np.argwhere(numbers[:s, c] >= 0)}
            for k in np.flatnonzero(is_attractor[s, c] & (numbers[s, c] < 0)):
                numbers[s, c, k] = here.get(keys[s, c, k], -1)
            left = [int(k) for k in np.flatnonzero(is_attractor[s, c] & (numbers[s, c] < 0))]
            # Where several are near, the one that has been seen most often goes on.
            recent = tuple(trace for number, (last, trace) in sorted(
                seen.items(), key=lambda item: -np.count_nonzero(numbers == item[0]))
                # A letter is exact: where it is missing, the attractor is not there.
                if c - last <= (1 if number < first else
                                GAP_OF_CHAOS if trace.is_chaotic else GAP)
                and number not in numbers[s, c])
            _, found = follow(recent, [_of(points[s, c, k], chaotic[s, c, k]) for k in left],
                              fresh=count)
            numbers[s, c, left] = found
            count = max(count, int(numbers.max()) + 1)
            for k in np.flatnonzero((numbers[s, c] >= 0) & ~resting[s, c]):
                number = int(numbers[s, c, k])
                seen[number] = c, Trace(number, *_of(points[s, c, k], chaotic[s, c, k]))
    return _by_length(numbers, first, count)


def _of(points: FloatArray, is_chaotic: np.bool_) -> tuple[FloatArray, bool]:
    return points[np.isfinite(points[:, 0])], bool(is_chaotic)


def _by_length(numbers: npt.NDArray[np.int64], first: int, count: int) -> npt.NDArray[np.int64]:
    lengths = np.bincount(numbers[numbers >= 0], minlength=count)[first:]
    order = first + np.argsort(-lengths, kind='stable')
    renamed = np.append(np.arange(count), -1)
    renamed[order] = np.arange(first, count)
    return renamed[numbers]
