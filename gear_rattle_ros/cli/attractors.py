"""The command `attractors`."""

import argparse

from . import options
from .refusal import Parser
from .run import Command, Run


def _add_options(parser: Parser) -> None:
    options.add_model(parser)
    options.add_plane(parser, size=None)
    options.add_search(parser)


def _work(given: argparse.Namespace, run: Run) -> None:
    from ..studies.attractors import attractors, describe
    dataset = attractors(options.model_of(given), options.plane_of(given),
                         **options.chosen(given, *options.SEARCH), **run.work)
    run.finish(dataset, describe(dataset))


main = Command('attractors', 'Find every attractor at given parameters.',
               'attractors-{alpha:g}.zarr', _add_options, _work)
