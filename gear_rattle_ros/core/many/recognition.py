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

"""Stable periodic orbits recognised in the impacts of a trajectory."""

import dataclasses

import numpy as np

from .neighbourhood import attracted
from ..arrays import RecordArray
from ..compiled import kernel
from ..flight.closed_form import release_delay, sticks, wall_of
from ..flight.elementary import TWO_PI
from ..model import Model, Parameters, Wall
from ..orbits.orbit import close_near, Orbit
from ..orbits.section import shortest_recurrence


@kernel
def last_sticks(row: RecordArray, model: Model, wall: int) -> tuple[int, int]:
    """Return the places of the last two impacts that stick to a wall, -1 for none."""
    last = -1
    for k in range(len(row) - 1, -1, -1):
        velocity = row[k].velocity
        if wall_of(velocity) != wall or not sticks(velocity, row[k].phase, model):
            continue
        if last >= 0:
            return k, last
        last = k
    return -1, last


def find_orbit(parameters: Parameters, row: RecordArray, longest: int,
               tolerance: float) -> Orbit | None:
    """Find the stable periodic orbit that a row of IMPACT approaches, in canonical order."""
    # Its period is at most `longest` impacts unless it sticks; None where nothing recurs within
    # the tolerance [1], or what recurs is unstable.
    for wall in Wall:
        first, last = last_sticks(row, parameters.model, int(wall))
        if first >= 0:
            # From one release to the next nothing differs: the orbit is what has been seen.
            return _observed(parameters, row[first:last + 1], wall).canonical()
    q = int(shortest_recurrence(row, longest, tolerance))
    orbit = close_near(parameters, row[len(row) - q:]) if q else None
    if orbit is None or not orbit.is_stable:
        return None
    return with_neighbourhood(orbit, tolerance)


def with_neighbourhood(orbit: Orbit, tolerance: float) -> Orbit | None:
    """Put a stable orbit in its order, and find what it attracts; None where that is too small."""
    orbit = orbit.canonical()
    forms = attracted(orbit, tolerance)
    return dataclasses.replace(orbit, forms=forms) if np.any(np.isfinite(forms)) else None


def _observed(parameters: Parameters, row: RecordArray, sticks: Wall) -> Orbit:
    times = np.diff(row['cycle']) * TWO_PI + np.diff(row['phase'])
    # The two may stick at other phases; what follows is the same from the release on.
    first, last = (release_delay(sticks.displacement, row['phase'][k], parameters.model)
                   for k in (0, -1))
    periods = round((float(np.sum(times)) + last - first) / TWO_PI)
    times[0] += TWO_PI * periods - float(np.sum(times))
    return Orbit(parameters, np.signbit(row['velocity'][1:]).astype(np.int64),
                 np.stack([row['phase'][1:], row['velocity'][1:]], axis=1), times,
                 periods, np.zeros(2, np.complex128), int(sticks))
