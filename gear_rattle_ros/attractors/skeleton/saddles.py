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

"""Edge states and chaotic saddles of the gear, by straddling what the catalogue labels."""

from collections.abc import Callable, Iterator
import dataclasses
import functools
import math
from typing import Final

import numpy as np

from ..catalogue import Attractor, Catalogue, go_on, Kind, results_here
from ..finding import Check
from ..plane import Plane
from ...core.arrays import FloatArray, IntArray, RecordArray
from ...core.flight.closed_form import NO_WALL
from ...core.flight.elementary import TWO_PI
from ...core.many.recorded import initial_after, record_impacts
from ...core.many.settling import UNSETTLED
from ...core.many.sprinkler import estimate, growths, rates_of, SaddleRates
from ...core.model import STICKING_SPEED
from ...core.orbits.impact_map import map_points
from ...core.orbits.orbit import close_orbit, NEAR, Orbit
from ...core.orbits.section import distances, turn
from ...core.orbits.straddle import any_change, FINE, first_change, longest_lived, straddle
from ...core.words import counted

# Impacts for which initial conditions are followed to the section, and how many are drawn at once.
ARRIVE: Final = 3
DRAWN: Final = 64
TRIES: Final = 64
# Images whose flights differ by more than this lie on both sides of a grazing [1].
TOGETHER: Final = 0.1
# How near impacts are to an orbit [rad, 1].
CLOSE: Final = 0.01
# A straddle trajectory that has come to an orbit, of at most so many impacts, comes back as near
# in this share of the steps.
RETURNS: Final = 64
SETTLED: Final = 0.5
# Impacts after which a sprinkled trajectory is near the saddle, half the edge of the squares about
# its points in which they are sprinkled [rad, 1], and the rows of growth at the most.
HEAD: Final = 15
SPREAD: Final = 0.01
FOLLOWED: Final = 1000
ROW: Final = 400
# Impacts by which a trajectory that leaves is away from the saddle, before it begins to converge;
# lifetimes are told apart up to this many times those of what leaves at once.
LEAVE: Final = 20
FAR: Final = 4


@dataclasses.dataclass(frozen=True)
class Straddling:
    """What is straddled at given parameters: the boundaries of basins, or a chaotic transient."""

    catalogue: Catalogue
    is_edge: bool  # labels are compared; else lifetimes
    cap: int  # impacts after which a point is given up
    check: Check = go_on  # is called often, and raises to give up

    def results(self, points: FloatArray, cap: int) -> RecordArray:
        """Return the RESULT of impacts (phase, velocity before them)."""
        self.check()
        return results_here(initial_after(self.catalogue.parameters, *points.T), cap,
                            self.catalogue.table)

    def values(self, points: FloatArray) -> IntArray:
        """Return their labels, or their lifetimes as far as it matters here."""
        name, cap = ('label', self.cap) if self.is_edge else ('lifetime', FAR * self.tail)
        return np.asarray(self.results(points, cap)[name], np.int64)

    def advance(self, points: FloatArray) -> FloatArray | None:
        """Map points near each other to their next impacts, if these are near each other, too."""
        images, _, walls, times = map_points(points, self.catalogue.parameters.model)
        if NO_WALL in walls or np.ptp(walls) or np.ptp(times) > TOGETHER:
            return None
        images[:, 0] = images[0, 0] + turn(images[:, 0] - images[0, 0])
        return images

    def segments(self, plane: Plane, random: np.random.Generator) -> Iterator[FloatArray]:
        """Draw pairs of impacts at one wall of different values."""
        for _ in range(TRIES):
            initial = plane.draw(self.catalogue.parameters, DRAWN, int(random.integers(1 << 31)))
            rows, made = record_impacts(initial, ARRIVE, 1)
            rows = rows[made > 0, 0]
            points = np.column_stack([rows['phase'], rows['velocity']])
            upper = points[:, 1] > 0.0
            points = points[upper == (np.sum(upper) >= 0.5 * len(points))]
            values = self.values(points)
            other = np.flatnonzero(values != values[:1])
            if len(other):
                yield points[[0, int(other[0])]]

    def follow(self, plane: Plane, steps: int, random: np.random.Generator) -> FloatArray:
        """Return a straddle trajectory of impacts (phase, velocity), shape (steps, 2)."""
        alpha = self.catalogue.parameters.alpha
        settled = sum(each.label != UNSETTLED for each in self.catalogue.attractors)
        if self.is_edge and settled < 2:
            raise ValueError(f'alpha = {alpha:g}: there is no boundary of basins, as '
                             f'{counted(settled, "attractor")} is all that initial conditions '
                             'reach; follow a transient with --transient')
        choose = any_change if self.is_edge else longest_lived(FAR * self.tail)
        points = np.zeros((0, 2))
        # After a loss, it goes on elsewhere.
        for ends in self.segments(plane, random):
            points = np.concatenate([points, straddle(
                ends, self.advance, self.values, choose, HEAD + steps - len(points), random)[
                    HEAD:]])
            if len(points) >= steps:
                break
        if not len(points):
            raise ValueError(f'alpha = {alpha:g}: random initial conditions show nothing to '
                             'straddle; take another window or another alpha')
        points[:, 0] %= TWO_PI
        return points

    def orbits_near(self, points: FloatArray, orbits: tuple[Orbit, ...]
                    ) -> list[tuple[Orbit, int]]:
        """List the orbits that impacts come near all along, and how many are near each."""
        return [(orbit, int(np.sum(apart < CLOSE))) for orbit in orbits if np.all(np.min(
            apart := distances(points[:, 1], points[:, 0], orbit.velocities[:, None],
                               orbit.phases[:, None]), axis=1, initial=math.inf) < NEAR)]

    def orbit_of(self, points: FloatArray) -> Orbit | None:
        """Return the orbit on which a straddle trajectory stays; None where it stays on none."""
        for q in range(1, min(RETURNS, len(points) // 2)):
            back = distances(points[:-q, 1], points[:-q, 0], points[q:, 1], points[q:, 0])
            if np.mean(back < CLOSE) >= SETTLED:
                orbit = self.closed(points, back)
                return orbit.canonical() if orbit and not orbit.is_stable else None
        return None

    def closed(self, points: FloatArray, back: FloatArray) -> Orbit | None:
        """Close impacts to an orbit where they come back nearest, by their distances."""
        ring = points[np.argmin(back):][:len(points) - len(back)]
        return close_orbit(np.signbit(ring[:, 1]).astype(np.int64), ring,
                           self.catalogue.parameters, NEAR)

    def rates(self, points: FloatArray, estimates: Callable[[], FloatArray]) -> SaddleRates:
        """Return the rates of what a straddle trajectory lies on, exact where it is one orbit."""
        orbit = self.orbit_of(points)
        if orbit is None:
            return rates_of(estimates())
        one, two = ((exponent, 0.0) for exponent in orbit.exponents)
        return SaddleRates(one, one, two, impacts=orbit.impacts)

    def accessible(self, attractor: Attractor, steps: int, random: np.random.Generator
                   ) -> FloatArray:
        """Straddle the boundary that is met first from an attractor; no steps where none is."""
        inside = attractor.points()[:, 1:]
        for _ in range(TRIES):
            # At rest there are no impacts.
            own = (inside[random.integers(len(inside))] if len(inside) else
                   random.uniform([0.0, -1.0], [TWO_PI, 1.0]))
            ends = np.array([own, [1.0, own[1]] * random.uniform([0.0, 0.0], [TWO_PI, 2.0])])
            labels = self.values(ends)
            if labels[1] != attractor.label == labels[0]:
                return straddle(ends, self.advance, lambda points: np.asarray(
                    self.values(points) != attractor.label, np.int64), first_change, steps, random,
                    FINE)
        return np.zeros((0, 2))

    def accessible_orbit(self, attractor: Attractor, orbits: tuple[Orbit, ...], rays: int,
                         steps: int, random: np.random.Generator) -> tuple[Orbit, int] | None:
        """Return the orbit on the boundary that is met first, and how many impacts are near it."""
        points = np.concatenate([self.accessible(attractor, steps, random) for _ in range(rays)])
        return max(self.orbits_near(points, orbits), default=None,
                   key=lambda near: near[1] / near[0].impacts)

    @functools.cached_property
    def tail(self) -> int:
        """Impacts in which what has left the saddle settles on any attractor."""
        restitution, tails = self.catalogue.parameters.restitution, [0.0]
        for each in self.catalogue.attractors:
            if each.orbit:
                tails.append(math.log(self.catalogue.tolerance) / each.exponents[0])
            elif each.kind is Kind.RESTING and 0.0 < restitution < 1.0:
                tails.append(math.log(STICKING_SPEED) / math.log(restitution))
        return LEAVE + math.ceil(max(tails))

    def sprinkle(self, points: FloatArray, count: int, random: np.random.Generator) -> FloatArray:
        """Return an `estimate` from one batch of initial conditions about impacts on a saddle."""
        about = points[random.integers(len(points), size=count)]
        about = about + SPREAD * (2.0 * random.random(about.shape) - 1.0)
        results = self.results(about, self.cap)
        # Those that stick go on as one.
        about, results = (each[np.isnan(results['release'])] for each in (about, results))
        censored = results['label'] == UNSETTLED
        lifetimes = np.where(censored, results['impacts'], results['lifetime'])
        followed = np.flatnonzero(lifetimes > HEAD + self.tail)[:FOLLOWED]
        grown = self.growths(initial_after(self.catalogue.parameters, *about[followed].T), min(
            int(np.max(lifetimes[followed], initial=1)), ROW))
        return estimate(lifetimes, censored, grown, followed, HEAD, self.tail)

    def growths(self, initial: RecordArray, steps: int) -> FloatArray:
        """Return the growths of two directions along trajectories, shape (n, steps, 2)."""
        rows, _ = record_impacts(initial, 0, steps)
        _, matrices, _, _ = map_points(np.column_stack(
            [rows['phase'].ravel(), rows['velocity'].ravel()]), self.catalogue.parameters.model)
        return growths(matrices.reshape(-1, steps, 2, 2))
