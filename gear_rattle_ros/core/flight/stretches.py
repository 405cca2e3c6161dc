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
The short way to the first impact: one evaluation of the flight.

``exp(beta t) v`` is monotone between zeros of the force ``a(tau, 0)``. Where sine and cosine at
those zeros are known, the state there takes hardly more than an exponential. So the stretches from
zero to zero are looked at first: in one whose ends lie between the walls a wall can only be
reached at the one turn there may be, and one whose end lies beyond a wall brackets the impact. A
polynomial through its ends tells where, one evaluation of the flight next to it gives the digits.
doc/steps.md has the proofs. Nothing here has branches, for the lanes; where a bound does not
decide, the search of `advancement` takes over.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from .closed_form import acceleration, displace, later
from .elementary import arctangent, relaxation, SERIES_MAXIMUM, sine_cosine, TWO_PI
from .lanes_simd import choose, inlined
from ..compiled import kernel
from ..model import Model

# (exp(-x) - 1 + x)/x^2 for x in [0, 1], interpolated at the zeros of Chebyshev's polynomial: to
# 8.8e-9.
SHORT_SERIES: Final = (0.4999999912630972, -0.16666603660680485, 0.04165925535933733,
                       -0.00830117044582246, 0.0013248179642864888, -0.00013742419086074865)
# By the scale of the motion: far more than the error of a state at the end of a stretch.
BLUR: Final = 1e-5
# Largest ``beta h`` of a stretch.
DECAY_MAXIMUM: Final = 2.0
# Hermite's remainder, (x (1 - x))^4/8!, and that of its derivative, x^3 (1 - x)^3/7!.
REMAINDER: Final = 1.0 / (256.0 * 40320.0)
REMAINDER_1: Final = 1.0 / (64.0 * 5040.0)
# A stretch is taken for one that meets the wall ahead before it turns where the distance is this
# part of the way to the turn under a force that grows evenly.
STRIKES: Final = 0.95
# Most stretches that are looked at after the second.
ROUNDS: Final = 4
# How far from the turn of the polynomial that of the flight may be, by the stretch.
ASIDE: Final = 0.05
# Relative error of the time of an impact.
LAST_ERROR: Final = 1e-16
# Farthest from the impact that the flight may be evaluated, by 1 + beta [1].
NEAREST: Final = 0.05
# Verdicts on a flight: no impact as far as it is known; one is bracketed; it may meet a wall where
# it turns; the next stretch has to be looked at.
OPEN: Final = 0.0
BRACKETED: Final = 1.0
TURNS: Final = 2.0
FURTHER: Final = 3.0


class Stretches(NamedTuple):
    """The zeros of the force, or two opposite phases, and free motion from each to the other."""

    fall: float  # Phase [rad] at which the force falls through zero,
    fall_sine: float  # alpha times its sine and cosine.
    fall_cosine: float
    rise: float  # The same where it rises.
    rise_sine: float
    rise_cosine: float
    # From the fall to the rise: E, B, gamma B and gamma C of `relaxation`; then back.
    low_decay: float
    low_integral: float
    low_gain: float
    low_drift: float
    high_decay: float
    high_integral: float
    high_gain: float
    high_drift: float
    # Largest magnitude of the force before the rise, and before the fall [1].
    low_force: float
    high_force: float
    # In the first third of those stretches the force grows at least so fast [1].
    low_growth: float
    high_growth: float
    # 1 where this may be used, else 0.
    use: float


@kernel
def growth_from(phase: float, h: float, model: Model) -> float:
    """Bound from below, in the first third of a stretch, the force by the time since its zero."""
    if abs(model.gamma) >= model.alpha * math.sqrt(1.0 + model.beta * model.beta):
        return 0.0
    third = h / 3.0
    sine, cosine = sine_cosine(phase)
    slope = abs(model.alpha * (cosine + model.beta * sine))
    sine, cosine = sine_cosine(later(phase, third)[1])
    force = abs(acceleration(sine, cosine, 0.0, model)) / third
    return (1.0 - 1e-9) * min(slope, force)


@kernel
def stretches_of(model: Model) -> Stretches:
    """Find the zeros of the force and the motion between them."""
    alpha, beta, gamma, _ = model
    amplitude = alpha * math.sqrt(1.0 + beta * beta)
    lag = arctangent(beta)
    low_force = amplitude - gamma
    high_force = amplitude + gamma
    if abs(gamma) < amplitude:
        angle = arctangent(gamma / (math.sqrt(low_force) * math.sqrt(high_force)))
        rise = (lag + (math.pi - angle)) % TWO_PI
    else:
        # Any two phases will do.
        low_force = high_force = amplitude + abs(gamma)
        angle = 0.5 * math.pi
        rise = (lag - angle) % TWO_PI
    fall = (lag + angle) % TWO_PI
    fall_sine, fall_cosine = sine_cosine(fall)
    rise_sine, rise_cosine = sine_cosine(rise)
    low = rise - fall if rise > fall else rise - fall + TWO_PI
    decay, integral, second = relaxation(low, beta)
    high_decay, high_integral, high_second = relaxation(TWO_PI - low, beta)
    return Stretches(
        fall, alpha * fall_sine, alpha * fall_cosine, rise, alpha * rise_sine, alpha * rise_cosine,
        decay, integral, gamma * integral, gamma * second,
        high_decay, high_integral, gamma * high_integral, gamma * high_second,
        low_force, high_force, growth_from(fall, low, model),
        growth_from(rise, TWO_PI - low, model),
        1.0 if beta * max(low, TWO_PI - low) < DECAY_MAXIMUM else 0.0)


@inlined
def ratio(x: float, y: float) -> float:
    """Divide to seven digits, in half the time."""
    return np.float64(np.float32(x) / np.float32(y))


@inlined
def examine(s_a: float, v_a: float, s_b: float, v_b: float, h: float, decay: float, force: float,
            beta: float, blur: float, growth: float, from_zero: bool) -> tuple[float, float]:
    """Look at a stretch: return the verdict, FURTHER if it is safe, and the wall of that."""
    rising = v_a > 0.0
    speed = abs(v_a)
    last = abs(v_b)
    # Distances from the upper wall, and from the lower.
    lower_a = 1.0 + s_a
    lower_b = 1.0 + s_b
    ahead = choose(rising, -s_a, lower_a)
    left = choose(rising, -s_b, lower_b)
    room = choose(-s_b < lower_b, -s_b, lower_b)
    at_upper = -s_b < lower_b
    # With f/2 the largest acceleration: before a turn, the way is at most ``u t - u^2/f``, after
    # it, ``w/E t' - w^2/f``; the difference of both ways is known, and t + t' = h.
    f = 2.0 * (force + beta * speed)
    most = speed * (f * (last * h + decay * (ahead - left)) - last * (speed + decay * last))
    # Or under a force that grows at least evenly, if it turns within a third of the stretch.
    away = ahead - blur
    good = ((v_a * v_b > 0.0) | (most < (f * (speed * decay + last)) * away)
            | (from_zero & (speed * (speed * speed) < ((9.0 / 8.0) * growth) * (away * away))
               & (18.0 * speed < growth * (h * h)) & (away > 0.0)))
    sharp = last > blur
    sure = good & sharp
    meets = (room < -blur) & (sure | (rising == at_upper))
    safe = (room > blur) & sure
    other = choose(safe, FURTHER, choose(sharp & (not good), TURNS, OPEN))
    return (choose(meets, BRACKETED, other),
            choose(meets, choose(at_upper, 1.0, -1.0), choose(rising, 1.0, -1.0)))


@inlined
def relax_short(d: float, beta: float) -> tuple[float, float, float]:
    """Do as `relaxation` to eight digits, for ``beta d < 2``."""
    half = 0.5 * d
    x = beta * half
    y = x * x
    second = (SHORT_SERIES[0] + y * (SHORT_SERIES[2] + y * SHORT_SERIES[4])
              + x * (SHORT_SERIES[1] + y * (SHORT_SERIES[3] + y * SHORT_SERIES[5])))
    first = 1.0 - x * second
    decay = 1.0 - x * first
    integral = half * first
    # Twice the time.
    return (decay * decay, integral + integral * decay,
            2.0 * (half * half * second) + integral * integral)


@inlined
def look_first(phase: float, sine: float, cosine: float, displacement: float, velocity: float,
               alpha: float, beta: float, gamma: float,
               stretches: Stretches) -> tuple[float, ...]:
    """Look at the first stretch of a flight, from its beginning to a zero of the force."""
    # Returns verdict and wall, 1 where it ends at the fall, else 0, its length and that of the
    # next, the state at its end, bounds of the derivatives from the second on and of the eighth,
    # and the blur.
    z = stretches
    drive_cosine = alpha * cosine
    free = velocity - drive_cosine
    load = abs(gamma)
    relax = abs(gamma - beta * free)
    blur = BLUR * (abs(free) + (alpha + (3.0 * TWO_PI) * load))
    to_fall = z.fall - phase
    to_rise = z.rise - phase
    to_fall = choose(to_fall < 0.0, to_fall + TWO_PI, to_fall)
    to_rise = choose(to_rise < 0.0, to_rise + TWO_PI, to_rise)
    falls = to_fall < to_rise
    d = choose(falls, to_fall, to_rise)
    following = abs(to_fall - to_rise)
    decay, integral, second = relax_short(d, beta)
    v_b = (free * decay + gamma * integral) + choose(falls, z.fall_cosine, z.rise_cosine)
    s_b = ((displacement - alpha * sine) + (free * integral + gamma * second)) + choose(
        falls, z.fall_sine, z.rise_sine)
    verdict, wall = examine(displacement, velocity, s_b, v_b, d, decay,
                            choose(falls, z.high_force, z.low_force), beta, blur, 0.0, False)
    # Derivatives of the drive, and of the rest with beta^6 as DECAY_MAXIMUM allows.
    return (verdict, wall, choose(falls, 1.0, 0.0), d, following, s_b, v_b, alpha + relax,
            alpha + 0.07 * relax, blur)


@inlined
def look_on(at_fall: float, h: float, s_a: float, v_a: float, blur: float, beta: float,
            stretches: Stretches) -> tuple[float, ...]:
    """Look at a stretch that begins at a zero: return verdict, wall and the state at its end."""
    z = stretches
    falls = at_fall > 0.0
    free = v_a - choose(falls, z.fall_cosine, z.rise_cosine)
    centre = s_a - choose(falls, z.fall_sine, z.rise_sine)
    decay = choose(falls, z.low_decay, z.high_decay)
    v_b = (free * decay + choose(falls, z.low_gain, z.high_gain)) + choose(
        falls, z.rise_cosine, z.fall_cosine)
    s_b = (centre + (free * choose(falls, z.low_integral, z.high_integral)
                     + choose(falls, z.low_drift, z.high_drift))) + choose(
                         falls, z.rise_sine, z.fall_sine)
    verdict, wall = examine(
        s_a, v_a, s_b, v_b, h, decay, choose(falls, z.low_force, z.high_force), beta, blur,
        choose(falls, z.low_growth, z.high_growth), True)
    return verdict, wall, s_b, v_b


@inlined
def zero_of(at_fall: float, stretches: Stretches) -> tuple[float, float]:
    """Return alpha times sine and cosine at a zero."""
    return (choose(at_fall > 0.0, stretches.fall_sine, stretches.rise_sine),
            choose(at_fall > 0.0, stretches.fall_cosine, stretches.rise_cosine))


@inlined
def is_strike(s_a: float, v_a: float, c_1: float, c_3: float) -> bool:
    """Guess whether the wall ahead is met before the turn of a stretch that begins at a zero."""
    ahead = choose(v_a > 0.0, -s_a, 1.0 + s_a)
    return ((27.0 * abs(c_3)) * (ahead * ahead)
            < (4.0 * STRIKES * STRIKES) * (abs(c_1) * (c_1 * c_1)))


@inlined
def interpolate(h: float, s_a: float, v_a: float, sine_a: float, cosine_a: float, s_b: float,
                v_b: float, sine_b: float, cosine_b: float, beta: float,
                gamma: float) -> tuple[float, ...]:
    """Return coefficients 1 to 7 of Hermite's polynomial, time by h, and half its bend at 1."""
    # Of displacement, velocity, acceleration, jerk; sines and cosines are by alpha.
    a_a = (gamma - sine_a) + beta * (cosine_a - v_a)
    a_b = (gamma - sine_b) + beta * (cosine_b - v_b)
    half = (0.5 * h) * h
    third = ((1.0 / 3.0) * h) * half
    c_1 = h * v_a
    c_2 = half * a_a
    c_3 = -third * (cosine_a + beta * (sine_a + a_a))
    last = half * a_b
    # The rest is x^4 times a cubic, here about x = 1.
    c_23 = c_2 + c_3
    c_33 = c_23 + 2.0 * c_3
    r_0 = (s_b - s_a) - (c_1 + c_23)
    r_1 = (h * v_b - c_1) - (c_2 + c_33)
    r_2 = last - c_33
    r_3 = -third * (cosine_b + beta * (sine_b + a_b)) - c_3
    q_1 = r_1 - 4.0 * r_0
    q_2 = r_2 - 4.0 * q_1 - 6.0 * r_0
    q_3 = r_3 - 4.0 * q_2 - 6.0 * q_1 - 4.0 * r_0
    rest = q_2 - 3.0 * q_3
    return c_1, c_2, c_3, r_0 - q_1 + (q_2 - q_3), q_1 - q_2 - rest, rest, q_3, last


@inlined
def slope_at(x: float, c_1: float, c_2: float, c_3: float, c_4: float, c_5: float, c_6: float,
             c_7: float) -> float:
    """Return the first derivative of the polynomial."""
    return c_1 + x * (2.0 * c_2 + x * (3.0 * c_3 + x * (4.0 * c_4 + x * (
        5.0 * c_5 + x * (6.0 * c_6 + x * (7.0 * c_7))))))


@inlined
def turn_over(wall: float, h: float, c_0: float, c_1: float, c_2: float, c_3: float,
              c_4: float, c_5: float, c_6: float, c_7: float, s_b: float, v_b: float,
              snap: float, blur: float) -> tuple[float, ...]:
    """Decide a stretch that may meet the wall ahead where it turns."""
    # Returns verdict, wall, and the part [low, high] of the stretch in which the impact is.
    first = abs(c_1)
    x = ratio(first, first + h * abs(v_b))
    for _ in range(2):
        f_0 = slope_at(x, c_1, c_2, c_3, c_4, c_5, c_6, c_7)
        f_1 = 2.0 * c_2 + x * (6.0 * c_3 + x * (12.0 * c_4 + x * (
            20.0 * c_5 + x * (30.0 * c_6 + x * (42.0 * c_7)))))
        half = 3.0 * c_3 + x * (12.0 * c_4 + x * (30.0 * c_5 + x * (
            60.0 * c_6 + x * (105.0 * c_7))))
        x = x - ratio(f_0 * f_1, f_1 * f_1 - f_0 * half)
    within = (x > 0.0) & (x < 1.0)
    x = choose(within, x, 0.5)
    way = x * (c_1 + x * (c_2 + x * (c_3 + x * (c_4 + x * (c_5 + x * (c_6 + x * c_7))))))
    speed = slope_at(x, c_1, c_2, c_3, c_4, c_5, c_6, c_7)
    early = choose(x > ASIDE, x - ASIDE, 0.0)
    late = choose(x < 1.0 - ASIDE, x + ASIDE, 1.0)
    before = wall * slope_at(early, c_1, c_2, c_3, c_4, c_5, c_6, c_7)
    after = wall * slope_at(late, c_1, c_2, c_3, c_4, c_5, c_6, c_7)
    square = h * h
    square = square * square
    snap = snap * (square * square)
    blur = blur * (1.0 + h)
    unsure = snap * REMAINDER_1 + blur
    error = snap * REMAINDER + blur
    reached = wall * way
    most = reached + error + (2.0 * ASIDE) * (abs(speed) + unsure)
    rising = wall > 0.0
    lower = 1.0 + s_b
    ahead = choose(rising, -c_0, 1.0 + c_0)
    beyond = choose(rising, -lower, s_b)
    strikes = within & (reached - error > ahead)
    passes = within & (before > unsure) & (after < -unsure) & (most < ahead)
    returns = passes & (beyond > blur)
    clears = passes & (beyond < -blur)
    return (choose(strikes | returns, BRACKETED, choose(clears, FURTHER, OPEN)),
            choose(returns, -wall, wall), choose(returns, x, 0.0), choose(strikes, x, 1.0))


@inlined
def guess(wall: float, h: float, low: float, high: float, c_0: float, c_1: float, c_2: float,
          c_3: float, c_4: float, c_5: float, c_6: float, c_7: float, s_b: float, v_b: float,
          last: float) -> tuple[float, ...]:
    """Return roughly where in a stretch [0, 1] the polynomial meets the wall: Halley's method."""
    # Returns the coefficients of the distance, too: by x where the gear leaves the wall.
    rising = wall > 0.0
    z_a = choose(rising, c_0, 1.0 + c_0)
    z_b = choose(rising, s_b, 1.0 + s_b)
    slope_b = h * v_b
    leaves = z_a == 0.0
    a_0 = choose(leaves, c_1, z_a)
    a_1 = choose(leaves, c_2, c_1)
    a_2 = choose(leaves, c_3, c_2)
    # From the end against the force, else from the beginning.
    convex = (wall * slope_b > 0.0) & (wall * (z_b - z_a - c_1) > 0.0) & (not leaves)
    f_0 = choose(convex, z_b, a_0)
    f_1 = choose(convex, slope_b, a_1)
    half = choose(convex, last, a_2)
    x = choose(convex, 1.0, 0.0) - ratio(f_0 * f_1, f_1 * f_1 - f_0 * half)
    x = choose((x > low) & (x < high), x, choose(leaves, high, 0.5 * (low + high)))
    return (x, a_0, a_1, a_2, choose(leaves, c_4, c_3), choose(leaves, c_5, c_4),
            choose(leaves, c_6, c_5), choose(leaves, c_7, c_6), choose(leaves, 0.0, c_7))


@inlined
def improve(x: float, low: float, high: float, a_0: float, a_1: float, a_2: float, a_3: float,
            a_4: float, a_5: float, a_6: float, a_7: float) -> float:
    """Go nearer to a zero of a polynomial by a step of Halley's method."""
    y = x * x
    z = y * y
    f_0 = ((a_0 + x * a_1) + y * (a_2 + x * a_3)) + z * ((a_4 + x * a_5) + y * (a_6 + x * a_7))
    f_1 = ((a_1 + x * (2.0 * a_2)) + y * (3.0 * a_3 + x * (4.0 * a_4))) + z * (
        (5.0 * a_5 + x * (6.0 * a_6)) + y * (7.0 * a_7))
    half = ((a_2 + x * (3.0 * a_3)) + y * (6.0 * a_4 + x * (10.0 * a_5))) + z * (
        15.0 * a_6 + x * (21.0 * a_7))
    x = x - ratio(f_0 * f_1, f_1 * f_1 - f_0 * half)
    x = choose(x > low, x, low)
    return choose(x < high, x, high)


@inlined
def draw_near(wall: float, displacement: float, moved: float, velocity: float, sine: float,
              cosine: float, alpha: float, beta: float, gamma: float) -> tuple[float, ...]:
    """Go from an evaluation of the flight to the impact by three terms of the series, reversed."""
    # Returns the time, 1 by the speed, the distance, speed, acceleration and jerk.
    drive = wall * alpha
    drive_cosine = drive * cosine
    speed = wall * velocity
    ahead = choose(wall > 0.0, -displacement - moved, 1.0 + displacement + moved)
    relax = wall * gamma - beta * (speed - drive_cosine)
    pull = relax - drive * sine
    jerk = -drive_cosine - beta * relax
    inverse = ratio(1.0, speed)
    y = ahead * inverse
    q = pull * inverse
    x = y - (0.5 * (y * y)) * (q - y * (q * q - (1.0 / 3.0) * (jerk * inverse)))
    return x, inverse, ahead, speed, pull, jerk


@inlined
def finish(d: float, x: float, inverse: float, ahead: float, speed: float, pull: float,
           jerk: float, since: float, until: float, wall: float, sine: float, cosine: float,
           alpha: float, beta: float, bend: float) -> tuple[float, float, bool, bool]:
    """Go to the impact by one step of Newton's method on six terms, if its error is small."""
    # Returns the time, the speed, whether it is the impact, and else, whether it is worth another
    # evaluation.
    drive = wall * alpha
    drive_sine = drive * sine
    relax = (beta * beta) * (pull + drive_sine)
    s4 = drive_sine + relax
    relax = beta * relax
    s5 = drive * cosine - relax
    s6 = beta * relax - drive_sine
    x2 = 0.5 * x
    x3 = (1.0 / 3.0) * x
    x4 = 0.25 * x
    x5 = 0.2 * x
    way = x * (speed + x2 * (pull + x3 * (jerk + x4 * (s4 + x5 * (s5 + (1.0 / 6.0) * x * s6)))))
    speed_there = speed + x * (pull + x2 * (jerk + x3 * (s4 + x4 * (s5 + x5 * s6))))
    # 1 by that speed, from 1 by the other: its error is the fourth power.
    e = 1.0 - speed_there * inverse
    e2 = e * e
    slowness = inverse * ((1.0 + e) * (1.0 + e2))
    miss = way - ahead
    newton = miss * slowness
    time = x - newton
    impact_speed = speed_there - newton * (pull + x * (jerk + x2 * s4))
    total = d + time
    power = time * time
    power = power * power * power
    error = bend * (newton * newton + 0.00025 * (abs(time) * power)) + abs(miss) * (e2 * e2)
    within = (total > since) & (total < until) & (speed > 0.0)
    ends = (((abs(x) + abs(newton)) * (1.0 + beta) < NEAREST)
            & (error < LAST_ERROR * (impact_speed * total))
            & ((8.0 * bend) * error < impact_speed * impact_speed) & within)
    return total, impact_speed, ends, within


@kernel
def short_way(phase: float, sin_p: float, cos_p: float, s0: float, v0: float, model: Model,
              stretches: Stretches) -> tuple[bool, float, float]:
    """Return whether an impact was found; its time and velocity, or the time that is free [1]."""
    alpha, beta, gamma, _ = model
    verdict, wall, at_fall, h, following, s_b, v_b, bend, snap, blur = look_first(
        phase, sin_p, cos_p, s0, v0, alpha, beta, gamma, stretches)
    since, s_a, v_a = 0.0, s0, v0
    sine_a, cosine_a = alpha * sin_p, alpha * cos_p
    low, high = 0.0, 1.0
    if verdict == FURTHER:
        since, h, following = h, following, TWO_PI - following
        s_a, v_a = s_b, v_b
        sine_a, cosine_a = zero_of(at_fall, stretches)
        verdict, wall, s_b, v_b = look_on(at_fall, h, s_a, v_a, blur, beta, stretches)
        at_fall = 1.0 - at_fall
    for n in range(ROUNDS + 1):
        sine_b, cosine_b = zero_of(at_fall, stretches)
        c_1, c_2, c_3, c_4, c_5, c_6, c_7, last = interpolate(
            h, s_a, v_a, sine_a, cosine_a, s_b, v_b, sine_b, cosine_b, beta, gamma)
        if verdict == TURNS and since > 0.0 and is_strike(s_a, v_a, c_1, c_3):
            verdict = BRACKETED
        if n == ROUNDS:
            break
        if verdict == TURNS:
            verdict, wall, low, high = turn_over(
                wall, h, s_a, c_1, c_2, c_3, c_4, c_5, c_6, c_7, s_b, v_b, snap, blur)
        if verdict != FURTHER:
            break
        since, h, following = since + h, following, TWO_PI - following
        s_a, v_a, sine_a, cosine_a = s_b, v_b, sine_b, cosine_b
        verdict, wall, s_b, v_b = look_on(at_fall, h, s_a, v_a, blur, beta, stretches)
        at_fall = 1.0 - at_fall
    if verdict != BRACKETED:
        return False, since + h if verdict == FURTHER else since, 0.0
    x, a_0, a_1, a_2, a_3, a_4, a_5, a_6, a_7 = guess(
        wall, h, low, high, s_a, c_1, c_2, c_3, c_4, c_5, c_6, c_7, s_b, v_b, last)
    x = improve(x, low, high, a_0, a_1, a_2, a_3, a_4, a_5, a_6, a_7)
    x = improve(x, low, high, a_0, a_1, a_2, a_3, a_4, a_5, a_6, a_7)
    d = since + h * x
    for _ in range(2):
        if not beta * d < SERIES_MAXIMUM:
            break
        moved, velocity, sine, cosine = displace(d, sin_p, cos_p, v0, model)
        nearer, inverse, ahead, speed, pull, jerk = draw_near(
            wall, s0, moved, velocity, sine, cosine, alpha, beta, gamma)
        total, speed, ends, again = finish(
            d, nearer, inverse, ahead, speed, pull, jerk, since, since + h, wall, sine, cosine,
            alpha, beta, bend)
        if ends:
            return True, total, wall * speed
        if not again:
            break
        d = total
    return False, since, 0.0
