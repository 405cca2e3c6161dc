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
The first impact of a flight: conservative advancement, and where that is slow, bisection.

Steps of `advancement` find nearly every impact in a few evaluations of the flight, but near a wall
met with hardly any velocity, force and jerk they may shrink without end. A search that has run out
of patience goes from one zero of the force to the next, between which the flight turns at most
once (doc/steps.md has the proof).
"""

import math
from typing import Final

from .advancement import aim, close_in, is_slow, leap, look_ahead, stop_ahead, stop_behind
from .closed_form import departure, displace, later, LOWER, may_be_short, NO_WALL, UPPER
from .elementary import arctangent, sine_cosine, TWO_PI
from .stretches import short_way, Stretches, stretches_of
from ..compiled import kernel
from ..model import Model

# Halvings of an interval of times down to two neighbours: 11 of its logarithm, then 54.
HALVINGS: Final = 66
# In place of a velocity of zero, so that an impact has a direction [1].
FAINTEST: Final = 1e-300


@kernel
def force_zero_delay(phase: float, near: float, model: Model) -> float:
    """Return the time [1] until ``a(tau, 0)`` changes sign, a drive period if it never does."""
    # A zero no farther than `near` has been passed already, but for rounding.
    alpha, beta, gamma, _ = model
    amplitude = alpha * math.sqrt(1.0 + beta * beta)
    if abs(gamma) >= amplitude:
        return TWO_PI
    angle = arctangent(gamma / (math.sqrt(amplitude - gamma) * math.sqrt(amplitude + gamma)))
    lag = arctangent(beta) - phase
    falling = (angle + lag) % TWO_PI
    rising = (math.pi - angle + lag) % TWO_PI
    return min(falling if falling > near else falling + TWO_PI,
               rising if rising > near else rising + TWO_PI)


@kernel
def middle(a: float, b: float) -> float:
    """Halve an interval ``0 < a < b``, its logarithm first: floats are dense near zero."""
    return math.sqrt(a) * math.sqrt(b) if b > 2.0 * a else 0.5 * (a + b)


@kernel
def wall_reached(s0: float, moved: float) -> int:
    """Return the wall that has been reached or passed, NO_WALL for none."""
    if -s0 - moved <= 0.0:
        return UPPER
    return LOWER if 1.0 + s0 + moved <= 0.0 else NO_WALL


@kernel
def bisect_on(d: float, phase: float, s0: float, v0: float,
              model: Model) -> tuple[float, float, int, int]:
    """Go on from time d to the first impact, or to a zero of the force that comes before it."""
    # Until that zero ``exp(beta t) v`` is monotone: the gear turns at most once, and on either
    # side of that its displacement is monotone. Returns the step from d [1], the speed towards the
    # wall at an impact [1], the wall (NO_WALL at a zero), and the number of evaluations.
    sin_p, cos_p = sine_cosine(phase)
    near = 1e-14 + 1e-15 * d
    end = d + force_zero_delay(later(phase, d)[1], near, model)
    first = displace(d, sin_p, cos_p, v0, model)[1]
    moved, last, _, _ = displace(end, sin_p, cos_p, v0, model)
    evaluations = 2
    # The bracket [a, b] is of the turn first, then of the impact.
    a, b = d, end
    if (first > 0.0 > last) or (first < 0.0 < last):
        beyond = moved, last
        for _ in range(HALVINGS):
            time = middle(a, b)
            if not a < time < b:
                break
            there = displace(time, sin_p, cos_p, v0, model)
            evaluations += 1
            if (there[1] > 0.0) == (first > 0.0):
                a = time
            else:
                b = time
                moved, last = there[:2]
        a = d
        if wall_reached(s0, moved) == NO_WALL:
            a, b = b, end
            moved, last = beyond
    wall = wall_reached(s0, moved)
    if wall == NO_WALL:
        return end - d, 0.0, NO_WALL, evaluations
    for _ in range(HALVINGS):
        time = middle(a, b)
        if not a < time < b:
            break
        moved, velocity, _, _ = displace(time, sin_p, cos_p, v0, model)
        evaluations += 1
        if wall_reached(s0, moved) == NO_WALL:
            a = time
        else:
            b, last = time, velocity
    return b - d, max(last if wall == UPPER else -last, FAINTEST), wall, evaluations


@kernel
def search_along(d: float, effort: int, d_stop: float, phase: float, s0: float, v0: float,
                 model: Model, stretches: Stretches) -> tuple[float, int, float, int]:
    """Go forward in flight from time d to the first impact, or at least to `d_stop`."""
    # In no step can a wall be reached, so no impact is missed. A search that is resumed
    # with its d and `effort` makes the same steps. Returns the time [1], the evaluations so far,
    # the velocity [1], and the wall (NO_WALL: no impact yet).
    alpha, beta, gamma, _ = model
    sin_p, cos_p = sine_cosine(phase)
    if d == 0.0 and v0 == 0.0 and (s0 == 0.0 or s0 == -1.0):
        d = departure(sin_p, cos_p, model)
    elif d == 0.0 and effort == 0 and stretches.use > 0.0 and may_be_short(phase, s0, v0):
        effort = 1
        hits, d, velocity = short_way(phase, sin_p, cos_p, s0, v0, model, stretches)
        if hits:
            return d, effort, velocity, UPPER if velocity > 0.0 else LOWER
    while True:
        moved, velocity, sin_now, cos_now = displace(d, sin_p, cos_p, v0, model)
        towards, speed, pull, jerk, ahead, behind, horizon, jerk_bound, snap_bound = look_ahead(
            s0, moved, velocity, sin_now, cos_now, alpha, beta, gamma)
        front = stop_ahead(speed, pull, jerk, ahead, horizon, jerk_bound, snap_bound)
        aimed, error, slowness, longest = aim(
            speed, pull, jerk, ahead, horizon, jerk_bound, towards, sin_now, cos_now, alpha, beta)
        step, returns = stop_behind(front, speed, pull, jerk, behind, jerk_bound, snap_bound)
        step, towards, hits, before, crawls = close_in(
            d, velocity, step, returns, aimed, error, slowness, longest, speed, pull, jerk,
            jerk_bound, snap_bound, towards, sin_now, cos_now, alpha, beta)
        d += step
        effort += 1
        if hits:
            return d, effort, before, UPPER if towards > 0.0 else LOWER
        if is_slow(effort, d):
            step, speed, wall, evaluations = bisect_on(d, phase, s0, v0, model)
            d += step
            effort += evaluations
            if wall != NO_WALL:
                return d, effort, speed if wall == UPPER else -speed, wall
        elif crawls:
            effort += 1
            moved, velocity, sin_now, cos_now = displace(d, sin_p, cos_p, v0, model)
            d += leap(s0, moved, velocity, sin_now, cos_now, model)
        if d >= d_stop:
            return d, effort, velocity, NO_WALL


@kernel
def search_impact(d: float, effort: int, d_stop: float, phase: float, s0: float, v0: float,
                  model: Model) -> tuple[float, int, float, int]:
    """Do as `search_along` where the stretches of the parameters are not at hand."""
    return search_along(d, effort, d_stop, phase, s0, v0, model, stretches_of(model))
