"""The command `basins`."""

import argparse

from . import options
from .refusal import Parser
from .run import Command, Run
from ..core.defaults import BASINS_CAP


def _add_options(parser: Parser) -> None:
    options.add_model(parser)
    options.add_grid(parser, BASINS_CAP)
    options.add_search(parser)
    parser.add_argument('--zoom-levels', type=options.whole(1), default=1, metavar='N',
                        help='successive magnifications, each a store of its own')
    parser.add_argument('--zoom-at', type=options.number, nargs=2, default=[None, None],
                        metavar=('PHASE', 'VELOCITY'), help='point that stays where it is')
    parser.add_argument('--zoom-factor', type=options.number, default=10.0, metavar='X',
                        help='how many times smaller each window is; 10 by default')


def _work(given: argparse.Namespace, run: Run) -> None:
    from ..studies.basins import basins, describe, magnifications
    parameters = options.model_of(given)
    planes = magnifications(options.plane_of(given), given.zoom_levels,
                            given.zoom_at[0], given.zoom_at[1], given.zoom_factor)
    for level, plane in enumerate(planes):
        here = run if len(planes) == 1 else run.numbered(level)
        dataset = basins(parameters, plane, **options.chosen(given, *options.GRID), **here.work)
        here.finish(dataset, describe(dataset))


main = Command('basins', 'Find on which attractor every initial condition of a grid settles.',
               'basins-{alpha:g}.zarr', _add_options, _work)
