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

"""Distances between impacts on the section (wall, phase, velocity), and how impacts recur."""

import math

import numpy as np
import numpy.typing as npt

from ..arrays import FloatArray, RecordArray
from ..compiled import kernel
from ..flight.elementary import TWO_PI


@kernel
def distance(velocity_a: float, phase_a: float, velocity_b: float, phase_b: float) -> float:
    """Return the larger difference of phase (around the circle) and velocity [1]."""
    # It is inf at different walls: a velocity just before an impact is positive at the upper wall.
    if math.copysign(1.0, velocity_a) != math.copysign(1.0, velocity_b):
        return math.inf
    turned = abs(phase_a - phase_b)
    return max(min(turned, TWO_PI - turned), abs(velocity_a - velocity_b))


@kernel
def turn_of(angle: float) -> float:
    """Bring one difference of phases to [-pi, pi] [rad]."""
    return angle - TWO_PI * math.floor(angle / TWO_PI + 0.5)


def turn(angle: npt.ArrayLike) -> FloatArray:
    """Bring differences of phase to [-pi, pi] [rad]."""
    angle = np.asarray(angle, np.float64)
    return angle - TWO_PI * np.round(angle / TWO_PI)


def distances(velocity_a: npt.ArrayLike, phase_a: npt.ArrayLike, velocity_b: npt.ArrayLike,
              phase_b: npt.ArrayLike) -> FloatArray:
    """Compare arrays of impacts; see `distance`."""
    velocity_a, velocity_b = np.asarray(velocity_a), np.asarray(velocity_b)
    apart = np.maximum(np.abs(turn(np.subtract(phase_a, phase_b))),
                       np.abs(velocity_a - velocity_b))
    return np.where(np.signbit(velocity_a) == np.signbit(velocity_b), apart, math.inf)


@kernel
def shortest_recurrence(row: RecordArray, longest: int, tolerance: float) -> int:
    """Return the smallest lag at which a row of IMPACT recurs to its end, 0 without one."""
    # Two lags must fit into the row, and whole drive periods, at least one, pass in each.
    m = len(row)
    for q in range(1, min(longest, m // 2) + 1):
        cycles = row[m - 1].cycle - row[m - 1 - q].cycle
        if cycles < 1:
            continue
        k = m - 1
        while (k >= q and row[k].cycle - row[k - q].cycle - cycles <= 1
               and cycles - (row[k].cycle - row[k - q].cycle) <= 1
               and distance(row[k].velocity, row[k].phase, row[k - q].velocity,
                            row[k - q].phase) <= tolerance):
            k -= 1
        if k < q:
            return q
    return 0
