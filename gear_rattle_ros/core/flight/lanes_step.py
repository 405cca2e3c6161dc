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
The tile of lanes, and one step of the search for impacts in many of them at once.

Written without branches, so that LLVM turns the loops over the lanes into SIMD code; a lane whose
step ends at a wall goes through the impact in the same pass. The formulas are those of
`closed_form.displace` and `advancement`, so a lane makes the impacts of
`first_impact.search_along` bit for bit.
"""

from typing import Final

import numpy as np

from .advancement import aim, close_in, is_slow, look_ahead, stop_ahead, stop_behind
from .closed_form import later, LEG
from .elementary import relax, sine_cosine, sine_defect
from .lanes_simd import choose, inlined, prefer_wide_vectors
from .stretches import Stretches
from ..arrays import Record
from ..compiled import kernel
from ..model import STICKING_SPEED

# Lanes of a tile: its rows fit the first-level cache, with chains enough to hide latencies.
LANES: Final = 96
# In `search`: the flight is searched step by step; one more if the short way did not find its end.
SEARCHED: Final = 1.0
# Slots that one vector takes.
VECTOR: Final = 8
# After the lanes in each row, as many slots for what is done for some of them side by side; and
# one vector more, for rows an odd number of cache lines apart share no set of the cache.
ROW: Final = 2 * LANES + VECTOR
# Base of the counts that `stride` adds up.
WAITS: Final = 1024

# In `is_special`, at least this: the lane's steps crawl.
CRAWLING: Final = 2

WHOLE: Final = ('cycle', 'has_hit', 'is_special', 'count', 'number', 'end', 'lane')
# One record is a tile; every field is a row of lanes. The flight of a lane began at `cycle`,
# `phase`, with `displacement` and `velocity`, and is known to be free up to `duration` after that.
TILE: Final = np.dtype([(name, np.int64 if name in WHOLE else np.float64, ROW) for name in (
    # Where the flight began [1, rad, 1, 1] and the sine and cosine of that phase.
    'cycle', 'phase', 'displacement', 'velocity', 'sine', 'cosine',
    'alpha', 'beta', 'gamma', 'restitution', *Stretches._fields,
    # Impacts still to be made; inf for no limit, 0 parks the lane.
    'left',
    # The short way: verdict, time and length of the stretch, its polynomial, the state at its end.
    'first_verdict', 'first_wall', 'first_s', 'first_v', 'at_fall', 'length', 'following',
    'verdict', 'wall', 'since', 'next_length', 'v_a', 'sine_a', 'cosine_a',
    'c_0', 'c_1', 'c_2', 'c_3', 'c_4', 'c_5', 'c_6', 'c_7', 's_b', 'v_b', 'last',
    'bend', 'snap', 'blur', 'low', 'high',
    'a_0', 'a_1', 'a_2', 'a_3', 'a_4', 'a_5', 'a_6', 'a_7', 'x', 'next_x',
    # The motion at the time of the guess, and that of a second evaluation, or 0.
    'there', 'there_velocity', 'there_sine', 'there_cosine', 'again',
    # SEARCHED, or more, where the flight is searched; else 0.
    'search',
    # The search: how far it has come, by how many evaluations, and the motion up to there.
    'duration', 'effort', 'moved', 'velocity_now', 'sine_now', 'cosine_now',
    # Seen from the wall ahead (`towards` is +1 for the upper): speed, acceleration, jerk,
    # distances to both walls, a time of about that to the wall, the certain step.
    'towards', 'speed', 'pull', 'jerk', 'ahead', 'behind', 'horizon', 'step', 'jerk_bound',
    'snap_bound', 'returns',
    # The time to that wall by Taylor's polynomial: its error there, 1 by the speed then, or
    # -1 if of no use, and how long the velocity has to stay positive.
    'aimed', 'aim_error', 'slowness', 'longest',
    # After the step, on the way to the rows above. (A row that is loaded, selected and stored
    # to the same place makes a masked store, which stalls the next load.)
    'next_step', 'next_towards', 'next_displacement', 'next_velocity', 'next_sine', 'next_cosine',
    'next_again', 'next_at_fall', 'next_following', 'next_verdict', 'next_search',
    'sine_half', 'cosine_half',
    # In the latest step: velocity before the impact; whether it hit, and needs the scalar path.
    'impact_velocity', 'has_hit', 'is_special',
    # Impacts of the latest `advance`; number of the initial condition or EMPTY; why it has ended;
    # of a slot, its lane.
    'count', 'number', 'end', 'lane',
)], align=True)


@inlined
def look(t: Record, i: int) -> None:
    """Describe the flight of lane i as seen from the wall ahead."""
    (t.towards[i], t.speed[i], t.pull[i], t.jerk[i], t.ahead[i], t.behind[i], t.horizon[i],
     t.jerk_bound[i], t.snap_bound[i]) = look_ahead(
        t.displacement[i], t.moved[i], t.velocity_now[i], t.sine_now[i], t.cosine_now[i],
        t.alpha[i], t.beta[i], t.gamma[i])


@inlined
def front(t: Record, i: int) -> None:
    """Find how far lane i can go as far as the wall ahead is concerned."""
    t.step[i] = stop_ahead(t.speed[i], t.pull[i], t.jerk[i], t.ahead[i], t.horizon[i],
                           t.jerk_bound[i], t.snap_bound[i])


@inlined
def aim_at(t: Record, i: int) -> None:
    """Improve the time of lane i to the wall ahead."""
    t.aimed[i], t.aim_error[i], t.slowness[i], t.longest[i] = aim(
        t.speed[i], t.pull[i], t.jerk[i], t.ahead[i], t.horizon[i], t.jerk_bound[i],
        t.towards[i], t.sine_now[i], t.cosine_now[i], t.alpha[i], t.beta[i])


@inlined
def back(t: Record, i: int) -> None:
    """Shorten the step of lane i where the gear may come back to the wall behind."""
    t.step[i], t.returns[i] = stop_behind(
        t.step[i], t.speed[i], t.pull[i], t.jerk[i], t.behind[i], t.jerk_bound[i],
        t.snap_bound[i])


@inlined
def close(t: Record, i: int) -> None:
    """Find the impact of lane i, or its step; none where it is parked."""
    step, towards, hits, velocity, crawls = close_in(
        t.duration[i], t.velocity_now[i], t.step[i], t.returns[i], t.aimed[i], t.aim_error[i],
        t.slowness[i], t.longest[i], t.speed[i], t.pull[i], t.jerk[i], t.jerk_bound[i],
        t.snap_bound[i], t.towards[i], t.sine_now[i], t.cosine_now[i], t.alpha[i], t.beta[i])
    is_active = t.left[i] > 0.0
    t.next_step[i] = choose(is_active, step, 0.0)
    t.next_towards[i] = towards
    t.has_hit[i] = hits & is_active
    t.effort[i] = choose(is_active & (not hits), t.effort[i] + 1.0, 0.0)
    t.impact_velocity[i] = velocity
    t.is_special[i] = CRAWLING * np.int64(crawls & is_active)


@inlined
def strike(t: Record, i: int) -> None:
    """Take lane i forward by its step, through the impact if there is one."""
    hits = t.has_hit[i] != 0
    d = t.duration[i] + t.next_step[i]
    # A time of zero leaves phase and cycle as they are.
    periods, phase = later(t.phase[i], choose(hits, d, 0.0))
    t.cycle[i] += periods
    t.phase[i] = phase
    t.duration[i] = choose(hits, 0.0, d)
    t.left[i] -= choose(hits, 1.0, 0.0)
    after = -t.restitution[i] * t.impact_velocity[i]
    t.next_velocity[i] = choose(hits, after, t.velocity[i])
    t.next_displacement[i] = choose(
        hits, choose(t.next_towards[i] > 0.0, 0.0, -1.0), t.displacement[i])


@inlined
def turn(t: Record, i: int) -> None:
    """Take the sine and cosine of the phase of a flight that begins, or of half its duration."""
    d = t.duration[i]
    begins = d == 0.0
    sine, cosine = sine_cosine(choose(begins, t.phase[i], 0.5 * d))
    t.next_sine[i] = choose(begins, sine, t.sine[i])
    t.next_cosine[i] = choose(begins, cosine, t.cosine[i])
    t.sine_half[i] = choose(begins, 0.0, sine)
    t.cosine_half[i] = choose(begins, 1.0, cosine)


@inlined
def flown(d: float, v0: float, sin_p: float, cos_p: float, sin_half: float, cos_half: float,
          alpha: float, beta: float, gamma: float,
          relaxed: tuple[float, float, float]) -> tuple[float, ...]:
    """Do as `closed_form.displace`, with the sine and cosine of d/2 and `relaxation`."""
    decay, integral, second = relaxed
    versine = 2.0 * sin_half * sin_half
    sine = 2.0 * sin_half * cos_half
    defect = sine_defect(d, sine)
    return (
        v0 * integral + gamma * second
        + alpha * (cos_p * (defect + beta * second) - sin_p * versine),
        v0 * decay + gamma * integral
        + alpha * (cos_p * (beta * integral - versine) - sin_p * sine),
        sin_p + (cos_p * sine - sin_p * versine), cos_p - (cos_p * versine + sin_p * sine))


@inlined
def fly(t: Record, i: int) -> int:
    """Evaluate the flight of lane i for ``beta d < 1``; return 1 if it needs the scalar path."""
    d = t.duration[i]
    v0 = t.next_velocity[i]
    sin_p = t.next_sine[i]
    cos_p = t.next_cosine[i]
    t.velocity[i] = v0
    t.displacement[i] = t.next_displacement[i]
    t.sine[i] = sin_p
    t.cosine[i] = cos_p
    t.moved[i], t.velocity_now[i], t.sine_now[i], t.cosine_now[i] = flown(
        d, v0, sin_p, cos_p, t.sine_half[i], t.cosine_half[i], t.alpha[i], t.beta[i], t.gamma[i],
        relax(d, t.beta[i]))
    x = t.beta[i] * d
    special = (((t.has_hit[i] != 0) & (abs(v0) < STICKING_SPEED))
               | ((t.left[i] > 0.0)
                  & ((x >= 1.0) | (d >= LEG) | is_slow(t.effort[i], d))))
    t.is_special[i] += special
    return t.is_special[i]


@inlined
def search(t: Record, first: int, last: int) -> int:
    """Take lanes or slots a step of the search, impacts included; return how many are special."""
    prefer_wide_vectors()
    # Without a sign: numba would look for negative places, which no loop survives as SIMD code.
    begin, end = np.uint64(first), np.uint64(last)
    # Short loops: the processor then works on several lanes' chains of operations at once.
    for i in range(begin, end):
        look(t, i)
    for i in range(begin, end):
        front(t, i)
        aim_at(t, i)
    for i in range(begin, end):
        back(t, i)
    for i in range(begin, end):
        close(t, i)
    for i in range(begin, end):
        strike(t, i)
    for i in range(begin, end):
        turn(t, i)
    special = 0
    for i in range(begin, end):
        special += fly(t, i)
    return special


@kernel
def step(t: Record) -> int:
    """Take every lane one step of the search; return how many are special."""
    prefer_wide_vectors()
    return search(t, 0, LANES)


@kernel
def step_slots(t: Record, last: int) -> int:
    """Take slots one step of the search; return how many are special."""
    prefer_wide_vectors()
    return search(t, LANES, last)
