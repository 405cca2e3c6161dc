# Copyright 2026 The gear_rattle_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Options that the commands share: the model, the plane, windows, seeds, numbers."""

import argparse
from collections.abc import Callable
import math
from typing import Any, Final, TYPE_CHECKING

from .refusal import Parser
from ..core import defaults
from ..gear_pairs import add_gears

if TYPE_CHECKING:
    from ..attractors.plane import Plane
    from ..core.model import Parameters

GREATEST: Final = 2**31 - 1


def number(text: str) -> float:
    """Read a finite number; `pi` may stand at its end."""
    factor, rest = (math.pi, text[:-2]) if text.endswith('pi') else (1.0, text)
    if factor != 1.0 and rest in ('', '-'):
        rest += '1'
    try:
        value = float(rest) * factor
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f'{text!r} is not a finite number')
    return value


def whole(least: int) -> Callable[[str], int]:
    """Make a reader of whole numbers, also as 1e5; the greatest is what 32 bits hold."""
    def read(text: str) -> int:
        value = number(text)
        if value != int(value) or value < least:
            raise argparse.ArgumentTypeError(f'{text!r} is not a whole number from {least} on')
        if value > GREATEST:
            raise argparse.ArgumentTypeError(f'{text!r} is more than {GREATEST:,}')
        return int(value)

    return read


def add(group: Any, name: str, read: Callable[[str], Any], standard: Any, words: str,
        *aliases: str, shown: str = '') -> None:
    """Add an option whose help ends with its default value; a tuple is one of two numbers."""
    values = standard if isinstance(standard, tuple) else (standard,)
    letters = 'AB' if isinstance(values[0], float) else 'NM'
    shown = shown or ' '.join(f'{value:g}' if isinstance(value, float) else str(value)
                              for value in values)
    single = 'X' if letters == 'AB' else 'N'
    group.add_argument(
        f'--{name}', *aliases, type=read, default=standard, help=f'{words}; {shown} by default',
        **({'nargs': 2, 'metavar': tuple(letters)} if len(values) == 2 else {'metavar': single}))


def add_model(parser: Parser, alpha: float | tuple[float, float] | None = defaults.ALPHA,
              words: str = 'amplitude of the drive') -> None:
    """Add the options of the model; a tuple is a window of amplitudes; none leaves them out."""
    group = parser.add_argument_group('model')
    if alpha is not None:
        add(group, 'alpha', number, alpha, f'{words} [1]')
    add(group, 'beta', number, defaults.BETA, 'damping [1]')
    add(group, 'gamma', number, defaults.GAMMA, 'constant load [1]')
    add(group, 'restitution', number, defaults.RESTITUTION, 'coefficient of restitution [1]')
    add_gears(parser, number)


def add_plane(parser: Parser, *, size: int | None = None, displacement: float = 0.0,
              plane: str = 'displacement') -> None:
    """Add the options of the plane of initial conditions; --size only where it has a default."""
    group = parser.add_argument_group('initial conditions')
    group.add_argument('--plane', choices=('section', 'displacement', 'strobe'), default=plane,
                       help='impacts, each on the wall that it moves towards; all at one '
                       f'displacement; or all at one drive phase; {plane} by default')
    # A list is what was typed.
    group.add_argument('--displacement', type=number, nargs='+', default=(displacement,),
                       metavar='X', help='displacement of all initial conditions [1], -1 to 0; '
                       f'{displacement:g} by default; of a strobe its window, -1 0 by default')
    group.add_argument('--phase', type=number, nargs='+', default=(0.0, 2.0 * math.pi),
                       metavar='X', help='window of the drive phase [rad]; 0 2pi by default; of '
                       'a strobe its phase, 0 by default')
    add(group, 'velocity', number, (-2.0, 2.0), 'window of the velocity [1]')
    if size is not None:
        group.add_argument('--size', type=whole(1), nargs='+', default=[size], metavar='N',
                           help='cells across and along velocity, N or N M; '
                                f'{size} {size} by default')


def add_initial(parser: Parser) -> None:
    """Add the option of a single initial condition."""
    parser.add_argument('--initial', type=number, nargs=3,
                        metavar=('PHASE', 'VELOCITY', 'DISPLACEMENT'),
                        help='follow one trajectory, from this initial condition [rad, 1, 1]')


def add_seed(parser: Parser) -> None:
    add(parser, 'seed', whole(0), defaults.SEED, 'seed of the random initial conditions')


def add_search(parser: Parser, *, initial_conditions: int = defaults.INITIAL_CONDITIONS,
               hold: int = defaults.HOLD) -> None:
    add_seed(parser)
    add(parser, 'initial-conditions', whole(1), initial_conditions,
        'random initial conditions of the search for attractors', '--starts')
    add(parser, 'hold', whole(1000), hold, 'impacts after which a trajectory is unsettled, and '
        'for which nothing may leave a chaotic attractor')
    add(parser, 'tolerance', number, defaults.TOLERANCE,
        'distance within which an orbit is reached [1]')


def add_grid(parser: Parser, cap: int, size: int = 400, plane: str = 'displacement') -> None:
    add_plane(parser, size=size, plane=plane)
    add(parser, 'cap', whole(1), cap, 'impacts after which a cell is given up')
    parser.add_argument('--tile', type=whole(1), metavar='N',
                        help='cells along the edge of a tile')


def hold_of(given: argparse.Namespace) -> dict[str, int]:
    """Return `hold`, long enough for the impacts that are passed over."""
    return {'hold': max(given.hold, given.skip)}


def model_of(given: argparse.Namespace) -> 'Parameters':
    """Read the parameters of the model; of windows of alpha the highest end is taken."""
    from ..core.model import Parameters
    alpha = given.alpha
    while not isinstance(alpha, float):
        alpha = max(alpha)
    return Parameters(alpha, given.beta, given.gamma, given.restitution)


def plane_of(given: argparse.Namespace) -> 'Plane':
    from ..attractors.plane import Plane
    size = getattr(given, 'size', [1])
    if len(size) > 2:
        raise ValueError(f'--size takes one or two numbers, not {len(size)}')
    windows: dict[str, Any] = {
        name: value[0] if len(value) == 1 else tuple(value) for name in ('displacement', 'phase')
        if isinstance(value := getattr(given, name), list) or given.plane == 'displacement'}
    return Plane(**windows, velocity=tuple(given.velocity), phases=size[0],
                 velocities=size[-1], kind=given.plane)
