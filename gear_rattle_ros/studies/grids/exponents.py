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

"""How fast neighbouring trajectories of every initial condition diverge or converge."""

from typing import Final, Unpack

import numpy as np

from .grid import axes_of
from ..attractors import identity_of
from ..work import Arrays, Study, Work, WorkOptions
from ...attractors.catalogue import BATCH, go_on
from ...attractors.engine import run_tiles
from ...attractors.finding import Check
from ...attractors.listing import named
from ...attractors.plane import Plane
from ...core.arrays import FloatArray, RecordArray
from ...core.defaults import EXPONENT_IMPACTS
from ...core.flight.lanes import new_tiles
from ...core.many.growth import grow
from ...core.model import Parameters
from ...core.words import counted
from ...store.layout import Layout, Variable
from ...store.store import Store

NAME: Final = 'exponents'
# Cells along the edge of a tile.
EDGE: Final = 100


def finite_time_exponents(initial: RecordArray, count: int, threads: int | None = None,
                          check: Check = go_on) -> FloatArray:
    """Find the largest finite-time exponents of initial conditions over some impacts."""
    # Per impact [1]; -inf where the driven gear sticks or comes to rest, nan where it floats.
    # `check` is called for every batch and raises to give up.
    exponents = np.zeros(len(initial))

    def work(batch: int) -> None:
        check()
        part = slice(batch * BATCH, (batch + 1) * BATCH)
        grow(new_tiles(1)[0], initial[part], count, exponents[part])

    run_tiles(work, range(-(-len(initial) // BATCH)), lambda batch, result: None, threads=threads)
    return exponents


@Study
def exponents(parameters: Parameters, plane: Plane | None = None, *,
              impacts: int = EXPONENT_IMPACTS, **options: Unpack[WorkOptions]) -> Store:
    """
    Find how fast neighbouring trajectories of every cell of a plane diverge or converge.

    The dataset has `exponent` per impact [1] of every cell: -inf where the driven gear sticks, nan
    where it floats. It runs on the threads of this machine only.

    Parameters
    ----------
    parameters, plane
        The model and the cells.
    impacts : int
        Impacts of every trajectory.

    """
    work, plane = Work(**options), plane or Plane()
    if work.cluster:
        raise ValueError('--cluster: exponents run on the threads of this machine only')
    store = work.begin(Layout(
        axes_of(plane, EDGE),
        (Variable('exponent', ('velocity', plane.across), '<f8', named(
            f'largest finite-time exponent per impact over {counted(impacts, "impact")}; -inf '
            'where the driven gear sticks, nan where it floats')),),
        identity_of(NAME, parameters, plane, impacts=impacts,
                    size=[plane.phases, plane.velocities]),
        {'title': 'Finite-time exponents of the gear-rattling model'}))
    with work.pending(NAME, store, lambda tile: 1) as (tiles, finished):
        for tile in tiles:
            part = store.tiles[tile]
            cells = plane.cells(parameters, part['velocity'], part[plane.across])
            values = finite_time_exponents(cells, impacts, work.threads)
            store.write(tile, {'exponent': values.reshape(
                tuple(each.stop - each.start for each in part.values()))})
            finished(tile, impacts * len(cells))
    return store


def describe(dataset: Arrays) -> str:
    values = dataset['exponent'].values
    finite = values[np.isfinite(values)]
    return (f'{np.mean(finite > 0.0) if len(finite) else np.nan:.3%} of the trajectories that do '
            f'not stick diverge from their neighbours, over '
            f'{counted(dataset.attrs["impacts"], "impact")}\n'
            f'{np.mean(np.isneginf(values)):.3%} of all stick and forget their initial condition')
