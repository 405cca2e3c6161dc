"""The command `motion`."""

from . import options
from .options import add, whole
from .refusal import Parser
from .run import Command


def _add_options(parser: Parser) -> None:
    options.add_model(parser)
    parser.add_argument('--attractor', default='', metavar='NAME', help='its key, or its letter '
                        'in the paper; the one that is reached most often by default')
    options.add_initial(parser)
    add(parser, 'skip', whole(0), 0, 'impacts passed over')
    add(parser, 'periods', whole(1), 8, 'drive periods that follow')
    options.add_plane(parser)
    options.add_search(parser)


main = Command('motion', 'Sample the motion of an attractor, or from an initial condition, '
               'between the walls.', _add_options)
