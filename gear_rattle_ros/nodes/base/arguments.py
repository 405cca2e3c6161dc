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

"""The command line of a node: what ROS would refuse in many lines, or ignore in silence."""

from collections.abc import Iterator, Mapping, Sequence
import difflib
import json
import os
from pathlib import Path
import shlex
from typing import Any, Final

from rclpy.utilities import remove_ros_args

from ...core.words import in_columns, shown
from ...parameters import TABLES
from ...places import typed
from ...plain_yaml import read_yaml

# rcl needs time with the square of the size of a file: minutes for a megabyte [byte].
LARGEST_FILE: Final = 100_000
FORM: Final = 'it must read NODE: {ros__parameters: {NAME: VALUE}}'
_PARAMETER: Final = 'parameters are given as -p NAME:=VALUE, VALUE in YAML and of one type'
_REMAP: Final = 'names are changed by -r FROM:=TO, __node:=NAME or __ns:=/NAMESPACE'
_REMEDIES: Final = {
    '-p': _PARAMETER, '--param': _PARAMETER, '-r': _REMAP, '--remap': _REMAP,
    '--params-file': FORM,
    '--log-level': 'levels are debug, info, warn, error and fatal, for one logger NAME:=LEVEL',
}


def split_arguments(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the plain arguments, and those for ROS with the words that enclose them."""
    plain: list[str] = []
    ros: list[str] = []
    is_ros = False
    for argument in arguments:
        is_ros |= argument == '--ros-args'
        (ros if is_ros else plain).append(argument)
        is_ros &= argument != '--'
    return plain, ros


def overrides(values: Mapping[str, object]) -> list[str]:
    """Return arguments that set parameters: ROS reads JSON as YAML, and '2026' stays a string."""
    return [word for name, value in values.items()
            for word in ('-p', f'{name}:={json.dumps(value, ensure_ascii=False)}')]


def help_on(name: str) -> str:
    """Return how a node is started, and the table of its parameters."""
    return '\n'.join([
        f'usage: {shlex.join(typed(name))} [--ros-args [-p NAME:=VALUE] ...]', '',
        in_columns(['parameter', ' default', 'range', 'live', 'meaning'],
                   [specification.cells() for specification in TABLES[name]]), '',
        'A live parameter can be changed while the node runs. --version prints the version.'])


def refuse_plain(name: str, plain: Sequence[str]) -> None:
    """Raise ValueError where a node is given arguments that are not for ROS."""
    if not plain:
        return
    word = plain[0].lstrip('-').split('=')[0].replace('-', '_')
    names = [specification.name for specification in TABLES.get(name, ())]
    close = difflib.get_close_matches(word, names, 1)
    example = close[0] if close else 'NAME'
    raise ValueError(f'unknown argument {plain[0]!r}; parameters are given as '
                     f'--ros-args -p {example}:=VALUE'
                     + (f', NAME one of {", ".join(names)}' if names and not close else ''))


def refuse_large_files(ros: Sequence[str]) -> None:
    """Raise ValueError where rcl would read a parameter file for minutes."""
    for file in _parameter_files(ros):
        size = os.path.getsize(file) if os.path.isfile(file) else 0
        if size > LARGEST_FILE:
            raise ValueError(f'parameter file {file!r} has {size} bytes; at most {LARGEST_FILE} '
                             'are read')


def refused_argument(ros: Sequence[str], error: Exception) -> str:
    """Return one line that names the argument rcl refuses, found by asking rcl for each alone."""
    for flag, given in _pairs(ros):
        if flag not in _REMEDIES or (flag == '--params-file' and Path(given).is_fifo()):
            continue
        try:
            remove_ros_args(['--ros-args', flag, given])
        except RuntimeError as refusal:
            if flag == '--params-file':
                return _fault_of_file(given, refusal)
            return f'{flag} {shown(given)} is not understood; {_REMEDIES[flag]}'
    return f'ROS refuses the arguments: {_complaint(error)}'


def misspelt_sections(name: str, ros: Sequence[str]) -> Iterator[str]:
    """Yield a line for everything under another name that seems to be meant for this node."""
    for file in _parameter_files(ros):
        try:
            # A pipe can be read only once.
            sections = read_yaml(Path(file).read_text()) if os.path.isfile(file) else None
        except (OSError, ValueError):
            # rcl has read it, and refused it if it had to.
            continue
        # ROS ignores a lone word, and a section of another name, in silence.
        if not isinstance(sections, (Mapping, list, type(None))):
            yield f'{file}: {shown(sections)} is not a section and is ignored; {FORM}'
        yield from (f'{file}: section {section!r} belongs to no node; did you mean {name!r}?'
                    for section in _sections_of(sections) if _is_nearest(name, section))
    for flag, rule in _pairs(ros):
        node, colon, _ = rule.split(':=')[0].rpartition(':')
        if flag in ('-p', '--param') and colon and _is_nearest(name, node):
            yield f'-p {shown(rule)}: there is no node {node!r}; did you mean {name!r}?'


def _pairs(ros: Sequence[str]) -> Iterator[tuple[str, str]]:
    return zip(ros[:-1], ros[1:], strict=True)


def _parameter_files(ros: Sequence[str]) -> Iterator[str]:
    return (file for flag, file in _pairs(ros) if flag == '--params-file')


def _sections_of(content: Any) -> Iterator[str]:
    """Yield the names in a file that may be nodes, in namespaces too."""
    for name, inner in content.items() if isinstance(content, Mapping) else ():
        if name != 'ros__parameters':
            yield str(name)
            if not (isinstance(inner, Mapping) and 'ros__parameters' in inner):
                yield from _sections_of(inner)


def _is_nearest(name: str, section: str) -> bool:
    last = section.split('/')[-1]
    return last not in TABLES and '*' not in last and name in difflib.get_close_matches(
        last, list(TABLES), 1, 0.75)


def _complaint(error: Exception) -> str:
    """Return what rcl complains of, without the places in its own source that follow."""
    return ' '.join(str(error).partition(', at /')[0].rpartition('Error: ')[2].split())


def _fault_of_file(file: str, refusal: Exception) -> str:
    try:
        with open(file, 'rb') as stream:
            read_yaml(stream.read().decode())
    except OSError as error:
        return f'parameter file {file!r} cannot be read: {error.strerror}'
    except UnicodeDecodeError as error:
        fault = f'byte {error.start} is not UTF-8'
    except ValueError as error:
        fault = str(error)
    else:
        fault = _complaint(refusal)
    return f'parameter file {file!r}: {fault}; {FORM}'
