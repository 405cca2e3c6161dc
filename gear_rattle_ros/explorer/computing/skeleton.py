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

"""Layers over the plane: unstable orbits, manifolds, the edge state and the smallest kick."""

from collections.abc import Callable, Iterator, Mapping
import contextlib
import dataclasses
import math
import time
from types import MappingProxyType
from typing import Any, Final, NamedTuple

import numpy as np

from .catalogues import Catalogues
from .computing import SETTLED_AFTER
from ..view import CAP, View
from ...attractors.plane import IMPACT
from ...attractors.skeleton.kicks import Kick, smallest_kick, STEPS
from ...attractors.skeleton.orbits import find_orbits
from ...attractors.skeleton.saddles import Straddling
from ...core.arrays import FloatArray, IntArray
from ...core.flight.elementary import TWO_PI
from ...core.many.settling import UNSETTLED
from ...core.orbits.curves import Curve, sides_of
from ...core.orbits.listing import OrbitList
from ...core.orbits.orbit import Orbit
from ...core.orbits.section import turn
from ...core.words import counted

ORBITS: Final = 'orbits'
MANIFOLDS: Final = 'manifolds'
EDGE: Final = 'edge state'
KICK: Final = 'kick'
LAYERS: Final = (ORBITS, MANIFOLDS, EDGE, KICK)
# Impacts of the longest orbits and points of the section: of a first look, and of more and more.
QUICK: Final = (3, 64)
LONGEST: Final = 6
POINTS: Final = 128
MOST: Final = 1024
# Length of a side of a manifold [1], and the speed up to which it is followed [1].
LENGTH: Final = 60.0
FASTEST: Final = 6.0
# Impacts straddled, and those between two looks at whether they are still wanted.
STRADDLED: Final = 200
SLICE: Final = 50
# Steps of the scans for a kick, the first of which gives an upper bound.
SCANS: Final = (64, STEPS)
SIDES: Final = {0.0: 'upper', -1.0: 'lower'}
NOWHERE: Final = np.zeros((0, 2))


@dataclasses.dataclass(frozen=True)
class Asked:
    """Layers that are switched on, over the whole plane, and the point that was clicked."""

    view: View
    point: tuple[float, float]
    names: tuple[str, ...] = ()


class Layers(NamedTuple):
    """Layers as far as they are computed, in places of the plane (phase, velocity) [rad, 1]."""

    asked: Asked
    # What there is to say about each layer.
    words: Mapping[str, str] = MappingProxyType({})
    orbits: tuple[Orbit, ...] = ()
    # Lines; nan between their pieces.
    unstable: FloatArray = NOWHERE
    stable: FloatArray = NOWHERE
    edge: FloatArray = NOWHERE
    # From where a kick leads just after an impact, and to where, shape (n, 4).
    kick: FloatArray = np.zeros((0, 4))


def places(view: View, walls: IntArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return where impacts lie on a plane, just before and just after; nan off its wall."""
    plane, r = view.plane(1), view.parameters.restitution
    here = np.where(plane.holds(walls)[:, None], points, math.nan)
    here[:, 0] %= TWO_PI
    before, after = (here * ((1.0, factor) if factor in plane.factors(r) else (math.nan, math.nan))
                     for factor in (1.0, -r))
    return before, after


def nearest_saddle(asked: Asked, orbits: tuple[Orbit, ...]) -> Orbit | None:
    """Return the saddle with the impact that is drawn nearest to the point, None without any."""
    def distance(orbit: Orbit) -> float:
        apart = np.concatenate(places(asked.view, orbit.walls, orbit.points)) - asked.point
        return float(np.nanmin(np.hypot(turn(apart[:, 0]), apart[:, 1]), initial=math.inf))

    return min((each for each in orbits if not each.multipliers[0].imag
                and 0.0 < abs(each.multipliers[1]) < 1.0 < abs(each.multipliers[0])
                and np.any(asked.view.plane(1).holds(each.walls))), key=distance, default=None)


class Skeleton:
    """Computes layers; what depends on the parameters alone is kept until they change."""

    def __init__(self, catalogues: Catalogues) -> None:
        self._catalogues = catalogues
        self._view: View | None = None
        self._orbits: OrbitList | None = None
        self._edge: tuple[str, FloatArray] | None = None
        self._kicks: dict[tuple[int, int], Kick | None] = {}

    def layers(self, asked: Asked, check: Callable[[], None]) -> Iterator[Layers]:
        """Compute layers one after the other; `check` is called often, to abandon them."""
        now = Layers(asked)
        if asked.names and not asked.view.plane(1).holds(np.arange(2)).any():
            now = now._replace(words={
                '': 'Impacts lie on the walls: choose the section, or set s₀ to 0 or to −1, '
                    'to see the layers.'})
        yield now
        if now.words or not asked.names:
            return
        if asked.view != self._view:
            self._view, self._orbits, self._edge, self._kicks = asked.view, None, None, {}
            settled = time.monotonic() + SETTLED_AFTER
            while time.monotonic() < settled:
                check()
                time.sleep(0.01)
        for name, compute in ((ORBITS, self._find), (EDGE, self._straddle), (KICK, self._kick)):
            if name in asked.names or name == ORBITS and MANIFOLDS in asked.names:
                for words, change in compute(asked, check):
                    now = now._replace(words={**now.words, **words}, **change)
                    yield now

    def _find(self, asked: Asked, check: Callable[[], None]) -> Iterator[Any]:
        # Manifolds belong to an orbit of the list, and follow it as it grows.
        saddle = None
        while True:
            found = self._orbits
            known = found if found and found.longest == LONGEST else None
            if found is None or known is None or not known.is_complete and known.points < MOST:
                longest, points = QUICK if found is None else (
                    LONGEST, 2 * known.points if known else POINTS)
                found = self._orbits = find_orbits(
                    asked.view.parameters, longest, first=points, most=points, known=known,
                    reached=lambda done, found: check())
            unstable = found.unstable
            if ORBITS in asked.names:
                yield {ORBITS: f'{counted(len(unstable), "unstable orbit")} of up to '
                               f'{counted(found.longest, "impact")}'}, {'orbits': unstable}
            if MANIFOLDS in asked.names:
                nearest = nearest_saddle(asked, unstable)
                if nearest is None:
                    yield {MANIFOLDS: 'no saddle is found' if asked.view.parameters.restitution
                           else 'r = 0: impacts have no inverse, so there is no W<sup>s</sup>'}, {}
                elif saddle is None or nearest.key != saddle.key:
                    saddle = nearest
                    yield from self._grow(asked, saddle, check)
            if found.longest == LONGEST and (found.is_complete or found.points >= MOST):
                return

    def _grow(self, asked: Asked, orbit: Orbit, check: Callable[[], None]) -> Iterator[Any]:
        lines = {'unstable': NOWHERE, 'stable': NOWHERE}
        first, second = orbit.multipliers.real
        words = {MANIFOLDS: f'W<sup>u</sup> and W<sup>s</sup> of the saddle {orbit.name}, '
                            f'multipliers {first:.3g} and {second:.3g}'}
        for name, curve in sides_of(orbit, fastest=FASTEST, check=check, length=LENGTH):
            kind = name.split()[0]
            lines[kind] = np.concatenate([lines[kind], line_of(asked.view, curve)])
            yield words, dict(lines)

    def _straddle(self, asked: Asked, check: Callable[[], None]) -> Iterator[Any]:
        if self._edge is None:
            straddling = Straddling(
                self._catalogues.complete(asked.view, check).catalogue, True, CAP, check)
            points, random, words = NOWHERE, np.random.default_rng(1), 'no boundary of basins'
            with contextlib.suppress(ValueError):
                while len(points) < STRADDLED:
                    points = np.concatenate([points, straddling.follow(
                        asked.view.plane(1), SLICE, random)])
                    words = 'edge state'
                    yield {EDGE: words}, {'edge': self._both(asked.view, points)}
                orbit, words = straddling.orbit_of(points), 'the boundary holds a chaotic saddle'
                if orbit:
                    points, words = orbit.points, f'edge state: {orbit.name}'
            self._edge = words, self._both(asked.view, points)
        yield {EDGE: self._edge[0]}, {'edge': self._edge[1]}

    @staticmethod
    def _both(view: View, points: FloatArray) -> FloatArray:
        both = np.concatenate(places(view, np.signbit(points[:, 1]).astype(np.int64), points))
        return both[np.isfinite(both[:, 0])]

    def _kick(self, asked: Asked, check: Callable[[], None]) -> Iterator[Any]:
        catalogue = self._catalogues.complete(asked.view, check).catalogue
        (label,) = catalogue.label(asked.view.plane(1).at(
            asked.view.parameters, [asked.point[0]], [asked.point[1]]), CAP, check=check)[
                'label'].tolist()
        model = asked.view.parameters
        titles = {each.label: each.letter or each.key for each in catalogue.attractors}
        own = next((each for each in catalogue.attractors if each.label == label), None)
        if label == UNSETTLED or own is None:
            yield {KICK: 'the point that was clicked does not settle'}, {}
            return
        for steps in SCANS:
            if (label, steps) not in self._kicks:
                self._kicks[label, steps] = smallest_kick(
                    catalogue, own, steps=steps, cap=CAP, check=check)
            kick = self._kicks[label, steps]
            if kick is None:
                yield {KICK: f'no kick up to 2 leads away from {titles[label]}'}, {}
                continue
            words = (f'smallest kick from {titles[label]} to '
                     f'{titles.get(kick.target, kick.target)}: {kick.change:+.4g} at the '
                     f'{SIDES[-float(kick.wall)]} wall, phase {kick.phase:.4f}')
            here = int(asked.view.plane(1).holds(np.array([kick.wall]))[0])
            first, change, factor = kick.velocity_after, kick.change, model.restitution
            if asked.view.on == IMPACT:
                # As a change of the velocity before the impact it does the same.
                first, change = kick.velocity, change / (-factor if first and factor else 1.0)
            other = f' (set s₀ to {"−1" if kick.wall else "0"} to see it)'
            yield {KICK: words + ('' if here else other)}, {
                'kick': np.array([[kick.phase, first, kick.phase, first + change]])[:here]}


def line_of(view: View, curve: Curve) -> FloatArray:
    """Return a curve before and after its impacts as a line; nan where it breaks off."""
    def broken(points: FloatArray) -> FloatArray:
        # A step round the circle of phases is no line.
        breaks = curve.begins.copy()
        breaks[1:] |= np.abs(np.diff(points[:, 0])) > math.pi
        return np.insert(points, np.flatnonzero(breaks), math.nan, axis=0)

    return np.concatenate([broken(each) for each in places(view, curve.walls, curve.points)])
