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

"""Reading a bag, also one that was cut off or has no index."""

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
import itertools
from pathlib import Path
from typing import Final
import warnings

import numpy as np

from .clouds import CloudDecoder, has_events
from .files import decompressed, opened, Part, Scan, scan
from .metadata import file_names
from .order import LATE, Message, NO_TIME, Order
from .topics import BagError, Topic
from ..core.model import EVENT, EventArray
from ..core.stream.guard import StreamGuard
from ..core.words import counted

#: The unit of each column that `read_bag` returns; '1' where there is none.
EVENT_UNITS: Final = {name: {'cycle': 'drive periods', 'index': 'impacts', 'phase': 'rad'}.get(
    name, '1') for name in EVENT.names or ()}
# Later than any message [ns].
_EVER: Final = 2**65


class Bag:
    """
    A recorded bag: a directory, or a single .mcap file.

    A bag that is missing or damaged raises BagError, here or where the damaged place is read.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.topics: dict[str, Topic] = {}  #: By name.
        self.counts: dict[str, int] = {}  #: Messages on each topic.
        #: Whether all files were closed properly; if not, their complete chunks are read.
        self.is_whole = True
        self._files = [scan(file) for file in find_files(self.path)]
        #: The most by which log times were seen to go back, on topics where they do [ns].
        self.set_back: dict[str, int] = {}
        parts = [part for file in self._files for part in file.parts]
        self._is_steady = _are_steady(parts)
        self._survey(parts)

    def _survey(self, parts: Sequence[Part]) -> None:
        """Learn the topics, counts and times; files that do not state them are read."""
        unknown = [file for file in self._files if not (self._is_steady and file.is_described)]
        counts: Counter[str] = Counter()
        start, end = 2**64, 0
        for message in self._read(unknown, None, 0, _EVER):
            counts[message.topic] += 1
            start, end = min(start, message.time), max(end, message.time)
        for part in parts if self._is_steady else []:
            start, end = min(start, part.first), max(end, part.last)
        for file in self._files:
            self.is_whole &= file.is_closed
            if file not in unknown and file.statistics is not None:
                for number, count in file.statistics.channel_message_counts.items():
                    counts[file.topic(number).name] += count
            for topic in map(file.topic, file.channels):
                known = self.topics.setdefault(topic.name, topic)
                if known.type_name != topic.type_name:
                    raise BagError(f'{file.path}: topic {topic.name} is of two types, '
                                   f'{known.type_name} and {topic.type_name}')
        self.counts = {name: counts[name] for name in self.topics}
        #: Time of the first message [ns]; 0 if there is none.
        self.start = min(start, end)
        #: Time of the last message [ns]; 0 if there is none.
        self.end = end

    def messages(self, topics: Collection[str] | None = None, start: int = 0,
                 end: int = _EVER) -> Iterator[Message]:
        """
        Yield the messages of some topics, or of all, in order: those of a topic as recorded.

        `start` and `end` limit their time [ns] and are both included.
        """
        return self._read(self._files, topics, start, end)

    def _read(self, files: Sequence[Scan], topics: Collection[str] | None, start: int,
              end: int) -> Iterator[Message]:
        parts = [part for file in files for part in file.parts]
        firsts = [part.first for part in parts]
        # The earliest log time of all that comes after a part.
        later = [*itertools.accumulate(reversed(firsts), min, initial=2**64)][-2::-1]
        order = Order(next((first for first in firsts if 0 < first < NO_TIME), 0))
        coming = iter(later)
        for file in files:
            found: Counter[int] = Counter()
            is_all = True
            with opened(file.path) as stream:
                for part, earliest in zip(file.parts, coming, strict=False):
                    if self._is_steady and not (start <= part.last and part.first <= end):
                        is_all = False
                        continue
                    for record in file.read(stream, part):
                        found[record.channel_id] += 1
                        topic = file.topic(record.channel_id)
                        time, rank = order.time(topic.name, record.sequence, record.log_time)
                        if start <= time <= end and (topics is None or topic.name in topics):
                            order.hold(Message(
                                topic.name, topic.type_name, decompressed(topic, record.data),
                                record.log_time, record.publish_time, record.sequence, time), rank)
                    self.set_back |= order.set_back
                    yield from order.due(earliest)
            if is_all:
                file.compare(found)
        yield from order.due(_EVER)

    def events(self, topic: str = '') -> Iterator[EventArray]:
        """
        Yield the batches of EVENT that were recorded, shape (n,).

        Without `topic`, it is the one whose last part is ``impacts``.
        """
        topic = self.find_impacts(topic)
        decoder = CloudDecoder()
        for message in self.messages([topic]):
            try:
                events = decoder.events(message.data)
            except ValueError as error:
                raise BagError(f'{self.path}: {topic} at {message.log_time} ns: {error}') from None
            yield events

    def find_impacts(self, topic: str = '') -> str:
        """Return the name of the topic with the EVENT records; see `events`."""
        names = ', '.join(sorted(self.topics)) or 'none'
        if topic:
            if topic not in self.topics:
                raise BagError(f'{self.path}: has no topic {topic}; there are {names}')
            return topic
        found = [name for name, known in self.topics.items() if has_events(known)]
        if len(found) != 1:
            raise BagError(
                f'{self.path}: has {len(found)} topics named impacts; name one of {names}')
        return found[0]


def read_bag(path: str | Path, *, topic: str = '') -> EventArray:
    """
    Return all EVENT records of a bag, in the order in which they were recorded.

    Parameters
    ----------
    path : str or Path
        A bag directory, or a single .mcap file.
    topic : str
        Name of the topic; without it, the one whose last part is ``impacts``.

    Returns
    -------
    ndarray of EVENT, shape (n,)
        A structured array; ``pandas.DataFrame(read_bag(path))`` has a column for each field,
        and `EVENT_UNITS` the unit of each.

    Raises
    ------
    BagError
        If there is no bag or no such topic, or a damaged place is read.

    Warns
    -----
    UserWarning
        If impacts are missing, the numbering begins anew, or the bag was not closed properly.

    """
    bag = Bag(path)
    guard = StreamGuard()
    batches = [np.empty(0, EVENT)]
    for events in bag.events(topic):
        guard.split(events)
        batches.append(events)
    faults = [] if bag.is_whole else ['was not closed properly; its complete chunks are read']
    if guard.gaps:
        faults.append(f'{counted(guard.gaps, "hole")}, {counted(guard.lost, "impact")} missing; '
                      f'the last hole: {guard.holes[-1].describe()}')
    if guard.restarts:
        faults.append(f'the numbering begins anew {counted(guard.restarts, "time")}')
    for fault in faults:
        warnings.warn(f'{path}: {fault}', stacklevel=2)
    return np.concatenate(batches)


def _are_steady(parts: Sequence[Part]) -> bool:
    """Return whether log times go forward from part to part, as far as can be seen outside."""
    newest = 0
    for part in parts:
        # A jump inside of the only part is not seen otherwise.
        if not 0 < part.first <= part.last < NO_TIME or part.first < newest - LATE or (
                len(parts) == 1 and part.first < part.last - LATE):
            return False
        newest = max(newest, part.last)
    return True


def find_files(path: Path) -> list[Path]:
    if path.is_dir():
        files = [path / name for name in file_names(path)]
        if not files:
            raise BagError(f'{path}: has no .mcap file')
        return files
    if not path.exists():
        raise BagError(f'{path}: does not exist')
    return [path]
