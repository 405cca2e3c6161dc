"""The command `crisis`."""

import argparse

from . import options
from .refusal import Parser
from .run import Command, Run


def _add_options(parser: Parser) -> None:
    options.add_alpha_window(parser, 1.23, 1.25, 'before and beyond the crisis')
    parser.add_argument('--beyond', type=options.number, nargs=2, default=[4e-6, 4e-4],
                        metavar=('A', 'B'), help='distances from the crisis at which escapes are '
                        'timed [1]; 4e-6 4e-4 by default')
    parser.add_argument('--rates', type=options.whole(4), default=20, metavar='N',
                        help='amplitudes at which they are; 20 by default')
    parser.add_argument('--escapes', type=options.whole(16), default=80, metavar='N',
                        help='timed at each; 80 by default')
    parser.add_argument('--skip', type=options.whole(0), default=300, metavar='N',
                        help='escapes before this do not count [impacts]; 300 by default')
    parser.add_argument('--limit', type=options.whole(1000), default=50_000_000, metavar='N',
                        help='impacts after which one is given up; 5e7 by default')
    # Off the walls hardly a trajectory sticks: those that do all go on as one.
    options.add_plane(parser, size=None, displacement=-0.5)
    options.add_seed(parser)


def _work(given: argparse.Namespace, run: Run) -> None:
    from ..studies.crisis import crisis, describe
    dataset = crisis(options.model_of(given), options.alpha_window_of(given),
                     options.plane_of(given), beyond=tuple(given.beyond), **options.chosen(
                         given, 'rates', 'escapes', 'skip', 'limit', 'seed'), **run.work)
    run.finish(dataset, describe(dataset))


main = Command('crisis', 'Locate a boundary crisis, by the tangency of manifolds and by escape '
               'rates, and fit the law of the lifetimes.', 'crisis.zarr', _add_options, _work)
