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
One step towards the first impact, in which no wall can be reached: conservative advancement.

The scalar search and the lanes share these formulas, so they agree bit for bit. They have no
branches, so that LLVM turns loops over lanes into SIMD code. Displacements are positive towards
the wall ahead; a bound of a derivative holds for the rest of a flight because ``|s''|`` without
the drive only decays.
"""

from typing import Final

from .lanes_simd import choose, inlined, square_root
from ..compiled import kernel
from ..model import Model

# Longest single step of the search [1].
HORIZON_MAXIMUM: Final = 10.0
# Shortest horizon where the wall ahead is out of reach [1].
HORIZON_MINIMUM: Final = 0.3
# Longest time for which Taylor's polynomial is used [1].
NEAR: Final = 2.0
# Relative error at which Taylor's polynomial may end the search.
LAST_STEP_ERROR: Final = 1e-16
# Evaluations of a flight, and more for each unit of its time, after which bisection takes over:
# beyond what a search has been seen to take but where its steps shrink without end.
PATIENCE: Final = 64.0
PATIENCE_RATE: Final = 4.0
# Marks a step that is shortened to no purpose: the next one had better be a leap.
CRAWLS: Final = 2.0
LEAP_TRIALS: Final = 16


@inlined
def is_slow(effort: float, d: float) -> bool:
    """Whether a search up to time d has taken more evaluations than one that surely ends."""
    return effort > PATIENCE + PATIENCE_RATE * d


@inlined
def look_ahead(displacement: float, moved: float, velocity: float, sine: float, cosine: float,
               alpha: float, beta: float, gamma: float) -> tuple[float, ...]:
    """Describe the flight as seen from the wall ahead, and roughly how long it takes to reach."""
    drive_cosine = alpha * cosine
    relax = gamma - beta * (velocity - drive_cosine)
    relax_1 = beta * relax
    jerk_bound = alpha + abs(relax_1)
    snap_bound = alpha + abs(beta * relax_1)
    rising = velocity > 0.0
    towards = choose(rising, 1.0, -1.0)
    speed = abs(velocity)
    pull = towards * (relax - alpha * sine)
    jerk = towards * (-drive_cosine - relax_1)
    upper = -displacement - moved
    lower = 1.0 + displacement + moved
    upper = choose(upper > 0.0, upper, 0.0)
    lower = choose(lower > 0.0, lower, 0.0)
    ahead = choose(rising, upper, lower)
    behind = choose(rising, lower, upper)
    # The time to the wall at constant acceleration.
    discriminant = speed * speed + 2.0 * pull * ahead
    root = square_root(discriminant)
    moves = speed > 0.0
    recedes = (discriminant < 0.0) | ((speed <= 0.0) & (pull <= 0.0))
    horizon = (choose(recedes, 2.5 * abs(pull), choose(moves, 2.0 * ahead, root))
               / choose(recedes, jerk_bound, choose(moves, speed + root, pull)))
    horizon = choose(recedes & (not horizon > HORIZON_MINIMUM), HORIZON_MINIMUM, horizon)
    horizon = choose(horizon < HORIZON_MAXIMUM, horizon, HORIZON_MAXIMUM)
    return towards, speed, pull, jerk, ahead, behind, horizon, jerk_bound, snap_bound


@inlined
def worst_jerk(jerk: float, jerk_bound: float, snap_bound: float, longest: float) -> float:
    """Bound c such that the third-order remainder is at most ``c t^3/6`` until `longest`."""
    c = jerk + snap_bound * longest * 0.25
    c = choose(c < jerk_bound, c, jerk_bound)
    return choose(c > 0.0, c, 0.0)


@inlined
def stop_ahead(speed: float, pull: float, jerk: float, ahead: float, horizon: float,
               jerk_bound: float, snap_bound: float) -> float:
    """Return how far the flight can certainly go before the wall ahead [1]."""
    # Towards that wall, the displacement in time t is at most ``u t + f t^2/2 + c t^3/6`` for ``t
    # <= T``, with c the largest jerk until T; so at most ``u t + (f + c T/3) t^2/2``. Any T is
    # valid; the time to the wall at constant acceleration is a good one.
    c = worst_jerk(jerk, jerk_bound, snap_bound, horizon)
    bent = pull + c * horizon * (1.0 / 3.0)
    root = square_root(speed * speed + 2.0 * bent * ahead)
    moves = speed > 0.0
    front = choose(moves, 2.0 * ahead, root) / choose(moves, speed + root, bent)
    reaches = (moves | (bent > 0.0)) & (front < horizon)
    return choose(reaches, front, horizon)


@inlined
def stop_behind(front: float, speed: float, pull: float, jerk: float, behind: float,
                jerk_bound: float, snap_bound: float) -> tuple[float, float]:
    """Return the step `front`, shortened where the gear may come back to the wall behind."""
    # The bound of the way back, ``-u t - f t^2/2 + c t^3/6``, is greatest at an end of the
    # stretch. The second result is 0 where it does not come back, else 1, or CRAWLS where the step
    # is short only because `front` is long.
    c = worst_jerk(-jerk, jerk_bound, snap_bound, front)
    q = c * front * (1.0 / 3.0) - pull
    way = speed + square_root(speed * speed + 2.0 * q * behind)
    bends = way * c < 3.0 * pull * q
    back = choose(bends, 3.0 * pull, way) / choose(bends, c, q)
    returns = (front * (0.5 * q * front - speed) > behind) & (back < front)
    crawls = (q > 16.0 * abs(pull)) & (16.0 * back < front)
    return choose(returns, back, front), choose(returns, choose(crawls, CRAWLS, 1.0), 0.0)


@kernel
def leap(displacement: float, moved: float, velocity: float, sine: float, cosine: float,
         model: Model) -> float:
    """Return a time [1] in which no wall can be reached, where the usual step crawls."""
    # A gear that leaves a wall very slowly while the force changes sign soon comes back by the
    # jerk, long before it could reach the other wall: the bound need not hold for longer.
    _, speed, pull, jerk, ahead, behind, horizon, jerk_bound, snap_bound = look_ahead(
        displacement, moved, velocity, sine, cosine, model.alpha, model.beta, model.gamma)
    longest = stop_ahead(speed, pull, jerk, ahead, horizon, jerk_bound, snap_bound)
    step = longest
    for _ in range(LEAP_TRIALS):
        step, returns = stop_behind(longest, speed, pull, jerk, behind, jerk_bound, snap_bound)
        if returns == 0.0 or 2.0 * step > longest:
            break
        # The bound goes as the inverse of its validity, or less.
        longest = square_root(step) * square_root(longest)
    return step


@inlined
def derivatives(towards: float, pull: float, sine: float, cosine: float, alpha: float,
                beta: float) -> tuple[float, ...]:
    """Return the fourth to eighth derivative of the way, and a bound of the 2nd and 8th."""
    signed = towards * alpha
    sine = signed * sine
    cosine = signed * cosine
    relax = pull + sine
    square = beta * beta
    relax_2 = square * relax
    relax_3 = beta * relax_2
    relax_4 = square * relax_2
    relax_5 = square * relax_3
    relax_6 = square * relax_4
    bend = alpha + choose(abs(relax_6) > abs(relax), abs(relax_6), abs(relax))
    return (sine + relax_2, cosine - relax_3, relax_4 - sine, -cosine - relax_5, sine + relax_6,
            bend)


@inlined
def aim(speed: float, pull: float, jerk: float, ahead: float, horizon: float, jerk_bound: float,
        towards: float, sine: float, cosine: float, alpha: float,
        beta: float) -> tuple[float, ...]:
    """Improve the time to the wall ahead: one Chebyshev step on Taylor's seventh order."""
    # Returns the time, its error there as a length, 1 by the speed there (-1 if the time is of no
    # use), and how long the velocity has to stay positive for it to be the first impact.
    s4, s5, s6, s7, _, bend = derivatives(towards, pull, sine, cosine, alpha, beta)
    x = horizon
    x2 = 0.5 * x
    x3 = (1.0 / 3.0) * x
    x4 = 0.25 * x
    x5 = 0.2 * x
    x6 = (1.0 / 6.0) * x
    way = x * (speed + x2 * (pull + x3 * (jerk + x4 * (
        s4 + x5 * (s5 + x6 * (s6 + (1.0 / 7.0) * x * s7))))))
    speed_there = speed + x * (pull + x2 * (jerk + x3 * (s4 + x4 * (s5 + x5 * (s6 + x6 * s7)))))
    acceleration = pull + x * (jerk + x2 * (s4 + x3 * (s5 + x4 * (s6 + x5 * s7))))
    inverse = 1.0 / speed_there
    newton = (way - ahead) * inverse
    bending = (0.5 * acceleration) * (inverse * newton)
    change = newton + newton * bending
    # The remainder. Up to NEAR the polynomial's third derivative is at most `bend` and the bound
    # of the jerk, its second 5/4 of `bend`.
    error = (newton * newton) * (
        1.25 * abs(acceleration * bending) + (0.57 * (bend + jerk_bound)) * abs(newton))
    slowness = choose((abs(bending) < 0.5) & (speed > 0.0), inverse, -1.0)
    return x - change, error, slowness, x + abs(change)


@inlined
def close_in(d: float, velocity: float, step: float, returns: float, aimed: float,
             aim_error: float, slowness: float, longest: float, speed: float, pull: float,
             jerk: float, jerk_bound: float, snap_bound: float, towards: float, sine: float,
             cosine: float, alpha: float, beta: float) -> tuple[float, float, bool, float, bool]:
    """Find the impact, or a longer certain step."""
    # Where the velocity certainly stays positive the zero is the first impact, and a time earlier
    # by more than all errors is a certain step. Returns the step, the wall it is towards, whether
    # it ends there, the velocity before the impact if so, and whether it crawls.
    s4, s5, s6, s7, s8, bend = derivatives(towards, pull, sine, cosine, alpha, beta)
    x = aimed
    impact_speed = speed + x * (pull + 0.5 * x * (jerk + (1.0 / 3.0) * x * (s4 + 0.25 * x * (
        s5 + 0.2 * x * (s6 + (1.0 / 6.0) * x * (s7 + (1.0 / 7.0) * x * s8))))))
    power = x * x
    power = power * power
    error = aim_error + bend * (power * power * (1.0 / 40320.0))
    margin = 2.0 * error * slowness
    # The velocity is at least ``u + f t - c t^2/2`` until then.
    c = (1.0 / 3.0) * snap_bound * longest - jerk
    c = choose(c < jerk_bound, c, jerk_bound)
    c = choose(c > 0.0, c, 0.0)
    certain = (
        (slowness > 0.0) & (longest < NEAR) & (x >= margin)
        & (speed + longest * (pull - 0.5 * c * longest) > 0.0)
        & (margin * (impact_speed - (1.25 * bend) * margin) >= error))
    ends = certain & (error < LAST_STEP_ERROR * impact_speed * (d + x))
    near = x - margin
    turns = returns != 0.0
    step = choose(certain & ((near > step) | turns), near, step)
    towards = choose(turns & (not certain), -towards, towards)
    before = choose(ends, impact_speed, towards * velocity)
    hits = ends | (d + step == d)
    return (choose(ends, x, step), towards, hits, towards * choose(before > 0.0, before, 0.0),
            (returns == CRAWLS) & (not certain) & (not hits))
