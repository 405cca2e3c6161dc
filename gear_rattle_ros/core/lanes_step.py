"""
One step of the search for impacts in every lane of a tile at once.

Written without a branch, so that LLVM turns the loops over the lanes into SIMD code; a lane whose
step ends at a wall goes through the impact in the same pass. No fused multiply-add and no
reordering is allowed, as in the scalar kernels, so the bits are the same on every machine and in
every lane.

A flight is evaluated by the formulas of `flight.displace`, bit for bit. The search is another one
than that of `flight.search_impact`, with the same guarantee: a step is taken only where no wall
can be reached. It needs 3.3 to 3.5 steps an impact instead of 4 to 4.7, and 3 square roots a step
instead of 7; found times differ by rounding, an ulp or two of the phase away from grazing.
"""

from typing import Final

import numpy as np

from .compiled import kernel
from .elementary import sine_cosine, sine_defect
from .flight import HORIZON_MAXIMUM, LAST_STEP_ERROR, later, LEG
from .lanes_simd import choose, inlined, prefer_wide_vectors, square_root
from .model import STICKING_SPEED

# Lanes of a tile: its rows fit the first-level cache, with chains enough to hide latencies.
LANES: Final = 96
# Shortest horizon of the search where the wall ahead is out of reach [1].
HORIZON_MINIMUM: Final = 0.3
# Longest time for which Taylor's polynomial is used [1].
NEAR: Final = 2.0

# One record is a tile; every field is a row of lanes. The flight of a lane began at `cycle`,
# `phase`, with `displacement` and `velocity`, and is known to be free up to `duration` after that.
TILE: Final = np.dtype(
    [
        # Where the flight began [1, rad, 1, 1] and the sine and cosine of that phase.
        ('cycle', np.int64, LANES),
        ('phase', np.float64, LANES),
        ('displacement', np.float64, LANES),
        ('velocity', np.float64, LANES),
        ('sine', np.float64, LANES),
        ('cosine', np.float64, LANES),
        ('alpha', np.float64, LANES),
        ('beta', np.float64, LANES),
        ('gamma', np.float64, LANES),
        ('restitution', np.float64, LANES),
        # Impacts still to be made; inf for no limit, 0 parks the lane.
        ('left', np.float64, LANES),
        # The search: how far it has come, and the motion there since the flight began.
        ('duration', np.float64, LANES),
        ('moved', np.float64, LANES),
        ('velocity_now', np.float64, LANES),
        ('sine_now', np.float64, LANES),
        ('cosine_now', np.float64, LANES),
        # Seen from the wall ahead (`towards` is +1 for the upper): speed, acceleration, jerk,
        # distances to both walls, a time of about that to the wall, the certain step.
        ('towards', np.float64, LANES),
        ('speed', np.float64, LANES),
        ('pull', np.float64, LANES),
        ('jerk', np.float64, LANES),
        ('ahead', np.float64, LANES),
        ('behind', np.float64, LANES),
        ('horizon', np.float64, LANES),
        ('step', np.float64, LANES),
        ('jerk_bound', np.float64, LANES),
        ('snap_bound', np.float64, LANES),
        ('returns', np.float64, LANES),
        # The time to that wall by Taylor's polynomial: its error there, 1 by the speed then, or
        # -1 if of no use, and how long the velocity has to stay positive.
        ('aimed', np.float64, LANES),
        ('aim_error', np.float64, LANES),
        ('slowness', np.float64, LANES),
        ('longest', np.float64, LANES),
        # After the step, on the way to the rows above. (A row that is loaded, selected and stored
        # to the same place makes a masked store, which stalls the next load.)
        ('next_step', np.float64, LANES),
        ('next_towards', np.float64, LANES),
        ('next_displacement', np.float64, LANES),
        ('next_velocity', np.float64, LANES),
        ('next_sine', np.float64, LANES),
        ('next_cosine', np.float64, LANES),
        ('sine_half', np.float64, LANES),
        ('cosine_half', np.float64, LANES),
        # Of the latest step: velocity before the impact, whether there was one, and whether the
        # lane needs the scalar path.
        ('impact_velocity', np.float64, LANES),
        ('has_hit', np.int64, LANES),
        ('is_special', np.int64, LANES),
        # Impacts of the latest `advance`; number of the start that the lane carries, EMPTY for
        # none; why it has ended.
        ('count', np.int64, LANES),
        ('start', np.int64, LANES),
        ('end', np.int64, LANES),
    ],
    align=True,
)


@inlined
def worst_jerk(jerk, jerk_bound, snap_bound, longest):  # type: ignore[no-untyped-def]
    """Bound c such that the third-order remainder is at most ``c t^3/6`` until `longest`."""
    c = jerk + snap_bound * longest * 0.25
    c = choose(c < jerk_bound, c, jerk_bound)
    return choose(c > 0.0, c, 0.0)


@inlined
def look_ahead(t, i):  # type: ignore[no-untyped-def]
    """Describe the flight of lane i as seen from the wall ahead, and how far that is about."""
    alpha = t.alpha[i]
    beta = t.beta[i]
    velocity = t.velocity_now[i]
    drive_cosine = alpha * t.cosine_now[i]
    relax = t.gamma[i] - beta * (velocity - drive_cosine)
    relax_1 = beta * relax
    bound_3 = alpha + abs(relax_1)
    rising = velocity > 0.0
    towards = choose(rising, 1.0, -1.0)
    u = abs(velocity)
    f = towards * (relax - alpha * t.sine_now[i])
    upper = -t.displacement[i] - t.moved[i]
    lower = 1.0 + t.displacement[i] + t.moved[i]
    upper = choose(upper > 0.0, upper, 0.0)
    lower = choose(lower > 0.0, lower, 0.0)
    ahead = choose(rising, upper, lower)
    # The time to the wall at constant acceleration.
    discriminant = u * u + 2.0 * f * ahead
    root = square_root(discriminant)
    moves = u > 0.0
    recedes = (discriminant < 0.0) | ((u <= 0.0) & (f <= 0.0))
    horizon = (choose(recedes, 2.5 * abs(f), choose(moves, 2.0 * ahead, root))
               / choose(recedes, bound_3, choose(moves, u + root, f)))
    horizon = choose(recedes & (not horizon > HORIZON_MINIMUM), HORIZON_MINIMUM, horizon)
    t.horizon[i] = choose(horizon < HORIZON_MAXIMUM, horizon, HORIZON_MAXIMUM)
    t.towards[i] = towards
    t.speed[i] = u
    t.pull[i] = f
    t.jerk[i] = towards * (-drive_cosine - relax_1)
    t.jerk_bound[i] = bound_3
    t.snap_bound[i] = alpha + abs(beta * relax_1)
    t.ahead[i] = ahead
    t.behind[i] = choose(rising, lower, upper)


@inlined
def stop_ahead(t, i):  # type: ignore[no-untyped-def]
    """
    Find how far lane i can certainly go as far as the wall ahead is concerned.

    Counted towards that wall, the displacement in time t is at most ``u t + f t^2/2 + c t^3/6``
    for ``t <= T``, with c the largest jerk until T; so at most ``u t + (f + c T/3) t^2/2``. Any T
    is valid; the time to the wall at constant acceleration is a good one.
    """
    u = t.speed[i]
    ahead = t.ahead[i]
    horizon = t.horizon[i]
    c = worst_jerk(t.jerk[i], t.jerk_bound[i], t.snap_bound[i], horizon)
    bent = t.pull[i] + c * horizon * (1.0 / 3.0)
    root = square_root(u * u + 2.0 * bent * ahead)
    moves = u > 0.0
    front = choose(moves, 2.0 * ahead, root) / choose(moves, u + root, bent)
    reaches = (moves | (bent > 0.0)) & (front < horizon)
    t.step[i] = choose(reaches, front, horizon)


@inlined
def stop_behind(t, i):  # type: ignore[no-untyped-def]
    """
    Shorten the step of lane i where the mass may come back to the wall behind.

    The bound of the way back, ``-u t - f t^2/2 + c t^3/6``, is greatest at an end of the stretch.
    """
    u = t.speed[i]
    f = t.pull[i]
    front = t.step[i]
    c = worst_jerk(-t.jerk[i], t.jerk_bound[i], t.snap_bound[i], front)
    q = c * front * (1.0 / 3.0) - f
    behind = t.behind[i]
    way = u + square_root(u * u + 2.0 * q * behind)
    bends = way * c < 3.0 * f * q
    back = choose(bends, 3.0 * f, way) / choose(bends, c, q)
    returns = (front * (0.5 * q * front - u) > behind) & (back < front)
    t.step[i] = choose(returns, back, front)
    t.returns[i] = choose(returns, 1.0, 0.0)


@inlined
def derivatives(t, i):  # type: ignore[no-untyped-def]
    """
    Derive the displacement of lane i towards the wall ahead, from the fourth to the eighth time.

    The last result bounds the second and the eighth derivative from now on.
    """
    beta = t.beta[i]
    alpha = t.alpha[i]
    signed = t.towards[i] * alpha
    sine = signed * t.sine_now[i]
    cosine = signed * t.cosine_now[i]
    relax = t.pull[i] + sine
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
def aim(t, i):  # type: ignore[no-untyped-def]
    """
    Improve the time to the wall ahead, by Taylor's polynomial of the seventh order.

    One step of Chebyshev's method: Newton's with the acceleration taken in.
    """
    u = t.speed[i]
    f = t.pull[i]
    j = t.jerk[i]
    s4, s5, s6, s7, _, bend = derivatives(t, i)
    x = t.horizon[i]
    x2 = 0.5 * x
    x3 = (1.0 / 3.0) * x
    x4 = 0.25 * x
    x5 = 0.2 * x
    x6 = (1.0 / 6.0) * x
    way = x * (u + x2 * (f + x3 * (j + x4 * (s4 + x5 * (s5 + x6 * (s6 + (1.0 / 7.0) * x * s7))))))
    speed = u + x * (f + x2 * (j + x3 * (s4 + x4 * (s5 + x5 * (s6 + x6 * s7)))))
    acceleration = f + x * (j + x2 * (s4 + x3 * (s5 + x4 * (s6 + x5 * s7))))
    inverse = 1.0 / speed
    newton = (way - t.ahead[i]) * inverse
    bending = (0.5 * acceleration) * (inverse * newton)
    change = newton + newton * bending
    t.aimed[i] = x - change
    # The remainder. Up to NEAR the polynomial's third derivative is at most `bend` and the bound
    # of the jerk, its second 5/4 of `bend`.
    t.aim_error[i] = (newton * newton) * (
        1.25 * abs(acceleration * bending)
        + (0.57 * (bend + t.jerk_bound[i])) * abs(newton))
    t.slowness[i] = choose((abs(bending) < 0.5) & (u > 0.0), inverse, -1.0)
    t.longest[i] = x + abs(change)


@inlined
def close_in(t, i):  # type: ignore[no-untyped-def]
    """
    Find the impact of lane i, or a longer step than that known.

    Where the velocity certainly stays positive the zero is the first impact, and less than it by
    more than all errors is a certain step.
    """
    u = t.speed[i]
    f = t.pull[i]
    j = t.jerk[i]
    s4, s5, s6, s7, s8, bend = derivatives(t, i)
    x = t.aimed[i]
    impact_speed = u + x * (f + 0.5 * x * (j + (1.0 / 3.0) * x * (s4 + 0.25 * x * (
        s5 + 0.2 * x * (s6 + (1.0 / 6.0) * x * (s7 + (1.0 / 7.0) * x * s8))))))
    power = x * x
    power = power * power
    error = t.aim_error[i] + bend * (power * power * (1.0 / 40320.0))
    slowness = t.slowness[i]
    margin = 2.0 * error * slowness
    # The velocity is at least ``u + f t - c t^2/2`` until then.
    longest = t.longest[i]
    jerk_bound = t.jerk_bound[i]
    c = (1.0 / 3.0) * t.snap_bound[i] * longest - j
    c = choose(c < jerk_bound, c, jerk_bound)
    c = choose(c > 0.0, c, 0.0)
    certain = (
        (slowness > 0.0) & (longest < NEAR) & (x >= margin)
        & (u + longest * (f - 0.5 * c * longest) > 0.0)
        & (margin * (impact_speed - (1.25 * bend) * margin) >= error))
    d = t.duration[i]
    ends = certain & (error < LAST_STEP_ERROR * impact_speed * (d + x))
    near = x - margin
    step = t.step[i]
    returns = t.returns[i] != 0.0
    step = choose(certain & ((near > step) | returns), near, step)
    towards = choose(returns & (not certain), -t.towards[i], t.towards[i])
    before = choose(ends, impact_speed, towards * t.velocity_now[i])
    is_active = t.left[i] > 0.0
    hits = (ends | (d + step == d)) & is_active
    t.next_step[i] = choose(is_active, choose(ends, x, step), 0.0)
    t.next_towards[i] = towards
    t.has_hit[i] = hits
    t.impact_velocity[i] = towards * choose(before > 0.0, before, 0.0)


@inlined
def strike(t, i):  # type: ignore[no-untyped-def]
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
def turn(t, i):  # type: ignore[no-untyped-def]
    """Take the sine and cosine of the phase of a flight that begins, or of half its duration."""
    d = t.duration[i]
    begins = d == 0.0
    sine, cosine = sine_cosine(choose(begins, t.phase[i], 0.5 * d))
    t.next_sine[i] = choose(begins, sine, t.sine[i])
    t.next_cosine[i] = choose(begins, cosine, t.cosine[i])
    t.sine_half[i] = choose(begins, 0.0, sine)
    t.cosine_half[i] = choose(begins, 1.0, cosine)


@inlined
def fly(t, i):  # type: ignore[no-untyped-def]
    """
    Evaluate the flight of lane i, as `flight.displace` for ``beta d < 1``.

    Returns 1 where the scalar path has to look at the lane.
    """
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
    y = x * x
    second = (
        1.0 / 2 + y * (1.0 / 24 + y * (1.0 / 720 + y * (1.0 / 40320 + y * (
            1.0 / 3628800 + y * (1.0 / 479001600 + y * (1.0 / 87178291200 + y * (
                1.0 / 20922789888000)))))))
        - x * (1.0 / 6 + y * (1.0 / 120 + y * (1.0 / 5040 + y * (1.0 / 362880 + y * (
            1.0 / 39916800 + y * (1.0 / 6227020800 + y * (1.0 / 1307674368000 + y * (
                1.0 / 355687428096000))))))))
    )
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
               | ((t.left[i] > 0.0) & ((x >= 1.0) | (d >= LEG))))
    t.is_special[i] = special
    return np.int64(special)


@kernel
def step(t):  # type: ignore[no-untyped-def]
    """
    Take every lane of a tile one step forward, through an impact where there is one.

    Parameters
    ----------
    t : TILE record
        Changed in place.

    Returns
    -------
    int
        How many lanes need the scalar path.

    """
    prefer_wide_vectors()
    # Short loops: the processor then works on several lanes' chains of operations at once.
    for i in range(LANES):
        look_ahead(t, i)
    for i in range(LANES):
        stop_ahead(t, i)
        aim(t, i)
    for i in range(LANES):
        stop_behind(t, i)
    for i in range(LANES):
        close_in(t, i)
    for i in range(LANES):
        strike(t, i)
    for i in range(LANES):
        turn(t, i)
    special = 0
    for i in range(LANES):
        special += fly(t, i)
    return special
