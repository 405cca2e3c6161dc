"""What a node is given on its command line, and what of it nobody would read."""

from collections.abc import Iterator, Sequence
import difflib
from pathlib import Path

from ..parameters import TABLES
from ..plain_yaml import read_yaml


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


def misspelt_sections(name: str, ros: Sequence[str]) -> Iterator[str]:
    """Yield a line for every section of a parameter file that seems meant for this node."""
    for flag, file in zip(ros[:-1], ros[1:], strict=True):
        if flag != '--params-file':
            continue
        try:
            sections = read_yaml(Path(file).read_text())
        except (OSError, ValueError):
            # rcl has read it and had its say.
            continue
        for section in sections if isinstance(sections, dict) else ():
            last = str(section).split('/')[-1]
            # ROS passes over a section of another name without a word.
            if last not in TABLES and '*' not in last and name in difflib.get_close_matches(
                    last, list(TABLES), 1, 0.75):
                yield f'{file}: section {str(section)!r} is for no node; did you mean {name!r}?'
