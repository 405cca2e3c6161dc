"""The command `exponents`."""

import argparse

from . import options
from .refusal import Parser
from .run import Command, Run
from ..core.defaults import EXPONENT_IMPACTS


def _add_options(parser: Parser) -> None:
    options.add_model(parser)
    options.add_plane(parser)
    parser.add_argument('--impacts', type=options.whole(1), default=EXPONENT_IMPACTS, metavar='N',
                        help=f'impacts of every trajectory; {EXPONENT_IMPACTS} by default')


def _work(given: argparse.Namespace, run: Run) -> None:
    from ..studies.exponents import describe, exponents
    dataset = exponents(options.model_of(given), options.plane_of(given), impacts=given.impacts,
                        **run.work)
    run.finish(dataset, describe(dataset))


main = Command('exponents', 'Find how fast neighbouring trajectories of every initial condition '
               'diverge or converge: the largest exponent of the first impacts.',
               'exponents-{alpha:g}.zarr', _add_options, _work)
