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

"""Impact velocities of many trajectories counted in bins, with their largest exponents."""

import dataclasses
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from .settling import STEPS
from ..arrays import FloatArray, Record, RecordArray
from ..compiled import kernel
from ..flight import lanes
from ..flight.closed_form import elapsed, sticks
from ..flight.elementary import length, logarithm
from ..flight.lanes_step import LANES
from ..flight.tangent import flight_matrix, impact_matrix

# Block means of the exponent, for its error.
BLOCKS: Final = 16
# Impacts over which the tangent vector turns to the direction of growth, before it is measured.
TURN_IMPACTS: Final = 64


@dataclasses.dataclass(frozen=True)
class Counted:
    """Impact velocities counted and exponents measured, a row for each trajectory."""

    counts: npt.NDArray[np.uint32]  # shape (n, bins)
    growth: FloatArray  # mean per impact in each of BLOCKS blocks [1]; -inf where the gear sticks
    times: FloatArray  # total time of the counted flights [1]


@kernel
def measure(tile: Record, initial: RecordArray, keep: int, low: float, high: float, bins: int
            ) -> tuple[npt.NDArray[np.uint32], FloatArray, FloatArray]:
    """Follow trajectories; return the fields of `Counted`, from impact TURN_IMPACTS on."""
    trajectories, skip = len(initial), TURN_IMPACTS
    counts = np.zeros((trajectories, bins), np.uint32)
    growth, times = np.zeros((trajectories, BLOCKS)), np.zeros(trajectories)
    vectors, made = np.ones((trajectories, 2)), np.zeros(trajectories, np.int64)
    cycles, phases = np.zeros(trajectories, np.int64), initial['phase'].copy()
    impacts = lanes.new_impacts(STEPS)
    scale = bins / (high - low)
    block = keep // BLOCKS
    following = 0
    while True:
        following = lanes.refill(tile, initial, following, float(skip + keep))
        if not lanes.is_busy(tile):
            return counts, growth, times
        lanes.advance(tile, impacts, STEPS)
        for i in range(LANES):
            t = tile.number[i]
            if t == lanes.EMPTY:
                continue
            model = lanes.model_in(tile, i)
            for k in range(tile.count[i]):
                one = impacts[i, k]
                n, made[t] = made[t], made[t] + 1
                d = elapsed(one.cycle - cycles[t], phases[t], one.phase)
                cycles[t], phases[t] = one.cycle, one.phase
                integral, decay = flight_matrix(d, model.beta)
                s11, s21, s22 = impact_matrix(
                    one.phase, one.velocity, -model.restitution * one.velocity, model)
                s = vectors[t, 0] + integral * vectors[t, 1]
                v = s21 * s + s22 * decay * vectors[t, 1]
                s *= s11
                size = length(s, v)
                if size == 0.0 or sticks(one.velocity, one.phase, model):
                    rate = -math.inf
                    vectors[t] = 1.0
                else:
                    rate = logarithm(size)
                    vectors[t, 0], vectors[t, 1] = s / size, v / size
                if n < skip:
                    continue
                times[t] += d
                if n < skip + block * BLOCKS:
                    growth[t, (n - skip) // block] += rate / block
                bin_ = int(math.floor((one.velocity - low) * scale))
                if 0 <= bin_ < bins:
                    counts[t, bin_] += 1
            if tile.left[i] <= 0.0:
                lanes.release(tile, i)


def count_velocities(initial: RecordArray, keep: int, low: float, high: float, bins: int
                     ) -> Counted:
    """Count `keep` >= BLOCKS impact velocities of each trajectory in bins over [low, high]."""
    return Counted(*measure(lanes.new_tiles(1)[0], initial, keep, low, high, bins))
