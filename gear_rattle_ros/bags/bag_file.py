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

"""Writing one .mcap file of a bag, so that it stays readable while it grows."""

from collections.abc import Mapping
import contextlib
import dataclasses
import os
from pathlib import Path
from typing import Final

from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Schema
from mcap.writer import CompressionType, Writer

from . import metadata
from .topics import Contents, Topic

COMPRESSIONS: Final = {
    'zstd': CompressionType.ZSTD, 'lz4': CompressionType.LZ4, 'none': CompressionType.NONE}
_CHUNK: Final = 2 * 1024 * 1024


class _Sink:
    """A file without a buffer: a write is whole or raises its own error."""

    def __init__(self, path: Path) -> None:
        self._raw = path.open('xb', buffering=0)
        self.size = 0

    def write(self, data: bytes) -> int:
        view = memoryview(data)
        while view:
            view = view[self._raw.write(view):]
        self.size += len(data)
        return len(data)

    def tell(self) -> int:
        return self.size

    def flush(self) -> None:
        """Do nothing: there is no buffer."""

    def sync(self) -> None:
        # A file that was closed meanwhile is on the disk.
        with contextlib.suppress(ValueError):
            os.fdatasync(self._raw.fileno())

    def close(self, size: int) -> None:
        """Close, and cut off what lies beyond a size."""
        with self._raw:
            if self._raw.tell() > size:
                self._raw.truncate(size)
            os.fsync(self._raw.fileno())


class BagFile:
    """A file of a bag; every method but `abandon` raises OSError if it cannot be written."""

    def __init__(self, path: Path, compression: str) -> None:
        self.path = path
        # What reading the file up to its present size would find.
        self.settled = Contents()
        self._settled_size = 0
        self.written = Contents()
        self._names: dict[int, str] = {}
        self._schemas: dict[str, int] = {}
        self._open_chunk = 0
        self._is_closed = False
        # Topics, written once more after their chunk: without them no message can be read.
        self._repeated = RecordBuilder()
        self._sink = _Sink(path)
        self._writer = Writer(
            self._sink, chunk_size=_CHUNK,  # type: ignore[arg-type]
            compression=COMPRESSIONS[compression])
        self._writer.start(profile='ros2')
        self._settle()

    @property
    def size(self) -> int:
        return self._sink.size

    def add_topic(self, topic: Topic) -> int:
        """Announce a topic and return its channel; the same order gives the same channels."""
        schema = self._schemas.get(topic.type_name, 0)
        if topic.type_name and not schema:
            schema = self._writer.register_schema(
                topic.type_name, topic.encoding, topic.definition.encode())
            self._schemas[topic.type_name] = schema
        offered = metadata.dump([dict(qos) for qos in topic.offered_qos])
        described = {'offered_qos_profiles': offered, 'topic_type_hash': topic.type_hash}
        channel = self._writer.register_channel(
            topic.name, topic.serialization, schema, described)
        if schema:
            Schema(schema, topic.definition.encode(), topic.encoding, topic.type_name).write(
                self._repeated)
        Channel(channel, topic.name, topic.serialization, described, schema).write(self._repeated)
        self._names[channel] = topic.name
        self.written.announce(topic)
        self.settled.announce(topic)
        return channel

    def write(self, channel: int, log_time: int, publish_time: int, sequence: int,
              data: bytes) -> None:
        self.written.count(self._names[channel], log_time)
        self._open_chunk += 1
        size = self.size
        self._writer.add_message(channel, log_time, data, publish_time, sequence & 0xFFFFFFFF)
        if self.size != size:
            self._settle()

    def flush(self) -> None:
        """Close the open chunk and hand everything to the operating system."""
        if self._open_chunk:
            self._writer.flush()
            self._settle()

    def sync(self) -> None:
        """Wait until the disk has what the operating system was given."""
        self._sink.sync()

    def finish(self, others: Mapping[str, Contents]) -> None:
        """Write the index, and close; `others` are the earlier files of the bag."""
        self.flush()
        self._writer.add_metadata('rosbag2', {'serialized_metadata': metadata.dump(
            metadata.document({**others, self.path.name: self.settled}))})
        self._writer.finish()
        self._sink.close(self.size)
        self._is_closed = True

    def abandon(self) -> None:
        """After an error, cut off what was written in part, so that the rest stays readable."""
        if not self._is_closed:
            self._is_closed = True
            with contextlib.suppress(OSError, ValueError):
                self._sink.close(self._settled_size)

    def _settle(self) -> None:
        self._open_chunk = 0
        if self._repeated.count:
            self._sink.write(self._repeated.end())
        self._settled_size = self._sink.size
        self.settled = dataclasses.replace(
            self.written, topics=dict(self.written.topics), counts=dict(self.written.counts))
