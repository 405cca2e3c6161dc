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

"""Rates, their errors and tests, from stays on attractors that were seen to end or not."""

import dataclasses
import math
from typing import Final

import numpy as np

from ..arrays import FloatArray, IntArray, RecordArray
from ..flight.lanes import EMPTY

# The largest mean that is compatible with no event at 95 %.
NONE_SEEN: Final = -math.log(0.05)
# Stays below which nothing is tested or fitted.
FEW: Final = 10


@dataclasses.dataclass(frozen=True)
class Residence:
    """The stays on one attractor."""

    jumps: IntArray  # to each label asked for
    exposure: float  # impacts on it, of stays that were not seen to end, too
    periods: float  # the same in drive periods
    exponential: float  # probability that exponential stays are as uneven; nan for few

    @property
    def ends(self) -> int:
        """Stays that were seen to end."""
        return int(self.jumps.sum())

    @property
    def mean(self) -> float:
        """Mean residence time [impacts]; where no end was seen, its lower bound at 95 %."""
        return self.exposure / (self.ends or NONE_SEEN)

    @property
    def mean_error(self) -> float:
        """Return the standard error of the mean [impacts], of a Poisson count; nan for a bound."""
        return self.mean / math.sqrt(self.ends) if self.ends else math.nan


def residence_on(stays: RecordArray, label: int, others: list[int]) -> Residence:
    """Collect the stays on an attractor, and the jumps from it to others."""
    own = stays[stays['label'] == label]
    ended = own['following'] != EMPTY
    return Residence(
        np.array([np.count_nonzero(own['following'] == other) for other in others]),
        float(own['impacts'].sum()), float(own['periods'].sum()),
        evenness(own['impacts'][ended]))


def evenness(lengths: IntArray) -> float:
    """Test whether lengths are exponential against uneven and too even ones; return p."""
    # Moran's statistic with Bartlett's correction is chi^2 of n - 1 degrees of freedom; its
    # distribution by the cube root (Wilson & Hilferty 1931).
    n = len(lengths)
    if n < FEW or np.min(lengths) <= 0:
        return math.nan
    shares = lengths / np.mean(lengths)
    statistic = -2.0 * float(np.sum(np.log(shares))) / (1.0 + (n + 1.0) / (6.0 * n))
    part = 2.0 / (9.0 * (n - 1))
    score = (math.cbrt(statistic / (n - 1)) - 1.0 + part) / math.sqrt(part)
    return math.erfc(abs(score) / math.sqrt(2.0))


def slopes(noise: FloatArray, residences: list[Residence]) -> tuple[FloatArray, FloatArray]:
    """Return d ln T / d(1/sigma^2) between neighbouring strengths, with standard errors."""
    # They are nan where fewer than `FEW` ends were seen. A Poisson count has an error of ln T of
    # one over the root of the count.
    ends = np.array([each.ends for each in residences], np.float64)
    ends[ends < FEW] = np.nan
    logs = np.log([each.mean for each in residences])
    across = np.diff(noise**-2.0)
    return (np.diff(logs) / across + 0.0 * ends[1:] * ends[:-1],
            np.sqrt(1.0 / ends[1:] + 1.0 / ends[:-1]) / np.abs(across))
