"""Grids of labels and lifetimes, tile by tile: what the tools basins and lifetimes share."""

from collections.abc import Callable
import dataclasses
import functools
import json
from pathlib import Path
from typing import Any, Final

import numpy as np

from .cli import Run
from .engine import run_tiles
from .grid import Plane
from .layout import Axis, Layout, Variable
from .search import Catalogue, orbits_among, settle_here, STAGES
from .store import Store
from .store_making import make_store
from ..core.classify import RESULT, Table, UNRESOLVED
from ..core.model import Parameters
from ..core.periodic import Orbit

LABELS: Final = '<i2'
LIFETIMES: Final = '<i4'
# Impacts of a start that are looked at where it has not settled, and longest period.
LOOKED_AT: Final = STAGES[0][1:]
LATE: Final = 'late_orbits'
# Tiles: as many along an edge, within these lengths.
ACROSS: Final = 4
SHORTEST: Final = 50
LONGEST: Final = 500


@dataclasses.dataclass(frozen=True)
class Job:
    """
    What a worker has to know to compute any tile.

    Attributes
    ----------
    path : Path
        The store.
    parameters : Parameters
        Of the model.
    plane : Plane
        All cells.
    cap : int
        Impacts after which a start is given up.
    tolerance : float
        Largest distance of a trajectory that is on its orbit [1].
    table : Table
        Known attractors.

    """

    path: Path
    parameters: Parameters
    plane: Plane
    cap: int
    tolerance: float
    table: Table


@dataclasses.dataclass(frozen=True)
class Done:
    """
    What is told of a tile.

    Attributes
    ----------
    impacts : int
        Impacts made.
    orbits : tuple of Orbit
        Stable orbits that the table did not know.

    """

    impacts: int
    orbits: tuple[Orbit, ...]


def grid_layout(plane: Plane, identity: dict[str, Any], title: str, cap: int,
                tile: int | None = None) -> Layout:
    """
    Lay out a grid of labels and lifetimes.

    Parameters
    ----------
    plane : Plane
        The cells.
    identity : dict
        What makes it this result.
    title : str
        Title.
    cap : int
        Impacts after which starts are given up.
    tile : int, optional
        Length of a tile's edge.

    Returns
    -------
    Layout
        For `make_store`.

    """
    edge = tile or min(max(-(-max(plane.phases, plane.velocities) // ACROSS), SHORTEST), LONGEST)
    return Layout(
        (Axis('velocity', plane.velocity_values(),
              {'long_name': 'initial velocity', 'units': '1'}, edge),
         Axis('phase', plane.phase_values(),
              {'long_name': 'initial drive phase', 'units': 'rad'}, edge)),
        (Variable('label', ('velocity', 'phase'), LABELS, {
            'long_name': 'attractor: attractor_label; -1 unresolved, -2 and -3 at rest on the '
                         'upper and lower wall, -4 between the walls', 'units': '1'}),
         Variable('lifetime', ('velocity', 'phase'), LIFETIMES, {
             'long_name': 'impacts until the trajectory stays within the tolerance of its '
                          f'attractor; {cap} where label is -1', 'units': '1'})),
        identity, {'title': title})


def compute_tile(job: Job, tile: int) -> Done:
    """
    Compute and store a tile.

    Parameters
    ----------
    job : Job
        What to compute.
    tile : int
        Its number.

    Returns
    -------
    Done
        What to tell.

    """
    store = Store(job.path)
    starts = job.plane.starts(
        job.parameters, store.tiles[tile]['velocity'], store.tiles[tile]['phase'])
    results = np.zeros(len(starts), RESULT)
    impacts = settle_here(starts, job.cap, job.table, results)
    _write(store, tile, results)
    left = results['label'] == UNRESOLVED
    states = starts[left]
    for name in ('phase', 'displacement', 'velocity'):
        states[name] = results[name][left]
    return Done(impacts, tuple(orbits_among(
        job.parameters, states, *LOOKED_AT, job.tolerance)))


def resolve_tile(job: Job, tile: int) -> Done:
    """
    Follow the unresolved starts of a tile once more, with a table that knows more.

    Parameters
    ----------
    job : Job
        What to compute.
    tile : int
        Its number.

    Returns
    -------
    Done
        What to tell.

    """
    store = Store(job.path)
    label, lifetime = (store.read(tile, name).ravel() for name in ('label', 'lifetime'))
    left = label == UNRESOLVED
    if not np.any(left):
        return Done(0, ())
    starts = job.plane.starts(
        job.parameters, store.tiles[tile]['velocity'], store.tiles[tile]['phase'])[left]
    found = np.zeros(len(starts), RESULT)
    impacts = settle_here(starts, job.cap, job.table, found)
    results = np.zeros(len(label), RESULT)
    results['label'], results['lifetime'] = label, lifetime
    results['label'][left], results['lifetime'][left] = found['label'], found['lifetime']
    _write(store, tile, results)
    return Done(impacts, ())


def compute_grid(store: Store, parameters: Parameters, plane: Plane, catalogue: Catalogue,
                 cap: int, run: Run) -> tuple[Orbit, ...]:
    """
    Compute all tiles of a store that are not done.

    Parameters
    ----------
    store : Store
        The store.
    parameters : Parameters
        Of the model.
    plane : Plane
        The cells.
    catalogue : Catalogue
        Known attractors.
    cap : int
        Impacts after which a start is given up.
    run : Run
        How.

    Returns
    -------
    tuple of Orbit
        Orbits that no random start had reached, in the order of their keys; labels follow those
        of the catalogue.

    """
    late = {orbit.key: orbit for orbit in _orbits_from(store.attributes.get(LATE, '[]'))}
    known = {orbit.key for orbit in catalogue.orbits}
    job = Job(store.path, parameters, plane, cap, catalogue.tolerance, catalogue.table())
    progress = run.progress(plane.phases * plane.velocities)
    pending = store.pending()
    progress.skip(sum(_size(store, tile) for tile in range(len(store.tiles)))
                  - sum(_size(store, tile) for tile in pending))

    def finished(tile: int, done: Done) -> None:
        fresh = {orbit.key: orbit for orbit in done.orbits if orbit.key not in {*known, *late}}
        if fresh:
            late.update(fresh)
            store.set_attributes({LATE: _text_of(late)})
        store.mark(tile)
        progress.add(_size(store, tile), done.impacts)

    def do(work: Callable[[Job, int], Done], tiles: list[int],
           then: Callable[[int, Done], None]) -> None:
        run_tiles(functools.partial(work, job), tiles, then, cluster=run.cluster,
                  threads=run.threads)

    try:
        do(compute_tile, pending, finished)
        ordered = tuple(late[key] for key in sorted(late))
        if ordered:
            job = dataclasses.replace(job, table=catalogue.table(ordered))
            do(resolve_tile, list(range(len(store.tiles))), lambda tile, done: store.mark(tile))
    finally:
        progress.end()
    return ordered


def open_grid(run: Run, layout: Layout) -> Store:
    """
    Make the store of a run, or open the one to go on with.

    Parameters
    ----------
    run : Run
        How and where.
    layout : Layout
        What it consists of.

    Returns
    -------
    Store
        Ready.

    """
    return make_store(run.output, layout, run.command, resume=run.resume)


def _size(store: Store, tile: int) -> int:
    return int(np.prod([part.stop - part.start for part in store.tiles[tile].values()]))


def _write(store: Store, tile: int, results: np.ndarray[Any, Any]) -> None:
    shape = tuple(part.stop - part.start for part in store.tiles[tile].values())
    store.write(tile, {name: results[name].reshape(shape) for name in ('label', 'lifetime')})


def _text_of(late: dict[str, Orbit]) -> str:
    return json.dumps([{
        'sides': orbit.sides.tolist(), 'phases': orbit.phases.tolist(),
        'velocities': orbit.velocities.tolist(), 'flight_times': orbit.flight_times.tolist(),
        'drive_periods': orbit.drive_periods, 'sticks': orbit.sticks,
        'multipliers': [[value.real, value.imag] for value in orbit.multipliers],
        'forms': [[None if np.isinf(value) else value for value in form]
                  for form in orbit.forms.tolist()],
    } for orbit in late.values()])


def _orbits_from(text: str) -> list[Orbit]:
    return [Orbit(
        np.array(each['sides'], np.int64), np.array(each['phases']), np.array(each['velocities']),
        np.array(each['flight_times']), each['drive_periods'],
        (complex(*each['multipliers'][0]), complex(*each['multipliers'][1])), each['sticks'],
        np.array([[np.inf if value is None else value for value in form]
                  for form in each['forms']]).reshape(-1, 3),
    ) for each in json.loads(text)]
