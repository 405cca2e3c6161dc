"""Reading a bag, also one that was cut off or has no index."""

from collections.abc import Collection, Iterator
import heapq
from pathlib import Path

from .clouds import CloudDecoder, POINT_CLOUD
from .files import Contents, Message, opened, read_indexed, read_summary, read_through, scan
from .metadata import file_names
from .topics import BagError, Topic
from ..core.model import EventArray


class Bag:
    """
    A recorded bag.

    Parameters
    ----------
    path : Path
        A bag directory, or a single .mcap file.

    Attributes
    ----------
    topics : dict of str to Topic
        By name.
    counts : dict of str to int
        Messages on each topic.
    start, end : int
        Log time of the first and the last message [ns]; 0 if there is none.
    is_whole : bool
        Whether all files were closed properly; if not, their complete chunks are read.

    Raises
    ------
    BagError
        If there is no bag, or it is damaged.

    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.topics: dict[str, Topic] = {}
        self.counts: dict[str, int] = {}
        self.is_whole = True
        self._files: list[tuple[Path, Contents]] = []
        starts, ends = [], []
        for file in _find_files(path):
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
            if any(contents.counts.values()):
                starts.append(contents.start)
                ends.append(contents.end)
        self.start = min(starts, default=0)
        self.end = max(ends, default=0)

    def messages(self, topics: Collection[str] | None = None, start: int = 0,
                 end: int = 2**63 - 1) -> Iterator[Message]:
        """
        Return messages in the order of their log time.

        Parameters
        ----------
        topics : collection of str, optional
            Names; without them, all.
        start, end : int
            Range of the log time [ns], both included.

        Yields
        ------
        Message
            One after the other.

        Raises
        ------
        BagError
            At a damaged place.

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
        Return the batches of EVENT that were recorded.

        Parameters
        ----------
        topic : str
            Name of the topic; without it, the one whose last part is ``impacts``.

        Yields
        ------
        ndarray of EVENT, shape (n,)
            One batch.

        Raises
        ------
        BagError
            If there is no such topic, or no EVENT in it.

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
        """
        Return the name of the topic with the EVENT records.

        Parameters
        ----------
        topic : str
            Its name; without it, the one whose last part is ``impacts``.

        Returns
        -------
        str
            The name.

        Raises
        ------
        BagError
            If there is no such topic, or more than one.

        """
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


def _messages_of(file: Path, contents: Contents, topics: Collection[str] | None, start: int,
                 end: int) -> Iterator[Message]:
    with opened(file) as stream:
        read = read_indexed if contents.is_indexed else read_through
        yield from read(stream, topics, start, end)


def _find_files(path: Path) -> list[Path]:
    if path.is_dir():
        files = [path / name for name in file_names(path)]
        if not files:
            raise BagError(f'{path}: has no .mcap file')
        return files
    if not path.exists():
        raise BagError(f'{path}: does not exist')
    return [path]
