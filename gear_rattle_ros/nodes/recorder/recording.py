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

"""The recorder's other thread: counts lost impacts and writes the bag."""

from collections import deque
import dataclasses
import threading
import time
from typing import Final

import numpy as np

from ...bags import BagError, BagWriter, CloudDecoder, Topic
from ...core.model import EVENT, EventKind, impact_count
from ...core.stream.guard import GUARDED, StreamGuard

# Bytes that may wait for the disk. Beyond that the node stops reading, and DDS holds up the
# publishers, so that nothing is lost.
_ROOM: Final = 32 * 1024 * 1024
# A killed recorder loses only messages younger than this and the time of one write [s].
_FLUSH_PERIOD: Final = 0.4
# Interval at which the file is synced to the disk, in a thread that holds nobody up [s].
_SYNC_PERIOD: Final = 0.4
_METADATA_PERIOD: Final = 2.0

# The fields of an event that show whether the stream is whole.
_KEYS: Final = np.dtype([(name, EVENT[name]) for name in GUARDED])


@dataclasses.dataclass(frozen=True)
class Received:
    """A message on its way to the bag; times in ns."""

    topic: Topic
    data: bytes
    log_time: int
    publish_time: int
    sequence: int


class Recording:
    """Writes a bag in a thread of its own; the records of the stream show what is missing."""

    def __init__(self, writer: BagWriter, impacts: str) -> None:
        self.impacts = self.messages = self.unreadable = 0
        self.failure = ''
        self.guard = StreamGuard()
        # Compile now, not while the first batch waits.
        StreamGuard().split(np.zeros(2, _KEYS))
        self._decoder = CloudDecoder()
        self._impacts_topic = impacts
        self._writer = writer
        self._channels: dict[str, int] = {}
        self._waiting: deque[Received] = deque()
        # Bytes that wait for the thread.
        self.backlog = 0
        self._oldest: int | None = None
        self._is_closing = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name='recording', daemon=True)
        self._sync_error: BagError | None = None
        self._ended = threading.Event()
        self._syncing = threading.Thread(target=self._sync, name='syncing', daemon=True)
        self._syncing.start()
        self._thread.start()

    @property
    def size(self) -> int:
        return self._writer.size

    @property
    def age(self) -> float:
        """Age of the oldest message that is not on the disk [s]."""
        oldest = self._oldest
        return 0.0 if oldest is None else max(time.time_ns() - oldest, 0) / 1e9

    def put(self, received: Received) -> None:
        """Hand a message over; wait while there is no room."""
        with self._changed:
            while self.backlog > _ROOM and not self.failure:
                self._changed.wait()
            if self.failure:
                return
            if self._oldest is None:
                self._oldest = received.log_time
            self._waiting.append(received)
            self.backlog += len(received.data)
            self._changed.notify_all()

    def close(self) -> None:
        with self._changed:
            self._is_closing = True
            self._changed.notify_all()
        self._thread.join()

    def _run(self) -> None:
        flushed = described = time.monotonic()
        try:
            while True:
                received = self._take(_FLUSH_PERIOD)
                if received is not None:
                    self._write(received)
                now = time.monotonic()
                if now >= flushed + _FLUSH_PERIOD:
                    flushed = now
                    self._writer.flush()
                    if self._sync_error is not None:
                        raise self._sync_error
                    with self._changed:
                        self._oldest = self._waiting[0].log_time if self._waiting else None
                if now >= described + _METADATA_PERIOD:
                    described = now
                    self._writer.write_metadata()
                if received is None and self._is_closing:
                    self._end_sync()
                    self._writer.close()
                    return
        except Exception as error:
            # Whatever went wrong, the publishers must not be left waiting.
            self._end_sync()
            self.messages = self._writer.abandon()
            self._fail(str(error))

    def _sync(self) -> None:
        while not self._ended.wait(_SYNC_PERIOD):
            try:
                self._writer.sync()
            except BagError as error:
                self._sync_error = error
                return

    def _end_sync(self) -> None:
        self._ended.set()
        self._syncing.join()

    def _take(self, patience: float) -> Received | None:
        with self._changed:
            if not self._waiting and not self._is_closing:
                self._changed.wait(patience)
            if not self._waiting:
                return None
            received = self._waiting.popleft()
            self.backlog -= len(received.data)
            self._changed.notify_all()
        return received

    def _fail(self, reason: str) -> None:
        """Ignore messages from now on, so that no publisher waits for a full disk."""
        with self._changed:
            self.failure = reason
            self._waiting.clear()
            self.backlog = 0
            self._changed.notify_all()

    def _write(self, received: Received) -> None:
        topic = received.topic
        channel = self._channels.get(topic.name)
        if channel is None:
            channel = self._channels[topic.name] = self._writer.add_topic(topic)
        self._writer.write(channel, received.log_time, received.publish_time, received.sequence,
                           received.data)
        self.messages += 1
        if topic.name == self._impacts_topic:
            self._count(received.data)

    def _count(self, data: bytes) -> None:
        try:
            records = self._decoder.columns(data, _KEYS.names or ())
            if len(records) and records['kind'].max() > max(EventKind):
                raise ValueError('unknown kind of event')
        except ValueError:
            self.unreadable += 1
            return
        self.guard.split(records)
        self.impacts += impact_count(records)
