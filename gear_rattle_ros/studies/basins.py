"""The tool `basins`: on which attractor every start of a grid settles, and how soon."""

import argparse
import dataclasses
from pathlib import Path
from typing import Final

import numpy as np

from .attractors import identity_of, require_tolerance, write_attractors
from .tiles import compute_grid, grid_layout
from ..attractors.catalogue import Catalogue, HOLD, TOLERANCE
from ..attractors.finding import find_attractors, STARTS
from ..attractors.plane import Plane
from ..cli import options, run as cli
from ..cli.listing import listed
from ..core.many.settling import UNRESOLVED
from ..core.model import Parameters
from ..core.words import counted
from ..store.making import make_store
from ..store.store import Store

NAME: Final = 'basins'
CAP: Final = 20_000
TITLE: Final = 'Basins of attraction of the gear-rattling model'


@dataclasses.dataclass(frozen=True)
class Settings:
    """
    What decides over the result, beside model and plane.

    Attributes
    ----------
    cap : int
        Impacts after which a start is given up.
    tolerance : float
        Largest distance of a trajectory that is on its orbit [1].
    starts, seed : int
        Random starts of the search for attractors, and their seed.
    hold : int
        Impacts for which nothing may leave a chaotic attractor.
    chaotic : bool
        Whether chaotic attractors count; if not, only orbits and rest end a transient.
    tile : int or None
        Length of a tile's edge; the result does not depend on it.

    """

    cap: int = CAP
    tolerance: float = TOLERANCE
    starts: int = STARTS
    seed: int = 1
    hold: int = HOLD
    chaotic: bool = True
    tile: int | None = None


def compute_basins(parameters: Parameters, plane: Plane, run: cli.Run, settings: Settings,
                   title: str = TITLE) -> tuple[Store, Catalogue]:
    """
    Compute a grid into a store.

    Parameters
    ----------
    parameters : Parameters
        Of the model.
    plane : Plane
        The cells.
    run : Run
        How and where.
    settings : Settings
        What else decides.
    title : str
        Title of the dataset.

    Returns
    -------
    tuple
        The store, and all attractors.

    """
    require_tolerance(settings.tolerance)
    others = dataclasses.asdict(settings)
    del others['tile']
    identity = identity_of(run.name, parameters, plane, **others,
                           size=[plane.phases, plane.velocities])
    store = make_store(run.output, grid_layout(
        plane, identity, title, settings.cap, settings.tile), run.command, resume=run.resume)
    catalogue = find_attractors(
        parameters, plane.random_starts(parameters, settings.starts, settings.seed),
        tolerance=settings.tolerance, hold=settings.hold, chaotic=settings.chaotic,
        threads=run.threads)
    catalogue = compute_grid(store, plane, catalogue, settings.cap, run)
    write_attractors(store, catalogue)
    return store, catalogue


def count_labels(store: Store) -> dict[int, int]:
    """
    Count the starts of every label, tile by tile.

    Parameters
    ----------
    store : Store
        A finished grid.

    Returns
    -------
    dict
        Starts by label.

    """
    counts: dict[int, int] = {}
    for tile in range(len(store.tiles)):
        for label, count in zip(*np.unique(store.read(tile, 'label'), return_counts=True),
                                strict=True):
            counts[int(label)] = counts.get(int(label), 0) + int(count)
    return counts


def magnifications(plane: Plane, levels: int, phase: float | None, velocity: float | None,
                   factor: float) -> list[Plane]:
    """
    List the windows of successive magnifications.

    Parameters
    ----------
    plane : Plane
        The first window.
    levels : int
        How many windows.
    phase, velocity : float or None
        The point that stays [rad, 1]; the middle of the window by default.
    factor : float
        How many times smaller each is.

    Returns
    -------
    list of Plane
        The first one first.

    Raises
    ------
    ValueError
        If the point lies outside the window or the factor is not more than 1.

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


def add_settings(parser: argparse.ArgumentParser, cap: int) -> None:
    """
    Add the options of `Settings`.

    Parameters
    ----------
    parser : ArgumentParser
        Receives them.
    cap : int
        Default of the cap.

    """
    options.add_seed(parser)
    parser.add_argument('--cap', type=options.whole(1), default=cap, metavar='N',
                        help=f'impacts after which a start is given up; {cap} by default')
    parser.add_argument('--tolerance', type=options.number, default=TOLERANCE, metavar='X',
                        help=f'distance within which an orbit is reached [1]; {TOLERANCE:g} by '
                             'default')
    parser.add_argument('--starts', type=options.whole(1), default=STARTS, metavar='N',
                        help=f'random starts of the search for attractors; {STARTS} by default')
    parser.add_argument('--hold', type=options.whole(1000), default=HOLD, metavar='N',
                        help='impacts for which nothing may leave a chaotic attractor; '
                             f'{HOLD} by default')
    parser.add_argument('--tile', type=options.whole(1), metavar='N',
                        help='cells along the edge of a tile')


def settings_of(given: argparse.Namespace, chaotic: bool = True) -> Settings:
    """
    Read the options of `Settings`.

    Parameters
    ----------
    given : Namespace
        What was given.
    chaotic : bool
        Whether chaotic attractors count.

    Returns
    -------
    Settings
        Read.

    """
    return Settings(given.cap, given.tolerance, given.starts, given.seed, given.hold, chaotic,
                    given.tile)


def main(arguments: list[str] | None = None) -> int:
    """Run the command `basins`."""
    parser = options.Parser(
        NAME, description='Find on which attractor every start of a grid settles.')
    options.add_model(parser)
    options.add_plane(parser)
    add_settings(parser, CAP)
    parser.add_argument('--zoom-levels', type=options.whole(1), default=1, metavar='N',
                        help='successive magnifications, each a store of its own')
    parser.add_argument('--zoom-at', type=options.number, nargs=2, default=[None, None],
                        metavar=('PHASE', 'VELOCITY'), help='point that stays where it is')
    parser.add_argument('--zoom-factor', type=options.number, default=10.0, metavar='X',
                        help='how many times smaller each window is; 10 by default')

    def work(given: argparse.Namespace, run: cli.Run) -> int:
        parameters = options.model_of(given)
        planes = magnifications(options.plane_of(given), given.zoom_levels, given.zoom_at[0],
                                given.zoom_at[1], given.zoom_factor)
        for level, plane in enumerate(planes):
            here = run if len(planes) == 1 else dataclasses.replace(
                run, output=_numbered(run.output, level),
                picture=run.picture and _numbered(run.picture, level))
            status = _one(parameters, plane, here, settings_of(given))
            if status:
                return status
        return 0

    return cli.run_tool(parser, arguments, 'basins-{alpha:g}.zarr', work)


def _one(parameters: Parameters, plane: Plane, run: cli.Run, settings: Settings) -> int:
    try:
        store, catalogue = compute_basins(parameters, plane, run, settings)
    except KeyboardInterrupt:
        return cli.say_stopped(run)
    counts = count_labels(store)
    print(listed(catalogue, counts))
    print(f'unsettled after {counted(settings.cap, "impact")}: {counts.get(UNRESOLVED, 0):,} of '
          f'{counted(plane.phases * plane.velocities, "cell")}')

    def draw() -> cli.Figure:
        from ..figures.grids import draw_basins, in_words, thinned
        labels = store.read_every('label', thinned(plane))
        return draw_basins(labels.astype(np.int64), plane, catalogue.attractors,
                           f'Basins of attraction, {in_words(catalogue)}, '
                           f's = {plane.displacement:g}')

    return run.finish(draw)


def _numbered(path: Path, level: int) -> Path:
    return path.with_name(f'{path.stem}-{level}{path.suffix}')
