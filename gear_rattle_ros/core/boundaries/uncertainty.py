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

"""Shares of random probes that a boundary cuts, at any size, and the power law that they obey."""

from collections.abc import Callable
import dataclasses
import math
from typing import Final, TypeAlias

import numpy as np

from ..arrays import FloatArray, IntArray

# Labels of the points of a plane, given by both coordinates.
Label: TypeAlias = Callable[[FloatArray, FloatArray], IntArray]
Window: TypeAlias = tuple[tuple[float, float], tuple[float, float]]

PROBES: Final = ('triplet', 'box')
# Probes that are labelled together; after these it is foreseen how many are needed.
BATCH: Final = 2000
# Fewer cut probes than this say nothing of a power law, nor do fewer sizes.
CUT_LEAST: Final = 10
SIZES_LEAST: Final = 4
# A power law holds where chance alone gives as large a chi^2 at least this often.
PROBABILITY_LEAST: Final = 0.05


def count_cut(label: Label, window: Window, probe: str, size: float, error: float, most: int,
              rng: np.random.Generator) -> tuple[int, int]:
    """Count random probes whose points differ in their labels, and all, until that is accurate."""
    # A 'triplet' is a point and its neighbours at the distance `size` on either side, in a random
    # direction, a 'box' the corners of a square of this edge. `error` is the relative error of the
    # share at which no more are needed; where `most` probes would not do, only the first are made.
    cut = probes = 0
    while not probes or probes < (probes - cut + 1) / ((cut + 1) * error**2) <= most:
        x, y = (low + (high - low) * rng.random((BATCH, 1)) for low, high in window)
        if probe == 'box':
            dx, dy = np.array([[0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]])
        else:
            angle = 2.0 * math.pi * rng.random((BATCH, 1))
            dx, dy = (np.array([0.0, 1.0, -1.0]) * f(angle) for f in (np.cos, np.sin))
        x, y = x + size * dx, y + size * dy
        labels = label(x.ravel(), y.ravel()).reshape(x.shape)
        cut += int(np.count_nonzero(np.ptp(labels, axis=1)))
        probes += BATCH
    return cut, probes


@dataclasses.dataclass(frozen=True)
class PowerLaw:
    """A law share = constant size^exponent over a range of sizes."""

    exponent: float
    error: float  # standard error, larger where the shares scatter more than by chance
    constant: float
    low: float  # ends of the range
    high: float
    chi_squared: float
    freedom: int  # sizes less two

    @property
    def probability(self) -> float:
        """Return how often chance alone gives as large a chi^2."""
        return chance(self.chi_squared, self.freedom)


def fit_power_law(sizes: FloatArray, cut: IntArray, probes: IntArray) -> PowerLaw | None:
    """
    Fit the share of cut probes over the widest range of sizes in which it is a power law.

    A range is one where chance exceeds chi^2 in one of twenty cases at least and a parabola bends
    by no more than its error: a law that ends within a range bends, long before chi^2 shows it.
    Of several with the most sizes that of the smallest is taken; where there is none, the most
    likely of the shortest. None where too few probes are cut.
    """
    use = (cut >= CUT_LEAST) & (cut < probes)
    order = np.argsort(sizes[use])
    x, n, k = np.log(sizes[use][order]), probes[use][order], cut[use][order]
    y, weights = np.log(k / n), np.sqrt(n * k / (n - k))
    shortest = []
    for length in range(len(x), SIZES_LEAST - 1, -1):
        for first in range(len(x) - length + 1):
            law, is_straight = _line(*(each[first:first + length] for each in (x, y, weights)))
            if law.probability >= PROBABILITY_LEAST and is_straight:
                return law
            if length == SIZES_LEAST:
                shortest.append(law)
    return max(shortest, key=lambda law: law.probability, default=None)


def _line(x: FloatArray, y: FloatArray, weights: FloatArray) -> tuple[PowerLaw, bool]:
    """Fit a line, and find whether a parabola is as good."""
    (slope, offset), covariance = np.polyfit(x, y, 1, w=weights, cov='unscaled')
    chi_squared = float(np.sum((weights * (y - offset - slope * x))**2))
    freedom = len(x) - 2
    (bend, *_), variances = np.polyfit(x, y, 2, w=weights, cov='unscaled')
    return PowerLaw(
        float(slope), math.sqrt(max(1.0, chi_squared / freedom) * covariance[0, 0]),
        math.exp(offset), math.exp(x[0]), math.exp(x[-1]), chi_squared, freedom
        ), bool(bend**2 <= variances[0, 0])


def chance(chi_squared: float, freedom: int) -> float:
    """Return the probability of a larger chi^2."""
    half = 0.5 * chi_squared
    term = math.exp(-half)
    total, k = (term, 2) if freedom % 2 == 0 else (math.erfc(math.sqrt(half)), 1)
    while k < freedom:
        total += half**(0.5 * k) * term / math.gamma(0.5 * k + 1.0)
        k += 2
    return total
