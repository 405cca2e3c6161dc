"""The command `crisis`."""

from . import options
from .options import add, number, whole
from .refusal import Parser
from .run import Command


def _add_options(parser: Parser) -> None:
    options.add_model(parser, (1.24, 1.25), 'amplitudes on both sides of the crisis')
    parser.add_argument('--attractor', default='', metavar='KEY', help='the chaotic attractor '
                        'that ends, as `attractors` prints it; by default the first that does')
    add(parser, 'beyond', number, (4e-6, 4e-4),
        'distances from the crisis at which escapes are timed [1]', shown='4e-6 4e-4')
    add(parser, 'rates', whole(4), 20, 'number of amplitudes at which they are')
    add(parser, 'escapes', whole(16), 80, 'escapes timed at each')
    add(parser, 'skip', whole(0), 300, 'escapes before this do not count [impacts]')
    add(parser, 'limit', whole(1000), 50_000_000, 'impacts after which a trajectory is given up',
        shown='5e7')
    # Off the walls hardly a trajectory sticks: those that do all go on as one.
    options.add_plane(parser, displacement=-0.5)
    options.add_seed(parser)


main = Command('crisis', 'Locate the crisis of a chaotic attractor, by the tangency of manifolds '
               'and by escape rates; name the orbit that it collides with.', _add_options)
