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
The flight backwards: from an impact to the one before.

With ``t = -tau`` it is a flight forwards with the damping -beta, the phase ``pi - tau`` and the
velocity reversed. It is searched from one zero of the force to the next, between which the gear
turns at most once whatever the sign of beta, so no impact is missed (doc/steps.md).
"""

import math
from typing import Final

from .closed_form import acceleration, displace, is_pressed, later, LEG, NO_WALL, sticks, UPPER
from .elementary import sine_cosine, TWO_PI
from .first_impact import FAINTEST, force_zero_delay, wall_reached
from ..compiled import kernel
from ..model import Model, Parameters

# Steps of Newton's method or halvings, far more than the slowest root takes.
STEPS: Final = 132
# Growth of a deviation beyond which float64 ends, as a logarithm [1].
GROWTH: Final = 600.0


def require_inverse(parameters: Parameters) -> None:
    """Refuse parameters at which an impact forgets the flight before it."""
    if not parameters.restitution:
        raise ValueError('restitution = 0 forgets the flight before an impact, so there is no '
                         'way back; give a --restitution above 0')


@kernel
def rise(a: float, b: float, sign: float, level: float, turns: bool, sin_p: float, cos_p: float,
         v0: float, model: Model) -> float:
    """
    Find the time in (a, b] at which the way, or with `turns` the velocity, passes a level.

    `sign` times what it lacks grows throughout.
    """
    d, last = b, b - a
    for _ in range(STEPS):
        value, slope, sine, cosine = displace(d, sin_p, cos_p, v0, model)
        if turns:
            value, slope = slope, acceleration(sine, cosine, slope, model)
        value -= level
        if sign * value >= 0.0:
            b = d
        else:
            a = d
        step = value / slope
        # Halved where Newton's method does not converge, or gives no number.
        if not (a <= d - step <= b and abs(step) < 0.5 * last):
            step = d - 0.5 * (a + b)
        last = abs(step)
        if d - step == d or not a < b:
            break
        d -= step
    return d


@kernel
def previous_impact(wall: int, phase: float, velocity: float,
                    model: Model) -> tuple[int, float, float, float]:
    """
    Go back to the impact before: its wall, phase, velocity before it, and the flight time [1].

    The wall is NO_WALL where the gear comes from none within a leg, or had stuck to one.
    """
    alpha, beta, gamma, restitution = model
    back = Model(alpha, -beta, gamma, restitution)
    s0 = 0.0 if wall == UPPER else -1.0
    if velocity == 0.0 and is_pressed(s0, phase, model):
        return NO_WALL, phase, velocity, 0.0
    sin_p, cos_p = sine_cosine(phase)
    cos_p = -cos_p
    start = (math.pi if phase <= math.pi else 3.0 * math.pi) - phase
    farthest = min(LEG, GROWTH / beta) if beta > 0.0 else LEG
    b, after = 0.0, -velocity
    while b < farthest:
        a, before = b, after
        b += force_zero_delay(later(start, a)[1], 1e-14 + 1e-15 * a, back)
        moved, after, _, _ = displace(b, sin_p, cos_p, -velocity, back)
        end, found = b, NO_WALL
        if before * after < 0.0:
            turn = rise(a, b, math.copysign(1.0, after), 0.0, True, sin_p, cos_p, -velocity, back)
            found = wall_reached(s0, displace(turn, sin_p, cos_p, -velocity, back)[0])
            if found == NO_WALL:
                a = turn
            else:
                end = turn
        if found == NO_WALL:
            found = wall_reached(s0, moved)
        if found == NO_WALL:
            continue
        towards = 1.0 - 2.0 * found
        d = rise(a, end, towards, -found - s0, False, sin_p, cos_p, -velocity, back)
        speed = towards * displace(d, sin_p, cos_p, -velocity, back)[1]
        v = towards * max(speed / restitution, FAINTEST)
        p = TWO_PI - later(TWO_PI - phase, d)[1]
        p = 0.0 if p >= TWO_PI else p
        return (NO_WALL if sticks(v, p, model) else found), p, v, d
    return NO_WALL, phase, velocity, b
