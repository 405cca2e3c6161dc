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

"""The orbit on the boundary of a basin that a kick leads to, and how far its manifold is."""

import math
from typing import Final

import numpy as np

from .kicks import Kick
from .saddles import Straddling
from ..catalogue import Attractor, Catalogue
from ...core.arrays import FloatArray
from ...core.orbits.curves import Curve, grow, impact_map, Map, Segment, segments_of
from ...core.orbits.manifolds import saddle_of
from ...core.orbits.orbit import Orbit
from ...core.orbits.section import distances, turn
from ...core.orbits.straddle import FINE, first_change, straddle

# Impacts for which the boundary is followed, and how near these come back on an orbit [rad, 1].
FOLLOWED: Final = 60
RECURS: Final = 1e-3
SEED: Final = 1
# Length of each side of a manifold [1]; by chords a distance from it is known to this factor, and
# in rounds its place is located, among so many points at a time.
LENGTH: Final = 60.0
CHORD: Final = 1.01
ROUNDS: Final = 25
AMONG: Final = 9


def accessible_orbit(catalogue: Catalogue, attractor: Attractor, kick: Kick | None, cap: int
                     ) -> Orbit | None:
    """Find the saddle on the boundary that is met first on the way to the tip of a kick."""
    restitution = catalogue.parameters.restitution
    if kick is None or not restitution:
        return None
    straddling = Straddling(catalogue, True, cap)
    # As a change of the velocity before the impact the kick does the same.
    ends = np.array([kick.phase, kick.velocity]) - np.outer(
        [0.0, kick.change / restitution], [0.0, 1.0])
    points = straddle(
        ends, straddling.advance, lambda points: np.asarray(
            straddling.values(points) != attractor.label, np.int64),
        first_change, FOLLOWED, np.random.default_rng(SEED), FINE)
    for q in range(1, len(points)):
        back = distances(points[:-q, 1], points[:-q, 0], points[q:, 1], points[q:, 0])
        if back.min() < RECURS:
            orbit = straddling.closed(points, back)
            first, second = orbit.multipliers if orbit else (0.0, 0.0)
            # What sticks has no stable manifold.
            if orbit and first.imag == 0.0 and abs(first) > 1.0 > abs(second) > 0.0:
                return orbit.canonical()
    return None


def least_changes(orbit: Orbit, impacts: FloatArray, fastest: float) -> tuple[float, float]:
    """
    Return the least changes of impacts that lead to the stable manifold of a saddle.

    The first is of the velocity alone, the second of phase and velocity before the impact [1];
    inf where the manifold, as far as it is followed, has no such place.
    """
    least = [math.inf, math.inf]
    map_on = impact_map(orbit.parameters.model, backwards=True, fastest=fastest)
    for _, segment, backwards in segments_of(saddle_of(orbit)):
        if backwards:
            curve = grow(segment, map_on, length=LENGTH)
            for impact in impacts:
                for k, is_kick in enumerate((True, False)):
                    least[k] = min(least[k], _nearest(
                        curve, segment, map_on, impact, is_kick, least[k]))
    return least[0], least[1]


def _nearest(curve: Curve, segment: Segment, map_on: Map, impact: FloatArray, is_kick: bool,
             least: float) -> float:
    """Return the distance of a curve from an impact, at its phase where that is kicked."""
    wall, *place = impact
    begin, step = _beside(curve.points, place)[:-1], curve.steps[:-1]
    with np.errstate(invalid='ignore', divide='ignore'):
        part = (-begin[:, 0] / step[:, 0] if is_kick else np.clip(
            -np.sum(begin * step, axis=1) / np.sum(step**2, axis=1), 0.0, 1.0))
        apart = np.hypot(*(begin + part[:, None] * step).T)
        apart[~((part >= 0.0) & (part <= 1.0)) | (curve.walls[1:] != wall)] = math.inf
    k = int(np.argmin(apart))
    if apart[k] == math.inf or apart[k] > CHORD * least:
        return math.inf
    # The end of an image is the beginning of the next.
    joined = curve.impacts[k] == curve.impacts[k + 1]
    low, high = curve.places[k] if joined else 0.0, curve.places[k + 1]
    for _ in range(ROUNDS):
        places = np.linspace(low, high, AMONG)
        beside = _beside(map_on(*segment.at(places), curve.impacts[k + 1])[1], place)
        sizes = np.hypot(*beside.T)
        best = int(np.argmin(np.abs(beside[:, 0]) if is_kick else sizes))
        low, high = places[max(best - 1, 0)], places[min(best + 1, AMONG - 1)]
    return float(sizes[best])


def _beside(points: FloatArray, place: list[float]) -> FloatArray:
    return np.column_stack([turn(points[:, 0] - place[0]), points[:, 1] - place[1]])
