"""A topic as a bag describes it, with the definition of its messages."""

from collections.abc import Callable, Mapping
import dataclasses
from pathlib import Path
from typing import Any, Final, TypeAlias

# A quality of service, with the keys and words of rosbag2.
Qos: TypeAlias = Mapping[str, Any]

_LINE: Final = 80 * '='
_BASIC: Final = frozenset({
    'bool', 'byte', 'char', 'float32', 'float64', 'int8', 'uint8', 'int16', 'uint16', 'int32',
    'uint32', 'int64', 'uint64', 'string', 'wstring',
})


class BagError(ValueError):
    """A bag cannot be read or written; the message names the file and what is wrong."""


@dataclasses.dataclass(frozen=True)
class Topic:
    """A topic as a bag records it; `encoding` is the language of its definition."""

    name: str
    type_name: str
    definition: str
    type_hash: str
    offered_qos: tuple[Qos, ...]
    encoding: str = 'ros2msg'


def message_definition(type_name: str, share: Callable[[str], str]) -> str:
    """
    Return the definition of a message type and of all its parts, as MCAP's ros2msg divides them.

    `share` returns the share directory of a package.
    """
    seen: list[str] = []
    texts: list[str] = []
    waiting = [_short(type_name)]
    while waiting:
        name = waiting.pop(0)
        if name in seen:
            continue
        seen.append(name)
        package, message = name.split('/')
        text = (Path(share(package)) / 'msg' / f'{message}.msg').read_text('utf-8')
        texts.append(f'{_LINE}\nMSG: {name}\n{text}' if texts else text)
        waiting.extend(_parts(text, package))
    return '\n'.join(texts)


def _parts(text: str, package: str) -> list[str]:
    names = []
    for line in text.splitlines():
        words = line.split('#', 1)[0].split()
        kind = words[0].split('[', 1)[0].split('<=', 1)[0] if len(words) > 1 else 'bool'
        if kind not in _BASIC:
            names.append(_short(kind) if '/' in kind else f'{package}/{kind}')
    return names


def _short(type_name: str) -> str:
    return type_name.replace('/msg/', '/')
