"""Attractors and their shares followed across alpha; where each is born, doubles and ends."""

import argparse
import sys
from typing import Any, Final

import numpy as np

from .cli import Figure, Run, run_tool
from .columns import Window
from .diagram import Diagram
from .events import Event, events_of, HEADING, searches_of
from .options import (
    add_alpha_window,
    add_plane,
    add_seed,
    model_of,
    number,
    Parser,
    plane_of,
    whole,
)
from .orbit_diagram import compute
from .progress import Progress
from .store import Store
from ..core.raster import BLOCKS

# Of the velocities by which attractors are matched from alpha to alpha.
BINS: Final = 1200


def locate(diagram: Diagram, store: Store, tolerance: float, hold: int) -> list[Event]:
    """
    Locate what happens to the attractors; tell of it, and how it goes.

    Parameters
    ----------
    diagram : Diagram
        The diagram.
    store : Store
        Complete.
    tolerance : float
        In alpha [1].
    hold : int
        A chaotic attractor lasts where trajectories stay for so many impacts.

    Returns
    -------
    list of Event
        All of it.

    """
    progress = Progress('continuation, searches for events',
                        searches_of(diagram, store), sys.stderr)

    try:
        events = events_of(diagram, store, tolerance, hold, progress.add)
    finally:
        progress.end()
    print('\n'.join([HEADING, *(event.describe() for event in events)]), flush=True)
    return events


def write_events(store: Store, events: list[Event]) -> None:
    """
    Write events as a table.

    Parameters
    ----------
    store : Store
        Receives them.
    events : list of Event
        The events.

    """
    one = {'units': '1'}
    columns: dict[str, tuple[Any, dict[str, str]]] = {
        'event_attractor': (np.array([e.attractor for e in events], np.int32), {
            'long_name': 'number of the attractor'}),
        'event_kind': (np.array([e.what for e in events], 'U15'), {
            'long_name': 'what happens'}),
        'event_orbit': (np.array([e.key for e in events], 'U48'), {
            'long_name': 'what changes, or on what trajectories then settle'}),
        'event_alpha': (np.array([e.alpha for e in events]), {'long_name': 'where', **one}),
        'event_tolerance': (np.array([e.tolerance for e in events]), {
            'long_name': 'how well it is located', **one}),
        'event_period_impacts': (np.array([e.orbit.impacts if e.orbit else 0 for e in events],
                                          np.int32), {
            'long_name': 'period of the orbit', 'units': 'impacts'}),
        'event_period_drive': (np.array([e.orbit.drive_periods if e.orbit else 0 for e in events],
                                        np.int32), {
            'long_name': 'period of the orbit', 'units': 'drive periods'}),
        'event_multiplier': (np.array([e.multiplier for e in events]), {
            'long_name': 'critical multiplier, real part', **one})}
    store.write_table({name: (('event',), values, attributes)
                       for name, (values, attributes) in columns.items()})


def main(arguments: list[str] | None = None) -> int:
    """
    Run the command `continuation`.

    Parameters
    ----------
    arguments : list of str, optional
        Without the program's name; by default those of the process.

    Returns
    -------
    int
        Exit status.

    """
    parser = Parser('continuation', description='Follow attractors and their shares across alpha; '
                    'locate where they are born, double and end.')
    add_alpha_window(parser, 0.47, 0.60, 'window of alpha')
    parser.add_argument('--columns', type=whole(2), default=131, metavar='N',
                        help='amplitudes; 131 by default')
    parser.add_argument('--trajectories', type=whole(1), default=256, metavar='N',
                        help='at each alpha; 256 by default')
    parser.add_argument('--skip', type=whole(1), default=4000, metavar='N',
                        help='impacts passed over at least where nothing settles; 4000 by default')
    parser.add_argument('--keep', type=whole(BLOCKS), default=512, metavar='N',
                        help='impacts looked at then; 512 by default')
    parser.add_argument('--tolerance', type=number, default=1e-7, metavar='X',
                        help='of the ends of chaotic attractors, in alpha [1]; 1e-7 by default')
    parser.add_argument('--hold', type=whole(256), default=100_000, metavar='N',
                        help='a chaotic attractor lasts where trajectories stay for so many '
                        'impacts; 100000 by default')
    add_plane(parser, size=None)
    add_seed(parser)

    def work(given: argparse.Namespace, run: Run) -> int:
        if not 1e-12 <= given.tolerance <= 1e-2:
            raise ValueError(f'--tolerance {given.tolerance:g} is not between 1e-12 and 1e-2')
        diagram = Diagram(
            model_of(given), (given.alpha[0], given.alpha[1]), given.columns, plane_of(given),
            given.trajectories, given.seed,
            Window(given.keep, bins=BINS, hold=max(given.hold, given.skip)),
            ('starts',))
        store = compute(diagram, run)
        write_events(store, locate(diagram, store, given.tolerance, given.hold))

        def draw() -> Figure:
            # Only here: matplotlib takes a second to import.
            from .figures_diagrams import draw_shares
            return draw_shares(store)

        return run.finish(draw)

    return run_tool(parser, arguments, 'continuation.zarr', work)
