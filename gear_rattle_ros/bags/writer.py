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

"""Writing a bag directory that stays readable while it grows."""

from collections.abc import Iterator
import contextlib
from pathlib import Path

from . import metadata
from .bag_file import BagFile
from .topics import BagError, Contents, Topic


class BagWriter:
    """
    A bag directory with .mcap files, of the layout that rosbag2 of Jazzy writes.

    What cannot be written raises BagError; `abandon` then keeps what was written before.

    Parameters
    ----------
    directory : str or Path
        A new directory.
    compression : str
        Of the chunks: zstd, lz4 or none.
    largest, longest : int
        Begin a new file when one has this size [byte], or when a message was received so long
        [ns] after the first in it; 0 for never. The index of a file is kept in memory until then.

    """

    def __init__(self, directory: str | Path, compression: str = 'zstd', *, largest: int = 0,
                 longest: int = 0) -> None:
        self.directory = directory = Path(directory)
        self.messages = 0  #: Messages written, those in the open chunk included.
        self._compression = compression
        self._largest = largest
        self._longest = longest
        self._topics: list[Topic] = []
        # The files that are finished, and their length.
        self._finished: dict[str, Contents] = {}
        self._finished_size = 0
        try:
            directory.mkdir(parents=True)
            self._name = directory.resolve().name
            self._file = self._new_file(0)
        except FileExistsError:
            raise BagError(f'{directory}: exists already, choose another name') from None
        except OSError as error:
            raise BagError(f'{directory}: cannot be made: {error.strerror}') from None
        self.write_metadata()

    @property
    def size(self) -> int:
        """Length of all files [byte]."""
        return self._finished_size + self._file.size

    def add_topic(self, topic: Topic) -> int:
        """Announce a topic and return its channel, for `write`."""
        with self._guarded():
            channel = self._file.add_topic(topic)
        self._topics.append(topic)
        return channel

    def write(self, channel: int, log_time: int, publish_time: int, sequence: int,
              data: bytes) -> None:
        """
        Add a serialized message, received at `log_time` and sent at `publish_time` [ns].

        `sequence` is its number in the publisher's counting, taken modulo 2^32.
        """
        with self._guarded():
            if (0 < self._largest <= self._file.size
                    or 0 < self._longest <= log_time - self._file.written.start):
                self._split()
            self._file.write(channel, log_time, publish_time, sequence, data)
        self.messages += 1

    def flush(self) -> None:
        """Close the open chunk and hand everything to the operating system."""
        with self._guarded():
            self._file.flush()

    def sync(self) -> None:
        """Wait until the disk has what the operating system was given; any thread may call it."""
        with self._guarded():
            self._file.sync()

    def write_metadata(self) -> None:
        """Bring metadata.yaml up to what a reader of the files would find now."""
        with self._guarded():
            metadata.write(self.directory, metadata.document(self._files()))

    def close(self) -> None:
        """Write the index and the final metadata.yaml."""
        with self._guarded():
            self._file.finish(self._finished)
            self.write_metadata()

    def abandon(self) -> int:
        """After an error, cut off what was written in part; return how many messages are kept."""
        self._file.abandon()
        with contextlib.suppress(BagError):
            self.write_metadata()
        return sum(contents.total for contents in self._files().values())

    def _files(self) -> dict[str, Contents]:
        return {**self._finished, self._file.path.name: self._file.settled}

    def _new_file(self, number: int) -> BagFile:
        return BagFile(self.directory / f'{self._name}_{number}.mcap', self._compression)

    def _split(self) -> None:
        self._file.finish(self._finished)
        following = self._new_file(len(self._finished) + 1)
        for topic in self._topics:
            following.add_topic(topic)
        self._finished = self._files()
        self._finished_size += self._file.size
        self._file = following
        # Before there is anything in the new file: readers go by its name in there.
        self.write_metadata()

    @contextlib.contextmanager
    def _guarded(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise BagError(f'{self.directory}: cannot be written: {error.strerror}') from error
