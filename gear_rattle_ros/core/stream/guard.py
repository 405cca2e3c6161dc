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

"""Whether a stream of events is whole: holes by index and epoch, and restarts."""

from collections import deque
import dataclasses
from typing import Final

import numpy as np
import numpy.typing as npt

from ..arrays import RecordArray
from ..compiled import kernel
from ..model import EventArray, EventKind

STICK, RETUNE = int(EventKind.STICK), int(EventKind.RETUNE)
# The fields by which a stream is judged.
GUARDED: Final = ('kind', 'index', 'epoch', 'cycle', 'phase')
# Holes that are kept; all of them are counted.
LATEST_HOLES: Final = 1000


@dataclasses.dataclass(frozen=True)
class Hole:
    """Records that were never seen."""

    after: tuple[int, int]  #: Index and epoch of the last record before it.
    before: tuple[int, int]  #: Index and epoch of the first record after it.
    lost: int  #: Impacts missing; 0 where only retunes, resets or releases are.

    def describe(self) -> str:
        """Return the missing impacts, modulo 2^32, and their epochs in words."""
        epochs = f'epoch {self.after[1]}'
        if self.before[1] != self.after[1]:
            epochs = f'epochs {self.after[1]} to {self.before[1]}'
        first, last = (self.after[0] + 1) % 2**32, (self.after[0] + self.lost) % 2**32
        if self.lost == 0:
            return f'no impact, but another record after impact {self.after[0]} ({epochs})'
        if self.lost == 1:
            return f'impact {first} ({epochs})'
        return f'{self.lost} impacts, {first} to {last} ({epochs})'


@dataclasses.dataclass(frozen=True)
class Piece:
    """A stretch of events without a hole."""

    events: EventArray  #: The records, at least one.
    follows: bool  #: Whether the first record follows from the last one seen before it.
    lost: int  #: Impacts missing before the first record, where that is known.
    reason: str  #: Why it does not follow: 'start', 'gap', 'restart'; empty where it does.


@kernel
def compare(last: RecordArray, events: RecordArray, jumps: npt.NDArray[np.int32],
            follows: npt.NDArray[np.bool_]) -> None:
    """Compare every record with the one before it."""
    # `jumps` receives the impacts missing before each, negative where the numbers run backwards.
    # The record before the first needs only the fields of `GUARDED`.
    p = last[0]
    kind, index, epoch, cycle, phase = p.kind, p.index, p.epoch, p.cycle, p.phase
    for i in range(len(events)):
        event = events[i]
        counted = 1 if event.kind <= STICK else 0
        begins = 1 if event.kind >= RETUNE else 0
        jumps[i] = np.int32(np.uint32(event.index - index - counted))
        passed = np.int32(np.uint32(event.cycle - cycle))
        goes_back = passed < 0 or (passed == 0 and event.phase < phase)
        # A gear that sticks hits nothing before it is released.
        follows[i] = (
            jumps[i] == 0 and np.uint32(event.epoch - epoch - begins) == 0
            and not goes_back and not (kind == STICK and counted == 1))
        kind, index, epoch, cycle, phase = (
            event.kind, event.index, event.epoch, event.cycle, event.phase)


class StreamGuard:
    """Cut a stream, given in batches of any size, where it has a hole."""

    def __init__(self) -> None:
        self.holes: deque[Hole] = deque(maxlen=LATEST_HOLES)  # the latest
        # Number of the last impact in or before the first record seen.
        self.first_index: int | None = None
        self.lost = 0  # impacts that were never seen
        self.gaps = 0  # holes found
        self.restarts = 0  # times the numbering began anew
        self._last: EventArray | None = None

    def split(self, events: EventArray) -> list[Piece]:
        """Take the next batch, an array of EVENT, and return it cut at every hole."""
        if not len(events):
            return []
        is_first = self._last is None
        if is_first:
            self.first_index = int(events['index'][0])
        last = events[:1] if self._last is None else self._last
        jumps = np.empty(len(events), np.int32)
        follows = np.empty(len(events), np.bool_)
        compare(last, events, jumps, follows)
        follows[0] &= not is_first
        pieces = []
        cuts = [0, *(int(i) for i in np.flatnonzero(~follows) if i > 0), len(events)]
        for start, stop in zip(cuts[:-1], cuts[1:], strict=True):
            piece = events[start:stop]
            if follows[start]:
                pieces.append(Piece(piece, True, 0, ''))
            elif is_first and start == 0:
                pieces.append(Piece(piece, False, 0, 'start'))
            else:
                before = events[start - 1:start] if start else last
                pieces.append(self._hole(before, piece, int(jumps[start])))
        self._last = events[-1:].copy()
        return pieces

    def _hole(self, before: EventArray, piece: EventArray, jump: int) -> Piece:
        after = (int(before['index'][0]), int(before['epoch'][0]))
        first = (int(piece['index'][0]), int(piece['epoch'][0]))
        passed = (int(piece['cycle'][0]) - int(before['cycle'][0]) + 2**31) % 2**32 - 2**31
        is_earlier = (passed, piece['phase'][0]) < (0, before['phase'][0])
        is_new = piece['kind'][0] == EventKind.RESET and first[0] == 0
        # Within one run neither impacts nor epochs nor time go backwards.
        if jump < 0 or (first[1] - after[1]) % 2**32 >= 2**31 or is_earlier or is_new:
            self.restarts += 1
            return Piece(piece, False, 0, 'restart')
        self.gaps += 1
        self.lost += jump
        self.holes.append(Hole(after, first, jump))
        return Piece(piece, False, jump, 'gap')
