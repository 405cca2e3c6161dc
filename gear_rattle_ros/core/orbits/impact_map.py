"""The map from one impact to the next with its exact derivatives, eq. (9) of the paper."""

import math

from ..arrays import FloatArray, IntArray
from ..compiled import kernel
from ..flight.closed_form import acceleration, is_pressed, later, LEG, NO_WALL, UPPER
from ..flight.elementary import relaxation, sine_cosine
from ..flight.first_impact import search_impact
from ..model import STICKING_SPEED


@kernel
def next_impact(wall: int, phase: float, velocity: float, alpha: float, beta: float, gamma: float,
                restitution: float) -> tuple[int, int, float, float, float]:
    """
    Go to the next impact: its wall, cycles passed, phase, velocity, and the flight time [1].

    The wall is NO_WALL where the gear sticks first or meets no wall in a leg: there the map is not
    smooth, or not defined.
    """
    towards = 1.0 if wall == UPPER else -1.0
    after = -restitution * velocity
    if abs(after) < STICKING_SPEED:
        sine, cosine = sine_cosine(phase)
        if is_pressed(towards, sine, cosine, alpha, beta, gamma):
            return NO_WALL, 0, phase, velocity, 0.0
    s0 = 0.0 if wall == UPPER else -1.0
    d, _, before, hit = search_impact(0.0, 0, LEG, phase, s0, after, alpha, beta, gamma)
    cycles, phase_hit = later(phase, d)
    return hit, cycles, phase_hit, before, d


@kernel
def derivatives(phase: float, velocity: float, d: float, phase_next: float, velocity_next: float,
                alpha: float, beta: float, gamma: float, restitution: float) -> tuple[float, ...]:
    """
    Differentiate an impact by the phase and velocity of the one before, and by alpha.

    The derivatives of its phase come first, then those of its velocity, which is not zero.
    """
    decay, integral, _ = relaxation(d, beta)
    sine, cosine = sine_cosine(phase)
    sine_next, cosine_next = sine_cosine(phase_next)
    after = -restitution * velocity
    leaving = acceleration(sine, cosine, after, alpha, beta, gamma)
    meeting = acceleration(sine_next, cosine_next, velocity_next, alpha, beta, gamma)
    # At fixed time: a later take-off is a state that lies that much behind.
    way_phase = -after - integral * leaving
    way_velocity = -restitution * integral
    way_alpha = sine_next - sine - integral * cosine
    slope = -1.0 / velocity_next
    phase_phase = slope * way_phase
    phase_velocity = slope * way_velocity
    phase_alpha = slope * way_alpha
    return (
        phase_phase, phase_velocity, phase_alpha,
        meeting * phase_phase - decay * leaving,
        meeting * phase_velocity - decay * restitution,
        meeting * phase_alpha + cosine_next - decay * cosine,
    )


@kernel
def shoot(walls: IntArray, points: FloatArray, alpha: float, beta: float, gamma: float,
          restitution: float, defects: FloatArray, jacobian: FloatArray,
          times: FloatArray) -> bool:
    """
    Map every impact of a closed sequence on; False where a flight ends at another wall.

    `defects` receives how far it is from closing [rad, 1], `jacobian` their derivatives by the
    points and, in the last column, by alpha, and `times` the flight times [1].
    """
    q = len(walls)
    jacobian[:] = 0.0
    for k in range(q):
        n = (k + 1) % q
        hit, _, phase, velocity, d = next_impact(
            walls[k], points[k, 0], points[k, 1], alpha, beta, gamma, restitution)
        if hit != walls[n] or velocity == 0.0:
            return False
        times[k] = d
        apart = phase - points[n, 0]
        defects[2 * k] = apart - 2.0 * math.pi * math.floor(apart / (2.0 * math.pi) + 0.5)
        defects[2 * k + 1] = velocity - points[n, 1]
        one = derivatives(points[k, 0], points[k, 1], d, phase, velocity, alpha, beta, gamma,
                          restitution)
        for row in range(2):
            jacobian[2 * k + row, 2 * k] = one[3 * row]
            jacobian[2 * k + row, 2 * k + 1] = one[3 * row + 1]
            jacobian[2 * k + row, 2 * q] = one[3 * row + 2]
            jacobian[2 * k + row, 2 * n + row] -= 1.0
    return True
