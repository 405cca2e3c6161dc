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

"""Everything of an .mcap file that can still be read, whatever happened to the rest."""

from collections.abc import Iterator
import contextlib
import dataclasses
import mmap
import os
from pathlib import Path
import re
from typing import Final, IO

from mcap.records import Message
from mcap.writer import MCAP0_MAGIC

from .files import BROKEN, chunk_at, decompressed, opened, Scan, VIEW
from .topics import BagError, Topic

# The head of a chunk: its length, times, size and checksum, and then a compression that is known.
_CHUNK: Final = re.compile(rb'\x06(?=.{36}(?:\x04\0{3}zstd|\x03\0{3}lz4|\0{4}))', re.DOTALL)
# A chunk that claims to hold more than this is taken for noise.
_LARGEST_CHUNK: Final = 2**30
# Length of a footer and of the magic after it.
_FOOTER: Final = 29 + len(MCAP0_MAGIC)


@dataclasses.dataclass(frozen=True)
class Damage:
    """The bytes of a file, from `start` to before `end`, from which nothing was read."""

    start: int
    end: int


class Salvage(Scan):
    """What is left of an .mcap file, which is only read; BagError if it cannot be read at all."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.damages: list[Damage] = []  # where nothing could be read, in order
        self.nameless = 0  # messages read whose topic is described nowhere in the file
        self.found = 0  # the other messages read
        with opened(path, is_damage_expected=True) as stream:
            self._go_through(stream)

    def messages(self) -> Iterator[tuple[Topic, Message]]:
        """Yield the messages that are left, in the order of the file."""
        self.nameless = self.found = 0
        with opened(self.path, is_damage_expected=True) as stream:
            for part in self.parts:
                for record in self.read(stream, part):
                    try:
                        topic = self.topic(record.channel_id)
                    except BagError:
                        self.nameless += 1
                        continue
                    with contextlib.suppress(*BROKEN):
                        record.data = decompressed(topic, record.data)
                        self.found += 1
                        yield topic, record

    def _go_through(self, stream: IO[bytes]) -> None:
        size = stream.seek(0, os.SEEK_END)
        stream.seek(0)
        self.place = len(MCAP0_MAGIC) if stream.read(len(MCAP0_MAGIC)) == MCAP0_MAGIC else 0
        while True:
            with contextlib.suppress(*BROKEN):
                self.walk(stream)
            if self.place >= size or self.is_closed:
                break
            start, self.place = self.place, self._next_chunk(stream, self.place + 1, size)
            self.damages.append(Damage(start, self.place))
        if self.is_closed and self.place < size:
            self.damages.append(Damage(self.place, size))
        if not self.is_closed:
            self._read_summary(stream, size)
        self._prove(stream)

    def _prove(self, stream: IO[bytes]) -> None:
        """Keep the chunks that can be read, those too that only the index has."""
        known = {part.place for part in self.parts}
        for place in self.indexed.keys() - known:
            with contextlib.suppress(*BROKEN, OSError):
                stream.seek(place)
                self.parts.append(chunk_at(place, stream.read(VIEW)))
        # What a chunk describes has a checksum and comes first.
        schemas, channels = self.schemas, self.channels
        self.schemas, self.channels = {}, {}
        self.ambiguous.clear()
        proven = []
        for part in sorted(self.parts, key=lambda each: each.place):
            stated = self.indexed.pop(part.place, part.size)
            with contextlib.suppress(*BROKEN):
                # The index may be damaged itself, but not so that a chunk has messages.
                if sum(1 for _ in self.read(stream, part)) or stated == part.size:
                    proven.append(part)
                    continue
            if part.place in known:
                self.damages.append(Damage(part.place, part.end))
        self.parts = proven
        self.schemas, self.channels = schemas | self.schemas, channels | self.channels
        self.damages.sort(key=lambda damage: damage.start)

    def _next_chunk(self, stream: IO[bytes], place: int, size: int) -> int:
        """Return where the next chunk that can be read begins, or the size of the file."""
        data = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
        for match in _CHUNK.finditer(data, place):
            with contextlib.suppress(*BROKEN):
                part = chunk_at(match.start(), data[match.start():match.start() + VIEW])
                if part.end <= size and part.size <= _LARGEST_CHUNK:
                    for _ in self.read(stream, part):
                        pass
                    return part.place
        return size

    def _read_summary(self, stream: IO[bytes], size: int) -> None:
        """Learn what is at the end of a file that is damaged in front of it."""
        if size < _FOOTER:
            return
        stream.seek(size - _FOOTER)
        footer = stream.read(_FOOTER)
        if footer.startswith(b'\x02\x14') and footer.endswith(MCAP0_MAGIC):
            self.is_closed = True
            place = int.from_bytes(footer[9:17], 'little')
            parts, self.parts, self.place, self.is_closed = self.parts, [], place, False
            with contextlib.suppress(*BROKEN):
                self.walk(stream)
            self.parts, self.is_closed = parts, True
