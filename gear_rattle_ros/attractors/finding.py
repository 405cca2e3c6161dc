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
Finding every attractor at given parameters: the one answer that all tools and nodes ask for.

Random initial conditions are followed in stages. After each, impacts of those that have not
settled are searched for recurrences; Newton's method closes them to orbits, and stable ones enter
the table by which the next stage recognises them. What has not settled after the stages moves on
sets of boxes of the section. Such a set is a chaotic attractor only if its largest exponent is
positive by `SIGNIFICANT` errors and if in `CONFIRMED` times `hold` impacts, shared by as many
trajectories as there are lanes, nothing leaves it: none settles elsewhere, none comes to recur.
Whatever else is not on a known attractor within `hold` impacts is labelled as unsettled.
"""

from collections.abc import Callable
import dataclasses
from typing import Any, Final, TypeAlias

import numpy as np

from .catalogue import BATCH, Catalogue, go_on, moved
from .letters import with_letters
from .plane import Plane
from ..core.defaults import HOLD, INITIAL_CONDITIONS, SEED, TOLERANCE
from ..core.flight.lanes_step import LANES
from ..core.many.chaotic_sets import chaotic_sets, ChaoticSet, Effort, fill_lanes, THOROUGH
from ..core.many.recognition import find_orbit, with_neighbourhood
from ..core.many.recorded import record_impacts
from ..core.many.settling import RecordArray, UNSETTLED
from ..core.model import Parameters
from ..core.orbits.orbit import close_orbit, NEAR, Orbit
from ..core.orbits.section import distances, shortest_recurrence

# A chaotic attractor must keep trajectories for this many times `hold` impacts.
CONFIRMED: Final = 32
# A largest exponent is positive if it exceeds zero by this many standard errors.
SIGNIFICANT: Final = 5.0
# Impacts in the boxes after which a trajectory is taken to be on a chaotic attractor: as few as
# are certain to be enough, from the first of these.
STAYS: Final = (128, 256, 512, 1024, 2048, 4096, 8192, 16384, 32768)
# Sets of boxes whose numbers fit in one byte.
SETS_MOST: Final = 60
# Impacts of each trajectory that are kept at the most; what is wanted beyond is only followed.
TRACED: Final = 40_000

Check: TypeAlias = Callable[[], None]
CONSERVES: Final = 'restitution = 1 and beta = 0 preserve areas: there are no attractors'


def conserves_areas(model: Parameters | np.recarray[Any, Any]) -> Any:
    """Whether nothing contracts, so that no attractors exist; of INITIAL for every row."""
    return (model.restitution == 1.0) & (model.beta == 0.0)


def find_attractors(parameters: Parameters, initial: RecordArray | None = None, *,
                    tolerance: float = TOLERANCE, hold: int = HOLD, chaotic: bool = True,
                    known: tuple[Orbit, ...] = (), effort: Effort = THOROUGH,
                    threads: int | None = None, cluster: str | None = None,
                    check: Check = go_on) -> Catalogue:
    """
    Find the attractors that initial conditions reach; none where areas are preserved.

    Parameters
    ----------
    parameters : Parameters
        The model.
    initial : ndarray of INITIAL, shape (n,), optional
        By default `INITIAL_CONDITIONS` random ones of the default plane.
    tolerance : float
        Largest distance of a trajectory that is on its orbit [1].
    hold : int
        Impacts after which what has not settled is unsettled, and for which nothing may leave
        what is called a chaotic attractor.
    chaotic : bool
        Whether chaotic attractors are searched for among what is left.
    known : tuple of Orbit
        Orbits at nearby parameters: a first guess, which saves time and finds thin basins.
    effort : Effort
        How long chaotic sets are followed.
    threads, cluster : optional
        As `run_tiles` takes them; the result does not depend on them.
    check : callable
        Called every few tenths of a second at least; raises to give up.

    """
    if initial is None:
        initial = Plane().draw(parameters, INITIAL_CONDITIONS, SEED)
    catalogue = Catalogue(parameters, tolerance, hold,
                          labels=np.full(len(initial), UNSETTLED, np.int64), states=initial)
    if conserves_areas(parameters):
        return catalogue
    search = _Search(catalogue, {'threads': threads, 'cluster': cluster, 'check': check})
    search.add(carried(known, parameters, tolerance))
    last = effort.stages[-1]
    for until, count, longest in (*(stage for stage in effort.stages if stage[0] < hold),
                                  (min(hold, last[0]), *last[1:])):
        if not len(search.left):
            break
        search.follow_to(until)
        search.add(orbits_among(parameters, search.unsettled, count, longest, tolerance, check))
    search.follow_to(search.followed + effort.stages[0][0])
    while chaotic and len(search.left):
        sets, orbits = search.confirmed(effort, check)
        if not search.add(orbits):
            search.settle_on(sets)
            break
        search.follow_to(search.followed + effort.stages[1][0])
    search.follow_to(hold)
    return with_letters(search.known)


class _Search:
    """A search under way: in `followed` impacts those numbered in `left` have not settled."""

    def __init__(self, catalogue: Catalogue, settings: dict[str, Any]) -> None:
        self.known = dataclasses.replace(catalogue, states=catalogue.states.copy())
        self._initial = catalogue.states
        self._settings = settings
        self.left = np.arange(len(catalogue.labels))
        self.followed = 0

    @property
    def unsettled(self) -> RecordArray:
        return self.known.states[self.left]

    def add(self, orbits: list[Orbit]) -> bool:
        """Enter orbits into the table, in the order of their keys; return whether any is new."""
        before, more = self.known.orbits, self.known.with_orbits(tuple(orbits))
        if more is self.known:
            return False
        ordered = {orbit.key: orbit for orbit in sorted(
            (*before, *more.late), key=lambda orbit: orbit.key)}
        numbers = np.array([[*ordered].index(orbit.key) for orbit in before], np.int64)
        settled = more.labels >= 0
        more.labels[settled] = numbers[more.labels[settled]]
        self.known = dataclasses.replace(more, orbits=tuple(ordered.values()), late=())
        return True

    def follow_to(self, impacts: int) -> None:
        """Follow what is left until it has made this number of impacts."""
        if impacts <= self.followed or not len(self.left):
            return
        results = self.known.label(self.unsettled, impacts - self.followed, **self._settings)
        self.known.labels[self.left] = results['label']
        self.known.states[self.left] = moved(self.unsettled, results)
        self.left = self.left[results['label'] == UNSETTLED]
        self.followed = impacts

    def confirmed(self, effort: Effort, check: Check) -> tuple[list[ChaoticSet], list[Orbit]]:
        """Find the sets that nothing leaves, and orbits to which some leave."""
        known, found = self.known, list[ChaoticSet]()
        wanted = CONFIRMED * known.hold
        states = fill_lanes(self.unsettled)
        ends = states[:0]
        check()
        length = min(max(wanted // LANES, effort.length), TRACED)
        for chaos in chaotic_sets(known.parameters, states, length, effort,
                                  known.tolerance)[:SETS_MOST]:
            check()
            ends = np.concatenate([ends, chaos.states[chaos.recurs]])
            report = chaos.exponents
            if np.any(chaos.recurs) or not report.lambda_1 > SIGNIFICANT * report.lambda_1_error:
                continue
            if chaos.impacts < wanted:
                # Few trajectories came there: they go on in all lanes.
                more = fill_lanes(chaos.states)
                results = known.label(more, -(-(wanted - chaos.impacts) // LANES),
                                      **self._settings)
                ends = np.concatenate([ends, moved(more, results)])
                if np.any(results['label'] != UNSETTLED):
                    continue
            found.append(chaos)
        return found, orbits_among(known.parameters, ends, *effort.stages[-1][1:],
                                   known.tolerance, check)

    def settle_on(self, sets: list[ChaoticSet]) -> None:
        """Let what is left settle on sets that nothing leaves, and find how soon it may."""
        elsewhere = np.delete(self._initial, self.left)
        for stay in STAYS:
            if not sets or stay > self.known.hold:
                return
            tried = dataclasses.replace(self.known, chaotic=tuple(sets), stay=stay)
            labels = tried.label(elsewhere, **self._settings)['label']
            leaks = labels[labels >= len(tried.orbits)] - len(tried.orbits)
            if not len(leaks):
                break
        else:
            # What trajectories leave after so long is a transient.
            tried = dataclasses.replace(tried, chaotic=tuple(
                chaos for number, chaos in enumerate(sets) if number not in leaks))
        self.known = tried
        self.follow_to(max(tried.hold, self.followed + stay))


def carried(orbits: tuple[Orbit, ...], parameters: Parameters, tolerance: float) -> list[Orbit]:
    """Close orbits of nearby parameters at these; those that are stable here."""
    found = (close_orbit(orbit.walls, orbit.points, parameters, NEAR) for orbit in orbits
             if orbit.sticks < 0)
    stable = (with_neighbourhood(orbit, tolerance) for orbit in found
              if orbit is not None and orbit.is_stable)
    return [orbit for orbit in stable if orbit is not None]


def orbits_among(parameters: Parameters, states: RecordArray, count: int, longest: int,
                 tolerance: float, check: Check = go_on) -> list[Orbit]:
    """Find the stable periodic orbits of at most `longest` impacts that trajectories approach."""
    # Each trajectory is followed for `count` impacts; the orbits come in the order of their keys.
    found: dict[str, Orbit] = {}
    for first in range(0, len(states), BATCH):
        check()
        rows, counts = record_impacts(states[first:first + BATCH], 0, count)
        for row in rows[counts == count]:
            last = row[-1]
            q = int(shortest_recurrence(row, longest, tolerance))
            # The same again as another trajectory has shown.
            if q and any(orbit.impacts == q and np.min(distances(
                    orbit.velocities, orbit.phases, last['velocity'], last['phase']))
                    < 2.0 * tolerance for orbit in found.values()):
                continue
            orbit = find_orbit(parameters, row, longest, tolerance)
            if orbit is not None:
                found.setdefault(orbit.key, orbit)
    return [found[key] for key in sorted(found)]
