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

"""The map from one impact to the next, its exact derivatives (eq. (9)), and Newton's method."""

import math
from typing import Final

import numpy as np

from .section import turn_of
from ..arrays import FloatArray, IntArray
from ..compiled import kernel
from ..flight.closed_form import acceleration, later, LEG, NO_WALL, sticks, UPPER, wall_of
from ..flight.elementary import relaxation, relaxation_third, sine_cosine, TWO_PI
from ..flight.first_impact import search_impact
from ..model import Model

# A step of this size is the last [rad, 1]; so is one that is not smaller than the one before
# where the sequence closes to rounding.
CLOSED: Final = 1e-12
ROUNDING: Final = 1e-11
NEWTON_STEPS: Final = 40


@kernel
def next_impact(wall: int, phase: float, velocity: float,
                model: Model) -> tuple[int, int, float, float, float]:
    """Go to the next impact: its wall, cycles passed, phase, velocity, and the flight time [1]."""
    # The wall is NO_WALL where the gear sticks first or meets no wall in a leg.
    s0 = 0.0 if wall == UPPER else -1.0
    if sticks(velocity, phase, model):
        return NO_WALL, 0, phase, velocity, 0.0
    d, _, before, hit = search_impact(0.0, 0, LEG, phase, s0, -model.restitution * velocity, model)
    cycles, phase_hit = later(phase, d)
    return hit, cycles, phase_hit, before, d


@kernel
def derivatives(phase: float, velocity: float, d: float, phase_next: float, velocity_next: float,
                model: Model) -> tuple[float, ...]:
    """Differentiate an impact by the phase and velocity of the one before."""
    # The derivatives of its phase come first, then those of its velocity, which is not zero.
    restitution = model.restitution
    decay, integral, _ = relaxation(d, model.beta)
    sine, cosine = sine_cosine(phase)
    sine_next, cosine_next = sine_cosine(phase_next)
    after = -restitution * velocity
    leaving = acceleration(sine, cosine, after, model)
    meeting = acceleration(sine_next, cosine_next, velocity_next, model)
    # At fixed time: a later take-off is a state that lies that much behind.
    way_phase = -after - integral * leaving
    way_velocity = -restitution * integral
    slope = -1.0 / velocity_next
    phase_phase = slope * way_phase
    phase_velocity = slope * way_velocity
    return (
        phase_phase, phase_velocity,
        meeting * phase_phase - decay * leaving,
        meeting * phase_velocity - decay * restitution,
    )


@kernel
def parameter_derivatives(phase: float, velocity: float, d: float, phase_next: float,
                          velocity_next: float, model: Model
                          ) -> tuple[tuple[float, float], ...]:
    """Differentiate the phase and velocity of an impact by each number of the model in turn."""
    decay, integral, second = relaxation(d, model.beta)
    sine, cosine = sine_cosine(phase)
    sine_next, cosine_next = sine_cosine(phase_next)
    meeting = acceleration(sine_next, cosine_next, velocity_next, model)
    # What the drag slows, and the derivatives of B and C of `relaxation` by beta.
    relaxing = -model.restitution * velocity - model.alpha * cosine
    integral_beta = second - d * integral
    second_beta = 2.0 * relaxation_third(d, model.beta, second) - d * second
    slope = -1.0 / velocity_next
    # At fixed time: how far the gear comes, and its velocity.
    phase_alpha = slope * (sine_next - sine - integral * cosine)
    phase_beta = slope * (relaxing * integral_beta + model.gamma * second_beta)
    phase_gamma = slope * second
    phase_restitution = slope * (-velocity * integral)
    return (
        (phase_alpha, meeting * phase_alpha + cosine_next - decay * cosine),
        (phase_beta, meeting * phase_beta - relaxing * d * decay + model.gamma * integral_beta),
        (phase_gamma, meeting * phase_gamma + integral),
        (phase_restitution, meeting * phase_restitution - velocity * decay),
    )


@kernel
def map_points(points: FloatArray, model: Model
               ) -> tuple[FloatArray, FloatArray, IntArray, FloatArray]:
    """Map impacts (phase, velocity) to the next: images, derivatives, their walls and times."""
    # The wall of an impact is that of the sign of its velocity; an image without one has NO_WALL.
    n = len(points)
    images, matrices = np.zeros((n, 2)), np.zeros((n, 2, 2))
    walls, times = np.full(n, NO_WALL), np.zeros(n)
    for i in range(n):
        # Phases of a segment may lie a little outside one drive period.
        phase = points[i, 0] - TWO_PI * math.floor(points[i, 0] / TWO_PI)
        velocity = points[i, 1]
        walls[i], _, images[i, 0], images[i, 1], times[i] = next_impact(
            wall_of(velocity), phase, velocity, model)
        if walls[i] != NO_WALL and images[i, 1] != 0.0:
            one = derivatives(phase, velocity, times[i], images[i, 0], images[i, 1], model)
            matrices[i, 0, 0], matrices[i, 0, 1] = one[0], one[1]
            matrices[i, 1, 0], matrices[i, 1, 1] = one[2], one[3]
    return images, matrices, walls, times


@kernel
def shoot(walls: IntArray, points: FloatArray, model: Model, by_model: bool
          ) -> tuple[bool, FloatArray, FloatArray, FloatArray]:
    """Map a closed sequence on: whether each flight ends at the next wall, and a `Shot`."""
    # By the model only where that is asked for, as it takes as long as the rest.
    q = len(walls)
    defects, slopes, times = np.zeros((q, 2)), np.zeros((q, 2, 6)), np.zeros(q)
    for k in range(q):
        n = (k + 1) % q
        hit, _, phase, velocity, d = next_impact(walls[k], points[k, 0], points[k, 1], model)
        if hit != walls[n] or velocity == 0.0:
            return False, defects, slopes, times
        times[k] = d
        defects[k, 0] = turn_of(phase - points[n, 0])
        defects[k, 1] = velocity - points[n, 1]
        one = derivatives(points[k, 0], points[k, 1], d, phase, velocity, model)
        for row in range(2):
            slopes[k, row, 0], slopes[k, row, 1] = one[2 * row], one[2 * row + 1]
        if by_model:
            by = parameter_derivatives(points[k, 0], points[k, 1], d, phase, velocity, model)
            for number in range(4):
                slopes[k, 0, 2 + number], slopes[k, 1, 2 + number] = by[number]
    return True, defects, slopes, times


@kernel
def close_ring(walls: IntArray, points: FloatArray, reach: float, model: Model) -> bool:
    """Move the points of a closed sequence, each by at most `reach` [rad, 1], onto an orbit."""
    # False where none is found. Each change follows from that of the first point, z_k = C_k z_0 +
    # d_k, in a row of `carried`; the sequence closes where z_q = z_0.
    q = len(walls)
    seeds, carried = points.copy(), np.zeros((q, 6))
    shortest = math.inf
    for _ in range(NEWTON_STEPS):
        closed, defects, slopes, _ = shoot(walls, points, model, False)
        if not closed:
            return False
        a, b, c, d, e, f = 1.0, 0.0, 0.0, 1.0, 0.0, 0.0
        for k in range(q):
            carried[k, 0], carried[k, 1], carried[k, 2] = a, b, e
            carried[k, 3], carried[k, 4], carried[k, 5] = c, d, f
            p_p, p_v = slopes[k, 0, 0], slopes[k, 0, 1]
            v_p, v_v = slopes[k, 1, 0], slopes[k, 1, 1]
            a, b, c, d, e, f = (
                p_p * a + p_v * c, p_p * b + p_v * d, v_p * a + v_v * c, v_p * b + v_v * d,
                p_p * e + p_v * f + defects[k, 0], v_p * e + v_v * f + defects[k, 1])
        # (C - 1) z = -d
        determinant = (a - 1.0) * (d - 1.0) - b * c
        if not abs(determinant) > 0.0:
            return False
        z_phase = (b * f - (d - 1.0) * e) / determinant
        z_velocity = (c * e - (a - 1.0) * f) / determinant
        size = 0.0
        for k in range(q):
            for j in range(2):
                by = (carried[k, 3 * j] * z_phase + carried[k, 3 * j + 1] * z_velocity
                      + carried[k, 3 * j + 2])
                points[k, j] += by
                size = max(size, abs(by))
                if not abs(points[k, j] - seeds[k, j]) <= reach:
                    return False
        off = 0.0
        for k in range(q):
            off = max(off, abs(defects[k, 0]), abs(defects[k, 1]))
        if size < CLOSED or (size >= shortest and off < ROUNDING):
            return True
        shortest = min(shortest, size)
    return False
