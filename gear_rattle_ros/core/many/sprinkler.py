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

Those that live long come near the saddle, stay, and leave. Left out the first impacts and the last,
their points have the natural measure of the saddle (Kantz & Grassberger, Physica D 17, 75, 1985;
Hsu, Ott & Grebogi, Phys. Lett. A 127, 199, 1988).
"""

import dataclasses
import math

import numpy as np
import numpy.typing as npt

from .escape import escape_rate
from ..arrays import FloatArray, IntArray
from ..compiled import kernel
from ..flight.elementary import length, logarithm

# By this factor both cuts are widened to see what the result owes to them.
WIDER = 1.5


@dataclasses.dataclass(frozen=True)
class SaddleRates:
    """Rates of a saddle per impact [1] and their standard errors, and what follows from them."""

    kappa: float  #: Escape rate.
    kappa_error: float
    lambda_1: float  #: Larger exponent.
    lambda_1_error: float
    lambda_2: float
    lambda_2_error: float
    escapes: int  #: Trajectories that were seen to leave.
    impacts: int  #: Impacts near the saddle that the exponents are means of.

    @property
    def exponent(self) -> tuple[float, float]:
        """Uncertainty exponent of the boundary, ``kappa / lambda_1``, and its error [1]."""
        value = self.kappa / self.lambda_1
        return value, abs(value) * math.hypot(self.kappa_error / self.kappa if self.kappa else 0.0,
                                              self.lambda_1_error / self.lambda_1)

    @property
    def dimension_1(self) -> tuple[float, float]:
        """Dimension along the unstable direction, ``1 - kappa / lambda_1``, and its error [1]."""
        value, error = self.exponent
        return 1.0 - value, error

    @property
    def dimension_2(self) -> tuple[float, float]:
        """Dimension along the stable one, ``(lambda_1 - kappa) / |lambda_2|``, and its error."""
        over, under = self.lambda_1 - self.kappa, abs(self.lambda_2)
        return over / under, math.hypot(math.hypot(self.lambda_1_error, self.kappa_error),
                                        over * self.lambda_2_error / under) / under


@kernel
def growths(matrices: FloatArray) -> FloatArray:
    """Return the logarithms by which two directions grow at each step of rows of matrices."""
    # Shape (rows, steps, 2, 2); Gram-Schmidt at each step.
    rows, steps = matrices.shape[:2]
    result = np.zeros((rows, steps, 2))
    for i in range(rows):
        # A direction that no map prefers.
        a, b = 0.6, 0.8
        for k in range(steps):
            m = matrices[i, k]
            c, d = m[0, 0] * a + m[0, 1] * b, m[1, 0] * a + m[1, 1] * b
            size = length(c, d)
            area = abs(m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0])
            result[i, k, 0] = logarithm(size)
            result[i, k, 1] = logarithm(area) - result[i, k, 0]
            a, b = c / size, d / size
    return result


def mean_growths(grown: FloatArray, stays: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return the mean growths of rows as far as each stays, and their errors by the scatter."""
    within = np.arange(grown.shape[1]) < np.asarray(stays)[:, None]
    counts = within.sum(axis=1)
    total = max(int(counts.sum()), 1)
    sums = np.where(within[..., None], grown, 0.0).sum(axis=1)
    means = sums.sum(axis=0) / total
    return means, np.sqrt(np.sum((sums - counts[:, None] * means)**2, axis=0)) / total


def saddle_rates(lifetimes: IntArray, censored: npt.NDArray[np.bool_], grown: FloatArray,
                 followed: IntArray, head: int, tail: int) -> SaddleRates:
    """
    Estimate the rates of a saddle from sprinkled trajectories.

    Parameters
    ----------
    lifetimes, censored : ndarray, shape (n,)
        Steps until each trajectory left or was given up, and whether it was given up.
    grown : ndarray, shape (m, steps, 2)
        Growths of two directions along some of them, from the first step on.
    followed : ndarray, shape (m,)
        The numbers of these.
    head, tail : int
        Steps after which a trajectory is near the saddle, and before its end from which on it is
        not any more.

    Returns
    -------
    SaddleRates
        Each error is that of the scatter with the change when both cuts are wider by half.

    """
    cuts = [(math.ceil(factor * head), math.ceil(factor * tail)) for factor in (1.0, WIDER)]
    chances = [escape_rate(lifetimes, censored, sum(cut)) for cut in cuts]
    means, errors = zip(*(mean_growths(grown[:, first:], lifetimes[followed] - first - last)
                          for first, last in cuts), strict=True)
    (one, two), (one_error, two_error) = means[0].tolist(), np.hypot(
        errors[0], means[1] - means[0]).tolist()
    impacts = int(np.clip(lifetimes[followed] - sum(cuts[0]), 0, max(
        grown.shape[1] - head, 0)).sum())
    escapes, stay = chances[0].escapes, 1.0 - chances[0].rate
    if not impacts or not chances[1].escapes or not stay > 0.0:
        return SaddleRates(*[math.nan] * 6, escapes, impacts)
    # The chance to leave at a step is that of a geometric law.
    error = math.hypot(chances[0].error, chances[1].rate - chances[0].rate) / stay
    return SaddleRates(-math.log(stay), error, one, one_error, two, two_error, escapes, impacts)
