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
One step of the search for impacts in every lane of a tile at once.

Written without branches, so that LLVM turns the loops over the lanes into SIMD code; a lane whose
step ends at a wall goes through the impact in the same pass. The formulas are those of
`closed_form.displace` and `advancement`, so a lane makes the impacts of
`first_impact.search_impact` bit for bit.
"""

from typing import Final

import numpy as np

from .advancement import aim, close_in, is_slow, look_ahead, stop_ahead, stop_behind
from .closed_form import later, LEG
from .elementary import relaxation_series, sine_cosine, sine_defect
from .lanes_simd import choose, inlined, prefer_wide_vectors
from ..arrays import Record
from ..compiled import kernel
from ..model import STICKING_SPEED

# Lanes of a tile: its rows fit the first-level cache, with chains enough to hide latencies.
LANES: Final = 96

# In `is_special`, at least this: the lane's steps crawl.
CRAWLING: Final = 2

WHOLE: Final = ('cycle', 'has_hit', 'is_special', 'count', 'number', 'end')
# One record is a tile; every field is a row of lanes. The flight of a lane began at `cycle`,
# `phase`, with `displacement` and `velocity`, and is known to be free up to `duration` after that.
TILE: Final = np.dtype([(name, np.int64 if name in WHOLE else np.float64, LANES) for name in (
    # Where the flight began [1, rad, 1, 1] and the sine and cosine of that phase.
    'cycle', 'phase', 'displacement', 'velocity', 'sine', 'cosine',
    'alpha', 'beta', 'gamma', 'restitution',
    # Impacts still to be made; inf for no limit, 0 parks the lane.
    'left',
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
    'sine_half', 'cosine_half',
    # In the latest step: velocity before the impact; whether it hit, and needs the scalar path.
    'impact_velocity', 'has_hit', 'is_special',
    # Impacts of the latest `advance`; number of the initial condition or EMPTY; why it has ended.
    'count', 'number', 'end',
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
def fly(t: Record, i: int) -> int:
    """Evaluate the flight of lane i for ``beta d < 1``; return 1 if it needs the scalar path."""
    alpha = t.alpha[i]
    beta = t.beta[i]
    gamma = t.gamma[i]
    d = t.duration[i]
    v0 = t.next_velocity[i]
    sin_p = t.next_sine[i]
    cos_p = t.next_cosine[i]
    t.velocity[i] = v0
    t.displacement[i] = t.next_displacement[i]
    t.sine[i] = sin_p
    t.cosine[i] = cos_p
    x = beta * d
    second = relaxation_series(x)
    first = 1.0 - x * second
    decay = 1.0 - x * first
    integral = d * first
    second = d * d * second
    sin_half = t.sine_half[i]
    versine = 2.0 * sin_half * sin_half
    sine = 2.0 * sin_half * t.cosine_half[i]
    defect = sine_defect(d, sine)
    t.moved[i] = (v0 * integral + gamma * second
                  + alpha * (cos_p * (defect + beta * second) - sin_p * versine))
    t.velocity_now[i] = (v0 * decay + gamma * integral
                         + alpha * (cos_p * (beta * integral - versine) - sin_p * sine))
    t.sine_now[i] = sin_p + (cos_p * sine - sin_p * versine)
    t.cosine_now[i] = cos_p - (cos_p * versine + sin_p * sine)
    special = (((t.has_hit[i] != 0) & (abs(v0) < STICKING_SPEED))
               | ((t.left[i] > 0.0)
                  & ((x >= 1.0) | (d >= LEG) | is_slow(t.effort[i], d))))
    t.is_special[i] += special
    return t.is_special[i]


@kernel
def step(t: Record) -> int:
    """Take every lane one step forward, impacts included; return how many need the scalar path."""
    prefer_wide_vectors()
    # Short loops: the processor then works on several lanes' chains of operations at once.
    for i in range(LANES):
        look(t, i)
    for i in range(LANES):
        front(t, i)
        aim_at(t, i)
    for i in range(LANES):
        back(t, i)
    for i in range(LANES):
        close(t, i)
    for i in range(LANES):
        strike(t, i)
    for i in range(LANES):
        turn(t, i)
    special = 0
    for i in range(LANES):
        special += fly(t, i)
    return special
