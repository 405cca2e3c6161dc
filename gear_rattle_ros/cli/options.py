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
from collections.abc import Callable, Iterator
import dataclasses
import itertools
import math
from typing import Any, Final, TYPE_CHECKING

from .refusal import Parser
from ..core import defaults
from ..gear_pairs import add_gears

if TYPE_CHECKING:
    from ..attractors.plane import Plane
    from ..core.model import Parameters
    from ..core.path import Path

GREATEST: Final = 2**31 - 1
MODEL: Final = ('alpha', 'beta', 'gamma', 'restitution')


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


class _Values(argparse.Action):
    """One value is a number, several are a list; windows are a list of tuples."""

    def __call__(self, parser: argparse.ArgumentParser, given: argparse.Namespace, values: Any,
                 option: str | None = None) -> None:
        before, takes_windows = getattr(given, self.dest), isinstance(self.metavar, tuple)
        if takes_windows and len(values) > 2:
            parser.error(f'{option} takes a value or a window of two, not {len(values)}')
        if len(values) == 1:
            values, = values
        elif takes_windows:
            values = [*(before if isinstance(before, list) else ()), tuple(values)]
        setattr(given, self.dest, values)


def add_model(parser: Parser, alpha: float = defaults.ALPHA,
              windows: tuple[tuple[float, float], ...] | None = None, words: str = '',
              about: str = '') -> None:
    """Add the options of the model; with windows of alpha, or none, each option takes one, too."""
    group = parser.add_argument_group(
        'model', about or 'Each option takes a value or a window of two; with several windows the '
        'sweep goes straight from all first values to all last ones, and --mark and accuracies '
        'are in parts of that way.' if windows is not None else
        'Each option takes one value or several, in turn.')
    for name, standard, what in (
            ('alpha', windows or alpha, 'amplitude of the drive'),
            ('beta', defaults.BETA, 'damping'), ('gamma', defaults.GAMMA, 'constant load'),
            ('restitution', defaults.RESTITUTION, 'coefficient of restitution')):
        shown = ' and '.join('{:g} {:g}'.format(*each) for each in windows or ())
        group.add_argument(
            f'--{name}', type=number, nargs='+', action=_Values, default=standard,
            metavar='X' if windows is None else ('A', 'B'), help=f'{what} [1]' + (
                f'{words}; {standard:g} by default' if isinstance(standard, float) else
                f'{words}; {shown} by default, {alpha:g} where another one has a window'))
    add_gears(parser, number, None if windows is None else _Values)


def add_plane(parser: Parser, *, size: int | None = None, displacement: float = 0.0,
              plane: str = 'displacement') -> None:
    """Add the options of the plane of initial conditions; --size only where it has a default."""
    group = parser.add_argument_group('initial conditions')
    group.add_argument('--plane', choices=('section', 'impact', 'displacement', 'strobe'),
                       default=plane, help='states just after an impact; just before one; all at '
                       f'one displacement; or all at one drive phase; {plane} by default')
    # A list is what was typed.
    group.add_argument('--displacement', type=number, nargs='+', default=(displacement,),
                       metavar='X', help='displacement of all initial conditions [1], -1 to 0; '
                       f'{displacement:g} by default; of a strobe its window, -1 0 by default')
    group.add_argument('--phase', type=number, nargs='+', default=(0.0, 2.0 * math.pi),
                       metavar='X', help='window of the drive phase [rad]; 0 2pi by default; of '
                       'a strobe its phase, 0 by default')
    add(group, 'velocity', number, (-2.0, 2.0), 'window of the velocity [1]')
    group.add_argument('--velocity-m-per-s', type=number, nargs=2, metavar=('A', 'B'),
                       help='the same of a gear pair [m/s]')
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
    from ..core.model import Parameters
    return Parameters(given.alpha, given.beta, given.gamma, given.restitution)


def one_by_one(given: argparse.Namespace) -> Iterator[tuple[argparse.Namespace, str]]:
    """Give each combination of values where several were typed, and what to name it by."""
    asked: dict[str, Any] = {name: getattr(given, name) for name in MODEL}
    several = {name: values for name, values in asked.items()
               if isinstance(values, list) and isinstance(values[0], float)}
    for values in itertools.product(*several.values()):
        chosen = dict(zip(several, values, strict=True))
        yield (argparse.Namespace(**{**vars(given), **chosen}),
               ''.join(f'-{name}-{value:g}' for name, value in chosen.items()))


def paths_of(given: argparse.Namespace) -> 'tuple[Path, ...]':
    """Read the windows of a sweep; that of alpha by default gives way to any other."""
    from ..core.model import Parameters
    from ..core.path import Path
    asked: dict[str, Any] = {name: getattr(given, name) for name in MODEL}
    fixed = {name: value for name, value in asked.items() if isinstance(value, float)}
    windows: dict[str, Any] = next(filter(None, (
        {name: each for name, each in asked.items() if isinstance(each, kind)}
        for kind in (list, tuple))), {})
    if not windows:
        raise ValueError('no parameter has a window; give one two values, such as --beta 0.1 0.2')
    if len({len(each) for each in windows.values()}) > 1:
        raise ValueError('give as many windows of ' + ' as of '.join(
            f'--{name}' for name in windows))
    # A gear pair has an alpha of its own.
    base = dataclasses.replace(given.pair.parameters if given.pair else Parameters(), **fixed)
    return tuple(Path.over(base, **{name: each[number] for name, each in windows.items()})
                 for number in range(len(next(iter(windows.values())))))


def path_of(given: argparse.Namespace) -> 'Path':
    """Read the one path of a sweep."""
    path, *others = paths_of(given)
    if others:
        raise ValueError(f'give one window of --{path.varied[0]}, not {1 + len(others)}')
    return path


def place_of(given: argparse.Namespace) -> 'Parameters | Path':
    """Read the model, or the path of a sweep where a parameter has a window."""
    is_swept = any(isinstance(getattr(given, name), list) for name in MODEL)
    return path_of(given) if is_swept else model_of(given)


def add_along(parser: Parser, of: str) -> None:
    """Add the option that says which parameter the window of another option is of."""
    parser.add_argument('--along', choices=MODEL, default=MODEL[0],
                        help=f'the parameter of the window --{of}; {MODEL[0]} by default')


def path_along(given: argparse.Namespace, window: list[float]) -> 'Path | None':
    from ..core.path import Path
    return Path.over(model_of(given), **{given.along: (window[0], window[1])}) if window else None


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
