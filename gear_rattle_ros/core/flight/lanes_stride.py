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
One flight in every lane of a tile at once, the short way.

Written without branches, as the steps are. The formulas are those of `stretches`, so a lane makes
the impacts of `first_impact.search_along` bit for bit.
"""

import numpy as np

from .closed_form import later
from .elementary import relax, relax_twice, SERIES_MAXIMUM, sine_cosine, TWO_PI
from .lanes_simd import choose, inlined, prefer_wide_vectors
from .lanes_step import flown, LANES, SEARCHED, VECTOR, WAITS
from .stretches import (
    BRACKETED,
    draw_near,
    finish,
    FURTHER,
    guess,
    improve,
    interpolate,
    is_strike,
    look_first,
    look_on,
    OPEN,
    ROUNDS,
    Stretches,
    turn_over,
    TURNS,
    zero_of,
)
from ..arrays import Record, Whole
from ..compiled import kernel
from ..model import STICKING_SPEED


@inlined
def stretches_in(t: Record, i: int) -> Stretches:
    return Stretches(
        t.fall[i], t.fall_sine[i], t.fall_cosine[i], t.rise[i], t.rise_sine[i], t.rise_cosine[i],
        t.low_decay[i], t.low_integral[i], t.low_gain[i], t.low_drift[i], t.high_decay[i],
        t.high_integral[i], t.high_gain[i], t.high_drift[i], t.low_force[i], t.high_force[i],
        t.low_growth[i], t.high_growth[i], t.use[i])


@inlined
def is_fresh(t: Record, i: int) -> bool:
    """Whether the flight of lane i is to be taken the short way."""
    return (t.left[i] > 0.0) & (t.search[i] == 0.0)


@inlined
def see_first(t: Record, i: int) -> None:
    """Look at the first stretch of the flight of lane i."""
    (t.first_verdict[i], t.first_wall[i], t.at_fall[i], t.length[i], t.following[i], t.first_s[i],
     t.first_v[i], t.bend[i], t.snap[i], t.blur[i]) = look_first(
        t.phase[i], t.sine[i], t.cosine[i], t.displacement[i], t.velocity[i], t.alpha[i],
        t.beta[i], t.gamma[i], stretches_in(t, i))


@inlined
def see_second(t: Record, i: int) -> None:
    """Look at the second, and keep the one in which the flight of lane i may end."""
    z = stretches_in(t, i)
    at_fall = t.at_fall[i]
    s_1 = t.first_s[i]
    v_1 = t.first_v[i]
    d_1 = t.length[i]
    h_2 = t.following[i]
    verdict, wall, s_2, v_2 = look_on(at_fall, h_2, s_1, v_1, t.blur[i], t.beta[i], z)
    further = t.first_verdict[i] == FURTHER
    falls = (at_fall > 0.0) != further
    sine_1, cosine_1 = zero_of(at_fall, z)
    t.verdict[i] = choose(further, verdict, t.first_verdict[i])
    t.wall[i] = choose(further, wall, t.first_wall[i])
    t.next_at_fall[i] = choose(falls, 1.0, 0.0)
    t.since[i] = choose(further, d_1, 0.0)
    t.next_length[i] = choose(further, h_2, d_1)
    t.next_following[i] = choose(further, TWO_PI - h_2, h_2)
    t.c_0[i] = choose(further, s_1, t.displacement[i])
    t.v_a[i] = choose(further, v_1, t.velocity[i])
    t.sine_a[i] = choose(further, sine_1, t.alpha[i] * t.sine[i])
    t.cosine_a[i] = choose(further, cosine_1, t.alpha[i] * t.cosine[i])
    t.s_b[i] = choose(further, s_2, s_1)
    t.v_b[i] = choose(further, v_2, v_1)


@inlined
def fit(t: Record, i: int) -> Whole:
    """Put the polynomial through the ends of that stretch; return 1 if there is more to see."""
    h = t.next_length[i]
    s_a = t.c_0[i]
    v_a = t.v_a[i]
    verdict = t.verdict[i]
    sine_b, cosine_b = zero_of(t.next_at_fall[i], stretches_in(t, i))
    c_1, c_2, c_3, c_4, c_5, c_6, c_7, last = interpolate(
        h, s_a, v_a, t.sine_a[i], t.cosine_a[i], t.s_b[i], t.v_b[i], sine_b, cosine_b, t.beta[i],
        t.gamma[i])
    t.c_1[i], t.c_2[i], t.c_3[i], t.c_4[i], t.c_5[i] = c_1, c_2, c_3, c_4, c_5
    t.c_6[i], t.c_7[i], t.last[i] = c_6, c_7, last
    strikes = (verdict == TURNS) & (t.since[i] > 0.0) & is_strike(s_a, v_a, c_1, c_3)
    verdict = choose(strikes, BRACKETED, verdict)
    t.next_verdict[i] = verdict
    t.low[i], t.high[i] = 0.0, 1.0
    return np.int64(verdict == TURNS) + np.int64(verdict == FURTHER) * WAITS


@inlined
def see_further(t: Record, i: int) -> None:
    """Look at the next stretch of the flight of lane i, where that is called for."""
    z = stretches_in(t, i)
    known = t.next_verdict[i] != FURTHER
    at_fall = t.next_at_fall[i]
    since = t.since[i] + t.next_length[i]
    h = t.next_following[i]
    s_a = t.s_b[i]
    v_a = t.v_b[i]
    sine_a, cosine_a = zero_of(at_fall, z)
    verdict, wall, s_b, v_b = look_on(at_fall, h, s_a, v_a, t.blur[i], t.beta[i], z)
    sine_b, cosine_b = zero_of(1.0 - at_fall, z)
    c_1, c_2, c_3, c_4, c_5, c_6, c_7, last = interpolate(
        h, s_a, v_a, sine_a, cosine_a, s_b, v_b, sine_b, cosine_b, t.beta[i], t.gamma[i])
    strikes = (verdict == TURNS) & is_strike(s_a, v_a, c_1, c_3)
    t.next_verdict[i] = choose(known, t.next_verdict[i], choose(strikes, BRACKETED, verdict))
    t.wall[i] = choose(known, t.wall[i], wall)
    t.next_at_fall[i] = choose(known, at_fall, 1.0 - at_fall)
    t.since[i] = choose(known, t.since[i], since)
    t.next_length[i] = choose(known, t.next_length[i], h)
    t.next_following[i] = choose(known, h, TWO_PI - h)
    t.c_0[i] = choose(known, t.c_0[i], s_a)
    t.c_1[i] = choose(known, t.c_1[i], c_1)
    t.c_2[i] = choose(known, t.c_2[i], c_2)
    t.c_3[i] = choose(known, t.c_3[i], c_3)
    t.c_4[i] = choose(known, t.c_4[i], c_4)
    t.c_5[i] = choose(known, t.c_5[i], c_5)
    t.c_6[i] = choose(known, t.c_6[i], c_6)
    t.c_7[i] = choose(known, t.c_7[i], c_7)
    t.s_b[i] = choose(known, t.s_b[i], s_b)
    t.v_b[i] = choose(known, t.v_b[i], v_b)
    t.last[i] = choose(known, t.last[i], last)


@inlined
def decide(t: Record, i: int) -> None:
    """Decide whether the flight in slot i meets the wall ahead before it turns."""
    t.next_verdict[i], t.wall[i], t.low[i], t.high[i] = turn_over(
        t.wall[i], t.next_length[i], t.c_0[i], t.c_1[i], t.c_2[i], t.c_3[i], t.c_4[i],
        t.c_5[i], t.c_6[i], t.c_7[i], t.s_b[i], t.v_b[i], t.snap[i], t.blur[i])


@kernel
def see_on(t: Record) -> None:
    """Look at the stretches that are still open; turns are decided side by side in slots."""
    prefer_wide_vectors()
    for _ in range(ROUNDS):
        k = LANES
        further = 0
        for i in range(LANES):
            if t.next_verdict[i] == TURNS:
                t.lane[k] = i
                t.wall[k], t.next_length[k] = t.wall[i], t.next_length[i]
                t.c_0[k], t.c_1[k], t.c_2[k], t.c_3[k] = t.c_0[i], t.c_1[i], t.c_2[i], t.c_3[i]
                t.c_4[k], t.c_5[k], t.c_6[k], t.c_7[k] = t.c_4[i], t.c_5[i], t.c_6[i], t.c_7[i]
                t.s_b[k], t.v_b[k] = t.s_b[i], t.v_b[i]
                t.snap[k], t.blur[k] = t.snap[i], t.blur[i]
                k += 1
            elif t.next_verdict[i] == FURTHER:
                further += 1
        if k > LANES:
            for i in range(np.uint64(LANES), np.uint64(LANES - (LANES - k) // VECTOR * VECTOR)):
                decide(t, i)
            for i in range(LANES, k):
                j = t.lane[i]
                t.next_verdict[j], t.wall[j] = t.next_verdict[i], t.wall[i]
                t.low[j], t.high[j] = t.low[i], t.high[i]
                further += t.next_verdict[i] == FURTHER
        if further == 0:
            return
        for i in range(LANES):
            see_further(t, i)
    for i in range(LANES):
        t.next_verdict[i] = choose(t.next_verdict[i] == TURNS, OPEN, t.next_verdict[i])


@inlined
def estimate(t: Record, i: int) -> None:
    """Estimate roughly where lane i meets its wall."""
    (t.x[i], t.a_0[i], t.a_1[i], t.a_2[i], t.a_3[i], t.a_4[i], t.a_5[i], t.a_6[i], t.a_7[i]
     ) = guess(
        t.wall[i], t.next_length[i], t.low[i], t.high[i], t.c_0[i], t.c_1[i], t.c_2[i], t.c_3[i],
        t.c_4[i], t.c_5[i], t.c_6[i], t.c_7[i], t.s_b[i], t.v_b[i], t.last[i])


@inlined
def approach(t: Record, i: int) -> None:
    """Improve that estimate."""
    t.next_x[i] = improve(t.x[i], t.low[i], t.high[i], t.a_0[i], t.a_1[i], t.a_2[i], t.a_3[i],
                          t.a_4[i], t.a_5[i], t.a_6[i], t.a_7[i])


@inlined
def approach_again(t: Record, i: int) -> Whole:
    """Estimate the time of the impact of lane i; return 1 if that is late."""
    x = improve(t.next_x[i], t.low[i], t.high[i], t.a_0[i], t.a_1[i], t.a_2[i], t.a_3[i],
                t.a_4[i], t.a_5[i], t.a_6[i], t.a_7[i])
    again = t.again[i]
    d = choose(again > 0.0, again, t.since[i] + t.next_length[i] * x)
    t.next_step[i] = d
    return np.int64(t.beta[i] * d >= 1.0)


@inlined
def halve(t: Record, i: int) -> None:
    """Take the sine and cosine of half the time to the impact."""
    t.sine_half[i], t.cosine_half[i] = sine_cosine(0.5 * t.next_step[i])


@inlined
def arrive(t: Record, i: int) -> None:
    """Evaluate the flight of lane i there."""
    d = t.next_step[i]
    t.there[i], t.there_velocity[i], t.there_sine[i], t.there_cosine[i] = flown(
        d, t.velocity[i], t.sine[i], t.cosine[i], t.sine_half[i], t.cosine_half[i],
        t.alpha[i], t.beta[i], t.gamma[i], relax(d, t.beta[i]))


@inlined
def arrive_late(t: Record, i: int) -> None:
    """Evaluate the flight of lane i where ``beta d`` is 1 or more."""
    d = t.next_step[i]
    moved, velocity, _, _ = flown(
        d, t.velocity[i], t.sine[i], t.cosine[i], t.sine_half[i], t.cosine_half[i],
        t.alpha[i], t.beta[i], t.gamma[i], relax_twice(d, t.beta[i]))
    late = t.beta[i] * d >= 1.0
    t.there[i] = choose(late, moved, t.there[i])
    t.there_velocity[i] = choose(late, velocity, t.there_velocity[i])


@inlined
def come_near(t: Record, i: int) -> None:
    """Go nearer to the impact of lane i."""
    t.x[i], t.slowness[i], t.ahead[i], t.speed[i], t.pull[i], t.jerk[i] = draw_near(
        t.wall[i], t.displacement[i], t.there[i], t.there_velocity[i], t.there_sine[i],
        t.there_cosine[i], t.alpha[i], t.beta[i], t.gamma[i])


@inlined
def conclude(t: Record, i: int) -> None:
    """Find the impact of lane i, or leave it to the search."""
    d = t.next_step[i]
    since = t.since[i]
    length = t.next_length[i]
    verdict = t.next_verdict[i]
    total, speed, ends, near = finish(
        d, t.x[i], t.slowness[i], t.ahead[i], t.speed[i], t.pull[i], t.jerk[i], since,
        since + length, t.wall[i], t.there_sine[i], t.there_cosine[i], t.alpha[i], t.beta[i],
        t.bend[i])
    fresh = is_fresh(t, i)
    known = fresh & (verdict == BRACKETED) & (t.beta[i] * d < SERIES_MAXIMUM)
    hits = known & ends
    again = known & near & (not ends) & (not t.again[i] > 0.0)
    t.next_again[i] = choose(again, total, 0.0)
    fails = fresh & (not (hits | again)) & (verdict != TURNS)
    t.next_search[i] = choose(fails, SEARCHED + 1.0, t.search[i])
    t.duration[i] += choose(fails, since + choose(verdict == FURTHER, length, 0.0), 0.0)
    t.has_hit[i] = hits
    t.next_step[i] = choose(hits, total, 0.0)
    t.impact_velocity[i] = t.wall[i] * speed


@inlined
def take_off(t: Record, i: int) -> int:
    """Take lane i through its impact, if there is one; return 1 if that is special."""
    hits = t.has_hit[i] != 0
    periods, phase = later(t.phase[i], t.next_step[i])
    t.cycle[i] += periods
    t.phase[i] = phase
    t.left[i] -= choose(hits, 1.0, 0.0)
    after = -t.restitution[i] * t.impact_velocity[i]
    t.next_velocity[i] = choose(hits, after, t.velocity[i])
    t.next_displacement[i] = choose(
        hits, choose(t.wall[i] > 0.0, 0.0, -1.0), t.displacement[i])
    t.is_special[i] = np.int64(hits & (abs(after) < STICKING_SPEED))
    t.again[i] = t.next_again[i]
    t.search[i] = t.next_search[i]
    searches = (t.left[i] > 0.0) & (t.next_search[i] > 0.0)
    return t.is_special[i] + np.int64(searches) * WAITS


@inlined
def orient(t: Record, i: int) -> None:
    """Take the sine and cosine of the phase at which the flight of lane i begins."""
    t.velocity[i] = t.next_velocity[i]
    t.displacement[i] = t.next_displacement[i]
    t.sine[i], t.cosine[i] = sine_cosine(t.phase[i])


@kernel
def stride(t: Record, turns: int) -> tuple[int, int]:
    """Take lanes whose flight begins to its impact; return how many are special, and wait."""
    # Fewer open turns than `turns` stay open.
    prefer_wide_vectors()
    for i in range(LANES):
        see_first(t, i)
    for i in range(LANES):
        see_second(t, i)
    more = 0
    for i in range(LANES):
        more += fit(t, i)
    if more >= turns:
        see_on(t)
    for i in range(LANES):
        estimate(t, i)
    for i in range(LANES):
        approach(t, i)
    late = 0
    for i in range(LANES):
        late += approach_again(t, i)
    for i in range(LANES):
        halve(t, i)
    for i in range(LANES):
        arrive(t, i)
    if late > 0:
        for i in range(LANES):
            arrive_late(t, i)
    for i in range(LANES):
        come_near(t, i)
    for i in range(LANES):
        conclude(t, i)
    found = 0
    for i in range(LANES):
        found += take_off(t, i)
    for i in range(LANES):
        orient(t, i)
    return found % WAITS, found // WAITS
