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

"""The order of messages: by time, and on each topic as they were recorded."""

from collections.abc import Iterator
import dataclasses
import heapq
from typing import Final

# A log time that is earlier than the one before it by more than this is another clock's [ns].
LATE: Final = 2_000_000_000
# ROS has no times from here on [ns].
NO_TIME: Final = 2**63
# Messages are held back until none that is earlier can follow, but no more than this [byte].
_HELD: Final = 2**26
# The rank of messages whose log time went back, after all sequence numbers.
_BEHIND: Final = 2**32


@dataclasses.dataclass(frozen=True)
class Message:
    """A message as it was recorded; `data` is its serialized form."""

    topic: str
    type_name: str
    data: bytes
    log_time: int
    publish_time: int
    sequence: int
    #: Its log time, or where the clock was set back, as if that had gone on [ns].
    time: int


class Order:
    """Gives messages, in the order of the file, their time, and puts them in order by it."""

    def __init__(self, begin: int) -> None:
        # The most by which log times on a topic went back [ns].
        self.set_back: dict[str, int] = {}
        self._newest = begin
        # On each topic the time, rank and sequence number of the latest, and the clock's shift.
        self._latest: dict[str, tuple[int, int, int, int]] = {}
        self._held: list[tuple[int, int, int, Message]] = []
        self._number = self._size = 0

    def time(self, topic: str, sequence: int, log_time: int) -> tuple[int, int]:
        """Return the time and, among equal times, the rank of the next message on a topic."""
        latest, rank, before, shift = self._latest.get(topic, (-1, 0, 0, 0))
        time = log_time + shift if log_time < NO_TIME else max(self._newest, latest)
        if latest - LATE <= time < latest and sequence < before:
            # It was written late.
            return time, sequence
        if time < latest:
            self.set_back[topic] = max(self.set_back.get(topic, 0), latest - time)
            if time < latest - LATE:
                shift += self._newest - time
                latest = self._newest
            time, rank = latest, _BEHIND
        elif time > latest or rank < _BEHIND:
            rank = sequence
        self._latest[topic] = time, rank, sequence, shift
        self._newest = max(self._newest, time)
        return time, rank

    def hold(self, message: Message, rank: int) -> None:
        self._number += 1
        self._size += len(message.data)
        heapq.heappush(self._held, (message.time, rank, self._number, message))

    def due(self, earliest: int) -> Iterator[Message]:
        """Yield what no message of a time from `earliest` on can precede."""
        while self._held and (self._held[0][0] < earliest or self._size > _HELD):
            message = heapq.heappop(self._held)[-1]
            self._size -= len(message.data)
            yield message
