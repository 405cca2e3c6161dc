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

"""The neighbourhood of a stable orbit that one period maps into itself, found by trial."""

import math
from typing import Final

import numpy as np

from .recorded import initial_after, record_impacts
from ..arrays import FloatArray
from ..flight.elementary import TWO_PI
from ..orbits.orbit import fire, Orbit
from ..orbits.section import turn

# It is tried on rays and shells of initial conditions at some points of an orbit, and halved.
RAYS: Final = 24
SHELLS: Final = (1.0, 0.7, 0.4)
POINTS_TRIED: Final = 8
HALVINGS: Final = 14


def attracted(orbit: Orbit, tolerance: float) -> FloatArray:
    """Find at some points of a stable orbit an ellipse that one period maps into itself."""
    # Returns a quadratic form for each point, at most 1 in the ellipse, inf where none was found
    # or tried. Within a period nothing in it goes farther from the orbit than the tolerance [1].
    shot = fire(orbit.walls, orbit.points, orbit.parameters)
    assert shot is not None
    q = orbit.impacts
    forms = np.full((q, 3), np.inf)
    angles = np.arange(RAYS) * (TWO_PI / RAYS)
    circle = np.stack([np.cos(angles), np.sin(angles)])
    disc = np.concatenate([shell * circle for shell in SHELLS], axis=1)
    for k in sorted({(j * q) // min(q, POINTS_TRIED) for j in range(min(q, POINTS_TRIED))}):
        norm = _contracted_norm(shot.derivative(k))
        inverse = np.linalg.inv(norm)
        # The largest ellipse that fits into the tolerance.
        radius = tolerance / math.sqrt(max(inverse[0, 0], inverse[1, 1]))
        shape = np.linalg.inv(np.linalg.cholesky(norm).T)
        for _ in range(HALVINGS):
            if _stays(orbit, k, shape @ disc * radius, norm / radius**2, tolerance):
                forms[k] = np.array([norm[0, 0], norm[0, 1], norm[1, 1]]) / radius**2
                break
            radius *= 0.5
    return forms


def _contracted_norm(matrix: FloatArray) -> FloatArray:
    """Sum a quadratic form that one period makes smaller (Lyapunov's equation)."""
    largest = float(np.max(np.abs(np.linalg.eigvals(matrix))))
    scaled = matrix / (0.5 * (1.0 + largest))
    # Doubling: after n rounds 2^n terms.
    total, step = np.eye(2), scaled
    for _ in range(40):
        total = total + step.T @ total @ step
        step = step @ step
        if np.max(np.abs(step)) < 1e-12:
            break
    return 0.5 * (total + total.T)


def _stays(orbit: Orbit, k: int, offsets: FloatArray, form: FloatArray, tolerance: float) -> bool:
    q = orbit.impacts
    phases = orbit.phases[k] + offsets[0]
    velocities = orbit.velocities[k] + offsets[1]
    if np.any(np.signbit(velocities) != bool(orbit.walls[k])):
        return False
    rows, counts = record_impacts(initial_after(orbit.parameters, phases, velocities), 0, q)
    if np.any(counts < q):
        return False
    order = (k + 1 + np.arange(q)) % q
    turned = turn(rows['phase'] - orbit.phases[order])
    faster = rows['velocity'] - orbit.velocities[order]
    if np.any(np.signbit(rows['velocity']) != orbit.walls[order].astype(bool)):
        return False
    if max(float(np.max(np.abs(turned))), float(np.max(np.abs(faster)))) > tolerance:
        return False
    back = np.stack([turned[:, -1], faster[:, -1]])
    before = np.einsum('in,ij,jn->n', offsets, form, offsets)
    after = np.einsum('in,ij,jn->n', back, form, back)
    return bool(np.all(after < before))
