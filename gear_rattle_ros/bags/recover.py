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

"""Make a clean bag of one that was cut off or damaged, and report what is missing."""

from collections.abc import Iterable
import contextlib
import dataclasses
from pathlib import Path

from . import BagError, BagWriter, CloudDecoder
from .clouds import has_events
from .metadata import glob, NAME, read_information, require_readable
from .reader import find_files
from .salvage import Damage, Salvage
from ..core.model import EventArray
from ..core.stream.guard import StreamGuard
from ..core.words import counted


class Accounts:
    """The events of a stream that are there, and those that are missing, by index and epoch."""

    def __init__(self) -> None:
        self.events = 0
        self.first: tuple[int, int] | None = None
        self.last: tuple[int, int] | None = None
        self.guard = StreamGuard()

    def take(self, events: EventArray) -> None:
        self.guard.split(events)
        if len(events):
            self.first = self.first or (int(events['index'][0]), int(events['epoch'][0]))
            self.last = int(events['index'][-1]), int(events['epoch'][-1])
            self.events += len(events)


@dataclasses.dataclass(frozen=True)
class Recovery:
    """
    The `messages` in the new bag, and the events of each topic; its text is a report.

    `nameless` messages, of topics that are not described anywhere, are left out; `damages` are
    stretches from which nothing could be read; `unclosed` files were cut off; `stated` has the
    files that state another number of messages, with that and the number that was read.
    """

    messages: int
    nameless: int
    damages: tuple[tuple[Path, Damage], ...]
    unclosed: tuple[Path, ...]
    stated: tuple[tuple[Path, int, int], ...]
    accounts: dict[str, Accounts]

    def __str__(self) -> str:
        lines = [f'{counted(self.messages, "message")} recovered']
        lines += [f'{path}: {counted(damage.end - damage.start, "byte")} from {damage.start} on '
                  'unreadable' for path, damage in self.damages]
        lines += [f'{path}: was not closed properly' for path in self.unclosed]
        lines += [f'{path}: states {counted(stated, "message")}, but has {found} that can be read'
                  for path, stated, found in self.stated]
        if self.nameless:
            lines.append(f'{counted(self.nameless, "message")} of unknown topics left out')
        for name, accounts in self.accounts.items():
            if accounts.first is None or accounts.last is None:
                lines.append(f'{name}: no events')
                continue
            first, last = (f'impact {index}, epoch {epoch}'
                           for index, epoch in (accounts.first, accounts.last))
            lines.append(f'{name}: {counted(accounts.events, "event")}, from {first}, to {last}')
            lines += [f'{name}: missing: {hole.describe()}' for hole in accounts.guard.holes]
            if accounts.guard.restarts:
                lines.append(f'{name}: the numbers begin anew '
                             f'{counted(accounts.guard.restarts, "time")}')
            if self.unclosed:
                lines.append(f'{name}: what came after impact {accounts.last[0]} is lost')
        return '\n'.join(lines)

    __repr__ = __str__


def recover(path: str | Path, output: str | Path) -> Recovery:
    """Copy all that can be read of a bag to a new one; BagError if nothing is left of it."""
    path, output = Path(path), Path(output)
    if path.is_dir() and output.resolve().is_relative_to(path.resolve()):
        raise BagError(f'{output}: lies in the bag to be recovered, choose another name')
    # Every file is read before anything is written.
    parts = [(file, Salvage(file)) for file in _find(path)]
    for file, part in parts:
        require_readable(file, part.information)
    if not any(True for _, part in parts for _ in part.messages()):
        raise BagError(f'{path}: nothing in it can be recovered')
    writer = BagWriter(output)
    try:
        accounts = _copy((part for _, part in parts), writer)
        writer.close()
    except BaseException:
        writer.abandon()
        raise
    return Recovery(
        writer.messages, sum(part.nameless for _, part in parts),
        tuple((file, damage) for file, part in parts for damage in part.damages),
        tuple(file for file, part in parts if not part.is_closed),
        tuple((file, part.statistics.message_count, part.found) for file, part in parts
              if part.statistics and part.statistics.message_count != part.found), accounts)


def _copy(parts: Iterable[Salvage], writer: BagWriter) -> dict[str, Accounts]:
    accounts: dict[str, Accounts] = {}
    channels: dict[tuple[str, str], int] = {}
    decoder = CloudDecoder()
    for part in parts:
        for topic, message in part.messages():
            key = (topic.name, topic.type_name)
            if key not in channels:
                channels[key] = writer.add_topic(topic)
            writer.write(channels[key], message.log_time, message.publish_time,
                         message.sequence, message.data)
            if has_events(topic):
                account = accounts.setdefault(topic.name, Accounts())
                # A message without EVENT is copied as it is, and not counted.
                with contextlib.suppress(ValueError):
                    account.take(decoder.events(message.data))
    return accounts


def _find(path: Path) -> list[Path]:
    if not path.is_dir():
        return find_files(path)
    files = [path / name for name in glob(path)]
    if not files:
        raise BagError(f'{path}: has no .mcap file')
    listed: list[Path] = []
    information = None
    with contextlib.suppress(BagError, OSError):
        information = read_information(path)
    require_readable(path / NAME, information or {})
    # Files that metadata.yaml does not name, or names wrongly, belong to the bag all the same.
    with contextlib.suppress(BagError, OSError):
        listed = [file for file in find_files(path) if file in files]
    return listed + [file for file in files if file not in listed]
