"""The command `orbit_diagram`."""

import argparse

from . import options
from .refusal import Parser
from .run import Command, Run

SWEEPS = ('starts', 'up', 'down')


def _add_options(parser: Parser) -> None:
    options.add_alpha_window(parser, 0.47, 0.60, 'window of alpha')
    parser.add_argument('--columns', type=options.whole(2), default=780, metavar='N',
                        help='amplitudes; 780 by default')
    parser.add_argument('--bins', type=options.whole(1), default=900, metavar='N',
                        help='bins of the velocity; 900 by default')
    parser.add_argument('--bin-window', type=options.number, nargs=2, default=[-1.5, 1.5],
                        metavar=('A', 'B'), help='velocities counted [1]; -1.5 1.5 by default')
    parser.add_argument('--hold', type=options.whole(1000), default=10_000, metavar='N',
                        help='impacts after which a trajectory is unsettled; in 32 times as many '
                        'nothing may leave a chaotic attractor; 10000 by default')
    parser.add_argument('--skip', type=options.whole(1), default=5000, metavar='N',
                        help='impacts passed over at least where nothing settles; 5000 by default')
    parser.add_argument('--keep', type=options.whole(1), default=2048, metavar='N',
                        help='impacts of each trajectory that are counted then; 2048 by default')
    parser.add_argument('--trajectories', type=options.whole(1), default=32, metavar='N',
                        help='at each alpha; 32 by default')
    parser.add_argument('--sweep', nargs='+', choices=SWEEPS, default=list(SWEEPS),
                        help='many initial conditions at each alpha (starts), or followed up and '
                        'down; all by default')
    parser.add_argument('--draw', choices=('velocity', 'exponent', 'both'), default='both',
                        help='what the picture shows; both by default')
    options.add_plane(parser, size=None)
    options.add_seed(parser)


def _work(given: argparse.Namespace, run: Run) -> None:
    from ..studies.orbit_diagram import describe, orbit_diagram
    dataset = orbit_diagram(
        options.model_of(given), options.alpha_window_of(given), options.plane_of(given),
        hold=max(given.hold, given.skip), bin_window=tuple(given.bin_window),
        sweeps=tuple(given.sweep),
        **options.chosen(given, 'columns', 'trajectories', 'keep', 'bins', 'seed'), **run.work)
    run.finish(dataset, describe(dataset), exponent=given.draw != 'velocity',
               raster=given.draw != 'exponent')


main = Command('orbit_diagram', 'Count impact velocities against alpha, from many initial '
               'conditions and followed up and down, with the largest exponent.',
               'orbit_diagram.zarr', _add_options, _work)
