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
The letters of attractors at the parameters of the paper, the same at every alpha.

A letter belongs to a periodic orbit that is followed in alpha by Newton's method. While that is
stable, it is the attractor of this letter. Past its doublings the attractor is the one, if there
is one, to which most of its unstable manifold leads: a smaller attractor may lie in its folds.
"""

import functools
from typing import Final, NamedTuple

import numpy as np

from .impact_map import next_impact
from .orbit import close_orbit, fire, Orbit, same_orbit
from .section import distances
from ..arrays import FloatArray
from ..compiled import kernel
from ..defaults import BETA, GAMMA, RESTITUTION
from ..flight.closed_form import NO_WALL
from ..model import Model, Parameters


class Founder(NamedTuple):
    """An orbit that gives an attractor its letter, by one of its impacts at some alpha."""

    letter: str
    alpha: float
    impacts: int
    phase: float
    velocity: float


# A, B and C are those of the paper; the others are small, and it does not name them.
FOUNDERS: Final = (
    Founder('A', 0.48, 3, 4.0915, 0.6273), Founder('B', 0.48, 2, 5.4554, 0.8585),
    Founder('C', 0.5, 3, 5.1607, 0.9647), Founder('D', 0.523, 6, 5.3233, 0.8390),
    Founder('E', 0.5715, 8, 4.9454, 0.9591), Founder('F', 0.5975, 5, 4.8835, 0.9998))
LETTERS: Final = tuple(founder.letter for founder in FOUNDERS)
# Amplitudes between which the paper gives letters to what has doubled.
LOWEST, HIGHEST = 0.47, 0.60
# Steps in which an orbit is followed [1], the distance within which two are the same one, and how
# far it is followed.
STEP: Final = 0.005
SAME: Final = 1e-6
REACH: Final = 0.3
# Points of the unstable manifold that are followed, the share of them that is most, how near to
# the orbit they begin [1], for how many impacts, and how near to another orbit they come that
# attracts them [1].
SAMPLES: Final = 32
MOST: Final = 2.0 / 3.0
NUDGE: Final = 1e-5
IMPACTS: Final = 4000
ATTRACTED: Final = 1e-4


def letter_of(orbit: Orbit) -> str:
    """Return the letter of a stable orbit; empty for none."""
    followed = followed_to(orbit.parameters)
    for letter, one in followed.items():
        if one.is_stable and same_orbit(one, orbit, SAME):
            return letter
    for letter, one in followed.items():
        led = [_leads_to(orbit, one.walls[0], *point) for point in leaving_points(one)]
        if sum(led) > MOST * SAMPLES:
            return letter
    return ''


def followed_to(parameters: Parameters) -> dict[str, Orbit]:
    """Return the orbits that give letters, stable or not, at some parameters."""
    if (parameters.beta, parameters.gamma, parameters.restitution) != (BETA, GAMMA, RESTITUTION):
        return {}
    followed = ((founder.letter, _followed(founder, parameters)) for founder in FOUNDERS)
    return {letter: orbit for letter, orbit in followed if orbit is not None}


def leaving_points(orbit: Orbit) -> FloatArray:
    """Return points of the unstable manifold of an orbit that has doubled, none of another's."""
    # The first multiplier has the largest modulus: below -1 past a doubling.
    shot = fire(orbit.walls, orbit.points, orbit.parameters)
    if (shot is None or not orbit.multipliers[0].real < -1.0
            or not LOWEST <= orbit.parameters.alpha <= HIGHEST):
        return np.zeros((0, 2))
    values, vectors = np.linalg.eig(shot.derivative())
    ahead = np.real(vectors[:, np.argmax(np.abs(values))])
    # Once round and round again: what is between has its image on either side.
    sides = NUDGE * np.abs(orbit.multipliers[0])**np.linspace(0.0, 2.0, SAMPLES, endpoint=False)
    return np.asarray(orbit.points[0] + sides[:, None] * ahead)


@kernel
def _go_on(wall: int, phase: float, velocity: float, model: Model) -> tuple[int, float, float]:
    for _ in range(IMPACTS):
        wall, _, phase, velocity, _ = next_impact(wall, phase, velocity, model)
        if wall == NO_WALL:
            break
    return wall, phase, velocity


def _leads_to(orbit: Orbit, wall: int, phase: float, velocity: float) -> bool:
    wall, phase, velocity = _go_on(wall, phase, velocity, orbit.parameters.model)
    here = orbit.points[orbit.walls == wall]
    return bool(np.any(distances(here[:, 1], here[:, 0], velocity, phase) < ATTRACTED))


def _followed(founder: Founder, parameters: Parameters) -> Orbit | None:
    ahead = parameters.alpha - founder.alpha
    if abs(ahead) > REACH:
        return None
    orbit = _after(founder, int(ahead / STEP))
    return orbit and close_orbit(orbit.walls, orbit.points, parameters)


@functools.lru_cache(4096)
def _after(founder: Founder, steps: int) -> Orbit | None:
    parameters = Parameters(founder.alpha + steps * STEP, BETA, GAMMA, RESTITUTION)
    if steps:
        before = _after(founder, steps - 1 if steps > 0 else steps + 1)
        return before and close_orbit(before.walls, before.points, parameters)
    walls, points = [0], [(founder.phase, founder.velocity)]
    for _ in range(founder.impacts - 1):
        wall, _, phase, velocity, _ = next_impact(walls[-1], *points[-1], parameters.model)
        walls.append(wall)
        points.append((phase, velocity))
    return close_orbit(np.array(walls), np.array(points), parameters)
