"""The newest part of the stream, on axes that never go back: what there is to draw."""

import dataclasses
import math

import numpy as np
import numpy.typing as npt

from ..core.model import EVENT, EventArray, EventKind
from ..core.stream import Piece, StreamGuard

TWO_PI = 2.0 * math.pi
# An event, its place on both axes, and how many events were seen up to it.
ROW = np.dtype([
    ('seen', np.int64),
    ('impact', np.int64),
    ('drive_time', np.float64),
    ('kind', np.uint32),
    ('phase', np.float64),
    ('velocity', np.float64),
    ('alpha', np.float64),
])
# The counters of the two axes.
AXES = ('index', 'cycle')
RowArray = npt.NDArray[np.void]


@dataclasses.dataclass(frozen=True)
class Now:
    """Where the stream stands: numbers that go on counting over restarts of the simulator."""

    impact: int
    cycle: int
    seen: int
    event: np.void

    @property
    def drive_time(self) -> float:
        """Drive periods."""
        return self.cycle + float(self.event['phase']) / TWO_PI


class Recent:
    """Keeps the newest events; what is kept does not grow, however long the run."""

    def __init__(self, most: int) -> None:
        self.guard = StreamGuard()
        self.impacts = 0
        self.now: Now | None = None
        self._most = most
        # What has come in since the last look: stretches, and whether they follow.
        self._parts: list[tuple[EventArray, Now, bool]] = []
        self._waiting = 0
        self._rows = np.empty(0, ROW)
        self._changes = np.empty(0, ROW)
        self._whole = np.empty(0, EVENT)

    @property
    def seen(self) -> int:
        """Events so far."""
        return 0 if self.now is None else self.now.seen

    def take(self, events: EventArray) -> None:
        """Take the next batch; it costs little, as the rest is done when it is looked at."""
        for piece in self.guard.split(events):
            self._take_piece(piece)

    def whole(self) -> EventArray:
        """Return the newest events since the last hole or restart."""
        self._look()
        return self._whole

    def impacts_after(self, seen: int) -> RowArray:
        """Return the impacts among the newest events that came after so many events."""
        self._look()
        rows = self._rows[self._rows['seen'] > seen]
        return rows[rows['kind'] <= EventKind.STICK]

    def changes_after(self, seen: int) -> RowArray:
        """Return the retunes and resets, not more than are kept, after so many events."""
        return self._changes[self._changes['seen'] > seen]

    def impact_number(self, index: int) -> int:
        """Return the number that goes on counting for an impact index near the newest one."""
        if self.now is None:
            return index
        ahead = (index - int(self.now.event['index']) + 2**31) % 2**32 - 2**31
        return max(self.now.impact + ahead, 0)

    def _take_piece(self, piece: Piece) -> None:
        events = piece.events
        last, first, before = events[-1].copy(), events[0], self.now
        if before is None:
            impact, cycle = (int(first[name]) + ahead(last, first, name) for name in AXES)
        elif piece.reason == 'restart':
            # A new simulator counts from 0; the axes go on from where they are.
            impact = before.impact + 1 + ahead(last, first, 'index')
            cycle = before.cycle + 1 + ahead(last, first, 'cycle')
        else:
            impact = before.impact + ahead(last, before.event, 'index')
            cycle = before.cycle + ahead(last, before.event, 'cycle')
        self.now = Now(impact, cycle, self.seen + len(events), last)
        kinds = events['kind']
        impacts = int(np.count_nonzero(kinds <= EventKind.STICK))
        self.impacts += impacts
        if impacts < len(events):
            places = np.flatnonzero(kinds >= EventKind.RETUNE)[-self._most:]
            rows = rows_of(events[places], self.now)
            rows['seen'] = self.now.seen - len(events) + 1 + places
            self._changes = np.concatenate([self._changes, rows])[-self._most:]
        self._parts.append((events[-self._most:].copy(), self.now, piece.follows))
        self._waiting += len(self._parts[-1][0])
        while self._waiting - len(self._parts[0][0]) >= self._most:
            self._waiting -= len(self._parts.pop(0)[0])
            # What is left no longer follows from what is kept.
            self._parts[0] = (*self._parts[0][:2], False)

    def _look(self) -> None:
        if not self._parts:
            return
        rows = [rows_of(events, now) for events, now, _ in self._parts]
        self._rows = np.concatenate([self._rows, *rows])[-self._most:]
        breaks = [i for i, part in enumerate(self._parts) if not part[2]]
        since = self._parts[breaks[-1] if breaks else 0:]
        whole = [] if breaks else [self._whole]
        self._whole = np.concatenate([*whole, *(part[0] for part in since)])[-self._most:]
        self._parts, self._waiting = [], 0


def ahead(event: np.void, before: np.void, name: str) -> int:
    """Return how far a counter modulo 2^32 has gone from one event to another."""
    return (int(event[name]) - int(before[name])) % 2**32


def rows_of(events: EventArray, now: Now) -> RowArray:
    """Return the rows of events of which the last, or one after it, stands at a moment."""
    rows = np.empty(len(events), ROW)
    rows['seen'] = now.seen - np.arange(len(events))[::-1]
    rows['impact'] = now.impact - (now.event['index'] - events['index']).astype(np.int64)
    cycles = now.cycle - (now.event['cycle'] - events['cycle']).astype(np.int64)
    rows['drive_time'] = cycles + events['phase'] / TWO_PI
    for name in ('kind', 'phase', 'velocity', 'alpha'):
        rows[name] = events[name]
    return rows
