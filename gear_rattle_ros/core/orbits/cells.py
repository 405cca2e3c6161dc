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

"""Where two manifolds cross."""

import numpy as np
import numpy.typing as npt

from ..arrays import FloatArray, IntArray
from ..compiled import kernel
from ..flight.elementary import TWO_PI


@kernel
def first_crossing(walls: IntArray, points: FloatArray, begins: npt.NDArray[np.bool_],
                   other_walls: IntArray, others: FloatArray, other_begins: npt.NDArray[np.bool_],
                   first: int) -> tuple[int, int, float]:
    """
    Find the first step of a curve from `first` on that crosses another, and which step of it.

    Each is numbered by the point that it ends at; the third result is the part of the step [1].
    -1 where none does.
    """
    for i in range(max(first, 1), len(points)):
        if begins[i]:
            continue
        x, y = points[i - 1]
        dx, dy = points[i, 0] - x, points[i, 1] - y
        dx -= TWO_PI * np.rint(dx / TWO_PI)
        for j in range(1, len(others)):
            low, high = others[j - 1, 1], others[j, 1]
            if (other_begins[j] or other_walls[j] != walls[i] or max(low, high) < min(y, y + dy)
                    or min(low, high) > max(y, y + dy)):
                continue
            ex, ey = others[j, 0] - others[j - 1, 0], high - low
            ex -= TWO_PI * np.rint(ex / TWO_PI)
            ox, oy = others[j - 1, 0] - x, low - y
            ox -= TWO_PI * np.rint(ox / TWO_PI)
            cross = dx * ey - dy * ex
            here, there = ox * ey - oy * ex, ox * dy - oy * dx
            if cross < 0.0:
                cross, here, there = -cross, -here, -there
            if 0.0 < here <= cross and 0.0 < there <= cross:
                return i, j, here / cross
    return -1, -1, 0.0
