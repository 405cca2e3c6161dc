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
Straddle trajectories: a short segment that is mapped on and kept across an invariant set.

Whenever it has grown long, points on it are compared and a shorter piece is chosen (Nusse & Yorke,
Physica D 36, 137, 1989). Between different labels it stays on the boundary of basins, about the
longest lifetimes on the chaotic saddle of a transient. Any map of points of the plane will do.
"""

from collections.abc import Callable
import functools
from typing import Final, TypeAlias

import numpy as np

from ..arrays import FloatArray, IntArray

# Lengths of the segment [1]: when it is shortened, and to what; below the last, rounding decides.
LONG: Final = 1e-7
SHORT: Final = 1e-8
SHORTEST: Final = 1e-13
# Points compared at once on a segment, and where the first change counts: it must not be missed.
SAMPLES: Final = 12
FINE: Final = 384
# How often their number is doubled in vain.
DOUBLINGS: Final = 5
# How often a trajectory may be lost and go back, and that for every ten steps once more.
FAILURES: Final = 20

# Images of points that lie near each other; None where they do not stay together.
Map: TypeAlias = Callable[[FloatArray], FloatArray | None]
# Labels or lifetimes of points, shape (n, 2).
Values: TypeAlias = Callable[[FloatArray], IntArray]
# From values along a segment, the places of the ends of the piece that goes on; None for none.
Choice: TypeAlias = Callable[[IntArray, np.random.Generator], IntArray | None]


def any_change(values: IntArray, random: np.random.Generator) -> IntArray | None:
    """Choose neighbours with different labels at random."""
    changes = np.flatnonzero(values[1:] != values[:-1])
    return int(random.choice(changes)) + np.arange(2) if len(changes) else None


def first_change(values: IntArray, _: np.random.Generator) -> IntArray | None:
    """Choose the first change of label: that boundary is accessible from the first end."""
    changes = np.flatnonzero(values[1:] != values[:-1])
    return changes[0] + np.arange(2) if len(changes) else None


def longest_lived(cap: int) -> Choice:
    """Make the choice of a piece about a longest lifetime, between shorter ones below a cap."""
    def choose(values: IntArray, random: np.random.Generator) -> IntArray | None:
        longest = values.max()
        k = int(random.choice(np.flatnonzero(values == longest)))
        if longest >= cap:
            return np.clip([k - 1, k + 1], 0, len(values) - 1)
        shorter = np.flatnonzero(values < longest)
        after = int(np.searchsorted(shorter, k))
        return shorter[after - 1:after + 1] if 0 < after < len(shorter) else None

    return choose


def straddle(ends: FloatArray, advance: Map, values: Values, choose: Choice, steps: int,
             random: np.random.Generator, samples: int = SAMPLES) -> FloatArray:
    """Follow a segment, shape (2, 2), across an invariant set; return its middles at each step."""
    # They are within `LONG` of the set, and fewer than `steps` where it was lost.
    shorten = functools.partial(_shorten, values, choose, random, samples)
    points, longer = list[FloatArray](), [(0, ends)]
    failures = 0
    while longer and len(points) < steps and failures < FAILURES + steps // 10:
        done, piece = longer[-1]
        del points[done:]
        short = shorten(piece, SHORT)
        while short is not None and len(points) < steps:
            images, length = advance(short), _length(short)
            # Where they do not stay together, a shorter piece may.
            while images is None:
                length *= 0.1
                shorter = shorten(short, length)
                if shorter is None or length < SHORTEST:
                    break
                short, images = shorter, advance(shorter)
            middle, short = short.mean(axis=0), images
            if short is None:
                break
            points.append(middle)
            if _length(short) > LONG:
                longer.append((len(points), short))
                break
        if short is None:
            # It held nothing after all: another is chosen where it was longer.
            failures += 1
            longer.pop()
    return np.array(points).reshape(-1, 2)


def _length(ends: FloatArray) -> float:
    return float(np.hypot(*(ends[1] - ends[0])))


def _shorten(values: Values, choose: Choice, random: np.random.Generator, samples: int,
             ends: FloatArray, length: float) -> FloatArray | None:
    """Shorten a segment to a length [1]; None where nothing is left to choose."""
    while _length(ends) > length:
        for doubling in range(DOUBLINGS):
            count = samples << doubling
            # Uneven, so that nothing in step with them is missed.
            shares = np.concatenate([[0.0], (np.arange(count) + random.random(count)) / count,
                                     [1.0]])
            points = ends[0] + shares[:, None] * (ends[1] - ends[0])
            piece = choose(values(points), random)
            if piece is not None and piece[1] - piece[0] <= count:
                break
        else:
            return None
        ends = points[piece]
    return ends
