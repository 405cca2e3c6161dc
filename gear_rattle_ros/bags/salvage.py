"""Everything of an .mcap file that can still be read, whatever happened to the rest."""

from collections.abc import Iterator
import contextlib
import dataclasses
from io import BytesIO
import mmap
from pathlib import Path
import struct
from typing import Any, Final

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
import mcap.records
from mcap.records import Channel, Chunk, Footer, McapRecord, Schema
from mcap.stream_reader import breakup_chunk
from mcap.writer import MCAP0_MAGIC

from .files import BROKEN, describe_topic
from .topics import BagError, Topic

# Opcode and length in front of a record.
_HEAD: Final = 9
# Least length of a message.
_MESSAGE: Final = 22
# A chunk that claims to hold more than this is taken for noise.
_LARGEST_CHUNK: Final = 2**30
_COMPRESSIONS: Final = (b'zstd', b'lz4', b'')
# Length of a footer and of the magic after it.
_FOOTER: Final = _HEAD + 20 + len(MCAP0_MAGIC)


@dataclasses.dataclass(frozen=True)
class Damage:
    """The bytes of a file, from `start` to before `end`, from which nothing was read."""

    start: int
    end: int


class Salvage:
    """What is left of an .mcap file, which is only read; BagError if it cannot be read at all."""

    # Its chunks are found by their own heads and proved by their checksums, so neither the index
    # nor the records in between are needed.
    def __init__(self, path: Path) -> None:
        self.damages: list[Damage] = []  # where nothing could be read, in order
        self.is_closed = False  # whether the file has its end
        self.nameless = 0  # messages read whose topic is described nowhere in the file
        # Messages outside of chunks have no checksum: they count in a file without chunks only.
        self._chunks: list[int] = []
        self._loose: list[int] = []
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        try:
            with path.open('rb') as stream:
                size = stream.seek(0, 2)
                self._data: bytes | mmap.mmap = mmap.mmap(
                    stream.fileno(), 0, access=mmap.ACCESS_READ) if size else b''
        except OSError as error:
            raise BagError(f'{path}: cannot be read: {error.strerror}') from None
        self._walk()

    def messages(self) -> Iterator[tuple[Topic, mcap.records.Message]]:
        """Yield the messages that are left, in the order of the file."""
        self.nameless = 0
        topics = {number: describe_topic(channel, self._schemas[channel.schema_id])
                  for number, channel in self._channels.items()
                  if channel.schema_id in self._schemas}
        for place in self._chunks or self._loose:
            for record in self._read(place):
                if isinstance(record, mcap.records.Message):
                    if topic := topics.get(record.channel_id):
                        yield topic, record
                    else:
                        self.nameless += 1

    def _walk(self) -> None:
        data = self._data
        place = len(MCAP0_MAGIC) if data[:len(MCAP0_MAGIC)] == MCAP0_MAGIC else 0
        while place < len(data):
            end = self._end(place)
            if end is not None and data[place] == Opcode.FOOTER:
                self.is_closed = True
                return
            if end is None or not self._take(place, end):
                end = self._next_chunk(place + 1)
                self.damages.append(Damage(place, end or len(data)))
                if end is None:
                    self._read_summary()
                    return
            place = end

    def _end(self, place: int) -> int | None:
        """Return where a record ends; None if its head or its end is not in the file."""
        if place + _HEAD > len(self._data):
            return None
        length, = struct.unpack_from('<Q', self._data, place + 1)
        end = place + _HEAD + int(length)
        return end if end <= len(self._data) else None

    def _take(self, place: int, end: int) -> bool:
        """Take a record that is whole; return whether it can be one."""
        opcode = self._data[place]
        if opcode in (Opcode.CHUNK, Opcode.SCHEMA, Opcode.CHANNEL):
            try:
                records = self._read(place)
            except BROKEN:
                return False
            is_chunk = opcode == Opcode.CHUNK
            self._chunks += [place] if is_chunk else []
            for record in records:
                if isinstance(record, Schema | Channel):
                    known: dict[int, Any] = (
                        self._schemas if isinstance(record, Schema) else self._channels)
                    # Those in a chunk have a checksum and come first.
                    if is_chunk or record.id not in known:
                        known[record.id] = record
        elif opcode == Opcode.MESSAGE and end - place >= _HEAD + _MESSAGE:
            self._loose.append(place)
        return bool(Opcode.HEADER <= opcode <= Opcode.DATA_END)

    def _read(self, place: int) -> list[McapRecord]:
        end = self._end(place)
        assert end is not None
        stream = ReadDataStream(BytesIO(self._data[place + _HEAD:end]))
        opcode = self._data[place]
        if opcode == Opcode.CHUNK:
            return breakup_chunk(Chunk.read(stream), validate_crc=True)
        if opcode == Opcode.SCHEMA:
            return [Schema.read(stream)]
        if opcode == Opcode.CHANNEL:
            return [Channel.read(stream)]
        return [mcap.records.Message.read(stream, end - place - _HEAD)]

    def _next_chunk(self, place: int) -> int | None:
        """Find the next place that has a sound head of a chunk and its checksum."""
        while (place := self._data.find(bytes([Opcode.CHUNK]), place)) >= 0:
            if self._looks_like_chunk(place):
                with contextlib.suppress(*BROKEN):
                    self._read(place)
                    return place
            place += 1
        return None

    def _looks_like_chunk(self, place: int) -> bool:
        end = self._end(place)
        if end is None or place + _HEAD + 40 > end:
            return False
        start, last, size, _, letters = struct.unpack_from('<QQQII', self._data, place + _HEAD)
        if start > last or not 0 < size <= _LARGEST_CHUNK or letters > 4:
            return False
        text = place + _HEAD + 32
        length_place = text + letters
        if length_place + 8 > end or self._data[text:length_place] not in _COMPRESSIONS:
            return False
        length, = struct.unpack_from('<Q', self._data, length_place)
        return bool(length == end - length_place - 8)

    def _read_summary(self) -> None:
        """Learn the topics from the end of a file that is damaged in front of it."""
        place = len(self._data) - _FOOTER
        if place < 0 or self._data[place] != Opcode.FOOTER or self._end(place) is None:
            return
        self.is_closed = True
        footer = Footer.read(ReadDataStream(BytesIO(self._data[place + _HEAD:])))
        begin = int(footer.summary_start)
        while 0 < begin < place and (end := self._end(begin)) is not None:
            if self._data[begin] in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._take(begin, end)
            begin = end
