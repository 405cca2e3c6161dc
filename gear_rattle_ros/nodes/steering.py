"""The commands that steer a running simulator: set, get, reset, pause and resume."""

import argparse
from collections.abc import Sequence
import itertools
import re
import sys
from typing import NoReturn

from rclpy.exceptions import NameValidationException

from .base.arguments import split_arguments
from .base.client import Visitor
from .base.errors import UserError
from .base.process import ended_in_time
from ..core.words import shown
from ..parameters import SIMULATOR
from ..places import program

# The numbers that a simulator has; all that can be set is one.
_NUMBERS = [each.name for each in SIMULATOR if type(each.default) in (float, int)]
_LIVE = {each.name: each for each in SIMULATOR if not each.read_only}
_KNOWN = ', '.join(_LIVE)
_TEXTS = {
    'set': 'Set parameters of a running simulator, all or none.',
    'get': 'Print parameters of a running simulator; without a name all that can be set.',
    'reset': 'Set a running simulator back to its initial condition.',
    'pause': 'Let a running simulator pause.',
    'resume': 'Let a paused simulator go on.',
}


class _Parser(argparse.ArgumentParser):
    def __init__(self, name: str) -> None:
        super().__init__(program(name), description=_TEXTS[name])
        # -1e-3 is a number, too.
        self._negative_number_matcher = re.compile(r'^-[\d.]')
        self.add_argument('--simulator', default='simulator', metavar='NODE',
                          help='its name, with its namespace; simulator by default')
        if name == 'set':
            self.add_argument('pairs', nargs='+', metavar='NAME VALUE',
                              help=f'such as alpha 1.244; known are {_KNOWN}')
        elif name == 'get':
            self.add_argument('names', nargs='*', metavar='NAME',
                              help=f'such as alpha; known are {", ".join(_NUMBERS)}')

    def error(self, message: str) -> NoReturn:
        raise ValueError(message)


def main(arguments: Sequence[str] | None = None) -> int:
    """Steer as the first argument says; the exit status is 2 after one line on what is wrong."""
    name, *words = sys.argv[1:] if arguments is None else arguments
    try:
        # What is for ROS, such as -r __ns:=/lab, rclpy takes from the command line itself.
        given = vars(_Parser(name).parse_args(split_arguments(words)[0]))
        names = given.get('names') or list(_LIVE)
        for unknown in sorted({*names} - {*_NUMBERS}):
            raise ValueError(f'{shown(unknown)} is no number of a simulator; known are '
                             f'{", ".join(_NUMBERS)}')
        _steer(name, given['simulator'], _values(given.get('pairs', ())), names)
    except (UserError, ValueError) as error:
        print(f'{name}: {error}', file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    return 0


def _values(pairs: Sequence[str]) -> dict[str, float]:
    values: dict[str, float] = {}
    for name, text in itertools.zip_longest(pairs[::2], pairs[1::2]):
        if name not in _LIVE:
            raise ValueError(f'{shown(name)} is no parameter that can be set; known are {_KNOWN}')
        whole = isinstance(_LIVE[name].default, int)
        try:
            values[name] = int(text) if whole else float(text)
        except (TypeError, ValueError):
            raise ValueError(f'{name} needs a {"whole " * whole}number behind it, '
                             f'not {shown(text or "nothing")}') from None
        _LIVE[name].check(values[name])
    return values


def _steer(name: str, simulator: str, values: dict[str, float], names: Sequence[str]) -> None:
    said: list[str] = []
    try:
        visitor = Visitor('steering', simulator)
    except (NameValidationException, RuntimeError) as error:
        raise UserError(' '.join(str(error).split())) from error
    try:
        if values:
            visitor.put(values)
        if name in ('set', 'get'):
            visitor.get(values or names, lambda found: said.extend(
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
