"""The command `continuation`."""

import argparse

from . import options
from .refusal import Parser
from .run import Command, Run
from ..core.defaults import HOLD


def _add_options(parser: Parser) -> None:
    options.add_alpha_window(parser, 0.47, 0.60, 'window of alpha')
    parser.add_argument('--columns', type=options.whole(2), default=131, metavar='N',
                        help='amplitudes; 131 by default')
    parser.add_argument('--trajectories', type=options.whole(1), default=256, metavar='N',
                        help='at each alpha; 256 by default')
    parser.add_argument('--skip', type=options.whole(1), default=4000, metavar='N',
                        help='impacts passed over at least where nothing settles; 4000 by default')
    parser.add_argument('--keep', type=options.whole(1), default=512, metavar='N',
                        help='impacts looked at then; 512 by default')
    parser.add_argument('--tolerance', type=options.number, default=1e-7, metavar='X',
                        help='of the ends of chaotic attractors, in alpha [1]; 1e-7 by default')
    parser.add_argument('--hold', type=options.whole(256), default=HOLD, metavar='N',
                        help='a chaotic attractor lasts where trajectories stay for so many '
                        f'impacts; {HOLD} by default')
    options.add_plane(parser, size=None)
    options.add_seed(parser)


def _work(given: argparse.Namespace, run: Run) -> None:
    from ..studies.continuation import continuation, describe
    dataset = continuation(
        options.model_of(given), options.alpha_window_of(given), options.plane_of(given),
        hold=max(given.hold, given.skip), **options.chosen(
            given, 'columns', 'trajectories', 'keep', 'tolerance', 'seed'), **run.work)
    run.finish(dataset, describe(dataset))


main = Command('continuation', 'Follow attractors and their shares across alpha; locate where '
               'they are born, double and end.', 'continuation.zarr', _add_options, _work)
