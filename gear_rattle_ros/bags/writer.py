"""Writing a bag that stays readable while it grows."""

from collections.abc import Iterator
import contextlib
import os
from pathlib import Path
from typing import Any, Final

from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Schema
from mcap.writer import CompressionType, Writer

from . import metadata
from .topics import BagError, Topic

COMPRESSIONS: Final = {
    'zstd': CompressionType.ZSTD,
    'lz4': CompressionType.LZ4,
    'none': CompressionType.NONE,
}
_CHUNK: Final = 2 * 1024 * 1024


class _File:
    """A file that hands every write on at once and whole, so that an error belongs to it."""

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
        """Nothing is held back."""

    def sync(self) -> None:
        os.fdatasync(self._raw.fileno())

    def close(self, size: int) -> None:
        """Close, without what lies behind a size."""
        with self._raw:
            if self._raw.tell() > size:
                self._raw.truncate(size)
            os.fsync(self._raw.fileno())


class BagWriter:
    """
    A bag directory with one .mcap file, of the layout that rosbag2 of Jazzy writes.

    Parameters
    ----------
    directory : Path
        To be made.
    compression : str
        Of the chunks: zstd, lz4 or none.

    Attributes
    ----------
    messages, size : int
        Messages written, those in the open chunk included, and length of the file [byte].

    Raises
    ------
    BagError
        If the directory exists or cannot be made.

    """

    def __init__(self, directory: Path, compression: str = 'zstd') -> None:
        self.directory = directory
        self.messages = 0
        self._topics: dict[int, Topic] = {}
        self._counts: dict[int, int] = {}
        self._schemas: dict[str, int] = {}
        self._start = 2**63 - 1
        self._end = 0
        # What reading the file up to its present size would find.
        self._whole: dict[str, Any] = {}
        self._whole_size = 0
        self._open_chunk = 0
        # Written once more behind the chunk they stand in: its loss would be that of all.
        self._repeated = RecordBuilder()
        try:
            directory.mkdir(parents=True)
            self.path = directory / f'{directory.resolve().name}_0.mcap'
            self._file = _File(self.path)
        except FileExistsError:
            raise BagError(f'{directory}: exists already, choose another name') from None
        except OSError as error:
            raise BagError(f'{directory}: cannot be made: {error.strerror}') from None
        with self._guarded():
            self._writer = Writer(
                self._file, chunk_size=_CHUNK,  # type: ignore[arg-type]
                compression=COMPRESSIONS[compression])
            self._writer.start(profile='ros2')
            self._settle()
            self.write_metadata()

    @property
    def size(self) -> int:
        return self._file.size

    def add_topic(self, topic: Topic) -> int:
        """
        Announce a topic.

        Parameters
        ----------
        topic : Topic
            With everything a reader needs.

        Returns
        -------
        int
            The channel, for `write`.

        """
        offered = metadata.dump([dict(qos) for qos in topic.offered_qos])
        with self._guarded():
            if topic.type_name not in self._schemas:
                self._schemas[topic.type_name] = self._writer.register_schema(
                    topic.type_name, topic.encoding, topic.definition.encode())
            described = {
                'offered_qos_profiles': offered,
                'topic_type_hash': topic.type_hash,
            }
            schema = self._schemas[topic.type_name]
            channel = self._writer.register_channel(topic.name, 'cdr', schema, described)
        Schema(schema, topic.definition.encode(), topic.encoding, topic.type_name).write(
            self._repeated)
        Channel(channel, topic.name, 'cdr', described, schema).write(self._repeated)
        self._topics[channel] = topic
        self._counts[channel] = 0
        return channel

    def write(self, channel: int, log_time: int, publish_time: int, sequence: int,
              data: bytes) -> None:
        """
        Add a message.

        Parameters
        ----------
        channel : int
            As `add_topic` returned it.
        log_time, publish_time : int
            When it was received and sent [ns].
        sequence : int
            Its number in the publisher's counting; taken modulo 2^32.
        data : bytes
            The serialized message.

        Raises
        ------
        BagError
            If the file cannot be written; see `abandon`.

        """
        self.messages += 1
        self._counts[channel] += 1
        self._start = min(self._start, log_time)
        self._end = max(self._end, log_time)
        self._open_chunk += 1
        size = self.size
        with self._guarded():
            self._writer.add_message(
                channel, log_time, data, publish_time, sequence & 0xFFFFFFFF)
        if self.size != size:
            self._settle()

    def flush(self) -> None:
        """
        Close the open chunk and hand everything to the operating system.

        Raises
        ------
        BagError
            If the file cannot be written.

        """
        with self._guarded():
            if self._open_chunk:
                self._writer.flush()
                self._settle()

    def sync(self) -> None:
        """
        Wait until the disk has what the operating system was given; any thread may call it.

        Raises
        ------
        BagError
            If the disk cannot take it.

        """
        with self._guarded():
            self._file.sync()

    def write_metadata(self) -> None:
        """
        Bring metadata.yaml up to what a reader of the file would find now.

        Raises
        ------
        BagError
            If it cannot be written.

        """
        with self._guarded():
            metadata.write(self.directory, self._whole)

    def close(self) -> None:
        """
        Write the index and the final metadata.yaml.

        Raises
        ------
        BagError
            If the file cannot be written; what it held before stays readable.

        """
        with self._guarded():
            self.flush()
            self._writer.add_metadata(
                'rosbag2', {'serialized_metadata': metadata.dump(self._whole)})
            self._writer.finish()
            self._file.close(self.size)
            metadata.write(self.directory, self._whole)

    def abandon(self) -> int:
        """
        After an error: cut off what was written in part, so that the rest stays readable.

        Returns
        -------
        int
            Messages that are kept.

        """
        with contextlib.suppress(OSError, ValueError):
            self._file.close(self._whole_size)
        with contextlib.suppress(OSError):
            metadata.write(self.directory, self._whole)
        return int(self._whole['message_count'])

    def _settle(self) -> None:
        self._open_chunk = 0
        if self._repeated.count:
            self._file.write(self._repeated.end())
        self._whole_size = self._file.size
        self._whole = metadata.document(
            self.path.name,
            [(topic, self._counts[channel]) for channel, topic in self._topics.items()],
            self._start, self._end)

    @contextlib.contextmanager
    def _guarded(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise BagError(f'{self.directory}: cannot be written: {error.strerror}') from error
