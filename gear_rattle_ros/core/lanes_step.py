"""
One step of the search for impacts in every lane of a tile at once.

The same formulas as `flight.search_impact`, written without a branch so that LLVM turns the loop
over the lanes into SIMD code; the results have the same bits. A step is taken in two parts,
`bound` (square roots and divisions) and `move` (polynomials); one loop bounds one half of the
tile and moves the other, which keeps the divider and the multipliers busy together.
"""

from typing import Any, Final

from llvmlite import ir
import numba
from numba import types
import numba.extending
import numpy as np

from .compiled import kernel
from .elementary import sine_cosine, sine_defect
from .flight import HORIZON_MAXIMUM, LAST_STEP_ERROR, later, LEG
from .model import STICKING_SPEED

# Lanes of a tile: its rows fit the first-level cache, with chains enough to hide latencies.
LANES: Final = 64
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
        ('returns', np.float64, LANES),
        ('aimed', np.float64, LANES),
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

# Both untyped in numba.
intrinsic: Any = numba.extending.intrinsic
inlined: Any = numba.njit(error_model='numpy', nogil=True, forceinline=True)


@intrinsic  # type: ignore[untyped-decorator]
def choose(_context: Any, condition: Any, yes: Any, no: Any) -> Any:
    """Select one of two floats without a branch, which LLVM would thread through the body."""
    def code(_target: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.select(*arguments)

    return types.float64(types.boolean, types.float64, types.float64), code


@intrinsic  # type: ignore[untyped-decorator]
def square_root(_context: Any, x: Any) -> Any:
    """Take a square root by instruction: `math.sqrt` calls libm, which does not vectorise."""
    def code(_target: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.call(
            builder.module.declare_intrinsic('llvm.sqrt', [ir.DoubleType()]), arguments)

    return types.float64(types.float64), code


@intrinsic  # type: ignore[untyped-decorator]
def prefer_wide_vectors(_context: Any) -> Any:
    """
    Let LLVM use 512-bit vectors in the calling function, where the processor has them.

    LLVM prefers 256 bits on many Intel processors. This is what clang's
    `-mprefer-vector-width=512` sets: a function attribute, so nothing else in the process is
    touched. llvmlite knows no attribute with a value; the text is put into its set as it is.
    """
    def code(context: Any, builder: Any, _signature: Any, _arguments: Any) -> Any:
        set.add(builder.function.attributes, '"prefer-vector-width"="512"')
        return context.get_dummy_value()

    return types.void(), code


@inlined
def look_ahead(t, i):  # type: ignore[no-untyped-def]
    """
    Find how far lane i can certainly go as far as the wall ahead is concerned.

    Counted towards that wall, the displacement in time t is at most ``u t + f t^2/2 + c t^3/6``
    for ``t <= T``, with c the largest jerk until T; so at most ``u t + (f + c T/3) t^2/2``.
    """
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
    j = towards * (-drive_cosine - relax_1)
    upper = -t.displacement[i] - t.moved[i]
    lower = 1.0 + t.displacement[i] + t.moved[i]
    upper = choose(upper > 0.0, upper, 0.0)
    lower = choose(lower > 0.0, lower, 0.0)
    ahead = choose(rising, upper, lower)
    # T is the time to the wall at constant acceleration; any other would be valid too.
    discriminant = u * u + 2.0 * f * ahead
    root = square_root(discriminant)
    moves = u > 0.0
    recedes = (discriminant < 0.0) | ((u <= 0.0) & (f <= 0.0))
    horizon = (choose(recedes, 2.5 * abs(f), choose(moves, 2.0 * ahead, root))
               / choose(recedes, bound_3, choose(moves, u + root, f)))
    horizon = choose(recedes & (not horizon > HORIZON_MINIMUM), HORIZON_MINIMUM, horizon)
    horizon = choose(horizon < HORIZON_MAXIMUM, horizon, HORIZON_MAXIMUM)
    c = j + (alpha + abs(beta * relax_1)) * horizon * 0.25
    c = choose(c < bound_3, c, bound_3)
    c = choose(c > 0.0, c, 0.0)
    bent = f + c * horizon * (1.0 / 3.0)
    discriminant = u * u + 2.0 * bent * ahead
    root = square_root(discriminant)
    front = choose(moves, 2.0 * ahead, root) / choose(moves, u + root, bent)
    reaches = (moves | (bent > 0.0)) & (front < horizon)
    t.step[i] = choose(reaches, front, horizon)
    t.horizon[i] = horizon
    t.towards[i] = towards
    t.speed[i] = u
    t.pull[i] = f
    t.jerk[i] = j
    t.jerk_bound[i] = bound_3
    t.ahead[i] = ahead
    t.behind[i] = choose(rising, lower, upper)


@inlined
def look_behind(t, i):  # type: ignore[no-untyped-def]
    """
    Shorten the step of lane i where the mass may come back to the wall behind.

    The bound of the way back, ``-u t - f t^2/2 + c t^3/6``, is greatest at an end of the stretch.
    """
    alpha = t.alpha[i]
    beta = t.beta[i]
    relax_1 = beta * (t.gamma[i] - beta * (t.velocity_now[i] - alpha * t.cosine_now[i]))
    bound_3 = t.jerk_bound[i]
    u = t.speed[i]
    f = t.pull[i]
    front = t.step[i]
    c = (alpha + abs(beta * relax_1)) * front * 0.25 - t.jerk[i]
    c = choose(c < bound_3, c, bound_3)
    c = choose(c > 0.0, c, 0.0)
    q = c * front * (1.0 / 3.0) - f
    behind = t.behind[i]
    way = u + square_root(u * u + 2.0 * q * behind)
    bends = way * c < 3.0 * f * q
    back = choose(bends, 3.0 * f, way) / choose(bends, c, q)
    returns = (front * (0.5 * q * front - u) > behind) & (back < front)
    t.step[i] = choose(returns, back, front)
    t.returns[i] = choose(returns, 1.0, 0.0)


@inlined
def taylor(t, i):  # type: ignore[no-untyped-def]
    """Taylor coefficients of the velocity towards the wall ahead, from the second on."""
    alpha = t.alpha[i]
    beta = t.beta[i]
    towards = t.towards[i]
    drive_sine = alpha * t.sine_now[i]
    drive_cosine = alpha * t.cosine_now[i]
    relax = t.gamma[i] - beta * (t.velocity_now[i] - drive_cosine)
    square = beta * beta
    relax_2 = square * relax
    relax_3 = beta * relax_2
    relax_4 = square * relax_2
    relax_5 = square * relax_3
    # The largest of the second and the eighth derivative of the displacement.
    relax_6 = square * relax_4
    bend = alpha + choose(abs(relax_6) > abs(relax), abs(relax_6), abs(relax))
    return (
        0.5 * t.jerk[i],
        (1.0 / 6.0) * (towards * (drive_sine + relax_2)),
        (1.0 / 24.0) * (towards * (drive_cosine - relax_3)),
        (1.0 / 120.0) * (towards * (relax_4 - drive_sine)),
        (1.0 / 720.0) * (towards * (-drive_cosine - relax_5)),
        (1.0 / 5040.0) * (towards * (drive_sine + relax_6)),
        bend,
    )


@inlined
def taylor_speed(x, u, f, c2, c3, c4, c5, c6):  # type: ignore[no-untyped-def]
    """Speed after time x by Taylor's polynomial."""
    y = x * x
    return ((u + x * f) + y * (c2 + x * c3)) + (y * y) * (c4 + x * (c5 + x * c6))


@inlined
def taylor_way(x, u, f, c2, c3, c4, c5, c6):  # type: ignore[no-untyped-def]
    """Way in time x by Taylor's polynomial."""
    y = x * x
    return x * (
        ((u + x * (0.5 * f)) + y * ((1.0 / 3.0) * c2 + x * (0.25 * c3)))
        + (y * y) * (0.2 * c4 + x * ((1.0 / 6.0) * c5 + x * ((1.0 / 7.0) * c6))))


@inlined
def aim(t, i):  # type: ignore[no-untyped-def]
    """Improve the time to the wall ahead by a step of Newton's method."""
    u = t.speed[i]
    f = t.pull[i]
    c2, c3, c4, c5, c6, _, _ = taylor(t, i)
    x = t.horizon[i]
    t.aimed[i] = x - ((taylor_way(x, u, f, c2, c3, c4, c5, c6) - t.ahead[i])
                      / taylor_speed(x, u, f, c2, c3, c4, c5, c6))


@inlined
def close_in(t, i):  # type: ignore[no-untyped-def]
    """
    Find the impact of lane i, or a longer step, by Taylor's polynomial of the seventh order.

    Where the velocity certainly stays positive the zero is the first impact, and less than it by
    more than all errors is a certain step.
    """
    u = t.speed[i]
    f = t.pull[i]
    c2, c3, c4, c5, c6, c7, bend = taylor(t, i)
    x = t.aimed[i]
    ahead = t.ahead[i]
    speed = taylor_speed(x, u, f, c2, c3, c4, c5, c6)
    inverse = 1.0 / speed
    change = (taylor_way(x, u, f, c2, c3, c4, c5, c6) - ahead) * inverse
    last = x - change
    # The remainders of Newton's method and of Taylor's formula. Up to NEAR the polynomial's second
    # derivative is at most 5/4 of `bend`.
    power = last * last
    power = power * power
    error = bend * (change * change + power * power * (1.0 / 40320.0))
    margin = 2.0 * error * inverse
    change = abs(change)
    longest = x + change
    certain = (
        (u > 0.0) & (x >= 0.0) & (longest < NEAR) & (last >= margin)
        & (u + longest * (f - 0.5 * t.jerk_bound[i] * longest) > 0.0)
        & (bend * (margin + change) < 0.25 * speed))
    impact_speed = taylor_speed(last, u, f, c2, c3, c4, c5, c6 + last * c7)
    d = t.duration[i]
    ends = certain & (error < LAST_STEP_ERROR * impact_speed * (d + last))
    near = last - margin
    step = t.step[i]
    returns = t.returns[i] != 0.0
    step = choose(certain & ((near > step) | returns), near, step)
    towards = choose(returns & (not certain), -t.towards[i], t.towards[i])
    before = choose(ends, impact_speed, towards * t.velocity_now[i])
    is_active = t.left[i] > 0.0
    hits = (ends | (d + step == d)) & is_active
    t.next_step[i] = choose(is_active, choose(ends, last, step), 0.0)
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
        look_behind(t, i)
    for i in range(LANES):
        aim(t, i)
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
