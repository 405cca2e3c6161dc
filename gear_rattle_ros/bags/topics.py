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

"""Topics as a bag describes them, and how many messages there are on each."""

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
    """A topic in a bag; `encoding` is the language of its definition; without a type all empty."""

    name: str
    type_name: str
    definition: str
    type_hash: str
    offered_qos: tuple[Qos, ...]
    encoding: str = 'ros2msg'
    serialization: str = 'cdr'


@dataclasses.dataclass
class Contents:
    """The topics of a file, its messages on each, and the log times of the first and the last."""

    topics: dict[str, Topic] = dataclasses.field(default_factory=dict)
    counts: dict[str, int] = dataclasses.field(default_factory=dict)
    # As rosbag2 has it where there is no message; it has no later times.
    start: int = 2**63 - 1
    end: int = 0

    @property
    def total(self) -> int:
        return sum(self.counts.values())

    def announce(self, topic: Topic) -> None:
        self.topics.setdefault(topic.name, topic)
        self.counts.setdefault(topic.name, 0)

    def count(self, name: str, log_time: int) -> None:
        self.counts[name] += 1
        self.start = min(self.start, log_time)
        self.end = min(max(self.end, log_time), 2**63 - 1)


def message_definition(type_name: str, share: Callable[[str], str]) -> str:
    """Return the definition of a message type and of its parts, as MCAP's ros2msg has them."""
    # `share` returns the share directory of a package.
    texts: dict[str, str] = {}
    waiting = [_short(type_name)]
    while waiting:
        name = waiting.pop(0)
        if name not in texts:
            package, message = name.split('/')
            text = (Path(share(package)) / 'msg' / f'{message}.msg').read_text('utf-8')
            texts[name] = f'{_LINE}\nMSG: {name}\n{text}' if texts else text
            waiting.extend(_parts(text, package))
    return '\n'.join(texts.values())


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
