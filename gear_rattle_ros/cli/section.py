"""The command `section`."""

import argparse

from . import options
from .refusal import Parser
from .run import Command, Run


def _add_options(parser: Parser) -> None:
    options.add_model(parser, alpha=1.23)
    parser.add_argument('--trajectories', type=options.whole(1), default=64, metavar='N',
                        help='random initial conditions; 64 by default')
    parser.add_argument('--skip', type=options.whole(0), default=1000, metavar='N',
                        help='impacts passed over; 1000 by default')
    parser.add_argument('--keep', type=options.whole(1), default=20_000, metavar='N',
                        help='impacts counted then; 20000 by default')
    parser.add_argument('--bins', type=options.whole(1), nargs=2, default=[720, 540],
                        metavar=('N', 'M'), help='along phase and velocity; 720 540 by default')
    parser.add_argument('--bin-window', type=options.number, nargs=2, default=[-2.0, 2.0],
                        metavar=('A', 'B'), help='velocities counted [1]; -2 2 by default')
    options.add_plane(parser, size=None)
    options.add_seed(parser)


def _work(given: argparse.Namespace, run: Run) -> None:
    from ..studies.section import describe, section
    dataset = section(
        options.model_of(given), options.plane_of(given), bins=tuple(given.bins),
        bin_window=tuple(given.bin_window),
        **options.chosen(given, 'trajectories', 'skip', 'keep', 'seed'), **run.work)
    run.finish(dataset, describe(dataset))


main = Command('section', 'Count impacts on the section of phase and velocity.', 'section.zarr',
               _add_options, _work)
