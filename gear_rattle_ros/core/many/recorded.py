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

"""Trajectories that are followed for some impacts, which are kept."""

import numpy as np

from .settling import STEPS
from ..arrays import FloatArray, IntArray, Record, RecordArray
from ..compiled import kernel
from ..flight import lanes
from ..flight.lanes_step import LANES
from ..model import Parameters


@kernel
def record(tile: Record, initial: RecordArray, skip: int,
           count: int) -> tuple[RecordArray, IntArray]:
    """Follow initial conditions and keep the impacts after the first `skip`, a row each."""
    # There are fewer than the row holds where the trajectory ends.
    rows, counts = np.zeros((len(initial), count), lanes.IMPACT), np.zeros(len(initial), np.int64)
    impacts = lanes.new_impacts(STEPS)
    following = 0
    while True:
        following = lanes.refill(tile, initial, following, float(skip + count))
        if not lanes.is_busy(tile):
            return rows, counts
        lanes.advance(tile, impacts, STEPS)
        for i in range(LANES):
            number = tile.number[i]
            if number == lanes.EMPTY:
                continue
            # `left` has counted these already; a lane that has ended has none left.
            for k in range(tile.count[i]):
                place = counts[number] - skip
                if 0 <= place < count:
                    rows[number, place] = impacts[i, k]
                counts[number] += 1
            if tile.left[i] <= 0.0:
                counts[number] = max(0, counts[number] - skip)
                lanes.release(tile, i)


def record_impacts(initial: RecordArray, skip: int, count: int) -> tuple[RecordArray, IntArray]:
    """Keep `count` impacts after the first `skip` of each; return them and how many there are."""
    return record(lanes.new_tiles(1)[0], initial, skip, count)


def initial_after(parameters: Parameters, phases: FloatArray, velocities: FloatArray
                  ) -> RecordArray:
    """Make initial conditions just after impacts with these phases [rad] and velocities before."""
    return lanes.make_initial_conditions(parameters, phases, -1.0 * np.signbit(velocities),
                                         -parameters.restitution * velocities)
