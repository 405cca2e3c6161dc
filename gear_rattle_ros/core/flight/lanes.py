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
Many trajectories at once, one lane of a tile each.

A consumer, itself a kernel, keeps a tile per thread: it calls `refill`, `advance`, looks at the
impacts of each lane and calls `release` for those that are done with, as `recorded.record` does.
Lanes do not wait for each other. A lane's impacts depend on its initial condition alone, not on
the tile, the neighbours or the cuts.
"""

import dataclasses
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from .advancement import is_slow, leap
from .closed_form import (
    departure,
    displace,
    displace_leg,
    is_pressed,
    later,
    LEG,
    LEG_PERIODS,
    may_be_short,
    NO_WALL,
    rebound,
    release_delay,
    UPPER,
)
from .elementary import sine_cosine, TWO_PI
from .first_impact import bisect_on, search_along
from .lanes_step import (
    CRAWLING,
    LANES,
    SEARCHED,
    step,
    step_slots,
    TILE,
    VECTOR,
)
from .lanes_stride import stretches_in, stride
from .noise import draw
from .stretches import stretches_of
from ..arrays import IntArray, Record, RecordArray
from ..compiled import kernel
from ..model import Model, Parameters, STICKING_SPEED

CACHE_LINE: Final = 64
# In place of the number of an initial condition: the lane is free.
EMPTY: Final = -1
# Why a trajectory has ended: not yet; permanently at rest on a wall; permanently between walls.
RUNS: Final = 0
RESTS: Final = 1
FLOATS: Final = 2

# Initial condition and parameters of a trajectory.
INITIAL: Final = np.dtype([
    ('phase', np.float64), ('displacement', np.float64), ('velocity', np.float64),
    ('alpha', np.float64), ('beta', np.float64), ('gamma', np.float64),
    ('restitution', np.float64),
], align=True)
# One impact: whole drive periods, phase [rad] and the velocity just before it [1]; the sign of
# that, even of a zero, gives the wall: positive for the upper.
IMPACT: Final = np.dtype(
    [('cycle', np.int64), ('phase', np.float64), ('velocity', np.float64)], align=True)

# So many flights that need a search are searched together, by so many steps at once.
ENOUGH: Final = 6
STEPS_TOGETHER: Final = 4
# So many turns are decided together.
TURNS_TOGETHER: Final = 6
# Nothing waits longer than so many steps of a tile.
WAIT: Final = 8

# For `advance` where impacts are only counted.
NO_IMPACTS: Final[RecordArray] = np.zeros((LANES, 0), IMPACT)


def new_tiles(count: int) -> RecordArray:
    """Make tiles with every lane free, one for each thread; the kernels take one record."""
    # A vector that crosses the border of cache lines costs twice.
    room = np.zeros(count * TILE.itemsize + CACHE_LINE, np.uint8)
    first = -room.ctypes.data % CACHE_LINE
    tiles = room[first:first + count * TILE.itemsize].view(TILE)
    tiles['number'] = EMPTY
    # No parameters yet.
    tiles['alpha'] = -1.0
    return tiles


def make_initial_conditions(parameters: Parameters, phases: npt.ArrayLike,
                            displacement: npt.ArrayLike, velocities: npt.ArrayLike) -> RecordArray:
    """Put initial conditions (phases of any size) and parameters together, as INITIAL."""
    initial = np.zeros(np.broadcast(phases, displacement, velocities).shape, INITIAL)
    turned = np.mod(np.asarray(phases, np.float64), TWO_PI)
    initial['phase'] = np.where(turned >= TWO_PI, 0.0, turned)
    initial['displacement'] = displacement
    initial['velocity'] = velocities
    for name, value in dataclasses.asdict(parameters).items():
        initial[name] = value
    return initial


@kernel
def new_impacts(steps: int) -> RecordArray:
    """Make room for the impacts of a tile, shape (LANES, steps + 1), for `steps` of `advance`."""
    return np.zeros((LANES, steps + 1), IMPACT)


@kernel
def model_in(tile: Record, i: int) -> Model:
    return Model(tile.alpha[i], tile.beta[i], tile.gamma[i], tile.restitution[i])


@kernel
def evaluate(tile: Record, i: int) -> None:
    """Evaluate the flight of a lane at the duration up to which it is known."""
    sine, cosine = sine_cosine(tile.phase[i])
    tile.sine[i], tile.cosine[i] = sine, cosine
    tile.moved[i], tile.velocity_now[i], tile.sine_now[i], tile.cosine_now[i] = displace(
        tile.duration[i], sine, cosine, tile.velocity[i], model_in(tile, i))


@kernel
def look_first_at(tile: Record, i: int) -> None:
    """Let the flight that begins in a lane take the short way, where that is of use."""
    tile.search[i] = 0.0 if tile.use[i] > 0.0 else SEARCHED


@kernel
def settle(tile: Record, i: int) -> None:
    """Prepare a lane whose flight begins: the gear may first rest on a wall, or permanently."""
    displacement = tile.displacement[i]
    look_first_at(tile, i)
    if not may_be_short(tile.phase[i], displacement, tile.velocity[i]):
        tile.search[i] = SEARCHED
    at_rest = tile.velocity[i] == 0.0 and (displacement == 0.0 or displacement == -1.0)
    # A parked lane keeps its state at the impact, for it may go on with other parameters.
    if at_rest and tile.left[i] > 0.0:
        model = model_in(tile, i)
        if is_pressed(displacement, tile.phase[i], model):
            delay = release_delay(displacement, tile.phase[i], model)
            if delay == math.inf:
                tile.end[i] = RESTS
                tile.left[i] = 0.0
                delay = 0.0
            periods, tile.phase[i] = later(tile.phase[i], delay)
            tile.cycle[i] += periods
        if tile.end[i] == RUNS:
            sine, cosine = sine_cosine(tile.phase[i])
            tile.duration[i] = departure(sine, cosine, model)
            tile.search[i] = SEARCHED
    evaluate(tile, i)


@kernel
def begin(tile: Record, i: int, cycle: int, phase: float, displacement: float, velocity: float,
          left: float) -> None:
    """Begin a flight in a lane from a state [1, rad, 1, 1], with the parameters in the lane."""
    # The lane parks after `left` impacts, never for inf. A parked lane goes on from its own state.
    tile.cycle[i], tile.phase[i] = cycle, phase
    tile.displacement[i], tile.velocity[i] = displacement, velocity
    tile.duration[i] = tile.effort[i] = tile.again[i] = 0.0
    tile.left[i], tile.end[i] = left, RUNS
    settle(tile, i)


@kernel
def release(tile: Record, i: int) -> None:
    """Free a lane whose trajectory is finished."""
    tile.number[i] = EMPTY
    tile.left[i] = 0.0


@kernel
def prepare(tile: Record, i: int) -> None:
    """Put the stretches between zeros of the force into a lane whose parameters are new."""
    (tile.fall[i], tile.fall_sine[i], tile.fall_cosine[i], tile.rise[i], tile.rise_sine[i],
     tile.rise_cosine[i], tile.low_decay[i], tile.low_integral[i], tile.low_gain[i],
     tile.low_drift[i], tile.high_decay[i], tile.high_integral[i], tile.high_gain[i],
     tile.high_drift[i], tile.low_force[i], tile.high_force[i], tile.low_growth[i],
     tile.high_growth[i], tile.use[i]
     ) = stretches_of(model_in(tile, i))


@kernel
def refill(tile: Record, initial: RecordArray, following: int, left: float) -> int:
    """Put initial conditions from `following` on into free lanes; return the first left."""
    for i in range(LANES):
        if following == len(initial):
            break
        if tile.number[i] != EMPTY:
            continue
        origin = initial[following]
        tile.number[i] = following
        if (origin.alpha != tile.alpha[i] or origin.beta != tile.beta[i]
                or origin.gamma != tile.gamma[i]):
            tile.alpha[i], tile.beta[i], tile.gamma[i] = origin.alpha, origin.beta, origin.gamma
            prepare(tile, i)
        tile.restitution[i] = origin.restitution
        begin(tile, i, 0, origin.phase, origin.displacement, origin.velocity, left)
        following += 1
    return following


@kernel
def is_busy(tile: Record) -> bool:
    """Whether any lane carries a trajectory; it may have parked or ended."""
    for i in range(LANES):
        if tile.number[i] != EMPTY:
            return True
    return False


@kernel
def floats(tile: Record, i: int) -> bool:
    """Whether the drive and the rest of the free motion of a lane both end between the walls."""
    if tile.gamma[i] != 0.0:
        return False
    alpha = tile.alpha[i]
    sine, cosine = sine_cosine(tile.phase[i])
    drift = tile.velocity[i] - alpha * cosine
    if drift != 0.0:
        drift /= tile.beta[i]
    middle = tile.displacement[i] - alpha * sine
    return (middle + alpha + max(drift, 0.0) < 0.0
            and middle - alpha + min(drift, 0.0) > -1.0)


@kernel
def begin_leg(tile: Record, i: int) -> None:
    """Go on from the end of a leg."""
    tile.displacement[i], tile.velocity[i] = displace_leg(
        tile.cosine[i], tile.displacement[i], tile.velocity[i], model_in(tile, i))
    tile.cycle[i] += LEG_PERIODS
    tile.duration[i] = tile.effort[i] = 0.0
    if floats(tile, i):
        tile.end[i] = FLOATS
        tile.left[i] = 0.0


@kernel
def stick(tile: Record, i: int) -> None:
    """Decide whether the gear of a lane sticks, after an impact that leaves it slow."""
    tile.velocity[i] = rebound(tile.impact_velocity[i], tile.phase[i], model_in(tile, i), 0.0)
    settle(tile, i)


@kernel
def attend(tile: Record, i: int) -> None:
    """Do for a lane or slot, just after a step of the search, what the vector loop leaves out."""
    # These are sticking and grazing, flights of ``beta d >= 1``, legs, crawls and slow searches.
    if tile.has_hit[i] != 0:
        if abs(tile.velocity[i]) < STICKING_SPEED:
            stick(tile, i)
        return
    if is_slow(tile.effort[i], tile.duration[i]):
        further, speed, wall, evaluations = bisect_on(
            tile.duration[i], tile.phase[i], tile.displacement[i], tile.velocity[i],
            model_in(tile, i))
        tile.duration[i] += further
        tile.effort[i] += evaluations
        if wall != NO_WALL:
            # At the wall and towards it: so the next step ends there, and has no length.
            evaluate(tile, i)
            tile.moved[i] = (0.0 if wall == UPPER else -1.0) - tile.displacement[i]
            tile.velocity_now[i] = speed if wall == UPPER else -speed
            return
    elif tile.is_special[i] >= CRAWLING:
        tile.effort[i] += 1.0
        evaluate(tile, i)
        tile.duration[i] += leap(
            tile.displacement[i], tile.moved[i], tile.velocity_now[i], tile.sine_now[i],
            tile.cosine_now[i], model_in(tile, i))
    if tile.duration[i] >= LEG:
        begin_leg(tile, i)
    evaluate(tile, i)


@kernel
def give(tile: Record, i: int, k: int) -> None:
    """Hand the flight of lane or slot i, as far as it is known, to slot or lane k."""
    tile.cycle[k], tile.phase[k] = tile.cycle[i], tile.phase[i]
    tile.displacement[k], tile.velocity[k] = tile.displacement[i], tile.velocity[i]
    tile.sine[k], tile.cosine[k] = tile.sine[i], tile.cosine[i]
    tile.duration[k], tile.effort[k] = tile.duration[i], tile.effort[i]
    tile.moved[k], tile.velocity_now[k] = tile.moved[i], tile.velocity_now[i]
    tile.sine_now[k], tile.cosine_now[k] = tile.sine_now[i], tile.cosine_now[i]
    tile.end[k] = tile.end[i]


@kernel
def is_new(tile: Record, i: int) -> bool:
    """Whether the short way has just not found the end of a flight, and it was not evaluated."""
    return tile.search[i] > SEARCHED and tile.effort[i] == 0.0


@kernel
def search_together(tile: Record) -> None:
    """Take the flights that need a search some steps on, side by side in slots."""
    last = LANES
    for i in range(LANES):
        if tile.left[i] > 0.0 and tile.search[i] > 0.0:
            if is_new(tile, i):
                # The short way was an evaluation, too.
                tile.effort[i] = 1.0
                evaluate(tile, i)
            give(tile, i, last)
            tile.alpha[last], tile.beta[last] = tile.alpha[i], tile.beta[i]
            tile.gamma[last], tile.restitution[last] = tile.gamma[i], tile.restitution[i]
            tile.left[last] = 1.0
            tile.lane[last] = i
            last += 1
    end = last
    while end % VECTOR != 0:
        # A parked one.
        tile.left[end] = 0.0
        end += 1
    for _ in range(STEPS_TOGETHER):
        special = step_slots(tile, end)
        busy = 0
        for k in range(LANES, last):
            i = tile.lane[k]
            if tile.has_hit[k] != 0:
                give(tile, k, i)
                look_first_at(tile, i)
                tile.left[i] -= 1.0
                tile.has_hit[i] = 1
                tile.impact_velocity[i] = tile.impact_velocity[k]
                tile.is_special[i] = abs(tile.velocity[i]) < STICKING_SPEED
            elif tile.left[k] > 0.0:
                if special > 0 and tile.is_special[k] != 0:
                    attend(tile, k)
                if tile.left[k] > 0.0 and tile.duration[k] > 0.0:
                    busy += 1
                    continue
                # A leg: the short way may go on, or nothing.
                give(tile, k, i)
                look_first_at(tile, i)
                tile.left[i] = tile.left[i] if tile.left[k] > 0.0 else 0.0
                tile.left[k] = 0.0
        if busy == 0:
            return
    for k in range(LANES, last):
        if tile.left[k] > 0.0:
            give(tile, k, tile.lane[k])
            tile.left[k] = 0.0


@kernel
def search_alone(tile: Record, i: int) -> None:
    """Take a lane that is new to the search to its impact, or through a leg."""
    d, _, velocity, wall = search_along(
        tile.duration[i], 1, LEG, tile.phase[i], tile.displacement[i], tile.velocity[i],
        model_in(tile, i), stretches_in(tile, i))
    look_first_at(tile, i)
    if wall == NO_WALL:
        begin_leg(tile, i)
        return
    periods, tile.phase[i] = later(tile.phase[i], d)
    tile.cycle[i] += periods
    tile.displacement[i] = 0.0 if wall == UPPER else -1.0
    tile.velocity[i] = -tile.restitution[i] * velocity
    tile.sine[i], tile.cosine[i] = sine_cosine(tile.phase[i])
    tile.duration[i] = 0.0
    tile.left[i] -= 1.0
    tile.has_hit[i] = 1
    tile.impact_velocity[i] = velocity
    tile.is_special[i] = abs(tile.velocity[i]) < STICKING_SPEED


@kernel
def move(tile: Record, n: int, enough: int) -> int:
    """Take lanes to their next impacts, or nearer; return how many need `attend`."""
    if enough == 0:
        return step(tile)
    is_due = n % WAIT == 0
    special, waiting = stride(tile, 1 if is_due else min(enough, TURNS_TOGETHER))
    if is_due and 0 < waiting < enough:
        # So few are faster one by one.
        for i in range(LANES):
            if tile.left[i] > 0.0 and is_new(tile, i):
                search_alone(tile, i)
                waiting -= 1
        special = LANES
    if waiting >= enough or (waiting > 0 and is_due):
        search_together(tile)
        special = LANES
    return special


@kernel
def enough_for(tile: Record) -> int:
    """Return how many flights that wait are to be searched together, 0 if all are searched."""
    busy = short = 0
    for i in range(LANES):
        if tile.left[i] > 0.0:
            busy += 1
            short += tile.use[i] > 0.0
    return min(busy, ENOUGH) if short > 0 else 0


@kernel
def advance(tile: Record, impacts: RecordArray, steps: int) -> None:
    """Take every lane of a tile a number of steps forward, each at most one impact."""
    # `count` is the impacts of each lane in this call. A lane ends for good with its trajectory
    # (`end`) and parks just after the impact with which it has none `left`. A row of `impacts` for
    # each lane receives them and must be longer than `steps`; NO_IMPACTS keeps none.
    room = impacts.shape[1]
    if impacts.shape[0] != LANES or 0 < room <= steps:
        raise ValueError('no room for the impacts')
    row = np.uint64(room)
    flat = impacts.reshape(impacts.size)
    enough = enough_for(tile)
    for i in range(LANES):
        tile.count[i] = 0
    for k in range(steps):
        special = move(tile, k, enough)
        if room > 0:
            for i in range(LANES):
                # Written whether there is one or not, which is cheaper than to ask.
                impact = flat[np.uint64(i) * row + np.uint64(tile.count[i])]
                impact.cycle = tile.cycle[i]
                impact.phase = tile.phase[i]
                impact.velocity = tile.impact_velocity[i]
                tile.count[i] += tile.has_hit[i]
        else:
            for i in range(LANES):
                tile.count[i] += tile.has_hit[i]
        if special > 0:
            for i in range(LANES):
                if tile.is_special[i] != 0:
                    attend(tile, i)


@kernel
def advance_kicked(tile: Record, impacts: RecordArray, noise: float, kind: int, seeds: IntArray,
                   made: IntArray) -> None:
    """Do as `advance`, with kicks as `simulation.run` draws them; all lanes have this noise."""
    # The seeds are by initial condition; `made` counts the impacts of each, these included.
    enough = enough_for(tile)
    for i in range(LANES):
        tile.count[i] = 0
    for k in range(impacts.shape[1] - 1):
        special = move(tile, k, enough)
        for i in range(LANES):
            if tile.has_hit[i] != 0:
                n = tile.number[i]
                made[n] += 1
                impact = impacts[i, tile.count[i]]
                impact.cycle, impact.phase = tile.cycle[i], tile.phase[i]
                impact.velocity = tile.impact_velocity[i]
                tile.count[i] += 1
                kick = noise * draw(kind, seeds[n], made[n])
                if kick != 0.0:
                    # The flight begins here, and all else of it is known.
                    tile.velocity[i] = tile.velocity_now[i] = rebound(
                        impact.velocity, impact.phase, model_in(tile, i), kick)
                    continue
            if special > 0 and tile.is_special[i] != 0:
                attend(tile, i)
