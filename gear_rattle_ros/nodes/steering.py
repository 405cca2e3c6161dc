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

"""The commands that steer a running simulator: set, get, reset, pause and resume."""

import argparse
from collections.abc import Iterable, Mapping, Sequence
import itertools
import re
import sys
from typing import NoReturn

from rclpy.exceptions import NameValidationException

from .base.arguments import split_arguments
from .base.client import Visitor
from .base.dds_room import avoid_memory
from .base.errors import UserError
from .base.process import ended_in_time
from ..core.words import shown
from ..parameters import CONTROL, SIMULATOR, SPEEDS, Value
from ..places import program

# What a simulator has, and what can be set; of the node control only the latter is of interest.
OF_SIMULATOR = {each.name: each for each in SIMULATOR}
OF_CONTROL = {each.name: each for each in CONTROL if not each.read_only}
KNOWN = OF_SIMULATOR | OF_CONTROL
LIVE = [name for name, each in KNOWN.items() if not each.read_only]


class _Parser(argparse.ArgumentParser):

    def error(self, message: str) -> NoReturn:
        raise ValueError(message)


def main(arguments: Sequence[str] | None = None) -> int:
    """Steer as the first argument says; the exit status is 2 after one line on what is wrong."""
    name, *words = sys.argv[1:] if arguments is None else arguments
    parser = _Parser(program(name))
    # -1e-3 is a number, too.
    parser._negative_number_matcher = re.compile(r'^-[\d.]')
    parser.add_argument('--simulator', default='simulator', metavar='NODE',
                        help='its name, with its namespace; simulator by default')
    known, form = (LIVE, 'NAME VALUE') if name == 'set' else (list(KNOWN), 'NAME')
    if name in ('set', 'get'):
        parser.add_argument('words', nargs='+' if name == 'set' else '*', metavar=form,
                            help=f'such as alpha; known are {", ".join(known)}')
    try:
        # What is for ROS, such as -r __ns:=/lab, rclpy takes from the command line itself.
        given = parser.parse_args(split_arguments(words)[0])
        words = getattr(given, 'words', [])
        require_known(words[::2] if name == 'set' else words, known)
        values = values_of(words) if name == 'set' else {}
        warning = avoid_memory()
        if warning:
            print(f'{name}: {warning}', file=sys.stderr)
        # Those of a gear pair are 0 where there is none.
        usual = [each for each in LIVE if each not in SPEEDS]
        beside = ''.join(given.simulator.rpartition('/')[:2])
        for kind, node, table in (('simulator', given.simulator, OF_SIMULATOR),
                                  ('control', f'{beside}control', OF_CONTROL)):
            names = [each for each in values or words or usual if each in table]
            if names and (kind == 'simulator' or words):
                _steer(name, node, kind, values, names)
    except (UserError, ValueError) as error:
        print(f'{name}: {error}', file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    return 0


def require_known(words: Iterable[str], known: Sequence[str]) -> None:
    """Refuse what is not the name of such a parameter."""
    for word in words:
        if word not in known:
            raise ValueError(f'{shown(word)} is not one of {", ".join(known)}')


def values_of(words: Sequence[str]) -> dict[str, Value]:
    """Read known names and values in turn; ValueError names what is no value or out of range."""
    values: dict[str, Value] = {}
    for name, text in itertools.zip_longest(words[::2], words[1::2]):
        given = KNOWN[name]
        wanted = type(given.default)
        try:
            value = text if wanted is str else {'true': True, 'false': False}[
                text] if wanted is bool else float(text)
        except (KeyError, TypeError, ValueError):
            what = 'true or false' if wanted is bool else 'a number'
            raise ValueError(f'{name} needs {what}, not {shown(text or "nothing")}') from None
        if text is None:
            raise ValueError(f'{name} needs a value')
        if wanted is int and isinstance(value, float) and value.is_integer():
            # A large seed has more digits than a float.
            value = int(text) if text.lstrip('+-').isdecimal() else int(value)
        values[name] = given.check(value)
    return values


def _steer(name: str, node: str, kind: str, values: Mapping[str, Value], names: Sequence[str]
           ) -> None:
    said: list[str] = []
    try:
        visitor = Visitor('steering', node, kind=kind)
    except (NameValidationException, RuntimeError) as error:
        raise UserError(' '.join(str(error).split())) from error
    try:
        if values:
            visitor.put({each: values[each] for each in names})
        if name in ('set', 'get'):
            visitor.get(names, lambda found: said.extend(
                f'{each} = {value!r}' for each, value in found.items()))
        elif name == 'reset':
            visitor.reset(said.append)
        else:
            visitor.pause(name == 'pause', said.append)
        visitor.wait()
        print('\n'.join(said), flush=True)
    finally:
        with ended_in_time():
            visitor.close()
