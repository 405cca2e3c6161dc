"""The command `continuation`."""

from . import options
from .options import add, number, whole
from .refusal import Parser
from .run import Command
from ..core.defaults import HOLD


def _add_options(parser: Parser) -> None:
    options.add_model(parser, (0.47, 0.60), 'window of alpha')
    add(parser, 'columns', whole(2), 131, 'amplitudes')
    add(parser, 'trajectories', whole(1), 256, 'trajectories at each alpha')
    add(parser, 'skip', whole(1), 4000, 'fewest impacts passed over where nothing settles')
    add(parser, 'keep', whole(1), 512, 'impacts kept after that')
    add(parser, 'tolerance', number, 1e-7, 'accuracy of the ends of chaos, in alpha [1]')
    add(parser, 'hold', whole(256), HOLD,
        'a chaotic attractor lasts where trajectories stay for this number of impacts')
    options.add_plane(parser)
    options.add_seed(parser)


main = Command('continuation', 'Follow attractors and their shares across alpha; locate where '
               'they are born, double and end.', _add_options,
               keywords=options.hold_of)
