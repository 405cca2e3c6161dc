"""The tool `exponents`: how fast neighbours of every start part or meet within some impacts."""

import argparse
from typing import Final

import numpy as np

from .attractors import identity_of
from ..attractors.catalogue import BATCH, go_on
from ..attractors.engine import run_tiles
from ..attractors.finding import Check
from ..attractors.plane import Plane, StartArray
from ..cli import options, run as cli
from ..core.arrays import FloatArray
from ..core.flight.lanes import new_impacts, new_tiles
from ..core.many.growth import grow, STEPS
from ..core.model import Parameters
from ..core.words import counted
from ..store.layout import Axis, Layout, Variable
from ..store.making import make_store
from ..store.store import Store

NAME: Final = 'exponents'
IMPACTS: Final = 50
# Cells along the edge of a tile.
EDGE: Final = 100


def finite_time_exponents(starts: StartArray, count: int, threads: int | None = None,
                          check: Check = go_on) -> FloatArray:
    """
    Find the largest finite-time exponents of starts.

    Parameters
    ----------
    starts : ndarray of START, shape (n,)
        The starts.
    count : int
        Impacts, at least 1.
    threads : int, optional
        How many; by default one for each processor.
    check : callable
        Called for every batch; raises to give up.

    Returns
    -------
    ndarray of float, shape (n,)
        Per impact [1]; -inf where the mass sticks or comes to rest, nan where it floats.

    """
    exponents = np.zeros(len(starts))

    def work(batch: int) -> None:
        check()
        part = slice(batch * BATCH, (batch + 1) * BATCH)
        grow(new_tiles(1)[0], new_impacts(STEPS), starts[part], count, exponents[part])

    run_tiles(work, range(-(-len(starts) // BATCH)), lambda batch, result: None, threads=threads)
    return exponents


def compute_exponents(parameters: Parameters, plane: Plane, run: cli.Run, count: int) -> Store:
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
    count : int
        Impacts.

    Returns
    -------
    Store
        Finished.

    """
    layout = Layout(
        (Axis('velocity', plane.velocity_values(),
              {'long_name': 'initial velocity', 'units': '1'}, EDGE),
         Axis('phase', plane.phase_values(),
              {'long_name': 'initial drive phase', 'units': 'rad'}, EDGE)),
        (Variable('exponent', ('velocity', 'phase'), '<f8', {
            'long_name': 'largest finite-time exponent per impact over '
                         f'{counted(count, "impact")}; -inf where the mass sticks, '
                         'nan where it floats', 'units': '1'}),),
        identity_of(NAME, parameters, plane, impacts=count,
                    size=[plane.phases, plane.velocities]),
        {'title': 'Finite-time exponents of the gear-rattling model'})
    store = make_store(run.output, layout, run.command, resume=run.resume)
    progress = run.progress(len(store.tiles))
    pending = store.pending()
    progress.skip(len(store.tiles) - len(pending))
    try:
        for tile in pending:
            part = store.tiles[tile]
            starts = plane.starts(parameters, part['velocity'], part['phase'])
            values = finite_time_exponents(starts, count, run.threads)
            store.write(tile, {'exponent': values.reshape(
                tuple(each.stop - each.start for each in part.values()))})
            store.mark(tile)
            progress.add(1, count * len(starts))
    finally:
        progress.end()
    return store


def main(arguments: list[str] | None = None) -> int:
    """Run the command `exponents`."""
    parser = options.Parser(
        NAME, description='Find how fast neighbours of every start part or meet: the largest '
        'exponent of the first impacts.')
    options.add_model(parser)
    options.add_plane(parser)
    parser.add_argument('--impacts', type=options.whole(1), default=IMPACTS, metavar='N',
                        help=f'impacts of every start; {IMPACTS} by default')

    def work(given: argparse.Namespace, run: cli.Run) -> int:
        if run.cluster:
            raise ValueError('--cluster: exponents run on the threads of this machine only')
        parameters, plane = options.model_of(given), options.plane_of(given)
        store = compute_exponents(parameters, plane, run, given.impacts)
        values = store.read_all('exponent')
        finite = values[np.isfinite(values)]
        print(f'{np.mean(finite > 0.0) if len(finite) else np.nan:.3%} of the starts that do not '
              f'stick part from their neighbours, over {counted(given.impacts, "impact")}')
        print(f'{np.mean(np.isneginf(values)):.3%} of all stick and forget theirs')

        def draw() -> cli.Figure:
            from ..figures.grids import draw_exponents, thinned
            return draw_exponents(
                store.read_every('exponent', thinned(plane)), plane,
                f'Finite-time exponents over {counted(given.impacts, "impact")}, '
                f'alpha {parameters.alpha:g}, s = {plane.displacement:g}')

        return run.finish(draw)

    return cli.run_tool(parser, arguments, 'exponents-{alpha:g}.zarr', work)
