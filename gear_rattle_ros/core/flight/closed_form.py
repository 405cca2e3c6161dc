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
One flight between the walls: closed form, impact law, sticking, release.

Eqs. (4)-(5) are used in a form without cancellation for small d and regular at ``beta = 0``.
"""

import math

import numpy as np

from .advancement import HORIZON_MAXIMUM
from .elementary import (
    arctangent,
    relaxation,
    sine_cosine,
    sine_defect,
    TWO_PI,
    TWO_PI_TAIL,
    WHOLE_BITS,
)
from .lanes_simd import choose
from ..arrays import Record, Whole
from ..compiled import kernel
from ..model import Model, STICKING_SPEED, Wall

# Which wall ends a flight.
NO_WALL = -1
UPPER = int(Wall.UPPER)
LOWER = int(Wall.LOWER)
# A flight without an impact is continued from a new initial condition after a leg of so long.
LEG_PERIODS = 64
LEG = LEG_PERIODS * TWO_PI
# Far more than rounding moves a displacement within a leg between the walls [1].
CLEARANCE = 1e-9
INVERSE_TWO_PI = 1.0 / TWO_PI
WHOLE_ZERO = int(np.float64(WHOLE_BITS).view(np.int64))
# Products below this have lost digits, or all of them [1].
SMALLEST = 1e-300


@kernel
def model_of(record: Record) -> Model:
    return Model(record.alpha, record.beta, record.gamma, record.restitution)


@kernel
def displace(d: float, sin_p: float, cos_p: float, v0: float,
             model: Model) -> tuple[float, float, float, float]:
    """Return displacement since take-off, velocity, sine, cosine after a time d, eqs. (4)-(5)."""
    # For small d the displacement has a small relative error, as chatter needs; d < 1e6.
    alpha, beta, gamma, _ = model
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
def displace_leg(cos_p: float, s0: float, v0: float, model: Model) -> tuple[float, float]:
    """Return displacement and velocity after a leg that meets no wall, eqs. (4)-(5)."""
    alpha, beta, gamma, _ = model
    decay, integral, second = relaxation(LEG, beta)
    moved = (v0 - alpha * cos_p) * integral + gamma * second
    return min(max(s0 + moved, -1.0), 0.0), v0 * decay + (gamma + alpha * beta * cos_p) * integral


@kernel
def stays_clear(sin_p: float, cos_p: float, s0: float, v0: float, model: Model) -> bool:
    """Whether bounds on each term of the closed form certainly keep a leg off the walls."""
    # And the time after it in which the last step of a search may still find an impact.
    alpha, beta, gamma, _ = model
    _, integral, second = relaxation(LEG + 2.0 * HORIZON_MAXIMUM, beta)
    # s(d) = s0 - alpha sin p + alpha sin(p + d) + (v0 - alpha cos p) B(d) + gamma C(d).
    middle = s0 - alpha * sin_p
    drift = (v0 - alpha * cos_p) * integral
    fall = gamma * second
    high = middle + alpha + max(drift, 0.0) + max(fall, 0.0)
    low = middle - alpha + min(drift, 0.0) + min(fall, 0.0)
    return high < -CLEARANCE and low > CLEARANCE - 1.0


@kernel
def acceleration(sin_p: float, cos_p: float, velocity: float, model: Model) -> float:
    """Return the acceleration ``s'' = a(tau, v)`` in flight, eq. (3)."""
    m = model
    return m.alpha * (m.beta * cos_p - sin_p) + (m.gamma - m.beta * velocity)


@kernel
def strikes_at_once(s0: float, v0: float) -> bool:
    """Whether a flight begins on a wall with a velocity into it."""
    return (s0 == 0.0 and v0 > 0.0) or (s0 == -1.0 and v0 < 0.0)


@kernel
def may_be_short(phase: float, s0: float, v0: float) -> bool:
    """Whether the zeros of the force can be looked at from here: in the first drive period."""
    return 0.0 <= phase < TWO_PI and not strikes_at_once(s0, v0)


@kernel
def departure(sin_p: float, cos_p: float, model: Model) -> float:
    """Return a time [1] in which a gear that leaves a wall from rest surely meets no wall."""
    # The force is away from the wall, or zero but for rounding: the gear leaves by the
    # acceleration or, at a release where that vanishes, by the jerk.
    alpha, beta, gamma, _ = model
    force = acceleration(sin_p, cos_p, 0.0, model)
    relax = abs(gamma + beta * alpha * cos_p)
    jerk = -alpha * (cos_p + beta * sin_p) - beta * force
    by_force = 2.5 * abs(force) / (alpha + beta * relax)
    by_jerk = 2.0 * abs(jerk) / (alpha + beta * beta * relax)
    if jerk * force < 0.0 and abs(force) > 1e-12:
        by_jerk = 0.0
    return min(max(by_force, by_jerk), HORIZON_MAXIMUM, math.sqrt(2.0 / (alpha + relax)))


@kernel
def is_pressed(displacement: float, phase: float, model: Model) -> bool:
    """Whether a gear at rest on a wall is pressed against it."""
    # The sign of a(tau, 0) decides, or of its derivative; without any force the gear is pressed.
    sin_p, cos_p = sine_cosine(phase)
    towards = 1.0 + 2.0 * displacement
    force = towards * acceleration(sin_p, cos_p, 0.0, model)
    if force != 0.0:
        return force > 0.0
    return -towards * model.alpha * (cos_p + model.beta * sin_p) >= 0.0


@kernel
def rests(displacement: float, velocity: float, phase: float, model: Model) -> bool:
    """Whether a gear stands on a wall against which it is pressed."""
    on_wall = velocity == 0.0 and (displacement == 0.0 or displacement == -1.0)
    return on_wall and is_pressed(displacement, phase, model)


@kernel
def release_delay(displacement: float, phase: float, model: Model) -> float:
    """Return the time [1] until a gear leaves the wall it rests on, inf where it never does."""
    # That is at the next zero of ``a(tau, 0) = gamma - alpha sqrt(1 + beta^2) sin(tau - atan
    # beta)`` in the leaving direction.
    alpha, beta, gamma, _ = model
    amplitude = alpha * math.sqrt(1.0 + beta * beta)
    # So close to never leaving, the speed gained is far below that at which it sticks again.
    if abs(gamma) >= amplitude * (1.0 - 1e-12):
        return math.inf
    product = (amplitude - gamma) * (amplitude + gamma)
    # Of a force so faint that this underflows, the factors have a root nevertheless.
    root = (math.sqrt(product) if product > SMALLEST
            else math.sqrt(amplitude - gamma) * math.sqrt(amplitude + gamma))
    angle = arctangent(gamma / root)
    if displacement < 0.0:
        angle = math.pi - angle
    delay = (angle + arctangent(beta) - phase) % TWO_PI
    # A zero just behind, by rounding, is now.
    return 0.0 if delay > TWO_PI - 1e-8 else delay


@kernel
def later(phase: float, d: float) -> tuple[Whole, float]:
    """Return the drive periods passed and the phase [rad] after a time d, to d's rounding."""
    total = phase + d
    part = total - phase
    rounding = (phase - (total - part)) + (d - part)
    # Rounded down, or to one less.
    periods = ((total * INVERSE_TWO_PI - 0.5) + WHOLE_BITS) - WHOLE_BITS
    rest = (total - periods * TWO_PI) + (rounding - periods * TWO_PI_TAIL)
    # Selections rather than branches, for the lanes.
    early = rest < 0.0
    periods = choose(early, periods - 1.0, periods)
    rest = choose(early, rest + TWO_PI, rest)
    # By rounding the sum may be a whole period.
    late = rest >= TWO_PI
    rest = choose(late, rest - TWO_PI, rest)
    periods = choose(late, periods + 1.0, periods)
    return np.float64(periods + WHOLE_BITS).view(np.int64) - WHOLE_ZERO, rest


@kernel
def elapsed(cycles: Whole, phase_from: float, phase_to: float) -> float:
    """Return the time ``2 pi cycles + phase_to - phase_from`` [1] between two moments."""
    return cycles * TWO_PI + (phase_to - phase_from)


@kernel
def wall_of(velocity: float) -> int:
    """Return the wall of an impact: that of the sign of its velocity, even of a zero."""
    return LOWER if math.copysign(1.0, velocity) < 0.0 else UPPER


@kernel
def sticks(velocity: float, phase: float, model: Model) -> bool:
    """Whether an impact leaves a gear so slow, with ``r < 1``, that its wall holds it."""
    return (abs(model.restitution * velocity) < STICKING_SPEED and model.restitution < 1.0
            and is_pressed(-1.0 * wall_of(velocity), phase, model))


@kernel
def rebound(velocity: float, phase: float, model: Model, kick: float) -> float:
    """Return the velocity after an impact, eq. (6): ``-r v`` plus the kick, 0 if it sticks."""
    # A kick never sends the gear through the wall.
    after = -model.restitution * velocity
    if kick != 0.0:
        return -math.copysign(after + kick, velocity)
    return 0.0 if sticks(velocity, phase, model) else after
