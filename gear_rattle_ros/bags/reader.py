"""Reading a bag, also one that was cut off or has no index."""

from collections.abc import Collection, Iterator
import heapq
from pathlib import Path
import warnings

import numpy as np

from .clouds import CloudDecoder, POINT_CLOUD
from .files import Message, opened, read_indexed, read_summary, read_through, scan
from .metadata import file_names
from .topics import BagError, Contents, Topic
from ..core.model import EVENT, EventArray
from ..core.stream.guard import StreamGuard
from ..core.words import counted


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
        self._files: list[tuple[Path, Contents]] = []
        for file in find_files(self.path):
            with opened(file) as stream:
                contents = read_summary(stream) or scan(stream)
            self._files.append((file, contents))
            self.is_whole &= contents.is_indexed
            for name, topic in contents.topics.items():
                known = self.topics.setdefault(name, topic)
                if known.type_name != topic.type_name:
                    raise BagError(f'{file}: topic {name} is of two types, '
                                   f'{known.type_name} and {topic.type_name}')
                self.counts[name] = self.counts.get(name, 0) + contents.counts[name]
        filled = [contents for _, contents in self._files if contents.total]
        #: Log time of the first message [ns]; 0 if there is none.
        self.start = min((contents.start for contents in filled), default=0)
        #: Log time of the last message [ns]; 0 if there is none.
        self.end = max((contents.end for contents in filled), default=0)

    def messages(self, topics: Collection[str] | None = None, start: int = 0,
                 end: int = 2**63 - 1) -> Iterator[Message]:
        """
        Yield the messages of some topics, or of all, in the order of their log time.

        `start` and `end` limit the log time [ns] and are both included.
        """
        # Where one file ends and the next begins, topics may overlap.
        waiting = sorted(self._files, key=lambda each: each[1].start, reverse=True)
        heads: list[tuple[int, int, Message, Iterator[Message]]] = []

        def push(number: int, source: Iterator[Message]) -> None:
            head = next(source, None)
            if head is not None:
                heapq.heappush(heads, (head.log_time, number, head, source))

        while waiting or heads:
            while waiting and (not heads or waiting[-1][1].start <= heads[0][0]):
                push(-len(waiting), _messages_of(*waiting.pop(), topics, start, end))
            if heads:
                _, number, message, source = heapq.heappop(heads)
                yield message
                push(number, source)

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
        found = [name for name, known in self.topics.items()
                 if known.type_name == POINT_CLOUD and name.split('/')[-1] == 'impacts']
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
        A structured array; ``pandas.DataFrame(read_bag(path))`` has a column for each field.

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


def _messages_of(file: Path, contents: Contents, topics: Collection[str] | None, start: int,
                 end: int) -> Iterator[Message]:
    with opened(file) as stream:
        read = read_indexed if contents.is_indexed else read_through
        yield from read(stream, topics, start, end)


def find_files(path: Path) -> list[Path]:
    if path.is_dir():
        files = [path / name for name in file_names(path)]
        if not files:
            raise BagError(f'{path}: has no .mcap file')
        return files
    if not path.exists():
        raise BagError(f'{path}: does not exist')
    return [path]
