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

"""The table of known attractors, ready to be recognised by `classify`."""

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from .settling import CELLS, ENTRY, POINT, Table
from ..flight.closed_form import NO_WALL
from ..flight.elementary import TWO_PI
from ..flight.lanes import EMPTY
from ..orbits.orbit import Orbit

# Cells reach beyond the fastest point by this factor.
ROOM: Final = 1.05
# Points are rounded to this.
GRAIN: Final = 2.0**-33


def make_table(orbits: Sequence[Orbit], tolerance: float, *,
               numbers: Sequence[int] | None = None, boxes: npt.ArrayLike = (),
               box_speed: float = 0.0, stay: int = 0) -> Table:
    """Make the table of some attractors for `classify`; ValueError for too many points."""
    # Orbits are labelled 0, 1, ... or `numbers`. `boxes` has the number of the chaotic attractor
    # of each box or EMPTY, `box_speed` is their greatest speed [1]; after `stay` impacts in them a
    # trajectory has settled.
    fastest = max((float(np.max(np.abs(orbit.velocities))) for orbit in orbits), default=0.0)
    speed = ROOM * fastest + 2.0 * tolerance
    sticks = np.full(2, EMPTY)
    points = np.zeros(sum(orbit.impacts for orbit in orbits), POINT)
    first = 0
    for number, orbit in zip(numbers or range(len(orbits)), orbits, strict=True):
        q = orbit.impacts
        own = points[first:first + q]
        # Rounded, so that lifetimes do not hang on the trajectory that an orbit was found from.
        own['wall'], own['phase'] = orbit.walls, GRAIN * np.round(orbit.phases / GRAIN)
        own['velocity'] = GRAIN * np.round(orbit.velocities / GRAIN)
        own['flight_time'], own['attractor'] = orbit.flight_times, number
        own['form'] = np.inf if orbit.forms is None else orbit.forms
        own['following'] = first + (1 + np.arange(q)) % q
        if orbit.sticks != NO_WALL:
            sticks[orbit.sticks] = number
        first += q
    heads = np.full(2 * CELLS * CELLS, EMPTY, np.int16)
    entries: list[tuple[int, int]] = []
    for number, point in enumerate(points):
        for cell in _cells_near(point, tolerance, speed):
            entries.append((number, int(heads[cell])))
            heads[cell] = len(entries) - 1
    if len(entries) > np.iinfo(heads.dtype).max:
        raise ValueError(f'{len(points)} points of orbits are more than a table holds')
    listed = np.zeros(max(1, len(entries)), ENTRY)
    if entries:
        listed['point'], listed['following'] = np.array(entries).T
    return Table(float(tolerance), speed, float(box_speed), int(stay), sticks,
                 points if len(points) else np.zeros(1, POINT), heads, listed,
                 np.ascontiguousarray(boxes, np.int8).ravel())


def _cells_near(point: np.void, tolerance: float, speed: float) -> list[int]:
    low, high = (int((abs(point['velocity']) + sign * tolerance) * CELLS / speed // 1)
                 for sign in (-1.0, 1.0))
    left, right = (int((point['phase'] + sign * tolerance) * CELLS / TWO_PI // 1)
                   for sign in (-1.0, 1.0))
    return [(int(point['wall']) * CELLS + row) * CELLS + column % CELLS
            for row in range(max(low, 0), min(high, CELLS - 1) + 1)
            for column in range(left, right + 1)]


def dilated(boxes: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Add to occupied boxes (wall, speed, phase) all their neighbours; phase is a circle."""
    wide = boxes | np.roll(boxes, 1, axis=2) | np.roll(boxes, -1, axis=2)
    tall = wide.copy()
    tall[:, 1:] |= wide[:, :-1]
    tall[:, :-1] |= wide[:, 1:]
    return tall
