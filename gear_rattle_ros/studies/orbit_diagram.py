"""Orbit diagrams: impact velocities against alpha, attractor by attractor, with the exponent."""

import argparse
import dataclasses
import functools
import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .diagram import describe, Diagram, KINDS, layout_of, STATE, SWEEPS
from ..attractors.catalogue import Kind
from ..attractors.columns import Branch, find_branches, Window
from ..attractors.engine import run_tiles
from ..attractors.tracks import track
from ..cli.options import (
    add_alpha_window,
    add_plane,
    add_seed,
    model_of,
    number,
    Parser,
    plane_of,
    whole,
)
from ..cli.run import Figure, Run, run_tool
from ..core.flight.lanes import START
from ..core.flight.lanes_step import LANES
from ..core.many.velocity_counts import BLOCKS
from ..core.orbits.orbit import Orbit
from ..core.words import counted, in_columns
from ..store.making import make_store
from ..store.store import Store


def compute(diagram: Diagram, run: Run) -> Store:
    """
    Make or go on with a diagram.

    Parameters
    ----------
    diagram : Diagram
        What is to be made.
    run : Run
        How and where.

    Returns
    -------
    Store
        Complete.

    Raises
    ------
    StoreError, EngineError
        As those modules say.

    """
    store = make_store(run.output, layout_of(diagram), run.command, resume=run.resume)
    pending = store.pending()
    progress = run.progress(diagram.columns * len(diagram.sweeps))
    progress.skip(sum(_width(store, tile) for tile in range(len(store.tiles)))
                  - sum(_width(store, tile) for tile in pending))
    work = functools.partial(fill_tile, diagram, run.output)

    def finished(tile: int, impacts: int) -> None:
        store.mark(tile)
        progress.add(_width(store, tile), impacts)

    settings: dict[str, Any] = {'cluster': run.cluster, 'threads': run.threads}
    try:
        run_tiles(work, [t for t in pending if _sweep(diagram, store, t) == 'starts'], finished,
                  **settings)
        # A tile that is followed begins where its neighbour ends: one of each sweep at a time.
        queues = [[t for t in pending if _sweep(diagram, store, t) == sweep]
                  for sweep in ('up', 'down')]
        queues[1].reverse()
        while any(queues):
            run_tiles(work, [queue.pop(0) for queue in queues if queue], finished, **settings)
    finally:
        progress.end()
    write_attractors(store)
    return store


def fill_tile(diagram: Diagram, output: Path, tile: int) -> int:
    """
    Compute a tile and write it.

    Parameters
    ----------
    diagram : Diagram
        The diagram.
    output : Path
        Its store.
    tile : int
        Number of the tile.

    Returns
    -------
    int
        Impacts made.

    """
    store = Store(output)
    region = store.tiles[tile]
    columns = range(region['alpha'].start, region['alpha'].stop)
    sweep = _sweep(diagram, store, tile)
    ends = np.full((len(columns), LANES, len(STATE)), math.nan)
    found: dict[int, list[Branch]] = {}
    order = list(columns) if sweep != 'down' else list(reversed(columns))
    starts = None if sweep == 'starts' else _states_before(diagram, store, tile, order[0])
    known: tuple[Orbit, ...] = ()
    for c in order:
        catalogue, found[c] = find_branches(
            diagram.at(c), diagram.starts(c) if starts is None else starts, diagram.window,
            # What is followed knows nothing of what it has left.
            known if starts is None else ())
        known = catalogue.orbits
        if starts is not None:
            ends[c - columns.start, :len(starts)] = np.stack(
                [catalogue.states[name] for name in STATE], axis=1)
            starts = _at(catalogue.states, diagram, c + (1 if sweep == 'up' else -1))
    values = describe([found[c] for c in columns], diagram)
    store.write(tile, {name: value[None] for name, value in {**values, 'end_state': ends}.items()})
    return sum(len(one.states) for c in columns for one in found[c]) * diagram.window.keep


def write_attractors(store: Store) -> None:
    """
    Match attractors from one alpha to the next, and write which is which.

    Parameters
    ----------
    store : Store
        Complete.

    """
    kinds = store.read_all('kind')
    numbers = track(store.read_all('key'), store.read_all('point'),
                    kinds == KINDS.index(Kind.CHAOTIC.value),
                    (kinds >= 0) & (kinds != KINDS.index(Kind.UNSETTLED.value)))
    store.write_table({
        'attractor': (('sweep', 'alpha', 'slot'), numbers.astype(np.int32), {
            'long_name': 'number of the attractor, matched from alpha to alpha; -1 none'})})


def listed(store: Store) -> str:
    """List the attractors of a diagram, numbered as in the store and in the picture."""
    numbers, alphas, keys = (store.read_all(name) for name in ('attractor', 'alpha', 'key'))
    rows = []
    for label in np.unique(numbers[numbers >= 0]):
        _, places, _ = np.nonzero(numbers == label)
        seen = alphas[np.unique(places)]
        rows.append([str(label), f'{len(seen):,}', f'{seen[0]:.6f}', f'{seen[-1]:.6f}',
                     str(keys[numbers == label][np.argmin(places)])])
    lines = [in_columns(
        [' attractor', ' alphas', ' from [1]', ' to [1]', 'key at the first'], rows)]
    unsettled = np.where(store.read_all('kind') == KINDS.index(Kind.UNSETTLED.value),
                         store.read_all('share'), 0.0).sum(axis=2).max(axis=0)
    if np.any(unsettled):
        lines.append(f'unsettled after {counted(store.attributes["hold"], "impact")}: at '
                     f'{np.count_nonzero(unsettled):,} of {counted(len(alphas), "alpha")}, '
                     f'at most {np.max(unsettled):.1%} of the trajectories')
    return '\n'.join(lines)


def _states_before(diagram: Diagram, store: Store, tile: int, column: int) -> npt.NDArray[np.void]:
    # The ends of the neighbouring column, or fresh starts at the end of the window.
    backwards = -1 if _sweep(diagram, store, tile) == 'up' else 1
    if not 0 <= column + backwards < diagram.columns:
        few = dataclasses.replace(diagram, trajectories=min(diagram.trajectories, LANES))
        return few.starts(column)
    sweep = store.tiles[tile]['sweep'].start
    states = store.read_all('end_state')[sweep, column + backwards]
    states = states[np.isfinite(states[:, 0])]
    starts = np.zeros(len(states), START)
    for k, name in enumerate(STATE):
        starts[name] = states[:, k]
    return _at(starts, diagram, column)


def _at(states: npt.NDArray[np.void], diagram: Diagram, column: int) -> npt.NDArray[np.void]:
    starts = states.copy()
    if 0 <= column < diagram.columns:
        for name, value in dataclasses.asdict(diagram.at(column)).items():
            starts[name] = value
    return starts


def _sweep(diagram: Diagram, store: Store, tile: int) -> str:
    return diagram.sweeps[store.tiles[tile]['sweep'].start]


def _width(store: Store, tile: int) -> int:
    region = store.tiles[tile]['alpha']
    return int(region.stop - region.start)


def main(arguments: list[str] | None = None) -> int:
    """Run the command `orbit_diagram`."""
    parser = Parser('orbit_diagram', description='Count impact velocities against alpha, from '
                    'many starts and followed up and down, with the largest exponent.')
    add_alpha_window(parser, 0.47, 0.60, 'window of alpha')
    parser.add_argument('--columns', type=whole(2), default=780, metavar='N',
                        help='amplitudes; 780 by default')
    parser.add_argument('--bins', type=whole(1), default=900, metavar='N',
                        help='bins of the velocity; 900 by default')
    parser.add_argument('--bin-window', type=number, nargs=2, default=[-1.5, 1.5],
                        metavar=('A', 'B'), help='velocities counted [1]; -1.5 1.5 by default')
    parser.add_argument('--hold', type=whole(1000), default=Window.hold, metavar='N',
                        help='impacts after which a trajectory is unsettled; in 32 times as many '
                        f'nothing may leave a chaotic attractor; {Window.hold} by default')
    parser.add_argument('--skip', type=whole(1), default=5000, metavar='N',
                        help='impacts passed over at least where nothing settles; 5000 by default')
    parser.add_argument('--keep', type=whole(BLOCKS), default=2048, metavar='N',
                        help='impacts of each trajectory that are counted then; 2048 by default')
    parser.add_argument('--trajectories', type=whole(1), default=LANES, metavar='N',
                        help=f'at each alpha; {LANES} by default')
    parser.add_argument('--sweep', nargs='+', choices=SWEEPS, default=list(SWEEPS),
                        help='many starts at each alpha, or followed up and down; all by default')
    parser.add_argument('--draw', choices=('velocity', 'exponent', 'both'), default='both',
                        help='what the picture shows; both by default')
    add_plane(parser, size=None)
    add_seed(parser)

    def work(given: argparse.Namespace, run: Run) -> int:
        store = compute(Diagram(
            model_of(given), (given.alpha[0], given.alpha[1]), given.columns, plane_of(given),
            given.trajectories, given.seed,
            Window(given.keep, given.bin_window[0], given.bin_window[1], given.bins,
                   max(given.hold, given.skip)),
            tuple(sweep for sweep in SWEEPS if sweep in given.sweep)), run)
        print(listed(store))

        def draw() -> Figure:
            # Only here: matplotlib takes a second to import.
            from ..figures.diagrams import draw_diagram
            return draw_diagram(store, exponent=given.draw != 'velocity',
                                raster=given.draw != 'exponent')

        return run.finish(draw)

    return run_tool(parser, arguments, 'orbit_diagram.zarr', work)
