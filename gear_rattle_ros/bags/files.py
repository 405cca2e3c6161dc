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

"""One .mcap file of a bag: where its records are, and what is in them."""

from collections import Counter
from collections.abc import Iterator, Mapping
import contextlib
import dataclasses
import io
import os
from pathlib import Path
import re
import shutil
import struct
import tempfile
from typing import Any, Final, IO
import zlib

import lz4.frame
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Message, Metadata, Schema, Statistics
from mcap.writer import MCAP0_MAGIC
import zstandard

from . import metadata
from .topics import BagError, Topic
from ..plain_yaml import read_yaml

BROKEN: Final = (McapError, zstandard.ZstdError, zlib.error, RuntimeError, struct.error, EOFError,
                 KeyError, UnicodeDecodeError, ValueError, OverflowError, MemoryError)
# Opcode and length in front of a record, and what every chunk and every message begins with.
_HEAD: Final = struct.Struct('<BQ')
_CHUNK: Final = struct.Struct('<QQQII')
_MESSAGE: Final = struct.Struct('<HIQQ')
# All of that, and the name of a compression, is in so many bytes.
VIEW: Final = 64
# Messages outside of chunks are read together up to this length.
_STRETCH: Final = 2**20
_ZSTD: Final = zstandard.FRAME_HEADER
_COMPRESSION: Final = re.compile(r'(compression_(?:format|mode))["\']?: *["\']?(\w*)')
_READ: Final[Mapping[int, Any]] = {
    Opcode.SCHEMA: Schema.read, Opcode.CHANNEL: Channel.read, Opcode.METADATA: Metadata.read,
    Opcode.STATISTICS: Statistics.read, Opcode.CHUNK_INDEX: ChunkIndex.read}


@contextlib.contextmanager
def opened(path: Path, *, is_damage_expected: bool = False) -> Iterator[IO[bytes]]:
    """Open a file, or what is in it if rosbag2 has compressed it whole."""
    try:
        with contextlib.ExitStack() as stack:
            stream: IO[bytes] = stack.enter_context(path.open('rb'))
            if stream.read(len(_ZSTD)) == _ZSTD:
                stream.seek(0)
                packed = zstandard.ZstdDecompressor().stream_reader(
                    stream, read_across_frames=True)
                stream = stack.enter_context(tempfile.TemporaryFile())
                with contextlib.suppress(*([zstandard.ZstdError] if is_damage_expected else [])):
                    shutil.copyfileobj(packed, stream)
            stream.seek(0)
            yield stream
    except BagError:
        raise
    except OSError as error:
        raise BagError(f'{path}: cannot be read: {error.strerror}') from None
    except BROKEN as error:
        what = str(error) or type(error).__name__
        raise BagError(f'{path}: is damaged or no MCAP file: {what}') from None


@dataclasses.dataclass
class Part:
    """A chunk, or a stretch with messages outside of chunks, and the range of its log times."""

    place: int
    end: int
    first: int
    last: int
    size: int = -1  # uncompressed, of a chunk

    @property
    def is_chunk(self) -> bool:
        return self.size >= 0


class Scan:
    """What is in an .mcap file, found by going from record to record, without an index."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.parts: list[Part] = []
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.ambiguous: set[int] = set()  # channels that are described in two ways
        self.statistics: Statistics | None = None
        self.indexed: dict[int, int] = {}  # the uncompressed size of each chunk in the index
        self.place = len(MCAP0_MAGIC)  # up to where the file was gone through
        self.is_closed = False  # whether its end was found there
        self.information: dict[str, str] = {}  # what rosbag2 states of its compression
        self._topics: dict[int, Topic] = {}

    @property
    def is_described(self) -> bool:
        """Whether its statistics and topics are known before any message is read."""
        stated = self.statistics
        return (self.is_closed and stated is not None
                and sum(stated.channel_message_counts.values()) == stated.message_count
                and all(channel in self.channels for channel in stated.channel_message_counts)
                and all(channel.schema_id in {0, *self.schemas}
                        for channel in self.channels.values())
                and all(part.is_chunk for part in self.parts))

    def walk(self, stream: IO[bytes]) -> None:
        """Go on to the end, or to a cut; ValueError where no record can be."""
        size = stream.seek(0, os.SEEK_END)
        while not self.is_closed:
            stream.seek(self.place)
            view = stream.read(VIEW)
            if len(view) < _HEAD.size or not any(view):
                # Zeros are what a file system leaves that went down.
                return
            opcode, length = _HEAD.unpack_from(view)
            end = self.place + _HEAD.size + length
            if end > size:
                return
            if opcode == Opcode.CHUNK:
                self.parts.append(chunk_at(self.place, view))
            elif opcode == Opcode.MESSAGE and length >= _MESSAGE.size:
                self._add_message(self.place, end, _MESSAGE.unpack_from(view, _HEAD.size)[2])
            elif opcode in _READ:
                stream.seek(self.place + _HEAD.size)
                self.take(opcode, stream.read(length))
            elif opcode in (0, Opcode.MESSAGE):
                raise ValueError(f'there is no record at byte {self.place}')
            elif opcode == Opcode.FOOTER:
                stream.seek(end)
                self.is_closed = stream.read(len(MCAP0_MAGIC)) == MCAP0_MAGIC
                if not self.is_closed:
                    return
                end += len(MCAP0_MAGIC)
            self.place = end

    def take(self, opcode: int, content: bytes) -> None:
        """Take one of the records that describe others."""
        record = _READ[opcode](ReadDataStream(io.BytesIO(content)))
        if opcode == Opcode.STATISTICS:
            self.statistics = record
        elif opcode == Opcode.CHUNK_INDEX:
            self.indexed[record.chunk_start_offset] = record.uncompressed_size
        elif opcode == Opcode.METADATA:
            if record.name == 'rosbag2':
                # Parsing all of it would take longer than the rest of the file.
                self.information = dict(_COMPRESSION.findall(
                    record.metadata.get('serialized_metadata', '')))
        elif record.id or opcode == Opcode.CHANNEL:
            known: dict[int, Any] = self.schemas if opcode == Opcode.SCHEMA else self.channels
            first = known.setdefault(record.id, record)
            if opcode == Opcode.CHANNEL and (first.topic, first.schema_id) != (
                    record.topic, record.schema_id):
                self.ambiguous.add(record.id)
                self._topics.pop(record.id, None)

    def read(self, stream: IO[bytes], part: Part) -> Iterator[Message]:
        """Yield the messages of a part; what it describes besides is kept."""
        stream.seek(part.place)
        data = stream.read(part.end - part.place)
        if part.is_chunk:
            if (stated := self.indexed.get(part.place, part.size)) != part.size:
                raise ValueError(f'the index states {stated} bytes in the chunk at byte '
                                 f'{part.place}, but that states {part.size}')
            data = _unpacked(part.place, data[_HEAD.size:])
        place = 0
        while place < len(data):
            opcode, length = _HEAD.unpack_from(data, place)
            start = place + _HEAD.size
            place = start + length
            if not opcode or place > len(data) or (
                    opcode == Opcode.MESSAGE and length < _MESSAGE.size):
                raise ValueError(f'a record is cut off in the chunk at byte {part.place}')
            if opcode == Opcode.MESSAGE:
                channel, sequence, log_time, publish_time = _MESSAGE.unpack_from(data, start)
                yield Message(channel, log_time, data[start + _MESSAGE.size:place], publish_time,
                              sequence)
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self.take(opcode, data[start:place])

    def topic(self, number: int) -> Topic:
        """Return the topic of a channel; BagError if it is not described."""
        if number not in self._topics:
            channel = self.channels.get(number)
            if channel is None or number in self.ambiguous or (
                    channel.schema_id not in {0, *self.schemas}):
                raise BagError(f'{self.path}: channel {number} is not described, or in two ways; '
                               'see what recover finds')
            self._topics[number] = _describe(channel, self.schemas.get(channel.schema_id))
        return self._topics[number]

    def compare(self, found: Counter[int]) -> None:
        """Hold the messages that were found on each channel against the statistics."""
        if self.statistics is not None:
            self.hold('messages', self.statistics.message_count, found.total())
            for number, count in self.statistics.channel_message_counts.items():
                name = self.channels[number].topic if number in self.channels else number
                self.hold(f'messages on {name}', count, found[number])

    def hold(self, things: str, stated: int, found: int) -> None:
        """Raise BagError if there are not as many of some things as the file states."""
        if stated != found:
            raise BagError(f'{self.path}: states {stated} {things}, but has {found}; see what '
                           'recover finds')

    def _add_message(self, place: int, end: int, time: int) -> None:
        last = self.parts[-1] if self.parts else None
        if last is None or last.is_chunk or end - last.place > _STRETCH:
            self.parts.append(Part(place, end, time, time))
        else:
            last.end, last.first, last.last = end, min(last.first, time), max(last.last, time)


def scan(path: Path) -> Scan:
    """Go through a file; BagError if it is damaged, or if it lacks what its index has."""
    found = Scan(path)
    with opened(path) as stream:
        if stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            raise ValueError('it does not begin as one')
        found.walk(stream)
        size = stream.seek(0, os.SEEK_END)
        if size == len(MCAP0_MAGIC):
            raise BagError(f'{path}: has only the {size} bytes that each MCAP file begins with; '
                           'nothing was recorded in it')
        stream.seek(-len(MCAP0_MAGIC), os.SEEK_END)
        if found.is_closed and found.place < size:
            raise BagError(f'{path}: has {size - found.place} bytes after its end at byte '
                           f'{found.place}; recover copies what is before it')
        if not found.is_closed and stream.read() == MCAP0_MAGIC:
            raise ValueError(f'there is no whole record at byte {found.place}')
    metadata.require_readable(path, found.information)
    chunks = {part.place for part in found.parts if part.is_chunk}
    found.hold('chunks', len(chunks | found.indexed.keys()), len(chunks))
    if found.statistics is not None:
        found.hold('chunks', found.statistics.chunk_count, len(chunks))
    return found


def chunk_at(place: int, view: bytes) -> Part:
    """Return the chunk that begins with some bytes; ValueError if they do not make sense."""
    _, length = _HEAD.unpack_from(view)
    first, last, size, _, letters = _CHUNK.unpack_from(view, _HEAD.size)
    head = _CHUNK.size + letters + 8
    if _HEAD.size + head > len(view) or head + int.from_bytes(
            view[_HEAD.size + head - 8:_HEAD.size + head], 'little') > length:
        raise ValueError(f'there is no chunk at byte {place}')
    return Part(place, place + _HEAD.size + length, first, last, size)


def _unpacked(place: int, content: bytes) -> bytes:
    """Return the records in a chunk, held against the size and the checksum that it states."""
    _, _, size, checksum, letters = _CHUNK.unpack_from(content)
    start = _CHUNK.size + letters
    compression = content[_CHUNK.size:start]
    packed = content[start + 8:start + 8 + int.from_bytes(content[start:start + 8], 'little')]
    # One byte more than is stated, but no bomb; frames may follow each other.
    if compression == b'zstd':
        data = zstandard.ZstdDecompressor().stream_reader(
            packed, read_across_frames=True).read(size + 1)
    elif compression == b'lz4':
        data = lz4.frame.open(io.BytesIO(packed)).read(size + 1)
    elif not compression:
        data = packed
    else:
        raise ValueError(f'the chunk at byte {place} is compressed with {compression!r}, not with '
                         'zstd or lz4')
    if len(data) != size:
        raise ValueError(f'the chunk at byte {place} states {size} bytes, but has '
                         f'{"more" if len(data) > size else len(data)}')
    if checksum and zlib.crc32(data) != checksum:
        raise ValueError(f'the checksum of the chunk at byte {place} is wrong')
    return data


def decompressed(topic: Topic, data: bytes) -> bytes:
    """Return a message that rosbag2 may have compressed by itself, which no CDR looks like."""
    if topic.serialization == 'cdr' and data[:len(_ZSTD)] == _ZSTD:
        return zstandard.ZstdDecompressor().decompress(data)
    return data


def _describe(channel: Channel, schema: Schema | None) -> Topic:
    return Topic(
        channel.topic, schema.name if schema else '',
        schema.data.decode('utf-8', 'replace') if schema else '',
        channel.metadata.get('topic_type_hash', ''),
        _parse_qos(channel.metadata.get('offered_qos_profiles', '')),
        schema.encoding if schema else '', channel.message_encoding)


def _parse_qos(text: str) -> tuple[dict[str, Any], ...]:
    with contextlib.suppress(ValueError):
        if isinstance(profiles := read_yaml(text), list):
            return tuple(profile for profile in profiles if isinstance(profile, dict))
    return ()
