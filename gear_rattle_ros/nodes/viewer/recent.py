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

"""The newest part of the stream, as it is drawn."""

import numpy as np
import numpy.typing as npt

from ...core.many.settling import UNSETTLED
from ...core.model import EVENT, EventArray, EventKind, impact_count
from ...core.stream.counters import advanced, drive_times, impact_numbers, Place
from ...core.stream.guard import Piece, StreamGuard
from ...palette import ENDS, rgba

# An event, its place on both axes, and how many events were seen up to it.
ROW = np.dtype([
    ('seen', np.int64), ('impact', np.int64), ('drive_time', float), ('kind', np.uint32),
    ('phase', float), ('velocity', float), ('alpha', float)])
RowArray = npt.NDArray[np.void]
# Attractors visited one after the other that are remembered.
_VISITS = 1000


class Recent:
    """Keeps the newest events, in memory that does not grow with the run."""

    def __init__(self, most: int) -> None:
        self.guard = StreamGuard()
        self.impacts = 0
        self.seen = 0
        self.now: Place | None = None
        self._most = most
        # The newest batches: events, place, events seen, whether they follow from those before.
        self._parts: list[tuple[EventArray, Place, int, bool]] = []
        self._waiting = 0
        self._rows = np.empty(0, ROW)
        self._changes = np.empty(0, ROW)
        self._whole = np.empty(0, EVENT)
        # First impacts of stays on attractors, in order, and the colours of these.
        self._visits = [(-1, ENDS[UNSETTLED])]

    def visit(self, index: int, colour: str) -> None:
        """Note that the trajectory is on an attractor of a colour from an impact on."""
        number = self.impact_number(index)
        before = [each for each in self._visits[-_VISITS:] if each[0] < number]
        self._visits = [*(before or self._visits[:1]), (number, colour)]

    def colours_of(self, impacts: RowArray) -> npt.NDArray[np.uint32]:
        """Return the colours of the attractors on which impacts are."""
        first, colours = zip(*self._visits, strict=True)
        place = np.searchsorted(first, impacts['impact'], 'right') - 1
        return np.array([rgba(colour) for colour in colours], np.uint32)[np.maximum(place, 0)]

    def take(self, events: EventArray) -> None:
        """Take the next batch; most of the work is left until it is drawn."""
        for piece in self.guard.split(events):
            self._take_piece(piece)

    def whole(self) -> EventArray:
        """Return the newest events since the last hole or restart."""
        self._look()
        return self._whole

    def impacts_after(self, seen: int) -> RowArray:
        """Return the impacts among the newest events, after the first `seen` events."""
        self._look()
        rows = self._rows[self._rows['seen'] > seen]
        return rows[rows['kind'] <= EventKind.STICK]

    def changes_after(self, seen: int) -> RowArray:
        """Return the newest retunes and resets, after the first `seen` events."""
        return self._changes[self._changes['seen'] > seen]

    def impact_number(self, index: int) -> int:
        """Return the number of an impact near the newest one, from its index modulo 2^32."""
        if self.now is None:
            return index
        ahead = (index - int(self.now.event['index']) + 2**31) % 2**32 - 2**31
        return max(self.now.impact + ahead, 0)

    def _take_piece(self, piece: Piece) -> None:
        events = piece.events
        self.now = advanced(self.now, piece)
        places = np.flatnonzero(events['kind'] >= EventKind.RETUNE)[-self._most:]
        if len(places):
            rows = rows_of(events[places], self.now, self.seen + 1 + places)
            self._changes = np.concatenate([self._changes, rows])[-self._most:]
        self.seen += len(events)
        self.impacts += impact_count(events)
        tail = events[-self._most:].copy()
        self._parts.append((tail, self.now, self.seen, piece.follows))
        self._waiting += len(tail)
        while self._waiting - len(self._parts[0][0]) >= self._most:
            self._waiting -= len(self._parts.pop(0)[0])
            # The first that is left no longer follows from what was kept before.
            self._parts[0] = (*self._parts[0][:3], False)

    def _look(self) -> None:
        if not self._parts:
            return
        rows = [rows_of(events, place, np.arange(seen - len(events), seen) + 1)
                for events, place, seen, _ in self._parts]
        self._rows = np.concatenate([self._rows, *rows])[-self._most:]
        breaks = [i for i, part in enumerate(self._parts) if not part[3]]
        since = self._parts[breaks[-1] if breaks else 0:]
        whole = [] if breaks else [self._whole]
        self._whole = np.concatenate([*whole, *(part[0] for part in since)])[-self._most:]
        self._parts, self._waiting = [], 0


def rows_of(events: EventArray, place: Place, seen: npt.NDArray[np.int64]) -> RowArray:
    """Return the rows of events that end at a place."""
    rows = np.empty(len(events), ROW)
    rows['seen'] = seen
    rows['impact'] = impact_numbers(events, place)
    rows['drive_time'] = drive_times(events, place)
    for name in ('kind', 'phase', 'velocity', 'alpha'):
        rows[name] = events[name]
    return rows
