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

"""What trajectories settle on at many parameters at once: period, exponent, walls in contact."""

import math
from typing import Final

import numpy as np

from .chaotic_sets import OVERLAP
from .recognition import last_sticks
from .recorded import record
from .settling import cell_of
from .velocity_counts import BLOCKS, measure, TURN_IMPACTS
from ..arrays import FloatArray, IntArray, Record, RecordArray
from ..compiled import kernel
from ..flight import lanes
from ..flight.closed_form import model_of, wall_of
from ..flight.elementary import exp_minus, logarithm, TWO_PI
from ..model import Model
from ..orbits.impact_map import close_ring, shoot
from ..orbits.orbit import least_period, NEAR, NEUTRAL, REPEATS
from ..orbits.section import distance, shortest_recurrence

# Kinds of what trajectories settle on.
PERIODIC, CHAOTIC, RESTING, FLOATING, UNSETTLED = range(5)
# An outcome: its kind; its period, 0 off an orbit; bits of the walls in contact, 1 the upper, 2
# the lower; the largest exponent per impact with its standard error, 0 from exact multipliers; the
# trajectories that lead there; and of an orbit its fastest impact, by which it is known again.
OUTCOME: Final = np.dtype([
    ('kind', np.int64), ('impacts', np.int64), ('drive', np.int64), ('walls', np.int64),
    ('exponent', np.float64), ('error', np.float64), ('trajectories', np.int64),
    ('phase', np.float64), ('velocity', np.float64)], align=True)
# Looks at trajectories: impacts that are passed over before, and then looked at. The longest is
# for those that stick, after some hundred impacts each time.
GLANCE: Final = (300, 256)
LOOK: Final = 1024
LONG_LOOK: Final = 8192
# Longest period that is found [impacts], and how near impacts recur [1].
LONGEST: Final = 128
RECURS: Final = 1e-3
# Attractors kept at one place; boxes along an edge that tell chaotic attractors apart; and beyond
# how many errors an exponent is positive.
SLOTS: Final = 4
EDGE: Final = 16
CERTAIN: Final = 3.0


@kernel
def multiplier(walls: IntArray, points: FloatArray, model: Model) -> tuple[float, int]:
    """Return the largest modulus of the multipliers of an orbit, and its drive periods."""
    _, _, slopes, times = shoot(walls, points, model, False)
    a, b, c, d, product = 1.0, 0.0, 0.0, 1.0, 1.0
    for k in range(len(walls)):
        one = slopes[k]
        product *= model.restitution * model.restitution
        a, b, c, d = (one[0, 0] * a + one[0, 1] * c, one[0, 0] * b + one[0, 1] * d,
                      one[1, 0] * a + one[1, 1] * c, one[1, 0] * b + one[1, 1] * d)
    whole = 0.0
    for time in times:
        whole += time
    turns = round(whole / TWO_PI)
    half = 0.5 * abs(a + d)
    product *= exp_minus(min(700.0, model.beta * TWO_PI * turns))
    inside = half * half - product
    return math.sqrt(product) if inside < 0.0 else half + math.sqrt(inside), int(turns)


@kernel
def settle_on_orbit(row: RecordArray, model: Model, one: Record) -> bool:
    """Find the stable orbit that a row of IMPACT approaches; whether there is one."""
    for wall in range(2):
        first, last = last_sticks(row, model, wall)
        if first >= 0:
            # Two that stick to one wall leave it at the same phase.
            one.kind, one.impacts = PERIODIC, last - first
            one.drive = row[last].cycle - row[first].cycle
            one.exponent, one.error, one.phase, one.velocity = -math.inf, 0.0, 0.0, -1.0 * wall
            return True
    q = shortest_recurrence(row, LONGEST, RECURS)
    if q == 0:
        return False
    walls, points = np.zeros(q, np.int64), np.zeros((q, 2))
    for k in range(q):
        impact = row[len(row) - q + k]
        walls[k] = wall_of(impact.velocity)
        points[k, 0], points[k, 1] = impact.phase, impact.velocity
    if not close_ring(walls, points, NEAR, model):
        return False
    q = least_period(walls, points)
    largest, turns = multiplier(walls[:q], points[:q], model)
    if not largest < 1.0 - NEUTRAL or turns < 1:
        return False
    fastest = np.argmax(points[:q, 1])
    one.kind, one.impacts, one.drive = PERIODIC, q, turns
    one.exponent, one.error = logarithm(largest) / q, 0.0
    one.phase, one.velocity = points[fastest, 0], points[fastest, 1]
    return True


@kernel
def is_same(one: Record, other: Record) -> bool:
    """Whether two outcomes that are not chaotic are one."""
    return (one.kind == other.kind and one.impacts == other.impacts and one.drive == other.drive
            and one.walls == other.walls and (one.kind != PERIODIC or distance(
                one.velocity, one.phase, other.velocity, other.phase) < REPEATS))


@kernel
def look(tile: Record, states: RecordArray, skip: int, count: int, outcomes: RecordArray,
         numbers: IntArray, boxes: Record) -> IntArray:
    """Follow what is left of trajectories, note what has settled; return what is still left."""
    # `states` of all trajectories move on; `numbers` says which are left.
    rows, made = record(tile, states[numbers], skip, count)
    still = 0
    left = numbers.copy()
    for m in range(len(numbers)):
        n, row = numbers[m], rows[m, :made[m]]
        one, state = outcomes[n], states[n]
        if made[m] < count:
            one.kind = FLOATING if state.gamma == 0.0 else RESTING
            one.walls = 0 if state.gamma == 0.0 else 1 if state.gamma > 0.0 else 2
            one.impacts, one.drive = 0, 0
            one.exponent = math.nan if state.gamma == 0.0 else -math.inf
            continue
        one.walls = 0
        boxes[n] = False
        for k in range(count):
            wall, speed = wall_of(row[k].velocity), abs(row[k].velocity)
            one.walls |= 1 << wall
            # However fast the impacts are, they are all in boxes.
            box = cell_of(wall, row[k].phase, speed / (speed + state.alpha), 1.0, EDGE)
            if box >= 0:
                boxes[n, box] = True
        model = model_of(state)
        if settle_on_orbit(row, model, one):
            continue
        last = row[count - 1]
        state.phase, state.displacement = last.phase, -1.0 * wall_of(last.velocity)
        state.velocity = -model.restitution * last.velocity
        left[still] = n
        still += 1
    return left[:still]


@kernel
def gather(outcomes: RecordArray, boxes: Record, growth: FloatArray, slots: RecordArray) -> int:
    """Put the outcomes of trajectories at one place together, most frequent first; count them."""
    # `growth` has the mean exponents of blocks [1] for those that have not settled.
    firsts = np.zeros(len(outcomes), np.int64)
    found = 0
    for n in range(len(outcomes)):
        one = outcomes[n]
        same = found
        for k in range(found):
            other = outcomes[firsts[k]]
            if one.kind != UNSETTLED or other.kind != UNSETTLED:
                alike = is_same(one, other)
            else:
                mine, theirs = boxes[n], boxes[firsts[k]]
                common = np.count_nonzero(mine & theirs)
                alike = bool(common > OVERLAP * min(
                    np.count_nonzero(mine), np.count_nonzero(theirs)))
            if alike:
                same = k
                break
        if same == found:
            firsts[found] = n
            one.trajectories = 0
            found += 1
        first = outcomes[firsts[same]]
        if one.kind == UNSETTLED and first.trajectories:
            growth[firsts[same]] += growth[n]
            first.walls |= one.walls
        first.trajectories += 1
    for k in range(found):
        one = outcomes[firsts[k]]
        if one.kind == UNSETTLED:
            blocks = growth[firsts[k]] / one.trajectories
            one.exponent, scatter = 0.0, 0.0
            for block in blocks:
                one.exponent += block / len(blocks)
            for block in blocks:
                scatter += (block - one.exponent) * (block - one.exponent)
            one.error = math.sqrt(scatter / len(blocks) / (len(blocks) - 1.0))
            if one.exponent > CERTAIN * one.error:
                one.kind = CHAOTIC
            elif one.exponent == -math.inf:
                one.error = 0.0
    for k in range(min(found, len(slots))):
        most = k
        for j in range(k + 1, found):
            if outcomes[firsts[j]].trajectories > outcomes[firsts[most]].trajectories:
                most = j
        # Those before it keep their order.
        place = firsts[most]
        for j in range(most, k, -1):
            firsts[j] = firsts[j - 1]
        firsts[k] = place
        slots[k] = outcomes[place]
    return found


def survey(initial: RecordArray, skip: int, keep: int) -> tuple[RecordArray, IntArray]:
    """Find what INITIAL, a row for each place, settle on: OUTCOME in slots, and their number."""
    # What has settled on no orbit after `skip` impacts has its exponent from `keep` more.
    states, tile = initial.ravel().copy(), lanes.new_tiles(1)[0]
    outcomes, boxes = np.zeros(len(states), OUTCOME), np.zeros((len(states), 2 * EDGE**2), bool)
    left = look(tile, states, *GLANCE, outcomes, np.arange(len(states)), boxes)
    left = look(tile, states, skip, GLANCE[1], outcomes, left, boxes)
    growth = np.zeros((len(states), BLOCKS))
    if len(left):
        growth[left] = measure(tile, states[left], keep, -1.0, 1.0, 1)[1]
        # At its end nothing has settled in between.
        left = look(tile, states, TURN_IMPACTS + keep - LOOK, LOOK, outcomes, left, boxes)
        stick = growth[left].min(axis=1) == -math.inf
        left = np.append(left[~stick], look(tile, states, 0, LONG_LOOK, outcomes, left[stick],
                                            boxes))
        outcomes['kind'][left], outcomes['impacts'][left] = UNSETTLED, 0
    slots, counts = np.zeros((len(initial), SLOTS), OUTCOME), np.zeros(len(initial), np.int64)
    shape = initial.shape[1]
    for place in range(len(initial)):
        part = slice(place * shape, (place + 1) * shape)
        counts[place] = gather(outcomes[part], boxes[part], growth[part], slots[place])
    return slots, counts
