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

"""Orbits, manifolds and edge states that organise the basins, quickly, for a live picture."""

from collections.abc import Iterator, Mapping
import contextlib
from typing import Final, TypeAlias

import numpy as np

from .kicks import Kick
from .orbits import find_orbits
from .saddles import Straddling
from ..catalogue import Catalogue
from ..finding import Check, conserves_areas
from ..plane import Plane
from ...core.arrays import FloatArray
from ...core.many.settling import UNSETTLED
from ...core.orbits.curves import pieces, sides_of
from ...core.orbits.orbit import Orbit

#: Places (phase, velocity before the impact) by layer: points of shape (n, 2), or pieces of lines
#: from one place to another of shape (n, 2, 2).
Layers: TypeAlias = Mapping[str, FloatArray]

ORBITS, UNSTABLE, STABLE, EDGE, KICK = LAYERS = (
    'unstable_orbits', 'unstable_manifold', 'stable_manifold', 'edge_state', 'smallest_kick')
# Impacts of the longest orbits, and points of the section from which they are sought.
LONGEST: Final = 6
FIRST: Final = 256
MOST: Final = 2048
# Impacts of the edge state, and of each of the rays to the boundary of a basin.
STRADDLED: Final = 400
REACHED: Final = 100
RAYS: Final = 4
# Length and precision of each side of a manifold, and its fastest impact in units of the plane's.
LENGTH: Final = 40.0
PRECISION: Final = 0.01
FASTER: Final = 3.0
SEED: Final = 1


def skeletons(catalogue: Catalogue, kicks: Mapping[int, Kick | None], plane: Plane, check: Check
              ) -> Iterator[dict[int, Layers]]:
    """
    Compute the layers of every attractor, by label, as far as they are known.

    They are yielded again when there are more, the smallest kick and the unstable orbits first.
    `check` is called many times a second, and raises to give up. There are none where areas are
    preserved, and nothing attracts.
    """
    parameters, random = catalogue.parameters, np.random.default_rng(SEED)
    attractors = catalogue.attractors
    if conserves_areas(parameters):
        return
    orbits = find_orbits(parameters, LONGEST, first=FIRST, most=MOST, threads=1,
                         reached=lambda points, found: check()).unstable
    layers: dict[int, Layers] = {each.label: within(plane, {ORBITS: np.concatenate(
        [np.zeros((0, 2)), *(orbit.points for orbit in orbits)])}) for each in attractors}
    for label, kick in kicks.items():
        if kick is not None and parameters.restitution:
            # As a change of the velocity before the impact it does the same.
            layers[label] = {**layers[label], KICK: np.array([[
                (kick.phase, kick.velocity),
                (kick.phase, kick.velocity - kick.change / parameters.restitution)]])}
    yield layers
    bounded = [each for each in attractors if each.label != UNSETTLED]
    # With one attractor there is no boundary, and where impacts forget everything no way back.
    if len(bounded) < 2 or not parameters.restitution:
        return
    straddling = Straddling(catalogue, True, catalogue.hold, check)
    known: dict[str, Layers] = {}
    for each in bounded:
        met = straddling.accessible_orbit(each, orbits, RAYS, REACHED, random)
        if met is None:
            continue
        saddle, _ = met
        if saddle.key not in known:
            known[saddle.key] = within(plane, manifolds(saddle, plane, check))
        layers = layers | {each.label: {**layers[each.label], **known[saddle.key]}}
        yield layers
    # ValueError where random initial conditions of the plane are in one basin.
    with contextlib.suppress(ValueError):
        edge = within(plane, {EDGE: straddling.follow(plane, STRADDLED, random)})
        yield {label: {**mine, **edge} for label, mine in layers.items()}


def manifolds(orbit: Orbit, plane: Plane, check: Check) -> Layers:
    """Return both manifolds of a saddle."""
    fastest = FASTER * max(map(abs, plane.velocity))
    parts: dict[str, list[FloatArray]] = {UNSTABLE: [], STABLE: []}
    for name, curve in sides_of(orbit, fastest=fastest, check=check, length=LENGTH,
                                tolerance=PRECISION):
        parts[STABLE if name.startswith('stable') else UNSTABLE].append(
            pieces(curve.points, curve.begins))
    return {name: np.concatenate(both) for name, both in parts.items()}


def within(plane: Plane, layers: Layers) -> Layers:
    """Leave out what is faster than the plane."""
    fastest = max(map(abs, plane.velocity))
    return {name: places[np.abs(places[..., 1]).max(axis=tuple(range(1, places.ndim - 1)))
                         <= fastest] for name, places in layers.items()}
