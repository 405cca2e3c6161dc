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

"""How well a control law holds its orbit, from the stream."""

import dataclasses
import math
from typing import Final

import numpy as np

from ..arrays import FloatArray, Record
from ..compiled import kernel
from ..flight.law import correction, Law
from ..flight.simulation import STICK, TRAJECTORY
from ..model import EventArray
from ..orbits.orbit import NEAR
from ..orbits.section import distance

# Periods of the orbit in which every impact is near it and within the limit: then it is caught.
PERIODS: Final = 10


@dataclasses.dataclass(frozen=True)
class HoldReport:
    """What a law has done since it was in force."""

    is_caught: bool = False
    catch_impacts: float = math.nan  # until the orbit was reached and has been kept
    impacts: int = 0
    last_correction: float = 0.0  # of alpha, or of the velocity; 0 for none [1]
    mean_correction: float = 0.0  # mean size, where there was one [1]
    share: float = 0.0  # of the impacts with a correction [1]


@kernel
def follow(trajectory: Record, phases: FloatArray, velocities: FloatArray, changes: FloatArray,
           apart: FloatArray) -> None:
    """Compute what a law wants at impacts, and how far they are from its orbit."""
    t = trajectory
    for n in range(len(phases)):
        changes[n], apart[n] = correction(t, phases[n], velocities[n]), np.inf
        for k in range(t.points):
            apart[n] = min(apart[n], distance(
                velocities[n], phases[n], t.law_velocity[k], t.law_phase[k]))


class RunningHold:
    """Judges a law by the impacts under it; the same however the stream is cut."""

    def __init__(self, law: Law, alpha: float) -> None:
        self.report = HoldReport()
        self._trajectory = np.zeros(1, TRAJECTORY)
        law.write(self._trajectory[0], alpha)
        # What it wants beyond the limit, where it changes nothing, is of interest here, too.
        self._trajectory['limit'] = math.inf
        self._limit = law.limit
        self._enough = PERIODS * len(law.points)
        self._since = self._corrected = 0
        self._total = 0.0

    def update(self, events: EventArray) -> None:
        """Take the next events."""
        impacts = events[events['kind'] <= STICK]
        if not len(impacts):
            return
        changes, apart = np.empty((2, len(impacts)))
        follow(self._trajectory[0], np.ascontiguousarray(impacts['phase']),
               np.ascontiguousarray(impacts['velocity']), changes, apart)
        is_beyond = np.abs(changes) > self._limit
        changes[is_beyond] = 0.0
        outside = np.flatnonzero(is_beyond | (apart > NEAR))
        if len(outside):
            self._since = self.report.impacts + int(outside[-1]) + 1
        self._corrected += int(np.count_nonzero(changes))
        # One by one, so that the last digit does not depend on the cuts.
        for change in np.abs(changes).tolist():
            self._total += change
        count = self.report.impacts + len(impacts)
        is_caught = count - self._since >= self._enough
        self.report = HoldReport(
            is_caught, float(self._since) if is_caught else math.nan, count, float(changes[-1]),
            self._total / max(self._corrected, 1), self._corrected / count)
