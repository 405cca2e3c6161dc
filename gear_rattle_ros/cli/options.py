"""Options that the offline tools share: the model, the plane, windows, seeds, numbers."""

import argparse
from collections.abc import Callable
import math
from typing import Any, Final, TYPE_CHECKING

from .refusal import Parser
from ..core import defaults

if TYPE_CHECKING:
    from ..attractors.plane import Plane
    from ..core.model import Parameters

GREATEST: Final = 2**31 - 1
# The model: names, default values, and what they are.
MODEL: Final = {
    'alpha': (defaults.ALPHA, 'amplitude of the drive'), 'beta': (defaults.BETA, 'damping'),
    'gamma': (defaults.GAMMA, 'constant load'),
    'restitution': (defaults.RESTITUTION, 'coefficient of restitution')}


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


def add_model(parser: Parser, *, alpha: float = defaults.ALPHA) -> None:
    """Add the options of the model."""
    _add_model(parser, {'alpha': alpha})


def add_alpha_window(parser: Parser, low: float, high: float, words: str) -> None:
    """Add a window of amplitudes, and the other parameters of the model."""
    parser.add_argument('--alpha', type=number, nargs=2, default=[low, high], metavar=('A', 'B'),
                        help=f'{words} [1]; {low:g} {high:g} by default')
    _add_model(parser, {'alpha': None})


def _add_model(parser: Parser, others: dict[str, float | None]) -> None:
    group = parser.add_argument_group('model')
    for name, (standard, words) in MODEL.items():
        value = others.get(name, standard)
        if value is not None:
            group.add_argument(f'--{name}', type=number, default=value, metavar='X',
                               help=f'{words} [1]; {value:g} by default')


def add_plane(parser: Parser, *, size: int | None = 400,
              displacement: float = 0.0) -> None:
    """Add the options of the plane of initial conditions; size None is no such option."""
    group = parser.add_argument_group('initial conditions')
    group.add_argument('--displacement', type=number, default=displacement, metavar='S',
                       help='displacement of all initial conditions [1], -1 to 0; '
                            f'{displacement:g} by default')
    group.add_argument('--phase', type=number, nargs=2, default=[0.0, 2.0 * math.pi],
                       metavar=('A', 'B'),
                       help='window of the drive phase [rad]; 0 2pi by default')
    group.add_argument('--velocity', type=number, nargs=2, default=[-2.0, 2.0],
                       metavar=('A', 'B'), help='window of the velocity [1]; -2 2 by default')
    if size is not None:
        group.add_argument('--size', type=whole(1), nargs='+', default=[size], metavar='N',
                           help='cells along phase and velocity, N or N M; '
                                f'{size} {size} by default')


def add_seed(parser: Parser) -> None:
    """Add the option of the seed of random initial conditions."""
    parser.add_argument('--seed', type=whole(0), default=defaults.SEED, metavar='N',
                        help='seed of the random initial conditions; '
                             f'{defaults.SEED} by default')


def add_search(parser: Parser, *, initial_conditions: int = defaults.INITIAL_CONDITIONS,
               hold: int = defaults.HOLD) -> None:
    """Add the options of the search for attractors."""
    add_seed(parser)
    parser.add_argument('--initial-conditions', '--starts', type=whole(1), metavar='N',
                        default=initial_conditions, help='random initial conditions of the search '
                        f'for attractors; {initial_conditions} by default')
    parser.add_argument('--hold', type=whole(1000), default=hold, metavar='N',
                        help='impacts after which a trajectory is unsettled, and for which '
                             f'nothing may leave a chaotic attractor; {hold} by default')
    parser.add_argument('--tolerance', type=number, default=defaults.TOLERANCE, metavar='X',
                        help='distance within which an orbit is reached [1]; '
                             f'{defaults.TOLERANCE:g} by default')


def add_grid(parser: Parser, cap: int) -> None:
    """Add the options of a grid of labels and lifetimes."""
    add_plane(parser)
    parser.add_argument('--cap', type=whole(1), default=cap, metavar='N',
                        help=f'impacts after which a cell is given up; {cap} by default')
    parser.add_argument('--tile', type=whole(1), metavar='N',
                        help='cells along the edge of a tile')


def chosen(given: argparse.Namespace, *names: str) -> dict[str, Any]:
    """Return some options as keywords of a function."""
    return {name: getattr(given, name) for name in names}


SEARCH: Final = ('initial_conditions', 'seed', 'hold', 'tolerance')
GRID: Final = (*SEARCH, 'cap', 'tile')


def model_of(given: argparse.Namespace) -> 'Parameters':
    """Read the parameters of the model; of a window of alpha the higher end is taken."""
    from ..core.model import Parameters
    values = chosen(given, *MODEL)
    if isinstance(values['alpha'], list):
        values['alpha'] = alpha_window_of(given)[1]
    return Parameters(**values)


def alpha_window_of(given: argparse.Namespace) -> tuple[float, float]:
    """Read a window of amplitudes."""
    from ..core.model import ALPHA_MAXIMUM, require_finite
    low, high = (require_finite('alpha', value, 0.0, ALPHA_MAXIMUM) for value in given.alpha)
    if not low < high:
        raise ValueError(f'alpha window {low:g} to {high:g} is empty or reversed; give the lower '
                         'end first')
    return low, high


def plane_of(given: argparse.Namespace) -> 'Plane':
    """Read the plane of initial conditions."""
    from ..attractors.plane import Plane
    size = getattr(given, 'size', [1])
    if len(size) > 2:
        raise ValueError(f'--size takes one or two numbers, not {len(size)}')
    return Plane(given.displacement, tuple(given.phase), tuple(given.velocity), size[0], size[-1])
