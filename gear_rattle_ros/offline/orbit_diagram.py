"""Orbit diagrams: impact velocities against alpha, attractor by attractor, with the exponent."""

import argparse
import dataclasses
import functools
import math
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from .cli import (
    add_model,
    add_plane,
    add_run,
    add_seed,
    attempt,
    model_of,
    number,
    Parser,
    plane_of,
    Run,
    run_of,
    say_interrupted,
    whole,
)
from .engine import run_tiles
from .ensembles import Ensemble, Followers, Kind, run_ensemble, settle, Settled, Window
from .grid import Plane
from .store import Axis, Layout, make_store, Store, Variable
from .tracks import track
from ..core.lanes import START
from ..core.lanes_step import LANES
from ..core.model import ALPHA_MAXIMUM, Parameters, require_finite

FloatArray = npt.NDArray[np.float64]
# Attractors kept apart at one alpha; what is beyond is counted with the last of them.
SLOTS: Final = 6
# Columns of a tile.
TILE: Final = 8
SWEEPS: Final = ('starts', 'up', 'down')
KINDS: Final = tuple(kind.value for kind in Kind)
STATE: Final = ('phase', 'displacement', 'velocity')


@dataclasses.dataclass(frozen=True)
class Diagram:
    """
    What an orbit diagram is made of.

    Attributes
    ----------
    parameters : Parameters
        Its alpha is not used.
    alphas : tuple of float
        First and last amplitude [1].
    columns : int
        How many amplitudes, equally spaced, both ends among them.
    plane : Plane
        Where starts are drawn from.
    trajectories : int
        At each alpha; those that are followed are at most `LANES`.
    seed : int
        Of the starts.
    window : Window
        Impacts that are counted.
    sweeps : tuple of str
        Which: from many starts at each alpha, followed up, followed down.

    Raises
    ------
    ValueError
        If a range is empty or reversed, or a number is out of range.

    """

    parameters: Parameters
    alphas: tuple[float, float]
    columns: int
    plane: Plane
    trajectories: int
    seed: int
    window: Window
    sweeps: tuple[str, ...] = SWEEPS

    def __post_init__(self) -> None:
        """Validate."""
        low, high = (require_finite('alpha', a, 0.0, ALPHA_MAXIMUM) for a in self.alphas)
        if not low < high:
            raise ValueError(f'alpha window {low:g} to {high:g} is empty or reversed; give the '
                             'lower end first')
        if not 2 <= self.columns <= 100_000:
            raise ValueError(f'{self.columns} columns are not between 2 and 100000')
        if not 1 <= self.trajectories <= 100_000:
            raise ValueError(f'{self.trajectories} trajectories are not between 1 and 100000')

    @property
    def values(self) -> FloatArray:
        """Amplitudes [1]."""
        return np.linspace(*self.alphas, self.columns)

    def starts(self, column: int) -> npt.NDArray[np.void]:
        """
        Draw the starts of a column; it has a seed of its own.

        Parameters
        ----------
        column : int
            Its number.

        Returns
        -------
        ndarray of START
            The starts.

        """
        return self.plane.random_starts(self.at(column), self.trajectories,
                                        self.seed * 1_000_003 + column)

    def at(self, column: int) -> Parameters:
        """
        Give the parameters of a column.

        Parameters
        ----------
        column : int
            Its number.

        Returns
        -------
        model.Parameters
            With its alpha.

        """
        return dataclasses.replace(self.parameters, alpha=float(self.values[column]))


def layout_of(diagram: Diagram) -> Layout:
    """
    Say what the store of a diagram consists of.

    Parameters
    ----------
    diagram : Diagram
        The diagram.

    Returns
    -------
    Layout
        Tiles are `TILE` columns of one sweep.

    """
    window, one = diagram.window, {'units': '1'}
    edges = np.linspace(window.low, window.high, window.bins + 1)
    slot = ('sweep', 'alpha', 'slot')
    identity: dict[str, Any] = {
        'tool': 'orbit_diagram', 'beta': diagram.parameters.beta,
        'gamma': diagram.parameters.gamma, 'restitution': diagram.parameters.restitution,
        'alpha_window': list(diagram.alphas), 'columns': diagram.columns,
        'trajectories': diagram.trajectories, 'seed': diagram.seed,
        'displacement': diagram.plane.displacement, 'phase_window': list(diagram.plane.phase),
        'start_velocity_window': list(diagram.plane.velocity),
        'impacts_skipped': window.skip, 'impacts_counted': window.keep,
        'velocity_window': [window.low, window.high], 'bins': window.bins,
        'sweeps': list(diagram.sweeps)}
    return Layout(
        (Axis('sweep', np.array(diagram.sweeps), {
            'long_name': 'starts: many at each alpha; up, down: followed from the last state'}, 1),
         Axis('alpha', diagram.values, {'long_name': 'amplitude of the drive', **one}, TILE),
         Axis('slot', np.arange(SLOTS), {'long_name': 'attractors at one alpha, largest first'}),
         Axis('velocity', 0.5 * (edges[1:] + edges[:-1]), {
             'long_name': 'velocity before the impact, centre of the bin', **one}),
         Axis('lane', np.arange(LANES), {'long_name': 'trajectory that is followed'}),
         Axis('state', np.array(STATE), {'long_name': 'phase [rad], displacement, velocity [1]'})),
        (Variable('count', (*slot, 'velocity'), '<u4', {
            'long_name': 'impacts counted', **one}),
         Variable('share', slot, '<f8', {'long_name': 'share of the trajectories', **one}),
         Variable('kind', slot, '|i1', {
             'long_name': 'what it is: ' + ', '.join(
                 f'{k} {name}' for k, name in enumerate(KINDS)) + ', -1 nothing'}, -1),
         Variable('period_impacts', slot, '<i4', {
             'long_name': 'period, 0 off a periodic orbit', 'units': 'impacts'}),
         Variable('period_drive', slot, '<i4', {
             'long_name': 'period, 0 off a periodic orbit', 'units': 'drive periods'}),
         Variable('exponent', slot, '<f8', {
             'long_name': 'largest Lyapunov exponent per impact', **one}, math.nan),
         Variable('exponent_error', slot, '<f8', {
             'long_name': 'standard error; 0 from exact multipliers', **one}, math.nan),
         Variable('exact_sum', slot, '<f8', {
             'long_name': 'exact sum of both exponents, 2 ln r - beta <D>', **one}, math.nan),
         Variable('end_state', ('sweep', 'alpha', 'lane', 'state'), '<f8', {
             'long_name': 'last state of the trajectories that are followed'}, math.nan)),
        identity)


def compute(diagram: Diagram, run: Run) -> tuple[Store, bool]:
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
    store : Store
        Its store.
    complete : bool
        False after Ctrl-C.

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
    except KeyboardInterrupt:
        return store, False
    finally:
        progress.end()
    write_attractors(store)
    return store, True


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
    ensembles: list[Ensemble] = []
    if sweep == 'starts':
        ensembles = [run_ensemble(diagram.starts(c), diagram.at(c), diagram.window)
                     for c in columns]
    else:
        order = list(columns) if sweep == 'up' else list(reversed(columns))
        followers = Followers(_states_before(diagram, store, tile, order[0]))
        for c in order:
            ensembles.append(followers.run(diagram.at(c), diagram.window))
            ends[c - columns.start, :followers.count] = followers.states()
        if sweep == 'down':
            ensembles.reverse()
    values = describe([settle(ensemble) for ensemble in ensembles], diagram)
    store.write(tile, {name: value[None] for name, value in {**values, 'end_state': ends}.items()})
    return sum(int(ensemble.made.sum()) for ensemble in ensembles)


def describe(columns: list[list[Settled]], diagram: Diagram) -> dict[str, npt.NDArray[Any]]:
    """
    Lay out the attractors of some columns as arrays.

    Parameters
    ----------
    columns : list of list of Settled
        The attractors at each alpha.
    diagram : Diagram
        The diagram.

    Returns
    -------
    dict
        For each variable an array (alpha, slot ...).

    """
    shape = (len(columns), SLOTS)
    values: dict[str, npt.NDArray[Any]] = {
        'count': np.zeros((*shape, diagram.window.bins), np.uint32),
        'share': np.zeros(shape), 'kind': np.full(shape, -1, np.int8),
        'period_impacts': np.zeros(shape, np.int32), 'period_drive': np.zeros(shape, np.int32),
        'exponent': np.full(shape, math.nan), 'exponent_error': np.full(shape, math.nan),
        'exact_sum': np.full(shape, math.nan)}
    p = diagram.parameters
    for c, found in enumerate(columns):
        total = sum(len(one.members) for one in found)
        for k, one in enumerate(found):
            slot = c, min(k, SLOTS - 1)
            values['count'][slot] += one.counts.astype(np.uint32)
            values['share'][slot] += len(one.members) / total
            if k >= SLOTS:
                continue
            values['kind'][slot] = KINDS.index(one.kind.value)
            values['exponent'][slot] = one.exponent
            values['exponent_error'][slot] = one.exponent_error
            if p.restitution > 0.0:
                values['exact_sum'][slot] = (2.0 * math.log(p.restitution)
                                             - p.beta * one.flight_time)
            if one.orbit is not None:
                values['period_impacts'][slot] = one.orbit.period_impacts
                values['period_drive'][slot] = one.orbit.period_drive
    return values


def write_attractors(store: Store) -> None:
    """
    Match attractors from one alpha to the next, and write which is which.

    Parameters
    ----------
    store : Store
        Complete.

    """
    numbers = track(store.read_all('count'), store.read_all('kind'),
                    store.read_all('period_impacts'), store.read_all('alpha'),
                    store.read_all('velocity'))
    store.write_table({
        'attractor': (('sweep', 'alpha', 'slot'), numbers.astype(np.int32), {
            'long_name': 'number of the attractor, matched from alpha to alpha; -1 none'})})


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
    for name, value in dataclasses.asdict(diagram.at(column)).items():
        starts[name] = value
    return starts


def _sweep(diagram: Diagram, store: Store, tile: int) -> str:
    return diagram.sweeps[store.tiles[tile]['sweep'].start]


def _width(store: Store, tile: int) -> int:
    region = store.tiles[tile]['alpha']
    return int(region.stop - region.start)


def main(arguments: list[str] | None = None) -> int:
    """
    Run the command `orbit_diagram`.

    Parameters
    ----------
    arguments : list of str, optional
        Without the program's name; by default those of the process.

    Returns
    -------
    int
        Exit status.

    """
    return attempt('orbit_diagram', lambda: _run(arguments))


def _run(arguments: list[str] | None) -> int:
    parser = Parser('orbit_diagram', description='Count impact velocities against alpha, from '
                    'many starts and followed up and down, with the largest exponent.')
    parser.add_argument('--alpha', type=number, nargs=2, default=[0.47, 0.60],
                        metavar=('A', 'B'), help='window of alpha [1]; 0.47 0.60 by default')
    add_model(parser, names=('beta', 'gamma', 'restitution'))
    parser.add_argument('--columns', type=whole(2), default=780, metavar='N',
                        help='amplitudes; 780 by default')
    parser.add_argument('--bins', type=whole(1), default=900, metavar='N',
                        help='bins of the velocity; 900 by default')
    parser.add_argument('--bin-window', type=number, nargs=2, default=[-1.5, 1.5],
                        metavar=('A', 'B'), help='velocities counted [1]; -1.5 1.5 by default')
    parser.add_argument('--skip', type=whole(1), default=5000, metavar='N',
                        help='impacts passed over; 5000 by default')
    parser.add_argument('--keep', type=whole(256), default=2048, metavar='N',
                        help='impacts counted then; 2048 by default')
    parser.add_argument('--trajectories', type=whole(1), default=LANES, metavar='N',
                        help=f'at each alpha; {LANES} by default')
    parser.add_argument('--sweep', nargs='+', choices=SWEEPS, default=list(SWEEPS),
                        help='many starts at each alpha, or followed up and down; all by default')
    parser.add_argument('--draw', choices=('velocity', 'exponent', 'both'), default='both',
                        help='what the picture shows; both by default')
    add_plane(parser, size=None)
    add_seed(parser)
    add_run(parser)
    given = parser.parse_args(arguments)
    diagram = Diagram(
        model_of(argparse.Namespace(**{k: v for k, v in vars(given).items() if k != 'alpha'})),
        (given.alpha[0], given.alpha[1]), given.columns, plane_of(given), given.trajectories,
        given.seed, Window(given.skip, given.keep, given.bin_window[0], given.bin_window[1],
                           given.bins),
        tuple(sweep for sweep in SWEEPS if sweep in given.sweep))
    run = run_of(parser, given, arguments, 'orbit_diagram.zarr')
    store, complete = compute(diagram, run)
    if not complete:
        return say_interrupted(run, len(store.tiles) - len(store.pending()), len(store.tiles))
    print(f'orbit_diagram: {run.output}')
    if run.picture is not None:
        # Only here: matplotlib takes a second to import.
        from .figures_diagrams import draw_diagram
        from .figures_style import save
        save(draw_diagram(store, exponent=given.draw != 'velocity',
                          raster=given.draw != 'exponent'), run.picture)
        print(f'orbit_diagram: {run.picture}')
    return 0
