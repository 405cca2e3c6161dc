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

"""Finite-time exponents of many initial conditions: the growth of a small difference."""

import math
from typing import Final

import numpy as np

from .settling import STEPS
from ..arrays import FloatArray, Record, RecordArray
from ..compiled import kernel
from ..flight import lanes
from ..flight.closed_form import elapsed, sticks
from ..flight.elementary import length, logarithm
from ..flight.lanes_step import LANES
from ..flight.tangent import flight_matrix, impact_matrix

# A matrix is scaled back when an entry is larger or all are smaller than this or its inverse.
LARGE: Final = 1e60


@kernel
def largest_singular(a: float, b: float, c: float, d: float) -> float:
    """Return the largest singular value of a 2 x 2 matrix, given row by row."""
    return 0.5 * (length(a + d, b - c) + length(a - d, b + c))


@kernel
def grow(tile: Record, initial: RecordArray, count: int, exponents: FloatArray) -> int:
    """Follow initial conditions for `count` impacts with their tangent; return all impacts."""
    # `exponents` receives the logarithm per impact of the product of all flight and saltation
    # matrices (Ott, Chaos in Dynamical Systems, ch. 4.4): -inf where the gear sticks or comes to
    # rest, nan where it floats between the walls.
    product, scale = np.zeros((len(initial), 4)), np.zeros(len(initial))
    product[:, 0] = product[:, 3] = 1.0
    cycle, phase = np.zeros(len(initial), np.int64), initial['phase'].copy()
    impacts = lanes.new_impacts(STEPS)
    following = total = 0
    while True:
        following = lanes.refill(tile, initial, following, float(count))
        if not lanes.is_busy(tile):
            return total
        lanes.advance(tile, impacts, STEPS)
        for i in range(LANES):
            n = tile.number[i]
            if n == lanes.EMPTY:
                continue
            total += tile.count[i]
            model = lanes.model_in(tile, i)
            stuck = False
            for k in range(tile.count[i]):
                one = impacts[i, k]
                if sticks(one.velocity, one.phase, model):
                    stuck = True
                    break
                d = elapsed(one.cycle - cycle[n], phase[n], one.phase)
                cycle[n], phase[n] = one.cycle, one.phase
                integral, decay = flight_matrix(d, model.beta)
                s11, s21, s22 = impact_matrix(
                    one.phase, one.velocity, -model.restitution * one.velocity, model)
                size = 0.0
                for j in range(2):
                    s = product[n, j] + integral * product[n, j + 2]
                    v = decay * product[n, j + 2]
                    product[n, j] = s11 * s
                    product[n, j + 2] = s21 * s + s22 * v
                    size += abs(product[n, j]) + abs(product[n, j + 2])
                if size > LARGE or size < 1.0 / LARGE:
                    if size == 0.0:
                        stuck = True
                        break
                    scale[n] += logarithm(size)
                    for j in range(4):
                        product[n, j] /= size
            if stuck or tile.end[i] == lanes.RESTS:
                exponents[n] = -math.inf
            elif tile.end[i] == lanes.FLOATS:
                exponents[n] = math.nan
            elif tile.left[i] > 0.0:
                continue
            else:
                exponents[n] = (scale[n] + logarithm(largest_singular(
                    product[n, 0], product[n, 1], product[n, 2], product[n, 3]))) / count
            lanes.release(tile, i)
