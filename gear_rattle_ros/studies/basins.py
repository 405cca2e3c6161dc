"""On which attractor every initial condition of a grid settles, and how soon."""

import dataclasses
from typing import Final, Unpack

import numpy as np

from .attractors import (
    describe as describe_attractors,
    identity_of,
    require_tolerance,
    write_attractors,
)
from .grid import compute_grid, grid_layout
from .work import Arrays, Study, Work, WorkOptions
from ..attractors.catalogue import Catalogue
from ..attractors.finding import find_attractors
from ..attractors.plane import Plane
from ..core.defaults import BASINS_CAP, HOLD, INITIAL_CONDITIONS, SEED, TOLERANCE
from ..core.many.settling import UNSETTLED
from ..core.model import Parameters
from ..core.words import counted
from ..store.store import Store

NAME: Final = 'basins'
TITLE: Final = 'Basins of attraction of the gear-rattling model'


@dataclasses.dataclass(frozen=True)
class Settings:
    """
    What determines a grid besides model and plane; `basins` explains it.

    Where not `chaotic`, only orbits and rest end a transient. The result does not depend on
    `tile`, the length of a tile's edge.
    """

    cap: int = BASINS_CAP
    tolerance: float = TOLERANCE
    initial_conditions: int = INITIAL_CONDITIONS
    seed: int = SEED
    hold: int = HOLD
    chaotic: bool = True
    tile: int | None = None


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
        Cells along the edge of a tile.
    **options
        As `Work` explains them.

    """
    settings = Settings(cap, tolerance, initial_conditions, seed, hold, tile=tile)
    return compute_basins(parameters, plane or Plane(), Work(**options), settings)[0]


def compute_basins(parameters: Parameters, plane: Plane, work: Work, settings: Settings,
                   name: str = NAME, title: str = TITLE) -> tuple[Store, Catalogue]:
    """Compute a grid into a store; return it with all attractors."""
    require_tolerance(settings.tolerance)
    others = dataclasses.asdict(settings)
    del others['tile']
    identity = identity_of(name, parameters, plane, **others,
                           size=[plane.phases, plane.velocities])
    store = work.begin(grid_layout(plane, identity, title, settings.cap, settings.tile))
    catalogue = find_attractors(
        parameters, plane.draw(
            parameters, settings.initial_conditions, settings.seed),
        tolerance=settings.tolerance, hold=settings.hold, chaotic=settings.chaotic,
        threads=work.threads)
    catalogue = compute_grid(store, plane, catalogue, settings.cap, work, name)
    write_attractors(store, catalogue)
    return store, catalogue


def describe(dataset: Arrays) -> str:
    """Put basins in words: the attractors with their cells, and what is unsettled."""
    labels, numbers = np.unique(dataset['label'].values, return_counts=True)
    cells = dict(zip(labels.tolist(), numbers.tolist(), strict=True))
    return describe_attractors(dataset, cells, (
        f'unsettled after {counted(dataset.attrs["cap"], "impact")}: '
        f'{cells.get(UNSETTLED, 0):,} of {counted(dataset["label"].values.size, "cell")}'))


def magnifications(plane: Plane, levels: int, phase: float | None, velocity: float | None,
                   factor: float) -> list[Plane]:
    """
    List the windows of successive magnifications about a point, the middle by default.

    ValueError where the point lies outside the window or the factor is not between 1 and 1e6.
    """
    at = (sum(plane.phase) / 2.0 if phase is None else phase,
          sum(plane.velocity) / 2.0 if velocity is None else velocity)
    for name, value, window in (('phase', at[0], plane.phase),
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
