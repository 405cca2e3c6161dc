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

"""Escapes from a chaotic transient, timed at places on both sides of a crisis."""

import dataclasses
import functools
import pathlib
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ..attractors import identity_along
from ..work import Work
from ...attractors.finding import find_attractors
from ...attractors.listing import named
from ...attractors.plane import Plane
from ...core.arrays import FloatArray
from ...core.flight.lanes import make_initial_conditions, new_tiles
from ...core.flight.lanes_step import LANES
from ...core.many.escape import CAPTURED, escape_rate, EscapeRate, last_until_captured, SURVIVED
from ...core.path import Path, SEVERAL
from ...store.layout import Axis, Layout, Variable
from ...store.store import Store

# A trajectory that has settled on an orbit which is not among the captors does not count.
ELSEWHERE: Final = 2
# Impacts for which a survivor is followed.
SURVIVED_LOOK: Final = 1000
# Independent parts in which the escapes at a place are counted, a tile each.
PARTS: Final = 8


@dataclasses.dataclass(frozen=True)
class Escapes:
    """Trajectories whose escape is timed."""

    values: tuple[float, ...]  # places; the first before the crisis, to see that nothing escapes
    path: Path
    plane: Plane  # from which initial conditions are drawn, the same at each place
    wanted: int  # escapes at each place, shared among `PARTS`
    seed: int
    skip: int  # impacts within which escapes do not count: these began in the basin
    limit: int  # impacts after which a trajectory is given up
    limit_before: int  # the same, at the first place
    captors: tuple[tuple[FloatArray, ...], ...]  # points of each at each place (phase, velocity)
    radius: float  # a trajectory is captured within this of them [rad, 1]

    @property
    def wanted_of_part(self) -> int:
        return -(-self.wanted // PARTS)

    @property
    def trajectories(self) -> int:
        """Count the trajectories of a part: all lanes are in use to the last escape."""
        return 2 * self.wanted_of_part + LANES


def layout_of(escapes: Escapes, attributes: dict[str, Any]) -> Layout:
    """Return the layout of the store: a tile for each part of each place."""
    plane, of_each = escapes.plane, (escapes.path.name, 'part', 'trajectory')
    identity = identity_along(
        'crisis', [escapes.path], plane, **{f'{escapes.path.name}s': list(escapes.values)},
        escapes_wanted=escapes.wanted, seed=escapes.seed,
        initial_velocity_window=list(plane.velocity), impacts_skipped=escapes.skip,
        impacts_limit=escapes.limit, impacts_limit_before=escapes.limit_before,
        capture_radius=escapes.radius,
        captors=' '.join(str(len(one)) for one in escapes.captors[-1]))
    del identity['velocity_window']
    # The values say where; of a straight path its ends are needed, too.
    if escapes.path.name != SEVERAL:
        del identity[f'{escapes.path.name}_window']
    return Layout(
        (Axis(escapes.path.name, np.array(escapes.values), named(escapes.path.words), 1),
         Axis('part', np.arange(PARTS), named('independent part', None), 1),
         Axis('trajectory', np.arange(escapes.trajectories),
              named('number of the initial condition', None))),
        (Variable('lifetime', of_each, '<i8', named(
            'impacts before the capture, or before it was given up', 'impacts')),
         Variable('fate', of_each, '|i1', named(
             '1 captured, 0 given up, 2 settled on another stable orbit, -1 came to rest, -2 not '
             'begun', None))),
        identity, attributes)


def time_escapes(escapes: Escapes, output: pathlib.Path, tile: int) -> int:
    """Time the escapes of one part at one place into its tile; return the impacts made."""
    k, part = divmod(tile, PARTS)
    parameters = escapes.path.at(escapes.values[k])
    captors = escapes.captors[k]
    initial = escapes.plane.draw(parameters, escapes.trajectories, escapes.seed * 1_000_003 + part)
    lifetimes, fates, ends = last_until_captured(
        new_tiles(1)[0], initial, np.concatenate(captors), np.array([len(one) for one in captors]),
        escapes.radius, escapes.skip, escapes.wanted_of_part,
        escapes.limit if k else escapes.limit_before)
    survivors = np.flatnonzero(fates == SURVIVED)
    if len(survivors):
        again = make_initial_conditions(parameters, *ends[survivors].T)
        settled = find_attractors(parameters, again, hold=SURVIVED_LOOK, chaotic=False).labels
        fates[survivors[settled >= 0]] = ELSEWHERE
    Store(output).write(tile, {'lifetime': lifetimes[None, None],
                               'fate': fates[None, None].astype(np.int8)})
    return int(lifetimes.sum())


def rates_of(lifetimes: npt.NDArray[Any], fates: npt.NDArray[Any], skip: int) -> list[EscapeRate]:
    """Estimate the escape rate at each place, from what is stored there."""
    return [escape_rate(life[counted], fate[counted] != CAPTURED, skip)
            for life, fate, counted in zip(
                lifetimes, fates, np.isin(fates, (CAPTURED, SURVIVED)), strict=True)]


def compute(escapes: Escapes, attributes: dict[str, Any], work: Work) -> Store:
    store = work.begin(layout_of(escapes, attributes))
    # Lifetimes go nearly as the inverse of the distance from the crisis: so does the time left.
    distances = np.abs(np.array(escapes.values) - attributes[f'tangency_{escapes.path.name}'])
    weights = np.repeat(np.ceil(1000.0 * distances.min() / distances).astype(int), PARTS)
    with work.pending('crisis', store, lambda tile: int(weights[tile])) as (tiles, finished):
        work.run(functools.partial(time_escapes, escapes, store.path), tiles, finished)
    return store
