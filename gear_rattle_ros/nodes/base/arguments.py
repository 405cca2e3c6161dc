"""What a node is given on its command line, and what of it nobody would read."""

from collections.abc import Iterator, Mapping, Sequence
import difflib
import os
from pathlib import Path
import re
from typing import Any, Final

from ...parameters import shown, TABLES
from ...plain_yaml import read_yaml

# rcl takes time with the square of what stands in a file, and minutes for a megabyte [byte].
LARGEST_FILE: Final = 100_000
FORM: Final = 'it must read NODE: {ros__parameters: {NAME: VALUE}}'
# What rcl says of a word of the command line; where in its source it does so helps nobody.
_SOURCE: Final = re.compile(r',? at /\S+\.\w+:\d+')
_UNPARSED: Final = re.compile(
    r"Couldn't parse [a-z ]+: '(-\S+) (.*?)(?:'\. Error: (.*)|$)", re.DOTALL)
_ALLOWED: Final = {
    '-p': 'parameters are given as -p NAME:=VALUE, VALUE in YAML and of one type',
    '-r': 'names are changed by -r FROM:=TO, __node:=NAME or __ns:=/NAMESPACE',
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


def refuse_plain(name: str, plain: Sequence[str]) -> None:
    """Raise ValueError where a node that takes ROS arguments only is given others."""
    if not plain:
        return
    word = plain[0].lstrip('-').split('=')[0].replace('-', '_')
    names = [specification.name for specification in TABLES.get(name, ())]
    close = difflib.get_close_matches(word, names, 1)
    example = close[0] if close else 'NAME'
    raise ValueError(f'argument {plain[0]!r} is not known; parameters are given as '
                     f'--ros-args -p {example}:=VALUE'
                     + (f', NAME one of {", ".join(names)}' if names and not close else ''))


def refuse_large_files(ros: Sequence[str]) -> None:
    """Raise ValueError where rcl would read a parameter file for minutes."""
    for file in _parameter_files(ros):
        if os.path.isfile(file) and os.path.getsize(file) > LARGEST_FILE:
            raise ValueError(f'parameter file {file!r} has more than {LARGEST_FILE} bytes: '
                             f'{os.path.getsize(file)}')


def can_be_read_again(ros: Sequence[str]) -> bool:
    """Whether all parameter files still have what they had: a pipe gives it only once."""
    return not any(_is_pipe(file) for file in _parameter_files(ros))


def explained(error: Exception) -> str:
    """Return what is wrong with arguments that rcl does not take: one line, with the remedy."""
    words = _SOURCE.sub('', str(error)).replace('failed to initialize rcl: ', '')
    found = _UNPARSED.search(words)
    if not found:
        return ' '.join(words.split())
    # The reason is cut off where the argument is long.
    flag, given, why = found.groups('')
    if flag == '--params-file':
        try:
            why = _fault_of_file(given) or why
        except OSError as error:
            return f'parameter file {given!r} cannot be read: {error.strerror}'
        return f'parameter file {given!r}: {" ".join(why.split())}; {FORM}'
    flag = {'--param': '-p', '--remap': '-r'}.get(flag, flag)
    return f'{flag} {shown(given)} is not understood' + (
        f'; {_ALLOWED[flag]}' if flag in _ALLOWED else '')


def misspelt_sections(name: str, ros: Sequence[str]) -> Iterator[str]:
    """Yield a line for everything given under another name that seems meant for this node."""
    for file in _parameter_files(ros):
        try:
            # A pipe gives what it has only once.
            sections = read_yaml(Path(file).read_text()) if os.path.isfile(file) else None
        except (OSError, ValueError):
            # rcl has read it and had its say.
            continue
        # ROS passes over a section of another name, and over a lone word, without a word.
        if not isinstance(sections, (Mapping, list, type(None))):
            yield f'{file}: {shown(sections)} is no section and is not read; {FORM}'
        for section in _sections_of(sections):
            if _is_nearest(name, section):
                yield f'{file}: section {section!r} is for no node; did you mean {name!r}?'
    for flag, rule in zip(ros[:-1], ros[1:], strict=True):
        node, colon, _ = rule.split(':=')[0].rpartition(':')
        if flag in ('-p', '--param') and colon and _is_nearest(name, node):
            yield f'-p {shown(rule)}: {node!r} is no node; did you mean {name!r}?'


def _parameter_files(ros: Sequence[str]) -> Iterator[str]:
    for flag, file in zip(ros[:-1], ros[1:], strict=True):
        if flag == '--params-file':
            yield file


def _is_pipe(file: str) -> bool:
    return os.path.exists(file) and not os.path.isfile(file) and not os.path.isdir(file)


def _sections_of(content: Any) -> Iterator[str]:
    """Yield the names of a file at which nodes may be, also those in a namespace."""
    places = [content]
    while places:
        place = places.pop()
        for name, inner in place.items() if isinstance(place, Mapping) else ():
            if name != 'ros__parameters':
                yield str(name)
                if not (isinstance(inner, Mapping) and 'ros__parameters' in inner):
                    places.append(inner)


def _is_nearest(name: str, section: str) -> bool:
    last = section.split('/')[-1]
    return last not in TABLES and '*' not in last and name in difflib.get_close_matches(
        last, list(TABLES), 1, 0.75)


def _fault_of_file(file: str) -> str:
    """Say what is wrong with a file as text, if anything; OSError where it cannot be read."""
    if _is_pipe(file):
        return ''
    try:
        with open(file, 'rb') as stream:
            read_yaml(stream.read().decode())
    except UnicodeDecodeError as error:
        return f'byte {error.start} is not UTF-8'
    except ValueError as error:
        return str(error)
    return ''
