"""The command `section`."""

from . import options
from .options import add, number, whole
from .refusal import Parser
from .run import Command


def _add_options(parser: Parser) -> None:
    options.add_model(parser, alpha=1.23)
    add(parser, 'trajectories', whole(1), 64, 'random initial conditions')
    add(parser, 'skip', whole(0), 1000, 'impacts passed over first')
    add(parser, 'keep', whole(1), 20_000, 'impacts counted after that')
    add(parser, 'bins', whole(1), (720, 540), 'bins along phase and velocity')
    add(parser, 'bin-window', number, (-2.0, 2.0), 'velocities counted [1]')
    options.add_initial(parser)
    options.add_plane(parser)
    options.add_seed(parser)


main = Command('section', 'Count impacts on the section of phase and velocity.', 'section.zarr',
               _add_options)
