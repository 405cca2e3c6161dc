"""The command `attractors`."""

from . import options
from .refusal import Parser
from .run import Command


def _add_options(parser: Parser) -> None:
    options.add_model(parser)
    options.add_plane(parser)
    options.add_search(parser)


main = Command('attractors', 'Find every attractor at given parameters.',
               _add_options)
