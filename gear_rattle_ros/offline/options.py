"""Options that the offline tools share: the model, the plane, windows, seeds, numbers."""

import argparse
from collections.abc import Callable
import dataclasses
import math
import re
from typing import Any, Final, NoReturn

from .grid import Plane
from ..core.model import ALPHA_MAXIMUM, Parameters, require_finite

GREATEST: Final = 2**31 - 1


class Parser(argparse.ArgumentParser):
    """Options of a tool; refuses with one line, and takes ``-1e-3`` and ``-pi`` for numbers."""

    def __init__(self, *arguments: Any, **settings: Any) -> None:
        """Make it as argparse does."""
        super().__init__(*arguments, **settings)
        self._negative_number_matcher = re.compile(r'^-[\d.p]')

    def error(self, message: str) -> NoReturn:
        """Refuse the command line."""
        self.exit(2, f'{self.prog}: {message}\n')


def number(text: str) -> float:
    """
    Read a finite number; `pi` may stand at its end.

    Parameters
    ----------
    text : str
        Such as 0.48, -1e-3, 2pi, -pi or 0.5pi.

    Returns
    -------
    float
        The number.

    Raises
    ------
    argparse.ArgumentTypeError
        If it is none.

    """
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
    """
    Make a reader of whole numbers.

    Parameters
    ----------
    least : int
        The least one taken; the greatest is what 32 bits hold, as lifetimes have.

    Returns
    -------
    callable
        Takes the text, also as 1e5.

    """
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
    """
    Add the options of the model.

    Parameters
    ----------
    parser : ArgumentParser
        Receives them.
    alpha : float
        Default of the amplitude [1].
    names : tuple of str
        Which of the parameters.

    """
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
    """
    Add a window of amplitudes, and the other parameters of the model.

    Parameters
    ----------
    parser : ArgumentParser
        Receives them.
    low, high : float
        The window by default [1].
    words : str
        What it is.

    """
    parser.add_argument('--alpha', type=number, nargs=2, default=[low, high], metavar=('A', 'B'),
                        help=f'{words} [1]; {low:g} {high:g} by default')
    add_model(parser, names=('beta', 'gamma', 'restitution'))


def add_plane(parser: argparse.ArgumentParser, *, size: int | None = 400,
              displacement: float = 0.0) -> None:
    """
    Add the options of the plane of initial conditions.

    Parameters
    ----------
    parser : ArgumentParser
        Receives them.
    size : int or None
        Default number of cells along an edge; None for no such option.
    displacement : float
        Default displacement [1].

    """
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
    """
    Read the parameters of the model.

    Parameters
    ----------
    given : Namespace
        What was given; of a window of amplitudes the higher end is taken.

    Returns
    -------
    model : Parameters
        Validated.

    Raises
    ------
    ValueError
        If one is out of range.

    """
    names = [field.name for field in dataclasses.fields(Parameters)]
    values = {name: getattr(given, name) for name in names if hasattr(given, name)}
    if isinstance(values['alpha'], list):
        values['alpha'] = alpha_window_of(given)[1]
    return Parameters(**values)


def alpha_window_of(given: argparse.Namespace) -> tuple[float, float]:
    """
    Read a window of amplitudes.

    Parameters
    ----------
    given : Namespace
        What was given.

    Returns
    -------
    tuple of float
        The lower and the higher end [1].

    Raises
    ------
    ValueError
        If it is empty, reversed or out of range.

    """
    low, high = (require_finite('alpha', value, 0.0, ALPHA_MAXIMUM) for value in given.alpha)
    if not low < high:
        raise ValueError(f'alpha window {low:g} to {high:g} is empty or reversed; give the lower '
                         'end first')
    return low, high


def plane_of(given: argparse.Namespace) -> Plane:
    """
    Read the plane of initial conditions.

    Parameters
    ----------
    given : Namespace
        What was given.

    Returns
    -------
    Plane
        Validated.

    Raises
    ------
    ValueError
        If a window is reversed or a size is wrong.

    """
    size = getattr(given, 'size', [1])
    if len(size) > 2:
        raise ValueError(f'--size takes one or two numbers, not {len(size)}')
    return Plane(given.displacement, tuple(given.phase), tuple(given.velocity), size[0], size[-1])
