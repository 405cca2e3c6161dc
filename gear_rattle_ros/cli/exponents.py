"""The command `exponents`."""

from . import options
from .refusal import Parser
from .run import Command
from ..core.defaults import EXPONENT_IMPACTS


def _add_options(parser: Parser) -> None:
    options.add_model(parser)
    options.add_plane(parser, size=400)
    options.add(parser, 'impacts', options.whole(1), EXPONENT_IMPACTS,
                'impacts of every trajectory')


main = Command('exponents', 'Find how fast neighbouring trajectories of every initial condition '
               'diverge or converge: the largest exponent of the first impacts.',
               _add_options)
