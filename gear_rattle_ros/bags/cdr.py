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

"""Messages in the bytes of plain CDR: a reader, and the small messages that verify compares."""

from collections.abc import Mapping
import dataclasses
import struct
from typing import Any, Final

_HEAD: Final = 4


class Reader:
    """Read a serialized message value by value; alignments count from the end of its head."""

    def __init__(self, cdr: bytes) -> None:
        if len(cdr) < _HEAD or cdr[0] != 0 or cdr[1] > 1:
            raise ValueError('message is not in plain CDR')
        self.place = _HEAD
        self._cdr = cdr
        self._order = '<' if cdr[1] else '>'

    def take(self, code: str, count: int = 1) -> tuple[Any, ...]:
        """Return values of a type of `struct`."""
        size = struct.calcsize(code)
        self.place += (_HEAD - self.place) % size
        start = self.skip(size * count)
        return struct.unpack_from(f'{self._order}{count}{code}', self._cdr, start)

    def skip(self, size: int) -> int:
        """Move past bytes, and return where they begin."""
        start = self.place
        self.place += size
        if self.place > len(self._cdr):
            raise ValueError(f'message of {len(self._cdr)} bytes is cut off')
        return start

    def length(self) -> int:
        return int(self.take('I')[0])

    def text(self) -> str:
        size = self.length()
        start = self.skip(size)
        return self._cdr[start:start + max(size - 1, 0)].decode('utf-8', 'replace')

    def header(self) -> int:
        """Return the stamp of a std_msgs/Header [ns]."""
        seconds, = self.take('i')
        nanoseconds, = self.take('I')
        self.text()
        return int(seconds) * 1_000_000_000 + int(nanoseconds)


@dataclasses.dataclass(frozen=True)
class Named:
    """A stamp with the numbers of a JointState by name, or the texts of a status `name` by key."""

    stamp: int
    values: Mapping[str, Any]
    name: str = ''


def read_joint_state(cdr: bytes) -> Named:
    """Return the positions of a sensor_msgs/JointState by name, or raise ValueError."""
    reader = Reader(cdr)
    stamp = reader.header()
    names = [reader.text() for _ in range(reader.length())]
    positions = reader.take('d', reader.length())
    if len(names) != len(positions):
        raise ValueError(f'joint state has {len(names)} names and {len(positions)} positions')
    return Named(stamp, dict(zip(names, positions, strict=True)))


def read_diagnostics(cdr: bytes) -> list[Named]:
    """Return the statuses of a diagnostic_msgs/DiagnosticArray, or raise ValueError."""
    reader = Reader(cdr)
    stamp = reader.header()
    found = []
    for _ in range(reader.length()):
        reader.take('B')
        name, _, _ = reader.text(), reader.text(), reader.text()
        values = {}
        for _ in range(reader.length()):
            key = reader.text()
            values[key] = reader.text()
        found.append(Named(stamp, values, name))
    return found
