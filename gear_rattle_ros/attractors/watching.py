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
Basins for somebody who watches: what is known at each level, and how much time it has.

On a chaotic attractor nothing settles before it has stayed there for too many impacts to be a
transient. Where that is the least number of a search, the levels before the last one try fewer,
the first with which no initial condition is claimed that settled elsewhere in the first level.
"""

from collections.abc import Callable, Iterator, Sequence
import dataclasses
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from .catalogue import Catalogue, moved, results_here
from .finding import Check, find_attractors, orbits_among, STAYS
from .letters import with_letters
from .plane import Plane
from .refining import FIRST_CAP, Level, refine, SEED
from ..core.arrays import FloatArray
from ..core.defaults import TOLERANCE
from ..core.flight.lanes import make_initial_conditions
from ..core.many.chaotic_sets import BRIEF, GLANCE
from ..core.many.recorded import record_impacts
from ..core.many.settling import RecordArray, UNSETTLED
from ..core.model import Parameters

# Random initial conditions of the first look for attractors and of the second, and impacts for
# which nothing may leave a chaotic attractor.
GLANCED: Final = 48
DRAWN: Final = 256
HOLD: Final = 2_000
# What takes longer to be distinguished from a transient is left unsettled [impacts].
STAY_MOST: Final = 256
# Shorter stays that are tried [impacts].
STAYS_TRIED: Final = (16, 32, 64)
# Edge of the first level [cells].
COARSEST: Final = 50
# Time for a level, by the length of its edge at the most, after which it is shown [s].
TIMES: Final = ((50, 0.04), (100, 0.08), (200, 0.12), (400, 0.5))
# From this edge on a level goes on until all of it has been followed [cells].
WHOLE_FROM: Final = 400
# Impacts for which what has not settled is followed, again and again.
ROUNDS: Final = (100, 300, 1_000, 3_000)
# A level under way is shown again when this share of it has settled meanwhile.
NEWS: Final = 0.002


class Dropped(Exception):
    """The picture is no longer wanted."""


@dataclasses.dataclass(frozen=True)
class Basins:
    """One picture."""

    plane: Plane
    labels: npt.NDArray[np.int16]  # of every cell, as `classify` gives them
    catalogue: Catalogue
    is_complete: bool  # whether chaotic attractors have been searched for

    def share(self, label: int) -> float:
        """Return the share of the plane that has a label [1]."""
        return float(np.mean(self.labels == label))


def sizes_up_to(largest: int) -> tuple[int, ...]:
    """List the edges of the levels [cells]: each twice the one before, and two at least."""
    sizes = [min(COARSEST, largest)]
    while 2 * sizes[-1] < largest:
        sizes.append(2 * sizes[-1])
    return (*sizes, largest)


def glance(parameters: Parameters, hints: FloatArray) -> tuple[Catalogue, float]:
    """Find the periodic attractors that are seen at once."""
    skip = GLANCE[0]
    drawn = Plane().draw(parameters, GLANCED, SEED)
    hinted = make_initial_conditions(parameters, hints[:, 1], -hints[:, 0], hints[:, 2])
    initial = np.concatenate([hinted, drawn])
    results = results_here(initial, skip, Catalogue(parameters).table)
    states = moved(initial, results)[results['label'] == UNSETTLED]
    orbits = tuple(orbits_among(parameters, states, *GLANCE[1:], TOLERANCE))
    rows, _ = record_impacts(states, 0, 64)
    return (with_letters(Catalogue(parameters, hold=skip, orbits=orbits, labels=results['label'])),
            float(np.max(np.abs(rows['velocity']), initial=0.0)))


def watch(seen: Catalogue, planes: Sequence[Plane], *, cap: int, threads: int,
          is_dropped: Callable[[], bool]) -> Iterator[Basins]:
    """Compute pictures, each finer than the one before."""
    parameters = seen.parameters

    def check() -> None:
        if is_dropped():
            raise Dropped

    def edge_of(plane: Plane) -> int:
        return max(plane.phases, plane.velocities)

    def level_of(plane: Plane, cap: int, sure: float = math.inf) -> Level:
        initial = plane.cells(parameters, slice(0, plane.velocities), slice(0, plane.phases))
        seconds = next((time for most, time in TIMES if edge_of(plane) <= most), math.inf)
        return Level(initial, (plane.velocities, plane.phases), cap, seconds=seconds, sure=sure,
                     is_mixed=True)

    def levels() -> Iterator[tuple[Level, Catalogue]]:
        first = level_of(planes[0], FIRST_CAP, 1)
        yield first, seen
        if len(planes) == 1:
            return
        certain = _without_slow_chaos(find_attractors(
            parameters, planes[1].draw(parameters, DRAWN, SEED), hold=HOLD,
            threads=threads, effort=BRIEF, check=check)).with_orbits(seen.orbits)
        hastened = _hastened(certain, first.states[first.labels.ravel() >= 0], threads, check)
        for plane in planes[1:-1]:
            yield level_of(plane, ROUNDS[-1], int(edge_of(plane) >= WHOLE_FROM)), hastened
        yield level_of(planes[-1], cap), certain

    numbers = iter(planes)
    plane, shown = next(numbers), 1.0
    for level, catalogue, is_done in refine(levels(), rounds=ROUNDS, threads=threads, check=check):
        is_first = plane is planes[0]
        if is_done or (not is_first and shown - level.unsettled > NEWS):
            shown = level.unsettled
            yield Basins(plane, level.labels.copy(), catalogue, not is_first)
        if is_done:
            plane, shown = next(numbers, plane), 1.0


def _without_slow_chaos(catalogue: Catalogue) -> Catalogue:
    if catalogue.stay <= STAY_MOST:
        return catalogue
    labels = np.where(catalogue.labels < len(catalogue.orbits), catalogue.labels, UNSETTLED)
    return dataclasses.replace(catalogue, chaotic=(), stay=0, labels=labels)


def _hastened(catalogue: Catalogue, settled: RecordArray, threads: int, check: Check) -> Catalogue:
    """Let states settle on chaotic attractors as soon as none of those settled elsewhere would."""
    # What leaves after more impacts leaves after fewer, too.
    if catalogue.chaotic and catalogue.stay == STAYS[0]:
        for stay in STAYS_TRIED:
            tried = dataclasses.replace(catalogue, stay=stay)
            labels = tried.label(settled, ROUNDS[-1], threads=threads, check=check)['label']
            first = len(catalogue.orbits)
            if not np.any((labels >= first) & (labels < first + len(catalogue.chaotic))):
                return tried
    return catalogue
