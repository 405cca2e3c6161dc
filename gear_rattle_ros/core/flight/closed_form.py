"""
One flight between the walls: closed form, impact law, sticking, release.

Scalar kernels, shared by everything that follows a trajectory. Notation of the paper, with
``d = tau - tau0`` the time since the flight began and ``p = tau0`` its phase. Eqs. (4)-(5) are
used in a form without cancellation for small d and regular at ``beta = 0``.
"""

import math

import numpy as np

from .advancement import HORIZON_MAXIMUM
from .elementary import arctangent, relaxation, sine_cosine, sine_defect, TWO_PI, TWO_PI_TAIL
from ..compiled import kernel
from ..model import STICKING_SPEED, Wall

# What holds a trajectory at a moment.
FLYING = 0
RESTING = 1
# Which wall ends a flight.
NO_WALL = -1
UPPER = int(Wall.UPPER)
LOWER = int(Wall.LOWER)
# A flight without an impact is continued from a fresh start after this many drive periods.
LEG_PERIODS = 64
LEG = LEG_PERIODS * TWO_PI
# Far more than rounding moves a displacement within a leg between the walls [1].
CLEARANCE = 1e-9


@kernel
def displace(d: float, sin_p: float, cos_p: float, v0: float, alpha: float, beta: float,
             gamma: float) -> tuple[float, float, float, float]:
    """
    Return displacement, velocity, sine and cosine of the phase after a time d, eqs. (4)-(5).

    The displacement is counted from the beginning of the flight [1]. Where d is small it is good
    to a relative accuracy, as chatter needs; d is at most about 1e6.
    """
    decay, integral, second = relaxation(d, beta)
    sin_half, cos_half = sine_cosine(0.5 * d)
    versine = 2.0 * sin_half * sin_half
    sine = 2.0 * sin_half * cos_half
    defect = sine_defect(d, sine)
    moved = (v0 * integral + gamma * second
             + alpha * (cos_p * (defect + beta * second) - sin_p * versine))
    velocity = (v0 * decay + gamma * integral
                + alpha * (cos_p * (beta * integral - versine) - sin_p * sine))
    sin_now = sin_p + (cos_p * sine - sin_p * versine)
    cos_now = cos_p - (cos_p * versine + sin_p * sine)
    return moved, velocity, sin_now, cos_now


@kernel
def displace_leg(cos_p: float, v0: float, alpha: float, beta: float,
                 gamma: float) -> tuple[float, float]:
    """
    Return displacement and velocity after a leg of whole drive periods, eqs. (4)-(5).

    The drive is where it was, exactly; the displacement is counted from the beginning of the leg.
    """
    decay, integral, second = relaxation(LEG, beta)
    moved = (v0 - alpha * cos_p) * integral + gamma * second
    return moved, v0 * decay + (gamma + alpha * beta * cos_p) * integral


@kernel
def stays_clear(sin_p: float, cos_p: float, s0: float, v0: float, alpha: float, beta: float,
                gamma: float) -> bool:
    """
    Whether a leg cannot come near a wall, from bounds on each term of the closed form.

    A leg without an impact may be near enough to make it False.
    """
    _, integral, second = relaxation(LEG, beta)
    # s(d) = s0 - alpha sin p + alpha sin(p + d) + (v0 - alpha cos p) B(d) + gamma C(d).
    middle = s0 - alpha * sin_p
    drift = (v0 - alpha * cos_p) * integral
    fall = gamma * second
    high = middle + alpha + max(drift, 0.0) + max(fall, 0.0)
    low = middle - alpha + min(drift, 0.0) + min(fall, 0.0)
    return high < -CLEARANCE and low > CLEARANCE - 1.0


@kernel
def acceleration(sin_p: float, cos_p: float, velocity: float, alpha: float, beta: float,
                 gamma: float) -> float:
    """Return the acceleration ``s'' = a(tau, v)`` in flight, eq. (3)."""
    return alpha * (beta * cos_p - sin_p) + (gamma - beta * velocity)


@kernel
def departure(sin_p: float, cos_p: float, alpha: float, beta: float, gamma: float) -> float:
    """
    Return a time [1] for which a mass that leaves a wall from rest certainly meets neither wall.

    The force is away from the wall, or zero but for rounding. The mass gets off this wall by the
    acceleration or, at a release where that vanishes, by the jerk; it is not at the other one yet.
    """
    force = acceleration(sin_p, cos_p, 0.0, alpha, beta, gamma)
    relax = abs(gamma + beta * alpha * cos_p)
    jerk = -alpha * (cos_p + beta * sin_p) - beta * force
    by_force = 2.5 * abs(force) / (alpha + beta * relax)
    by_jerk = 2.0 * abs(jerk) / (alpha + beta * beta * relax)
    if jerk * force < 0.0 and abs(force) > 1e-12:
        by_jerk = 0.0
    return min(max(by_force, by_jerk), HORIZON_MAXIMUM, math.sqrt(2.0 / (alpha + relax)))


@kernel
def is_pressed(towards: float, sin_p: float, cos_p: float, alpha: float, beta: float,
               gamma: float) -> bool:
    """
    Whether a mass at rest on a wall (+1 for the upper, -1 for the lower) is pressed against it.

    The sign of a(tau, 0) decides, that of its derivative where it is zero; where no force acts at
    all, the mass is pressed.
    """
    force = towards * acceleration(sin_p, cos_p, 0.0, alpha, beta, gamma)
    if force != 0.0:
        return force > 0.0
    return -towards * alpha * (cos_p + beta * sin_p) >= 0.0


@kernel
def release_delay(towards: float, phase: float, alpha: float, beta: float,
                  gamma: float) -> float:
    """
    Return the time [1] until a mass leaves the wall it rests on, inf where it never does.

    That is at the next zero of ``a(tau, 0) = gamma - alpha sqrt(1 + beta^2) sin(tau - atan beta)``
    in the leaving direction.
    """
    amplitude = alpha * math.sqrt(1.0 + beta * beta)
    # So close to never leaving, the speed gained is far below that at which it sticks again.
    if abs(gamma) >= amplitude * (1.0 - 1e-12):
        return math.inf
    angle = arctangent(gamma / math.sqrt((amplitude - gamma) * (amplitude + gamma)))
    if towards < 0.0:
        angle = math.pi - angle
    delay = (angle + arctangent(beta) - phase) % TWO_PI
    # A zero just behind, by rounding, is now.
    if delay > TWO_PI - 1e-8:
        return 0.0
    return delay


@kernel
def later(phase: float, d: float) -> tuple[int, float]:
    """Return the drive periods passed and the phase [rad] after a time d, to d's rounding."""
    total = phase + d
    if total < TWO_PI:
        return 0, total
    part = total - phase
    rounding = (phase - (total - part)) + (d - part)
    periods = np.floor(total / TWO_PI)
    rest = (total - periods * TWO_PI) + (rounding - periods * TWO_PI_TAIL)
    if rest < 0.0:
        rest += TWO_PI
        periods -= 1.0
    if rest >= TWO_PI:
        rest = max(rest - TWO_PI, 0.0)
        periods += 1.0
    return int(periods), rest


@kernel
def elapsed(cycles: int, phase_from: float, phase_to: float) -> float:
    """Return the time ``2 pi cycles + phase_to - phase_from`` [1] between two moments."""
    return cycles * TWO_PI + (phase_to - phase_from)


@kernel
def rebound(velocity: float, towards: float, phase: float, alpha: float, beta: float,
            gamma: float, restitution: float, kick: float) -> float:
    """
    Return the velocity after an impact, eq. (6): ``-r v`` plus the kick, or 0 where it sticks.

    It sticks where that is so slow, with ``r < 1``, on a wall against which the mass is pressed; a
    kick never sends it through the wall. `towards` is +1 at the upper wall, -1 at the lower.
    """
    after = -restitution * velocity
    if kick != 0.0:
        return -towards * abs(after + kick)
    if abs(after) < STICKING_SPEED and restitution < 1.0:
        sin_p, cos_p = sine_cosine(phase)
        if is_pressed(towards, sin_p, cos_p, alpha, beta, gamma):
            return 0.0
    return after
