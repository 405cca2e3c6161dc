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

"""The core of a stable orbit: balls round its points from which nearly all trajectories settle."""

from collections.abc import Callable
import functools
from typing import Final

import numpy as np

from .impact_map import next_impact
from .orbit import Orbit
from .section import distance
from ..arrays import FloatArray, IntArray
from ..compiled import kernel
from ..flight.closed_form import NO_WALL
from ..flight.elementary import TWO_PI
from ..model import Model

# A ball of the metric of `distance`, and the attractor in whose core it is.
BALL: Final = np.dtype([('phase', np.float64), ('velocity', np.float64), ('radius', np.float64),
                        ('label', np.int64)], align=True)
# The widest ball that is tried; the share of its points that must settle; points along an edge.
WIDEST: Final = 0.4
SETTLES: Final = 0.99
ACROSS: Final = 21
# A trajectory has settled when it is this near to every point of a whole round in turn [1].
SETTLED: Final = 1e-5
# Impacts after which it counts as one that does not.
PATIENCE: Final = 5000


def widest(is_core: Callable[[FloatArray], bool], smallest: float) -> float:
    """Return the radius of the widest balls [1] that are a core, by points spread over them."""
    side = np.linspace(-1.0, 1.0, ACROSS)
    grid = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    radius = WIDEST
    while radius > smallest and not is_core(radius * grid):
        radius /= 2.0
    return radius


def radius_of(orbit: Orbit, smallest: float) -> float:
    """Return the radius of the balls that are the core of an orbit that does not stick [1]."""
    return _radius(orbit.walls.tobytes(), orbit.points.tobytes(), orbit.parameters.model, smallest)


# Each run of a bag meets the same orbits again.
@functools.lru_cache(maxsize=64)
def _radius(walls: bytes, points: bytes, model: Model, smallest: float) -> float:
    there = np.frombuffer(walls, np.int64).copy(), np.frombuffer(points).reshape(-1, 2).copy()
    return widest(lambda shifts: _is_core(*there, shifts, model), smallest)


@kernel
def _is_core(walls: IntArray, points: FloatArray, shifts: FloatArray, model: Model) -> bool:
    tried = failed = 0
    for k in range(len(walls)):
        for j in range(len(shifts)):
            velocity = points[k, 1] + shifts[j, 1]
            if (velocity < 0.0) == (points[k, 1] < 0.0):
                tried += 1
    for j in range(len(shifts)):
        for k in range(len(walls)):
            velocity = points[k, 1] + shifts[j, 1]
            if (velocity < 0.0) == (points[k, 1] < 0.0) and not _settles(
                    walls[k], (points[k, 0] + shifts[j, 0]) % TWO_PI, velocity, points, model):
                failed += 1
                if failed > (1.0 - SETTLES) * tried:
                    return False
    return True


@kernel
def _settles(wall: int, phase: float, velocity: float, points: FloatArray, model: Model) -> bool:
    q = len(points)
    k, near = 0, 0
    for _ in range(PATIENCE):
        k = (k + 1) % q
        if near == 0:
            for j in range(q):
                if distance(velocity, phase, points[j, 1], points[j, 0]) <= SETTLED:
                    k = j
        near = near + 1 if distance(velocity, phase, points[k, 1], points[k, 0]) <= SETTLED else 0
        if near > q:
            return True
        wall, _, phase, velocity, _ = next_impact(wall, phase, velocity, model)
        if wall == NO_WALL:
            return False
    return False
