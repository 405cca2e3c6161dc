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

"""The escape rate of what unstable orbits span, from these orbits alone: a cycle expansion."""

from collections.abc import Sequence
import math
from typing import Final

import numpy as np

from .orbit import Orbit
from ..arrays import FloatArray

# Rates per impact that are searched for the leading zero, and how densely [1].
LOWEST: Final = -0.3
HIGHEST: Final = 1.0
SAMPLES: Final = 521
HALVINGS: Final = 60


def expand(orbits: Sequence[Orbit], order: int) -> list[float]:
    """
    Find the escape rate per impact from unstable orbits of up to 1 ... `order` drive periods.

    It is the leading zero of the Fredholm determinant ``exp(-sum_p sum_r z^(q r) / (r |det(1 -
    M_p^r)|))``, ``z = exp(rate)``, expanded in the drive periods of its cycles (Artuso, Aurell &
    Cvitanovic 1990): then long orbits correct what the shorter ones nearly give. nan where an
    order has no zero.
    """
    table = np.array([(orbit.impacts, orbit.drive_periods, *orbit.multipliers.real)
                      for orbit in orbits
                      if not orbit.is_stable and orbit.drive_periods <= order]).reshape(-1, 4)
    rates = np.linspace(LOWEST, HIGHEST, SAMPLES)
    values = np.array([_determinants(table, order, rate) for rate in rates])
    return [_first_zero(table, n, rates, values[:, n]) for n in range(1, order + 1)]


def _determinants(table: FloatArray, order: int, rate: float) -> FloatArray:
    # The determinant cut off after each order. Its terms follow from those of the logarithm.
    traces = np.zeros(order + 1)
    for r in range(1, order + 1):
        mine = table[table[:, 1] * r <= order]
        first, second = mine[:, 2]**r, mine[:, 3]**r
        np.add.at(traces, (mine[:, 1] * r).astype(np.int64), np.exp(rate * r * mine[:, 0])
                  / (r * np.abs((1.0 - first) * (1.0 - second))))
    terms = np.zeros(order + 1)
    terms[0] = 1.0
    for n in range(1, order + 1):
        k = np.arange(1, n + 1)
        terms[n] = -np.sum(k * traces[k] * terms[n - k]) / n
    return np.cumsum(terms)


def _first_zero(table: FloatArray, order: int, rates: FloatArray, values: FloatArray) -> float:
    # At a rate low enough nothing but the one is left of the determinant.
    below = np.flatnonzero(values <= 0.0)
    if not len(below) or not below[0]:
        return math.nan
    low, high = rates[below[0] - 1], rates[below[0]]
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if _determinants(table, order, middle)[order] > 0.0:
            low = middle
        else:
            high = middle
    return float(0.5 * (low + high))
