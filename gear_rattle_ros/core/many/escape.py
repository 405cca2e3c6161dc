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

"""How long many trajectories last before a periodic orbit captures them, and at which rate."""

import dataclasses
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from ..arrays import FloatArray, IntArray, Record, RecordArray
from ..compiled import kernel
from ..flight.lanes import advance, is_busy, new_impacts, refill, release, RUNS
from ..flight.lanes_step import LANES
from ..orbits.section import distance

STEPS: Final = 256
# What has become of a trajectory: captured; neither captured nor ended when its time was up;
# permanently at rest or floating; never begun, as enough had escaped.
CAPTURED: Final = 1
SURVIVED: Final = 0
ENDED: Final = -1
UNUSED: Final = -2


@dataclasses.dataclass(frozen=True)
class EscapeRate:
    """Rate of a geometric law, from lifetimes some of which are censored."""

    rate: float  # per impact [1]
    error: float  # its standard error [1]
    escapes: int  # lifetimes that were seen to end
    at_risk: float  # impacts of all trajectories while the law was counted [1]

    @property
    def mean(self) -> float:
        """Mean lifetime [impacts], inf where nothing escaped."""
        return 1.0 / self.rate if self.rate > 0.0 else math.inf

    @property
    def mean_error(self) -> float:
        """Its standard error [impacts]."""
        return self.error / self.rate**2 if self.rate > 0.0 else math.inf


def escape_rate(lifetimes: npt.ArrayLike, censored: npt.ArrayLike, skip: float,
                numbers: npt.ArrayLike = 1) -> EscapeRate:
    """Estimate an escape rate per impact after `skip`: escapes over impacts at risk."""
    # It is the maximum likelihood of a geometric law, whatever the censoring. `numbers` counts the
    # independent trajectories of each lifetime. The error is their scatter, whether the law holds
    # or not, and at least that of one escape.
    life = np.asarray(lifetimes, np.float64)
    late = np.where(life > skip, numbers, 0)
    escaped = np.where(censored, 0, 1)
    at_risk = float(np.sum(late * (life - skip)))
    escapes = int(np.sum(late * escaped))
    if at_risk <= 0.0:
        return EscapeRate(math.nan, math.nan, 0, 0.0)
    rate = escapes / at_risk
    scatter = math.sqrt(float(np.sum(late * (escaped - rate * (life - skip))**2)))
    return EscapeRate(rate, max(scatter, 1.0) / at_risk, escapes, at_risk)


@kernel
def last_until_captured(tile: Record, initial: RecordArray, points: FloatArray,
                        impacts_of: IntArray, radius: float, skip: int, wanted: int, limit: int
                        ) -> tuple[IntArray, IntArray, FloatArray]:
    """Follow trajectories until `wanted` of them are captured after more than `skip` impacts."""
    # One is captured when q + 1 impacts in a row lie within `radius` [rad, 1] of an orbit of q,
    # and given up after `limit` impacts; `points` (phases and velocities, shape (n, 2)) has orbit
    # after orbit, `impacts_of` the q of each. Returns the impacts until then, CAPTURED, SURVIVED,
    # ENDED or UNUSED, and the last phase, displacement and velocity [rad, 1, 1] of each. No time
    # goes into waiting for a last long transient.
    following_point, q = np.arange(1, len(points) + 1), np.zeros(len(points), np.int64)
    begin = 0
    for count in impacts_of:
        q[begin:begin + count] = count
        following_point[begin + count - 1] = begin
        begin += count
    lifetimes, fates = np.zeros(len(initial), np.int64), np.full(len(initial), UNUSED)
    ends = np.zeros((len(initial), 3))
    impacts = new_impacts(STEPS)
    # Impacts in a row that were near the orbit, and the point that the last was near.
    row = np.zeros(LANES, np.int64)
    where = np.zeros(LANES, np.int64)
    made = np.zeros(LANES, np.int64)
    late = 0
    following = refill(tile, initial, 0, math.inf)
    while late < wanted and (following < len(initial) or is_busy(tile)):
        advance(tile, impacts, STEPS)
        for i in range(LANES):
            number = tile.number[i]
            if number < 0:
                continue
            for k in range(tile.count[i]):
                one = impacts[i, k]
                made[i] += 1
                first, last = 0, len(points)
                if row[i] > 0:
                    first = following_point[where[i]]
                    last = first + 1
                near, least = -1, radius
                for j in range(first, last):
                    apart = distance(one.velocity, one.phase, points[j, 1], points[j, 0])
                    if apart < least:
                        near, least = j, apart
                if near >= 0:
                    row[i] += 1
                    where[i] = near
                else:
                    row[i] = 0
                if row[i] > q[where[i]] or made[i] >= limit:
                    break
            is_caught, is_late = row[i] > q[where[i]], made[i] >= limit
            lifetimes[number] = made[i] - (row[i] if is_caught else 0)
            fates[number] = SURVIVED
            if is_caught:
                fates[number] = CAPTURED
                late += 1 if lifetimes[number] > skip else 0
            elif tile.end[i] != RUNS and not is_late:
                fates[number] = ENDED
            ends[number, 0] = tile.phase[i]
            ends[number, 1] = tile.displacement[i]
            ends[number, 2] = tile.velocity[i]
            if is_caught or is_late or tile.end[i] != RUNS:
                release(tile, i)
                row[i] = made[i] = 0
        following = refill(tile, initial, following, math.inf)
    return lifetimes, fates, ends
