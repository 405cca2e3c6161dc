"""One .mcap file of a bag: what is in it, and its messages in order."""

from collections.abc import Collection, Iterator
import contextlib
import dataclasses
import heapq
import os
from pathlib import Path
import struct
from typing import Any, Final, IO
import zlib

from mcap.exceptions import EndOfFile, McapError
from mcap.reader import SeekingReader
import mcap.records
from mcap.records import Channel, Chunk, McapRecord, Schema
from mcap.stream_reader import breakup_chunk, StreamReader
from mcap.writer import MCAP0_MAGIC
import zstandard

from .topics import BagError, Contents, Topic
from ..plain_yaml import read_yaml

# In a file without an index, messages are sorted that are out of order by no more than this [ns].
_WINDOW: Final = 2_000_000_000
BROKEN: Final = (McapError, zstandard.ZstdError, zlib.error, RuntimeError, struct.error,
                 KeyError, UnicodeDecodeError, ValueError, OverflowError, MemoryError)


@dataclasses.dataclass(frozen=True)
class Message:
    """A message as it was recorded; `data` is its serialized form."""

    topic: str
    type_name: str
    data: bytes
    log_time: int
    publish_time: int
    sequence: int


@contextlib.contextmanager
def opened(path: Path) -> Iterator[IO[bytes]]:
    try:
        with path.open('rb') as stream:
            yield stream
    except BagError:
        raise
    except OSError as error:
        raise BagError(f'{path}: cannot be read: {error.strerror}') from None
    except BROKEN as error:
        what = str(error) or type(error).__name__
        raise BagError(f'{path}: is damaged or no MCAP file: {what}') from None


def read_summary(stream: IO[bytes]) -> Contents | None:
    """Return the contents from the index, or None where there is none."""
    reader = SeekingReader(stream)
    stream.seek(-min(len(MCAP0_MAGIC), stream.seek(0, os.SEEK_END)), os.SEEK_END)
    if stream.read() != MCAP0_MAGIC:
        return None
    summary = reader.get_summary()
    if summary is None or summary.statistics is None or not (
            summary.chunk_indexes or not summary.statistics.message_count):
        return None
    statistics = summary.statistics
    contents = Contents(
        start=statistics.message_start_time, end=statistics.message_end_time, is_indexed=True)
    for number, channel in summary.channels.items():
        contents.announce(describe_topic(channel, summary.schemas[channel.schema_id]))
        contents.counts[channel.topic] += statistics.channel_message_counts.get(number, 0)
    return contents


def scan(stream: IO[bytes]) -> Contents:
    contents = Contents()
    for schema, channel, message in _described(stream):
        if message is None:
            contents.announce(describe_topic(channel, schema))
        else:
            contents.count(channel.topic, message.log_time)
    return contents


def describe_topic(channel: Channel, schema: Schema) -> Topic:
    return Topic(
        channel.topic, schema.name, schema.data.decode('utf-8', 'replace'),
        channel.metadata.get('topic_type_hash', ''),
        _parse_qos(channel.metadata.get('offered_qos_profiles', '')), schema.encoding)


def _parse_qos(text: str) -> tuple[dict[str, Any], ...]:
    with contextlib.suppress(ValueError):
        if isinstance(profiles := read_yaml(text), list):
            return tuple(profile for profile in profiles if isinstance(profile, dict))
    return ()


def read_indexed(stream: IO[bytes], topics: Collection[str] | None, start: int,
                 end: int) -> Iterator[Message]:
    for schema, channel, message in SeekingReader(stream, validate_crcs=True).iter_messages(
            None if topics is None else list(topics), starting_at=start, ending_before=end + 1):
        yield _message(channel, '' if schema is None else schema.name, message)


def read_through(stream: IO[bytes], topics: Collection[str] | None, start: int,
                 end: int) -> Iterator[Message]:
    waiting: list[tuple[int, int, Message]] = []
    for number, (schema, channel, message) in enumerate(_described(stream)):
        if message is None or not start <= message.log_time <= end or (
                topics is not None and channel.topic not in topics):
            continue
        heapq.heappush(
            waiting, (message.log_time, number, _message(channel, schema.name, message)))
        while waiting[0][0] < message.log_time - _WINDOW:
            yield heapq.heappop(waiting)[2]
    while waiting:
        yield heapq.heappop(waiting)[2]


def _described(stream: IO[bytes]) -> Iterator[tuple[Schema, Channel, mcap.records.Message | None]]:
    """Yield every message with its topic, and every topic when it is announced."""
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    for record in _records(stream):
        if isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel):
            channels[record.id] = record
            yield schemas[record.schema_id], record, None
        elif isinstance(record, mcap.records.Message):
            channel = channels[record.channel_id]
            yield schemas[channel.schema_id], channel, record


def _records(stream: IO[bytes]) -> Iterator[McapRecord]:
    """Yield the records of a file up to where it was cut off."""
    stream.seek(0)
    records = StreamReader(stream, emit_chunks=True).records
    while True:
        try:
            record = next(records, None)
        except (EndOfFile, struct.error):
            # A cut within the few bytes of a record's head is the latter.
            if stream.read(1):
                raise
            return
        if record is None:
            return
        yield from breakup_chunk(record, validate_crc=True) if isinstance(record, Chunk) else [
            record]


def _message(channel: Channel, type_name: str, message: mcap.records.Message) -> Message:
    return Message(channel.topic, type_name, message.data, message.log_time,
                   message.publish_time, message.sequence)
