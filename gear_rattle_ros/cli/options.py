"""Options that the offline tools share: the model, the plane, windows, seeds, numbers."""

import argparse
from collections.abc import Callable
import dataclasses
import math
from typing import Final

from . import refusal as plain
from ..attractors.plane import Plane
from ..core.model import ALPHA_MAXIMUM, Parameters, require_finite

GREATEST: Final = 2**31 - 1
Parser = plain.Parser


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


def add_model(parser: argparse.ArgumentParser, *, alpha: float = 0.48,
              names: tuple[str, ...] = ('alpha', 'beta', 'gamma', 'restitution')) -> None:
    """Add the options of the model."""
    group = parser.add_argument_group('model')
    standard = Parameters(alpha=alpha)
    for name, words in (('alpha', 'amplitude of the drive'), ('beta', 'damping'),
                        ('gamma', 'constant load'), ('restitution', 'coefficient of restitution')):
        if name in names:
            value = getattr(standard, name)
            group.add_argument(f'--{name}', type=number, default=value, metavar='X',
                               help=f'{words} [1]; {value:g} by default')


def add_alpha_window(parser: argparse.ArgumentParser, low: float, high: float, words: str
                     ) -> None:
    """Add a window of amplitudes, and the other parameters of the model."""
    parser.add_argument('--alpha', type=number, nargs=2, default=[low, high], metavar=('A', 'B'),
                        help=f'{words} [1]; {low:g} {high:g} by default')
    add_model(parser, names=('beta', 'gamma', 'restitution'))


def add_plane(parser: argparse.ArgumentParser, *, size: int | None = 400,
              displacement: float = 0.0) -> None:
    """Add the options of the plane of initial conditions; size None is no such option."""
    group = parser.add_argument_group('initial conditions')
    group.add_argument('--displacement', type=number, default=displacement, metavar='S',
                       help='displacement of all starts [1], -1 to 0; '
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


def add_seed(parser: argparse.ArgumentParser) -> None:
    """Add the option of the seed of random starts."""
    parser.add_argument('--seed', type=whole(0), default=1, metavar='N',
                        help='seed of the random starts; 1 by default')


def model_of(given: argparse.Namespace) -> Parameters:
    """Read the parameters of the model; of a window of alpha the higher end is taken."""
    names = [field.name for field in dataclasses.fields(Parameters)]
    values = {name: getattr(given, name) for name in names if hasattr(given, name)}
    if isinstance(values['alpha'], list):
        values['alpha'] = alpha_window_of(given)[1]
    return Parameters(**values)


def alpha_window_of(given: argparse.Namespace) -> tuple[float, float]:
    """Read a window of amplitudes."""
    low, high = (require_finite('alpha', value, 0.0, ALPHA_MAXIMUM) for value in given.alpha)
    if not low < high:
        raise ValueError(f'alpha window {low:g} to {high:g} is empty or reversed; give the lower '
                         'end first')
    return low, high


def plane_of(given: argparse.Namespace) -> Plane:
    """Read the plane of initial conditions."""
    size = getattr(given, 'size', [1])
    if len(size) > 2:
        raise ValueError(f'--size takes one or two numbers, not {len(size)}')
    return Plane(given.displacement, tuple(given.phase), tuple(given.velocity), size[0], size[-1])
