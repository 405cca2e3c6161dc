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

"""Gear pairs from files and from options, the same in tools, the suite and the simulator."""

import argparse
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
import sys
from typing import Any, Final, TYPE_CHECKING

from .core.defaults import QUANTITIES, RESTITUTION

if TYPE_CHECKING:
    from .core.gears import Gears


def read_gears(path: Path | str | None, **changes: float) -> 'Gears':
    """Read a gear pair; `changes` replace what the file has. ValueError names what is wrong."""
    from .core.gears import Gears
    from .plain_yaml import read_yaml
    content: Any = {}
    if path:
        try:
            content = read_yaml(Path(path).read_text(encoding='utf-8'))
        except (OSError, UnicodeError) as error:
            reason = getattr(error, 'strerror', None) or 'is not text'
            raise ValueError(f'{path}: {reason}; name a YAML file of a gear pair') from error
        except ValueError as error:
            raise ValueError(f'{path} {error}') from error
        if not isinstance(content, dict):
            raise ValueError(f'{path} must give quantities by name, such as backlash_m: 0.0001')
    try:
        return Gears.of({'restitution': RESTITUTION} | content, **changes)
    except ValueError as error:
        raise ValueError(f'{path or "gear pair"}: {error}') from error


def pair_of(given: Mapping[str, Any]) -> 'Gears | None':
    """Return the gear pair that parameters of a node describe, if any does."""
    changes = {name: given[name] for name in QUANTITIES if name in given}
    # The restitution alone is a parameter of the model.
    if not given.get('gears') and not changes.keys() - {'restitution'}:
        return None
    return read_gears(given.get('gears'), **changes)


# Quantities that are proportional to a parameter: where it takes a window, they do, too.
PROPORTIONAL: Final = ('drive_rad', 'drive_m', 'drag_n_m_s_per_rad', 'torque_n_m')


def add_gears(parser: argparse.ArgumentParser, read: Callable[[str], float] = float,
              windows: type[argparse.Action] | None = None) -> None:
    """Add the options of a gear pair in SI units; `windows` reads those of sweeps."""
    group = parser.add_argument_group('gear pair in SI units, instead of alpha, beta and gamma')
    group.add_argument('--gears', type=Path, metavar='FILE.yaml', help='file of its quantities; '
                       'the options below replace single ones')
    for name, (words, unit) in QUANTITIES.items():
        many: Any = {'metavar': 'X'} if windows is None or name not in PROPORTIONAL else {
            'nargs': '+', 'action': windows, 'metavar': ('A', 'B')}
        # There is an option of the restitution already.
        if name != 'restitution':
            group.add_argument(f'--{name.replace("_", "-")}', type=read, **many, help=f'{words} '
                               f'[{unit}]' + ', or a window of two' * (len(many) > 1))


def parse(parser: argparse.ArgumentParser, words: Sequence[str]) -> argparse.Namespace:
    """
    Parse options; where they give a gear pair, its numbers are the defaults of the model's.

    The result has it as `pair`, else None; what looks wrong in it is said on stderr.
    """
    given = parser.parse_args(words)
    changes = {name: value for name in QUANTITIES if name != 'restitution'
               and (value := getattr(given, name, None)) is not None}
    given.pair = None
    windows = {name: each for name, each in changes.items() if isinstance(each, list)}
    changes |= {name: each[0][0] for name, each in windows.items()}
    if changes or getattr(given, 'gears', None) is not None:
        pair = read_gears(given.gears, **changes)
        for line in pair.warnings():
            print(f'{parser.prog.split()[-1]}: {line}', file=sys.stderr)
        # A window, such as that of alpha, stays.
        numbers = {name: value for name, value in
                   {**vars(pair.parameters), 'omega': pair.omega}.items() if name in given
                   and not isinstance(parser.get_default(name), tuple)}
        for name, (quantity, unit) in pair.units.items():
            if quantity in windows:
                if getattr(given, name) != parser.get_default(name):
                    raise ValueError(f'--{name} and --{quantity.replace("_", "-")} are windows of '
                                     'the same; give one of them')
                numbers[name] = [(a / unit, b / unit) for a, b in windows[quantity]]
        parser.set_defaults(**numbers)
        given = parser.parse_args(words)
        given.pair = pair
    if getattr(given, 'velocity_m_per_s', None):
        if given.pair is None:
            raise ValueError('--velocity-m-per-s is of a gear pair; give its file with --gears')
        given.velocity = [each / given.pair.scales.velocity_m_per_s
                          for each in given.velocity_m_per_s]
    return given
