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

"""Newton's method on closed sequences of impacts, all points at once."""

import math
from typing import Final

import numpy as np

from .impact_map import shoot
from ..arrays import FloatArray, IntArray
from ..compiled import kernel
from ..model import Model

# A step of this size is the last [rad, 1]; so is one that is not smaller than the one before
# where the sequence closes to rounding.
CLOSED: Final = 1e-12
ROUNDING: Final = 1e-11
NEWTON_STEPS: Final = 40


@kernel
def close_ring(walls: IntArray, points: FloatArray, reach: float, model: Model) -> bool:
    """Move the points of a closed sequence, each by at most `reach` [rad, 1], onto an orbit."""
    # False where none is found. Each change follows from that of the first point, z_k = C_k z_0 +
    # d_k, in a row of `carried`; the sequence closes where z_q = z_0.
    q = len(walls)
    seeds, carried = points.copy(), np.zeros((q, 6))
    shortest = math.inf
    for _ in range(NEWTON_STEPS):
        closed, defects, slopes, _ = shoot(walls, points, model)
        if not closed:
            return False
        a, b, c, d, e, f = 1.0, 0.0, 0.0, 1.0, 0.0, 0.0
        for k in range(q):
            carried[k, 0], carried[k, 1], carried[k, 2] = a, b, e
            carried[k, 3], carried[k, 4], carried[k, 5] = c, d, f
            p_p, p_v, v_p, v_v = slopes[k, 0], slopes[k, 1], slopes[k, 3], slopes[k, 4]
            a, b, c, d, e, f = (
                p_p * a + p_v * c, p_p * b + p_v * d, v_p * a + v_v * c, v_p * b + v_v * d,
                p_p * e + p_v * f + defects[k, 0], v_p * e + v_v * f + defects[k, 1])
        # (C - 1) z = -d
        determinant = (a - 1.0) * (d - 1.0) - b * c
        if not abs(determinant) > 0.0:
            return False
        z_phase = (b * f - (d - 1.0) * e) / determinant
        z_velocity = (c * e - (a - 1.0) * f) / determinant
        size = 0.0
        for k in range(q):
            for j in range(2):
                by = (carried[k, 3 * j] * z_phase + carried[k, 3 * j + 1] * z_velocity
                      + carried[k, 3 * j + 2])
                points[k, j] += by
                size = max(size, abs(by))
                if not abs(points[k, j] - seeds[k, j]) <= reach:
                    return False
        if size < CLOSED or (size >= shortest and np.abs(defects).max() < ROUNDING):
            return True
        shortest = min(shortest, size)
    return False
