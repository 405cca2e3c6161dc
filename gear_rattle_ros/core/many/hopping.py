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

"""How long trajectories with noise stay on an attractor, and to which they hop, by core sets."""

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from .settling import BOXES, cell_of, CELLS, FLOATING, RESTS_LOWER, RESTS_UPPER, STEPS
from ..arrays import FloatArray, IntArray, Record, RecordArray, Whole
from ..compiled import kernel
from ..flight.elementary import TWO_PI
from ..flight.lanes import (
    advance_kicked,
    EMPTY,
    FLOATS,
    is_busy,
    new_impacts,
    new_tiles,
    refill,
    release,
    RESTS,
    RUNS,
)
from ..flight.lanes_step import LANES
from ..flight.noise import jittered, Noise
from ..flight.simulation import RELEASE, run, settle, state_at, TRAJECTORY
from ..model import EVENT
from ..orbits.section import distance

# A stay: the attractor, the one that follows (EMPTY where it was not seen to end), how long it
# lasted from the first impact in the one core to the first in the other.
STAY: Final = np.dtype([('label', np.int64), ('following', np.int64), ('impacts', np.int64),
                        ('periods', np.float64)], align=True)
# A trajectory: impacts made, those outside every core, stays that were entered, and the present
# stay: attractor, impacts [1] and time [drive periods] at its beginning.
VISITOR: Final = np.dtype([('impacts', np.int64), ('outside', np.int64), ('stays', np.int64),
                           ('label', np.int64), ('since', np.int64), ('time', np.float64)],
                          align=True)


class Cores(NamedTuple):
    """The cores of attractors, on the section of phase and velocity just before an impact."""

    balls: RecordArray  # BALL
    near: npt.NDArray[np.bool_]  # the cells into which a ball reaches
    speed: float  # greatest of these cells [1]
    boxes: npt.NDArray[np.int8]  # the chaotic attractor of each box or EMPTY; none, or all
    box_speed: float  # greatest of these [1]


def make_cores(balls: RecordArray, boxes: npt.NDArray[np.int8], box_speed: float) -> Cores:
    """Prepare cores: balls of the metric of `distance`, and boxes."""
    speed = float(np.max(np.abs(balls['velocity']) + balls['radius'], initial=1e-3)) * (1 + 1e-9)
    near = np.zeros((2, CELLS, CELLS), np.bool_)
    for ball in balls:
        low, high = (int((abs(ball['velocity']) + sign * ball['radius']) * CELLS / speed // 1)
                     for sign in (-1.0, 1.0))
        left, right = (int((ball['phase'] + sign * ball['radius']) * CELLS / TWO_PI // 1)
                       for sign in (-1.0, 1.0))
        columns = np.arange(left, right + 1) % CELLS
        near[int(np.signbit(ball['velocity'])), max(low, 0):high + 1, columns] = True
    return Cores(balls, near.ravel(), speed, boxes.ravel(), box_speed)


@kernel
def core_at(cores: Cores, phase: float, velocity: float) -> int:
    """Return the attractor in whose core an impact is, EMPTY outside all."""
    wall = 1 if velocity < 0.0 else 0
    cell = cell_of(wall, phase, abs(velocity), cores.speed, CELLS)
    if cell >= 0 and cores.near[cell]:
        for ball in cores.balls:
            if distance(velocity, phase, ball.velocity, ball.phase) <= ball.radius:
                return int(ball.label)
    if len(cores.boxes) > 0:
        box = cell_of(wall, phase, abs(velocity), cores.box_speed, BOXES)
        if box >= 0:
            return int(cores.boxes[box])
    return EMPTY


@kernel
def cores_along(cores: Cores, phases: FloatArray, velocities: FloatArray) -> IntArray:
    """Return the attractor in whose core each impact of a trajectory is, EMPTY outside all."""
    found = np.empty(len(phases), np.int64)
    for k in range(len(phases)):
        found[k] = core_at(cores, phases[k], velocities[k])
    return found


@kernel
def is_full(v: Record, stays: RecordArray) -> bool:
    """Whether a trajectory has entered as many stays as there is room for; none are kept in 0."""
    return 0 < len(stays) <= v.stays


@kernel
def enter(v: Record, following: int, periods: float, stays: RecordArray) -> None:
    """Enter the present stay of a trajectory, and what follows it."""
    if v.label != EMPTY and v.stays < len(stays):
        stay = stays[v.stays]
        stay.label, stay.following = v.label, following
        stay.impacts, stay.periods = v.impacts - v.since, periods - v.time
        v.stays += 1


@kernel
def visit(v: Record, cores: Cores, cycle: Whole, phase: float, velocity: float,
          stays: RecordArray) -> None:
    """Count one impact of a trajectory."""
    v.impacts += 1
    label = core_at(cores, phase, velocity)
    if label == EMPTY:
        v.outside += 1
    elif label != v.label:
        periods = cycle + phase / TWO_PI
        enter(v, label, periods, stays)
        v.label, v.since, v.time = label, v.impacts, periods


@kernel
def hop(tile: Record, initial: RecordArray, noise: float, kind: int, seeds: IntArray, cap: int,
        cores: Cores, stays: RecordArray, visitors: RecordArray) -> None:
    """Follow initial conditions with kicks at impacts, each in a row of STAY and a VISITOR."""
    # Each ends after `cap` impacts, with its room for stays if there is any, or permanently at
    # rest, which is its last label then.
    impacts, made = new_impacts(STEPS), np.zeros(len(initial), np.int64)
    following = 0
    while True:
        following = refill(tile, initial, following, float(cap))
        if not is_busy(tile):
            return
        advance_kicked(tile, impacts, noise, kind, seeds, made)
        for i in range(LANES):
            number = tile.number[i]
            if number == EMPTY:
                continue
            v, row = visitors[number], stays[number]
            k = 0
            while k < tile.count[i] and not is_full(v, row):
                impact = impacts[i, k]
                visit(v, cores, impact.cycle, impact.phase, impact.velocity, row)
                k += 1
            if tile.end[i] == RUNS and tile.left[i] > 0.0 and not is_full(v, row):
                continue
            ended = EMPTY
            if tile.end[i] == RESTS:
                ended = RESTS_UPPER if tile.displacement[i] == 0.0 else RESTS_LOWER
            elif tile.end[i] == FLOATS:
                ended = FLOATING
            enter(v, ended, tile.cycle[i] + tile.phase[i] / TWO_PI, row)
            if ended != EMPTY:
                v.label = ended
            release(tile, i)


@kernel
def hop_with_jitter(initial: RecordArray, noise: float, seeds: IntArray, cap: int, cores: Cores,
                    stays: RecordArray, visitors: RecordArray) -> None:
    """Do as `hop`, with the amplitude of each drive period drawn anew in place of kicks."""
    events, trajectory = np.zeros(STEPS, EVENT), np.zeros(1, TRAJECTORY)
    for number in range(len(initial)):
        origin, v, row, t = initial[number], visitors[number], stays[number], trajectory[0]
        t.cycle, t.phase, t.index = 0, origin.phase, 0
        t.displacement, t.velocity = origin.displacement, origin.velocity
        t.alpha, t.beta, t.gamma = origin.alpha, origin.beta, origin.gamma
        t.restitution = origin.restitution
        settle(t)
        # A gear at rest, or between the walls, makes no more impacts.
        cycle, quiet = 0, 0
        while v.impacts < cap and quiet < cap and not is_full(v, row):
            cycle += 1
            quiet += 1
            count = STEPS
            while count == STEPS:
                count = run(t, events, cycle, 0.0)
                for k in range(count):
                    event = events[k]
                    if event.kind != RELEASE and v.impacts < cap and not is_full(v, row):
                        passed = (np.int64(event.cycle) - (cycle - 1)) & 0xFFFFFFFF
                        visit(v, cores, cycle - 1 + passed, event.phase, event.velocity, row)
                        quiet = 0
            t.displacement, t.velocity = state_at(t, cycle, 0.0)
            t.cycle, t.phase = cycle, 0.0
            t.alpha = jittered(origin.alpha, noise, seeds[number], cycle)
            settle(t)
        enter(v, EMPTY, float(cycle), row)


def hop_from(initial: RecordArray, noise: float, kind: Noise, seeds: IntArray, cap: int,
             cores: Cores, room: int) -> tuple[RecordArray, RecordArray]:
    """Follow initial conditions with noise; return a row of STAY and a VISITOR for each."""
    stays, visitors = np.zeros((len(initial), room), STAY), np.zeros(len(initial), VISITOR)
    visitors['label'] = EMPTY
    if kind is Noise.JITTER:
        hop_with_jitter(initial, noise, seeds, cap, cores, stays, visitors)
    else:
        hop(new_tiles(1)[0], initial, noise, int(kind), seeds, cap, cores, stays, visitors)
    return stays, visitors
