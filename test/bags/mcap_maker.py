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

"""A writer of MCAP of any layout, by the specification, that knows nothing of the package."""

from collections import Counter
from collections.abc import Iterable, Sequence
import dataclasses
import struct
import zlib

import lz4.frame
import zstandard

MAGIC = b'\x89MCAP0\r\n'
(HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX, _, _, STATISTICS,
 METADATA, _, SUMMARY_OFFSET, DATA_END) = range(1, 16)


@dataclasses.dataclass(frozen=True)
class Sent:
    """A message: its channel, sequence number, log time and bytes."""

    channel: int
    sequence: int
    time: int
    data: bytes


@dataclasses.dataclass(frozen=True)
class Layout:
    """
    How a file is laid out.

    `frames` are the compressed frames of a chunk, `loose` the messages in front of the chunks
    that are outside of them, `between` those after each chunk.
    Errors are added to what the chunks, their index and the statistics state.
    """

    chunks: bool = True
    compression: str = 'zstd'
    chunk_index: bool = True
    message_index: bool = True
    padding: bool = False
    repeated: bool = True
    statistics: bool = True
    offsets: bool = True
    checksum: bool = True
    private: bool = False
    frames: int = 1
    loose: int = 0
    between: int = 0
    in_chunk: int = 4
    size_error: int = 0
    index_error: int = 0
    count_error: int = 0
    channel_error: int = 0
    chunk_error: int = 0
    lost_chunk: bool = False


def text(value: str) -> bytes:
    """Return a string with its length in front."""
    return struct.pack('<I', len(value.encode())) + value.encode()


def pairs(values: Iterable[bytes]) -> bytes:
    """Return a map or an array with its length in front."""
    joined = b''.join(values)
    return struct.pack('<I', len(joined)) + joined


def make_schema(number: int, name: str, data: bytes) -> bytes:
    """Return the content of a schema."""
    return (struct.pack('<H', number) + text(name) + text('ros2msg')
            + struct.pack('<I', len(data)) + data)


def make_channel(number: int, schema: int, topic: str, encoding: str = 'cdr',
                 **described: str) -> bytes:
    """Return the content of a channel."""
    return struct.pack('<HH', number, schema) + text(topic) + text(encoding) + pairs(
        text(key) + text(value) for key, value in described.items())


def pack(data: bytes, compression: str, frames: int) -> bytes:
    """Compress in a number of frames."""
    cuts = [len(data) * number // frames for number in range(frames + 1)]
    make = {'zstd': zstandard.ZstdCompressor().compress, 'lz4': lz4.frame.compress,
            '': bytes}[compression]
    return b''.join(make(data[a:b]) for a, b in zip(cuts, cuts[1:], strict=False))


class Writer:
    """Writes a file from schemas, channels and messages."""

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.out = bytearray(MAGIC)

    def record(self, opcode: int, content: bytes) -> bytes:
        """Return a record; only messages and the footer cannot be extended."""
        if self.layout.padding and opcode not in (MESSAGE, FOOTER):
            content += b'\x05\x07\x00' * 5
        return struct.pack('<BQ', opcode, len(content)) + content

    def message(self, sent: Sent) -> bytes:
        """Return a message, its publish time a thousand nanoseconds earlier."""
        return self.record(MESSAGE, struct.pack(
            '<HIQQ', sent.channel, sent.sequence, sent.time, max(sent.time - 1000, 0)) + sent.data)

    def write(self, schemas: Sequence[bytes], channels: Sequence[bytes],
              messages: Sequence[Sent]) -> bytes:
        """Return the file."""
        layout = self.layout
        described = [self.record(SCHEMA, schema) for schema in schemas] + [
            self.record(CHANNEL, channel) for channel in channels]
        self.out += self.record(HEADER, text('ros2') + text('a test'))
        if layout.private:
            self.out += struct.pack('<BQ', 0x80, 12) + b'\x06' * 12
        index: list[bytes] = []
        loose = len(messages) if not layout.chunks else layout.loose
        if loose:
            self.out += b''.join(described)
        for sent in messages[:loose]:
            self.out += self.message(sent)
        step = layout.in_chunk + layout.between
        for start in range(loose, len(messages), step):
            some = messages[start:start + layout.in_chunk]
            index.append(self.chunk([] if start else described, some))
            for sent in messages[start + layout.in_chunk:start + step]:
                self.out += self.message(sent)
        crc = zlib.crc32(self.out) if layout.checksum else 0
        self.out += self.record(DATA_END, struct.pack('<I', crc))
        self.end(schemas, channels, messages, index)
        return bytes(self.out)

    def chunk(self, described: Sequence[bytes], messages: Sequence[Sent]) -> bytes:
        """Append a chunk and its message index; return its index."""
        layout = self.layout
        content = b''.join(described)
        if layout.private:
            content += struct.pack('<BQ', 0xC3, 5) + b'\x00' * 5
        places: dict[int, list[bytes]] = {}
        for sent in messages:
            places.setdefault(sent.channel, []).append(struct.pack('<QQ', sent.time, len(content)))
            content += self.message(sent)
        packed = pack(content, layout.compression, layout.frames)
        times = [sent.time for sent in messages]
        size = len(content) + layout.size_error
        place = len(self.out)
        self.out += self.record(CHUNK, struct.pack(
            '<QQQI', min(times), max(times), size, zlib.crc32(content) if layout.checksum else 0)
            + text(layout.compression) + struct.pack('<Q', len(packed)) + packed)
        length = len(self.out) - place
        offsets = []
        for number, found in places.items() if layout.message_index else ():
            offsets.append(struct.pack('<HQ', number, len(self.out)))
            self.out += self.record(MESSAGE_INDEX, struct.pack('<H', number) + pairs(found))
        return self.record(CHUNK_INDEX, struct.pack(
            '<QQQQ', min(times), max(times), place, length) + pairs(offsets) + struct.pack(
            '<Q', len(self.out) - place - length) + text(layout.compression) + struct.pack(
            '<QQ', len(packed), size + layout.index_error))

    def end(self, schemas: Sequence[bytes], channels: Sequence[bytes], messages: Sequence[Sent],
            index: Sequence[bytes]) -> None:
        """Append the summary, the footer and the magic."""
        layout = self.layout
        groups: list[tuple[int, list[bytes]]] = []
        if layout.repeated:
            groups += [(SCHEMA, [self.record(SCHEMA, schema) for schema in schemas]),
                       (CHANNEL, [self.record(CHANNEL, channel) for channel in channels])]
        if layout.statistics:
            counts = Counter(sent.channel for sent in messages)
            times = [sent.time for sent in messages] or [0]
            counts[1] += layout.channel_error
            groups.append((STATISTICS, [self.record(STATISTICS, struct.pack(
                '<QHIIIIQQ', len(messages) + layout.count_error, len(schemas), len(channels), 0, 0,
                len(index) + layout.chunk_error, min(times), max(times)) + pairs(
                struct.pack('<HQ', *pair) for pair in counts.items()))]))
        if layout.chunk_index and index:
            lost = [index[0][:25] + struct.pack('<Q', 7) + index[0][33:]]
            groups.append((CHUNK_INDEX, [*index, *(lost if layout.lost_chunk else [])]))
        start, begin = len(self.out), len(self.out)
        offsets = []
        for opcode, records in groups:
            joined = b''.join(records)
            self.out += joined
            offsets.append(self.record(SUMMARY_OFFSET, struct.pack(
                '<BQQ', opcode, begin, len(joined))))
            begin += len(joined)
        self.out += b''.join(offsets) if layout.offsets else b''
        self.out += self.record(FOOTER, struct.pack(
            '<QQI', start if groups else 0, begin if offsets and layout.offsets else 0, 0)) + MAGIC
