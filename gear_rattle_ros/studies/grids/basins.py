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

"""On which attractor every initial condition of a grid settles, and how soon."""

from typing import Any, Final, Unpack

import numpy as np

from .grid import compute_grid, grid_layout
from .. import attractors
from ..work import Arrays, Study, Work, WorkOptions
from ...attractors.catalogue import Catalogue
from ...attractors.finding import find_attractors
from ...attractors.plane import Plane
from ...core.defaults import BASINS_CAP, HOLD, INITIAL_CONDITIONS, SEED, TOLERANCE
from ...core.many.settling import UNSETTLED
from ...core.model import Parameters
from ...core.words import counted
from ...store.store import Store

NAME: Final = 'basins'
TITLE: Final = 'Basins of attraction of the gear-rattling model'


@Study
def basins(parameters: Parameters, plane: Plane | None = None, *, cap: int = BASINS_CAP,
           tolerance: float = TOLERANCE, initial_conditions: int = INITIAL_CONDITIONS,
           seed: int = SEED, hold: int = HOLD, tile: int | None = None,
           **options: Unpack[WorkOptions]) -> Store:
    """
    Find on which attractor every cell of a plane settles.

    The dataset has `label` and `lifetime` [impacts] of every cell, and the attractors.

    Parameters
    ----------
    parameters, plane
        The model and the cells.
    cap : int
        Impacts after which a cell is unsettled.
    tolerance : float
        Largest distance of a trajectory that is on its orbit [1].
    initial_conditions, seed : int
        Random initial conditions of the search for attractors, and their seed.
    hold : int
        Impacts for which nothing may leave a chaotic attractor.
    tile : int, optional
        Cells along the edge of a tile; the result does not depend on it.

    """
    return compute_basins(
        parameters, plane or Plane(), Work(**options), cap=cap, tolerance=tolerance,
        initial_conditions=initial_conditions, seed=seed, hold=hold, tile=tile)[0]


def compute_basins(parameters: Parameters, plane: Plane, work: Work, *, cap: int,
                   tolerance: float, initial_conditions: int, seed: int, hold: int,
                   chaotic: bool = True, tile: int | None = None, name: str = NAME,
                   title: str = TITLE, **others: Any) -> tuple[Store, Catalogue]:
    """Compute a grid into a store; return it with all attractors."""
    # Where not `chaotic`, only orbits and rest end a transient. `others` are part of the question.
    attractors.require_tolerance(tolerance)
    identity = attractors.identity_of(
        name, parameters, plane, cap=cap, tolerance=tolerance, seed=seed, hold=hold,
        initial_conditions=initial_conditions, chaotic=chaotic,
        size=[plane.phases, plane.velocities], **others)
    store = work.begin(grid_layout(plane, identity, title, cap, tile))
    catalogue = find_attractors(
        parameters, plane.draw(parameters, initial_conditions, seed), tolerance=tolerance,
        hold=hold, chaotic=chaotic, threads=work.threads)
    return store, compute_grid(store, plane, catalogue, cap, work, name)


def describe(dataset: Arrays) -> str:
    """Put basins in words: the attractors with their cells, and what is unsettled."""
    values = dataset['label'].values
    labels, numbers = np.unique(values, return_counts=True)
    cells = dict(zip(labels.tolist(), numbers.tolist(), strict=True))
    return attractors.describe(dataset, cells, (
        f'unsettled after {counted(dataset.attrs["cap"], "impact")}: '
        f'{cells.get(UNSETTLED, 0):,} of {counted(values.size, "cell")}'))


def magnifications(plane: Plane, levels: int, across: float | None, velocity: float | None,
                   factor: float) -> list[Plane]:
    """List the windows of successive magnifications about a point, the middle by default."""
    # ValueError where the point lies outside the window or the factor is not between 1 and 1e6.
    at = (sum(plane.window) / 2.0 if across is None else across,
          sum(plane.velocity) / 2.0 if velocity is None else velocity)
    for name, value, window in ((plane.across, at[0], plane.window),
                                ('velocity', at[1], plane.velocity)):
        if not window[0] <= value <= window[1]:
            raise ValueError(f'--zoom-at: {name} {value:g} is outside {window[0]:g} to '
                             f'{window[1]:g}')
    if not 1.0 < factor <= 1e6:
        raise ValueError(f'--zoom-factor {factor:g} is not between 1 and 1e6')
    planes = [plane]
    for _ in range(levels - 1):
        planes.append(planes[-1].magnified(*at, factor))
    return planes
