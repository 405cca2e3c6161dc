"""Grids of labels and lifetimes, tile by tile: what the tools basins and lifetimes share."""

from collections.abc import Callable
import dataclasses
import functools
import json
from pathlib import Path
from typing import Any, Final

import numpy as np

from .catalogue import Catalogue, follow_here, moved
from .cli import Run
from .engine import run_tiles
from .grid import Plane
from .layout import Axis, Layout, Variable
from .search import orbits_among
from .store import Store
from .store_making import make_store
from ..core.chaos import GLANCE
from ..core.classify import RESULT, UNRESOLVED
from ..core.closed_orbits import Orbit
from ..core.model import Parameters

LABELS: Final = '<i2'
LIFETIMES: Final = '<i4'
# Impacts of a start that are looked at where it has not settled, and longest period.
LOOKED_AT: Final = GLANCE[1:]
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
    plane : Plane
        All cells.
    cap : int
        Impacts after which a start is given up.
    catalogue : Catalogue
        Known attractors.

    """

    path: Path
    plane: Plane
    cap: int
    catalogue: Catalogue


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
                         'upper and lower wall, -4 between the walls', 'units': '1'}, UNRESOLVED),
         Variable('lifetime', ('velocity', 'phase'), LIFETIMES, {
             'long_name': 'impacts until the trajectory stays within the tolerance of its '
                          f'attractor; {cap} where label is -1', 'units': '1'}, 0)),
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
        job.catalogue.parameters, store.tiles[tile]['velocity'], store.tiles[tile]['phase'])
    results = np.zeros(len(starts), RESULT)
    impacts = follow_here(starts, job.cap, job.catalogue.table, results)
    _write(store, tile, results)
    left = results['label'] == UNRESOLVED
    return Done(impacts, tuple(orbits_among(
        job.catalogue.parameters, moved(starts[left], results[left]), *LOOKED_AT,
        job.catalogue.tolerance)))


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
        job.catalogue.parameters, store.tiles[tile]['velocity'], store.tiles[tile]['phase'])[left]
    found = np.zeros(len(starts), RESULT)
    impacts = follow_here(starts, job.cap, job.catalogue.table, found)
    results = np.zeros(len(label), RESULT)
    results['label'], results['lifetime'] = label, lifetime
    results['label'][left], results['lifetime'][left] = found['label'], found['lifetime']
    _write(store, tile, results)
    return Done(impacts, ())


def compute_grid(store: Store, plane: Plane, catalogue: Catalogue, cap: int, run: Run
                 ) -> Catalogue:
    """
    Compute all tiles of a store that are not done.

    Parameters
    ----------
    store : Store
        The store.
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
    Catalogue
        With the orbits that no random start had reached.

    """
    known = catalogue.with_orbits(tuple(_orbits_from(
        store.attributes.get(LATE, '[]'), catalogue.parameters)))
    job = Job(store.path, plane, cap, catalogue)
    progress = run.progress(plane.phases * plane.velocities)
    pending = store.pending()
    progress.skip(sum(_size(store, tile) for tile in range(len(store.tiles)))
                  - sum(_size(store, tile) for tile in pending))

    def finished(tile: int, done: Done) -> None:
        nonlocal known
        more = known.with_orbits(done.orbits)
        if more is not known:
            known = more
            store.set_attributes({LATE: _text_of(known.late)})
        store.mark(tile)
        progress.add(_size(store, tile), done.impacts)

    def do(work: Callable[[Job, int], Done], tiles: list[int],
           then: Callable[[int, Done], None]) -> None:
        run_tiles(functools.partial(work, job), tiles, then, cluster=run.cluster,
                  threads=run.threads)

    try:
        do(compute_tile, pending, finished)
        if known.late:
            # In the order of their keys: tiles end in any order.
            known = dataclasses.replace(known, late=tuple(
                sorted(known.late, key=lambda orbit: orbit.key)))
            job = dataclasses.replace(job, catalogue=known)
            do(resolve_tile, list(range(len(store.tiles))), lambda tile, done: store.mark(tile))
    finally:
        progress.end()
    return known


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


def _text_of(late: tuple[Orbit, ...]) -> str:
    return json.dumps([{
        'walls': orbit.walls.tolist(), 'points': orbit.points.tolist(),
        'flight_times': orbit.flight_times.tolist(), 'drive_periods': orbit.drive_periods,
        'multipliers': [[value.real, value.imag] for value in orbit.multipliers.tolist()],
        'sticks': orbit.sticks,
        'forms': None if orbit.forms is None else [
            [None if np.isinf(value) else value for value in form]
            for form in orbit.forms.tolist()],
    } for orbit in late])


def _orbits_from(text: str, parameters: Parameters) -> list[Orbit]:
    return [Orbit(
        parameters, np.array(each['walls'], np.int64), np.array(each['points']),
        np.array(each['flight_times']), each['drive_periods'],
        np.array([complex(*value) for value in each['multipliers']]), each['sticks'],
        None if each['forms'] is None else np.array([
            [np.inf if value is None else value for value in form] for form in each['forms']]),
    ) for each in json.loads(text)]
