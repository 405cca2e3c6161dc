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
Escape rate, exponents and dimensions of a saddle, from initial conditions sprinkled about it.

Those that live long come near the saddle, stay, and leave. Without the first impacts and the last
their points have the natural measure of the saddle (Kantz & Grassberger, Physica D 17, 75, 1985).
"""

import dataclasses
import math
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from .escape import escape_rate
from ..arrays import FloatArray, IntArray

# By this factor both cuts are widened to see what the result owes to them.
WIDER: Final = 1.25
# Steps over which the scatter of the growth is taken.
WINDOW: Final = 10
# What `estimate` returns of each cut.
QUANTITIES: Final = ('kappa', 'lambda_1', 'lambda_2', 'spread', 'at_risk', 'impacts')


# A value and its standard error.
Estimate: TypeAlias = tuple[float, float]


@dataclasses.dataclass(frozen=True)
class SaddleRates:
    """Escape rate and exponents of a saddle per impact [1], and what follows from them."""

    kappa: Estimate
    lambda_1: Estimate
    lambda_2: Estimate
    spread: float = 0.0  # variance of the growth of the first direction; 0 where it is not known
    escapes: int = 0  # trajectories that were seen to leave
    impacts: int = 0  # near the saddle, of which the exponents are means

    @property
    def dimension_1(self) -> Estimate:
        """Dimension along the unstable direction, ``1 - kappa / lambda_1`` [1]."""
        (kappa, error), (growth, growth_error) = self.kappa, self.lambda_1
        return 1.0 - kappa / growth, math.hypot(error, kappa / growth * growth_error) / growth

    @property
    def dimension_2(self) -> Estimate:
        """Dimension along the stable direction, ``(lambda_1 - kappa) / |lambda_2|`` [1]."""
        over, under = self.lambda_1[0] - self.kappa[0], abs(self.lambda_2[0])
        return over / under, math.hypot(self.lambda_1[1], self.kappa[1],
                                        over / under * self.lambda_2[1]) / under

    @property
    def exponent(self) -> Estimate:
        """Uncertainty exponent of the boundary, 2 minus its box dimension [1]."""
        # The root of the pressure, ``mean(stretch^a) = e^kappa``, to the second cumulant. Where
        # all stretch alike it is ``kappa / lambda_1``.
        kappa, growth = self.kappa[0], self.lambda_1[0]
        mean = 0.5 * (growth + math.sqrt(max(growth**2 + 2.0 * self.spread * kappa, 0.0)))
        return kappa / mean, self.dimension_1[1] * growth / mean


def growths(matrices: FloatArray) -> FloatArray:
    """Return the logarithms by which two directions grow at each step of rows of matrices."""
    # Shape (rows, steps, 2, 2); Gram-Schmidt at each step, from a direction that no map prefers.
    result, direction = np.zeros(matrices.shape[:3]), np.full((len(matrices), 2), (0.6, 0.8))
    for k in range(matrices.shape[1]):
        direction = np.einsum('nij,nj->ni', matrices[:, k], direction)
        size = np.hypot(*direction.T)
        result[:, k, 0] = np.log(size)
        direction /= size[:, None]
    result[:, :, 1] = np.log(np.abs(np.linalg.det(matrices))) - result[:, :, 0]
    return result


def estimate(lifetimes: IntArray, censored: npt.NDArray[np.bool_], grown: FloatArray,
             followed: IntArray, head: int, tail: int) -> FloatArray:
    """Estimate the rates of a saddle from one batch of trajectories with both cuts."""
    # `lifetimes` are steps, until a trajectory left or was given up as `censored`; of those whose
    # numbers are `followed`, `grown` has the growths from the first step on, shape (m, steps, 2).
    # They are near the saddle after `head` steps, and until `tail` steps before the end. It
    # returns `QUANTITIES`, nan where nothing is left.
    result = np.full((2, len(QUANTITIES)), np.nan)
    for k, factor in enumerate((1.0, WIDER)):
        first, last = math.ceil(factor * head), math.ceil(factor * tail)
        chance = escape_rate(lifetimes, censored, first + last)
        part = grown[:, first:]
        stays = np.clip(lifetimes[followed] - first - last, 0, part.shape[1])
        within = np.arange(part.shape[1]) < stays[:, None]
        result[k, 4:] = chance.at_risk, within.sum()
        if chance.rate < 1.0:
            # The chance to leave at a step is that of a geometric law.
            result[k, 0] = -math.log1p(-chance.rate)
        if within.any():
            result[k, 1:3] = part[within].mean(axis=0)
        windows = part.shape[1] // WINDOW
        sums = part[:, :windows * WINDOW, 0].reshape(len(part), windows, WINDOW).sum(axis=2)
        whole = sums[WINDOW * (1 + np.arange(windows)) <= stays[:, None]]
        if len(whole) > 1:
            result[k, 3] = whole.var(ddof=1) / WINDOW
    return result


def rates_of(batches: FloatArray) -> SaddleRates:
    """Combine the estimates of batches, shape (n, 2, 6); nan where nothing stays long enough."""
    # Each error is that of the batch means, with the change where both cuts are wider.
    values = np.nan_to_num(batches[:, :, :4])
    weights = np.where(np.isfinite(batches[:, :, :4]), batches[:, :, [4, 5, 5, 5]], 0.0)
    with np.errstate(invalid='ignore'):
        share = weights / weights.sum(axis=0)
        means, wider = np.sum(share * values, axis=0)
        scatter = np.sqrt(np.sum((share * (values - means))[:, 0]**2, axis=0)
                          * (len(batches) / (len(batches) - 1.0)))
    errors = np.hypot(scatter, wider - means)
    (kappa, one, two, spread), (kappa_error, one_error, two_error, _) = (
        means.tolist(), errors.tolist())
    at_risk, impacts = np.nansum(batches[:, 0, 4:], axis=0).tolist()
    escapes = 0 if math.isnan(kappa) else round(-math.expm1(-kappa) * at_risk)
    # Few batches may agree by chance, but not better than counts do, of one escape at least.
    kappa_error = max(kappa_error, (kappa or 1.0 / at_risk) / math.sqrt(max(escapes, 1)))
    return SaddleRates((kappa, kappa_error), (one, one_error), (two, two_error),
                       0.0 if math.isnan(spread) else spread, escapes, int(impacts))
