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

"""Grids of labels and lifetimes, tile by tile: what basins and lifetimes share."""

import dataclasses
import functools
import json
import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ..attractors import write_attractors
from ..work import Work
from ...attractors.catalogue import Catalogue
from ...attractors.letters import with_letters
from ...attractors.listing import named
from ...attractors.plane import Plane, STROBE
from ...attractors.refining import late_orbits, Level
from ...core.flight.lanes import EMPTY
from ...core.many.settling import RESULT, UNSETTLED
from ...core.model import Parameters
from ...core.orbits.orbit import Orbit
from ...store.layout import Axis, Layout, Variable
from ...store.store import Store

GRIDS: Final = ('label', 'lifetime', 'stick', 'release')
LATE: Final = 'late_orbits'
# Tiles: as many along an edge, within these lengths.
ACROSS: Final = 4
SHORTEST: Final = 50
LONGEST: Final = 500


def grid_layout(plane: Plane, identity: dict[str, Any], title: str, cap: int,
                tile: int | None = None) -> Layout:
    """Lay out a grid of labels and lifetimes; the result does not depend on the `tile`."""
    edge = tile or min(max(-(-max(plane.phases, plane.velocities) // ACROSS), SHORTEST), LONGEST)
    return Layout(axes_of(plane, edge), tuple(
        Variable(name, ('velocity', plane.across), dtype, named(words, units))
        for name, dtype, words, units in (
            ('label', '<i2', 'attractor: attractor_label; -1 unsettled, -2 and -3 at rest on the '
             'upper and lower wall, -4 between the walls', '1'),
            ('lifetime', '<i4', 'impacts until the trajectory stays within the tolerance of its '
             f'attractor; {cap} where label is -1', '1'),
            ('stick', '<i4', 'impacts until the driven gear first sticks; -1 where it settles '
             'without', '1'),
            ('release', '<f8', 'drive phase at which it then leaves the wall: all that leave at '
             'the same go on as one trajectory', 'rad'))), identity, {'title': title})


def axes_of(plane: Plane, edge: int) -> tuple[Axis, Axis]:
    """Return the axes of a grid whose tiles have this edge [cells]."""
    return (Axis('velocity', plane.velocity_values(), named('initial velocity'), edge),
            Axis(plane.across, plane.across_values(), named(
                'initial drive phase', 'rad') if plane.kind != STROBE else named(
                    'initial displacement'), edge))


def fill_tile(store: Store, plane: Plane, cap: int, is_far: bool, known: Catalogue, tile: int
              ) -> tuple[int, tuple[Orbit, ...], dict[str, npt.NDArray[Any]]]:
    """Compute a tile; what is unsettled once more, where late orbits are known."""
    # Returns the impacts made, stable orbits that the catalogue did not know, and what is to be
    # stored: nothing where that `is_far` from the store's process and has been stored from here.
    part, shape = store.tiles[tile], _shape(store, tile)
    level = Level(plane.cells(known.parameters, part['velocity'], part[plane.across]), shape, cap,
                  slice_impacts=math.inf)
    # As it stays where areas are preserved.
    grids = {name: np.full(shape, value, RESULT[name]) for name, value in zip(
        GRIDS, (UNSETTLED, cap, EMPTY, math.nan), strict=True)}
    if known.late:
        grids = {name: store.read(tile, name) for name in GRIDS}
        level.left = level.due = np.flatnonzero(grids['label'] == UNSETTLED)
        if not len(level.left):
            return 0, (), {}
    followed, found = level.follow(cap, known.table, threads=1)
    for name, grid in grids.items():
        np.put(grid, followed, found[name])
    if is_far:
        store.write(tile, grids)
        grids = {}
    orbits = () if known.late else late_orbits(known, level, len(level.states)).late
    return level.impacts, orbits, grids


def compute_grid(store: Store, plane: Plane, catalogue: Catalogue, cap: int, work: Work, name: str
                 ) -> Catalogue:
    """Compute the pending tiles; write the attractors, and orbits found late in them, too."""
    known = catalogue.with_orbits(tuple(_orbits_from(
        store.attrs.get(LATE, '[]'), catalogue.parameters)))
    # Threads that write would wait for each other.
    fill = functools.partial(fill_tile, store, plane, cap, work.cluster is not None)
    written = None
    with work.pending(name, store, lambda tile: math.prod(_shape(store, tile))) as (
            pending, finished):
        def filled(tile: int, done: tuple[int, tuple[Orbit, ...], dict[str, Any]]) -> None:
            nonlocal known, written
            impacts, orbits, grids = done
            store.write(tile, grids)
            more = known.with_orbits(orbits)
            if more is not known:
                known = more
                store.set_attributes({LATE: _text_of(known.late)})
            finished(tile, impacts)
            if written is None:
                # While other threads compute.
                write_attractors(store, known)
                written = known

        work.run(functools.partial(fill, catalogue), pending, filled)
        if known.late:
            # In the order of their keys: tiles end in any order.
            known = dataclasses.replace(known, late=tuple(
                sorted(known.late, key=lambda orbit: orbit.key)))
            work.run(functools.partial(fill, known), list(range(len(store.tiles))),
                     lambda tile, done: store.write(tile, done[2]))
            known = with_letters(known)
    if known is not written:
        write_attractors(store, known)
    return known


def _shape(store: Store, tile: int) -> tuple[int, int]:
    velocity, across = (each.stop - each.start for each in store.tiles[tile].values())
    return velocity, across


def _text_of(late: tuple[Orbit, ...]) -> str:
    # JSON has neither complex numbers nor infinity.
    return json.dumps([{
        'walls': orbit.walls.tolist(), 'points': orbit.points.tolist(),
        'flight_times': orbit.flight_times.tolist(), 'drive_periods': orbit.drive_periods,
        'multipliers': orbit.multipliers.astype(complex).view(float).tolist(),
        'sticks': orbit.sticks,
        'forms': None if orbit.forms is None else [
            [None if math.isinf(value) else value for value in form]
            for form in orbit.forms.tolist()]} for orbit in late])


def _orbits_from(text: str, parameters: Parameters) -> list[Orbit]:
    return [Orbit(
        parameters, np.array(each['walls'], np.int64), np.array(each['points']),
        np.array(each['flight_times']), each['drive_periods'],
        np.array(each['multipliers'], np.float64).ravel().view(np.complex128), each['sticks'],
        None if each['forms'] is None else np.nan_to_num(
            np.array(each['forms'], np.float64), nan=math.inf, posinf=math.inf),
    ) for each in json.loads(text)]
