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

from .impact_map import derivatives, next_impact
from .section import turn_of
from ..arrays import FloatArray, IntArray
from ..compiled import kernel
from ..model import Model

# A step of this size is the last [rad, 1]; so is one that is not smaller than the one before
# where the sequence closes to rounding.
CLOSED: Final = 1e-12
ROUNDING: Final = 1e-11
NEWTON_STEPS: Final = 40


@kernel
def correct(walls: IntArray, points: FloatArray, carried: FloatArray,
            model: Model) -> tuple[float, float]:
    """Take one step of Newton's method; return its size and the largest defect, inf for none."""
    # Each change follows from that of the first point: z_k = C_k z_0 + d_k, in a row of `carried`.
    # The sequence closes where z_q = z_0.
    q = len(walls)
    a, b, c, d, e, f = 1.0, 0.0, 0.0, 1.0, 0.0, 0.0
    largest = 0.0
    for k in range(q):
        following = k + 1 if k + 1 < q else 0
        carried[k, 0], carried[k, 1], carried[k, 2] = a, b, e
        carried[k, 3], carried[k, 4], carried[k, 5] = c, d, f
        hit, _, phase, velocity, time = next_impact(walls[k], points[k, 0], points[k, 1], model)
        if hit != walls[following] or velocity == 0.0:
            return math.inf, math.inf
        p_p, p_v, v_p, v_v = derivatives(points[k, 0], points[k, 1], time, phase, velocity,
                                         model)
        off_phase = turn_of(phase - points[following, 0])
        off_velocity = velocity - points[following, 1]
        largest = max(largest, abs(off_phase), abs(off_velocity))
        a, b, c, d, e, f = (p_p * a + p_v * c, p_p * b + p_v * d, v_p * a + v_v * c,
                            v_p * b + v_v * d, p_p * e + p_v * f + off_phase,
                            v_p * e + v_v * f + off_velocity)
    # (C - 1) z = -d
    determinant = (a - 1.0) * (d - 1.0) - b * c
    if not abs(determinant) > 0.0:
        return math.inf, largest
    z_phase = (b * f - (d - 1.0) * e) / determinant
    z_velocity = (c * e - (a - 1.0) * f) / determinant
    size = 0.0
    for k in range(q):
        by_phase = carried[k, 0] * z_phase + carried[k, 1] * z_velocity + carried[k, 2]
        by_velocity = carried[k, 3] * z_phase + carried[k, 4] * z_velocity + carried[k, 5]
        points[k, 0] += by_phase
        points[k, 1] += by_velocity
        size = max(size, abs(by_phase), abs(by_velocity))
    return size, largest


@kernel
def close_ring(walls: IntArray, points: FloatArray, carried: FloatArray, reach: float,
               model: Model) -> bool:
    """Move the points of a closed sequence, each by at most `reach` [rad, 1], onto an orbit."""
    # False where none is found; `carried` is room for 6 numbers and the seed for each point.
    q = len(walls)
    for k in range(q):
        carried[k, 6], carried[k, 7] = points[k, 0], points[k, 1]
    shortest = math.inf
    for _ in range(NEWTON_STEPS):
        size, defect = correct(walls, points, carried, model)
        if size == math.inf:
            return False
        for k in range(q):
            if not (abs(points[k, 0] - carried[k, 6]) <= reach
                    and abs(points[k, 1] - carried[k, 7]) <= reach):
                return False
        if size < CLOSED or (size >= shortest and defect < ROUNDING):
            return True
        shortest = min(shortest, size)
    return False
