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

"""
On which attractor every initial condition of a tile settles, and when.

A trajectory has settled on a periodic orbit when it is inside a neighbourhood of one of its points
that is mapped into itself, all of it within the tolerance of the orbit; on an orbit that sticks
when it sticks to the same wall, for then it leaves at the same phase; on a chaotic attractor when
it has stayed in its boxes for a given number of impacts.
"""

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from ..arrays import IntArray, Record, RecordArray as RecordArray, Whole
from ..compiled import kernel
from ..flight.closed_form import elapsed, later, model_of, release_delay, rests, sticks, wall_of
from ..flight.elementary import TWO_PI
from ..flight.lanes import advance, EMPTY, FLOATS, is_busy, new_impacts, refill, release, RESTS
from ..flight.lanes_step import LANES
from ..model import STICKING_SPEED
from ..orbits.section import distance

# Labels of trajectories that settle on no attractor of the table.
UNSETTLED: Final = -1
RESTS_UPPER: Final = -2
RESTS_LOWER: Final = -3
FLOATING: Final = -4

# Steps between two looks at the impacts.
STEPS: Final = 48
# Cells of the section, along phase and along speed: those that list points of orbits, and the
# finer ones that make up chaotic attractors.
CELLS: Final = 128
BOXES: Final = 512

# A point of a periodic orbit: wall (0 upper, 1 lower), phase [rad], velocity, time since the
# point before [1], the point after, the attractor, and the quadratic form that is at most 1 in
# the neighbourhood which the orbit attracts for certain.
POINT: Final = np.dtype([
    ('wall', np.int64), ('phase', np.float64), ('velocity', np.float64),
    ('flight_time', np.float64), ('following', np.int64), ('attractor', np.int64),
    ('form', np.float64, 3),
], align=True)
# Points that lie near a cell, in a list: the point, the entry after this one or -1.
ENTRY: Final = np.dtype([('point', np.int64), ('following', np.int64)], align=True)
# What is known of the trajectory in a lane.
WATCH: Final = np.dtype([
    ('impacts', np.int64), ('cycle', np.int64), ('phase', np.float64),
    # The point that comes next and since when; EMPTY away from all of them.
    ('point', np.int64), ('since', np.int64),
    # The chaotic attractor in whose cells it is, since when; EMPTY outside.
    ('box', np.int64), ('box_since', np.int64),
    # As in RESULT.
    ('stick', np.int64), ('release', np.float64),
], align=True)
# The result of a trajectory: attractor or a label from above, lifetime [impacts], impacts
# followed, and, if unsettled, the state just after the last of them. If the gear has stuck before
# it settled: impacts until then (else EMPTY) and the drive phase at which it left the wall again
# (else nan); all that leave at the same phase go on as one.
RESULT: Final = np.dtype([
    ('label', np.int64), ('lifetime', np.int64), ('impacts', np.int64), ('phase', np.float64),
    ('displacement', np.float64), ('velocity', np.float64), ('stick', np.int64),
    ('release', np.float64),
], align=True)


class Table(NamedTuple):
    """Known attractors, ready to be recognised."""

    tolerance: float
    speed: float  # greatest of the cells [1]
    box_speed: float  # greatest of the boxes of chaotic attractors [1]
    stay: int  # impacts in these after which a trajectory has settled
    sticks: IntArray  # attractor that sticks to the upper, to the lower wall; EMPTY for none
    points: RecordArray  # POINT: all points of all periodic orbits
    heads: npt.NDArray[np.int16]  # first entry of each cell or EMPTY, shape (2 * CELLS * CELLS,)
    entries: RecordArray  # ENTRY: lists of points
    boxes: npt.NDArray[np.int8]  # chaotic attractor of each box or EMPTY; none of them, or all


@kernel
def cell_of(wall: int, phase: float, speed: float, greatest: float, cells: int) -> int:
    """Return the cell of a point [rad, 1] of the section, -1 beyond the greatest speed."""
    row = int(speed * (cells / greatest))
    if not 0 <= row < cells:
        return -1
    column = min(int(phase * (cells / TWO_PI)), cells - 1)
    return (wall * cells + row) * cells + column


@kernel
def is_near(point: Record, phase: float, velocity: float, flight_time: float,
            tolerance: float) -> bool:
    """Whether an impact is within the tolerance of a point; a flight time of nan may be any."""
    return (distance(velocity, phase, point.velocity, point.phase) <= tolerance
            and not abs(flight_time - point.flight_time) > tolerance)


@kernel
def is_caught(point: Record, phase: float, velocity: float) -> bool:
    """Whether an impact at a point's wall is in the neighbourhood that is mapped into itself."""
    turn = phase - point.phase
    if turn > math.pi:
        turn -= TWO_PI
    elif turn < -math.pi:
        turn += TWO_PI
    faster = velocity - point.velocity
    form = point.form
    return turn * (form[0] * turn + 2.0 * form[1] * faster) + form[2] * faster * faster <= 1.0


@kernel
def note_stick(w: Record, displacement: float, phase: float, origin: Record) -> None:
    """Note when the gear first sticks, and at which phase it leaves."""
    delay = release_delay(displacement, phase, model_of(origin))
    if w.stick == EMPTY and delay < math.inf:
        w.stick = w.impacts
        w.release = later(phase, delay)[1]


@kernel
def watch(w: Record, impact: Record, origin: Record, table: Table) -> tuple[Whole, int]:
    """Compare one impact with the table; return label and lifetime, EMPTY and 0 if not settled."""
    tolerance = table.tolerance
    phase = impact.phase
    velocity = impact.velocity
    wall = wall_of(velocity)
    first = w.impacts == 0
    flight_time = math.nan if first else elapsed(impact.cycle - w.cycle, w.phase, phase)
    w.impacts += 1
    w.cycle, w.phase = impact.cycle, phase
    n = w.impacts
    expected = w.point
    w.point = EMPTY
    if expected != EMPTY:
        point = table.points[expected]
        if is_near(point, phase, velocity, flight_time, tolerance):
            if is_caught(point, phase, velocity):
                return point.attractor, w.since
            w.point = point.following
    cell = cell_of(wall, phase, abs(velocity), table.speed, CELLS)
    if cell >= 0:
        nearest = math.inf
        entry = table.heads[cell]
        while entry != EMPTY:
            number = table.entries[entry].point
            entry = table.entries[entry].following
            point = table.points[number]
            if number == expected or not is_near(point, phase, velocity, flight_time, tolerance):
                continue
            if is_caught(point, phase, velocity):
                # Out of step on the same orbit, it has still been near it.
                same = w.point != EMPTY and table.points[w.point].attractor == point.attractor
                return point.attractor, w.since if same else n
            if w.point == EMPTY or nearest < math.inf:
                apart = distance(velocity, phase, point.velocity, point.phase)
                if apart < nearest:
                    nearest = apart
                    w.point = point.following
                    w.since = n
    if sticks(velocity, phase, model_of(origin)):
        if table.sticks[wall] != EMPTY:
            return table.sticks[wall], n
        note_stick(w, -1.0 * wall, phase, origin)
    if len(table.boxes) > 0:
        box = cell_of(wall, phase, abs(velocity), table.box_speed, BOXES)
        inside = table.boxes[box] if box >= 0 else EMPTY
        if inside != w.box:
            w.box = inside
            w.box_since = n
        if inside != EMPTY and n - w.box_since + 1 >= table.stay:
            return np.int64(inside), w.box_since
    return EMPTY, 0


@kernel
def uneventful(row: RecordArray, first: int, count: int, restitution: float, table: Table) -> int:
    """Return the place of the first impact from `first` on that `watch` has to see, or `count`."""
    # Those before it are near no orbit and too fast to stick; the trajectory must be near no orbit
    # so far, and the table without chaotic attractors.
    heads = table.heads
    along_speed = CELLS / table.speed
    along_phase = CELLS / TWO_PI
    for k in range(first, count):
        velocity = row[k].velocity
        speed = abs(velocity)
        # Beyond the greatest speed, the last cell stands for none.
        level = np.uint64(min(speed * along_speed, CELLS - 1.0))
        column = np.uint64(min(row[k].phase * along_phase, CELLS - 1.0))
        side = np.uint64(wall_of(velocity))
        cell = (side * np.uint64(CELLS) + level) * np.uint64(CELLS) + column
        if heads[cell] != EMPTY or restitution * speed < STICKING_SPEED:
            return k
    return count


@kernel
def finish(tile: Record, i: int, result: Record, label: int, lifetime: int, impacts: int) -> None:
    """Write the result of the trajectory in a lane, and free the lane."""
    result.label, result.lifetime, result.impacts = label, lifetime, impacts
    result.phase, result.displacement, result.velocity = (
        tile.phase[i], tile.displacement[i], tile.velocity[i])
    release(tile, i)


@kernel
def classify(tile: Record, initial: RecordArray, cap: int, table: Table,
             results: RecordArray) -> int:
    """Follow initial conditions, at most for `cap` impacts, until they settle, into `results`."""
    # Returns the impacts that they made.
    impacts, watches = new_impacts(STEPS), np.zeros(LANES, WATCH)
    following = 0
    total = 0
    skips = len(table.boxes) == 0
    while True:
        before = following
        following = refill(tile, initial, following, float(cap))
        for i in range(LANES):
            if tile.number[i] >= before:
                w = watches[i]
                w.impacts, w.release = 0, math.nan
                w.point = w.box = w.stick = EMPTY
                origin = initial[tile.number[i]]
                if rests(origin.displacement, origin.velocity, origin.phase, model_of(origin)):
                    note_stick(w, origin.displacement, origin.phase, origin)
        if not is_busy(tile):
            return total
        advance(tile, impacts, STEPS)
        for i in range(LANES):
            number = tile.number[i]
            if number == EMPTY:
                continue
            w = watches[i]
            origin = initial[number]
            label = EMPTY
            lifetime = 0
            row = impacts[i]
            count = tile.count[i]
            k = 0
            while k < count and label == EMPTY:
                if w.point == EMPTY and skips:
                    seen = k
                    k = uneventful(row, k, count, origin.restitution, table)
                    if k > seen:
                        w.impacts += k - seen
                        w.cycle, w.phase = row[k - 1].cycle, row[k - 1].phase
                    if k == count:
                        break
                label, lifetime = watch(w, row[k], origin, table)
                k += 1
            total += count
            n = w.impacts
            results[number].stick = w.stick
            results[number].release = w.release
            if label != EMPTY:
                finish(tile, i, results[number], label, lifetime, n)
            elif tile.end[i] == RESTS:
                wall = RESTS_UPPER if tile.displacement[i] == 0.0 else RESTS_LOWER
                finish(tile, i, results[number], wall, n, n)
            elif tile.end[i] == FLOATS:
                finish(tile, i, results[number], FLOATING, n, n)
            elif tile.left[i] <= 0.0:
                finish(tile, i, results[number], UNSETTLED, n, n)
