"""Everything of an .mcap file that can still be read, whatever happened to the rest."""

from collections.abc import Iterator
import dataclasses
from io import BytesIO
import mmap
from pathlib import Path
import struct
from typing import Final

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
# Least length of a message [byte].
_MESSAGE: Final = 22
# A chunk that claims to hold more than this is none [byte].
_LARGEST_CHUNK: Final = 2**30
_COMPRESSIONS: Final = ('zstd', 'lz4', '')
# Length of a footer and of the magic behind it.
_FOOTER: Final = _HEAD + 20 + len(MCAP0_MAGIC)


@dataclasses.dataclass(frozen=True)
class Damage:
    """A stretch of a file from which nothing was read: from byte `start` to before `end`."""

    start: int
    end: int


class Salvage:
    """
    What is left of an .mcap file.

    Its chunks are found by their own heads and proved by their checksums, so neither the index
    nor the records in between are needed.

    Parameters
    ----------
    path : Path
        The file, which is only read.

    Attributes
    ----------
    damages : list of Damage
        Where nothing could be read, in order.
    is_closed : bool
        Whether it has its end.
    nameless : int
        Messages whose topic is described nowhere in the file; counted by `messages`.

    Raises
    ------
    BagError
        If it cannot be read at all.

    """

    def __init__(self, path: Path) -> None:
        self.damages: list[Damage] = []
        self.is_closed = False
        self.nameless = 0
        self._path = path
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._chunks: list[int] = []
        # Messages outside of chunks have no checksum: they count in a file without chunks only.
        self._loose: list[int] = []
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
        topics = {}
        for number, channel in self._channels.items():
            schema = self._schemas.get(channel.schema_id)
            if schema is not None:
                topics[number] = describe_topic(channel, schema)
        for place in self._chunks or self._loose:
            for record in self._read(place):
                if not isinstance(record, mcap.records.Message):
                    continue
                topic = topics.get(record.channel_id)
                if topic is None:
                    self.nameless += 1
                else:
                    yield topic, record

    def _walk(self) -> None:
        data = self._data
        place = len(MCAP0_MAGIC) if data[:len(MCAP0_MAGIC)] == MCAP0_MAGIC else 0
        while place < len(data):
            end = self._end(place)
            opcode = data[place]
            if end is not None and opcode == Opcode.FOOTER:
                self.is_closed = True
                break
            if end is not None and opcode != Opcode.CHUNK and self._take_small(place):
                place = end
            elif end is not None and opcode == Opcode.CHUNK and self._take_chunk(place):
                place = end
            else:
                following = self._next_chunk(place + 1)
                self.damages.append(Damage(place, following or len(data)))
                if following is None:
                    self._read_summary()
                    return
                place = following

    def _end(self, place: int) -> int | None:
        if place + _HEAD > len(self._data):
            return None
        end = place + _HEAD + self._length(place)
        return end if end <= len(self._data) else None

    def _length(self, place: int) -> int:
        return int(struct.unpack_from('<Q', self._data, place + 1)[0])

    def _take_small(self, place: int) -> bool:
        """Take a record other than a chunk; return whether it may be one."""
        opcode = self._data[place]
        if not Opcode.HEADER <= opcode <= Opcode.DATA_END:
            return False
        if opcode == Opcode.MESSAGE:
            self._loose += [place] if self._length(place) >= _MESSAGE else []
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            try:
                records = self._read(place)
            except BROKEN:
                return False
            # Those in a chunk have a checksum and come first.
            for record in records:
                if isinstance(record, Schema):
                    self._schemas.setdefault(record.id, record)
                elif isinstance(record, Channel):
                    self._channels.setdefault(record.id, record)
        return True

    def _take_chunk(self, place: int) -> bool:
        try:
            records = self._read(place)
        except BROKEN:
            return False
        for record in records:
            if isinstance(record, Schema):
                self._schemas[record.id] = record
            elif isinstance(record, Channel):
                self._channels[record.id] = record
        self._chunks.append(place)
        return True

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
        data = self._data
        while (place := data.find(bytes([Opcode.CHUNK]), place)) >= 0:
            if self._looks_like_chunk(place):
                try:
                    self._read(place)
                except BROKEN:
                    pass
                else:
                    return place
            place += 1
        return None

    def _looks_like_chunk(self, place: int) -> bool:
        end = self._end(place)
        if end is None or place + _HEAD + 40 > end:
            return False
        start, last, size, _, letters = struct.unpack_from('<QQQII', self._data, place + _HEAD)
        text = place + _HEAD + 32
        if start > last or not 0 < size <= _LARGEST_CHUNK or letters > 4 or text + letters > end:
            return False
        length_place = text + letters
        if self._data[text:length_place] not in [name.encode() for name in _COMPRESSIONS]:
            return False
        if length_place + 8 > end:
            return False
        length = int(struct.unpack_from('<Q', self._data, length_place)[0])
        return length == end - length_place - 8

    def _read_summary(self) -> None:
        """Learn the topics from the end of a file that is damaged in front of it."""
        place = len(self._data) - _FOOTER
        if place < 0 or self._data[place] != Opcode.FOOTER or self._end(place) is None:
            return
        self.is_closed = True
        footer = Footer.read(ReadDataStream(BytesIO(self._data[place + _HEAD:])))
        begin = int(footer.summary_start)
        while 0 < begin < place:
            end = self._end(begin)
            if end is None or not self._take_small(begin):
                return
            begin = end
