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

"""Gather what a picture of a whole run needs, batch by batch in bounded memory."""

from collections.abc import Iterable, Iterator
import dataclasses
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from ..core.model import EVENT, EventArray, EventKind, impact_count
from ..core.stream.counters import advanced, drive_times, impact_numbers, Place
from ..core.stream.guard import Piece, StreamGuard
from ..core.stream.lyapunov import RunningLyapunov
from ..core.stream.report_values import infinite_in_words, lyapunov_values
from ..core.stream.transients import Regime, TransientDetector, TransientReport

POINT: Final = np.dtype([
    ('impact', np.int64), ('drive_time', np.float64), ('phase', np.float64),
    ('velocity', np.float64), ('alpha', np.float64)])
ESTIMATE: Final = np.dtype([
    ('impact', np.int64), ('epoch', np.int64), ('impacts', np.int64), ('lambda_1', np.float64),
    ('lambda_2', np.float64), ('lambda_1_error', np.float64), ('lambda_1_finite', np.float64),
    ('sum', np.float64), ('exact_sum', np.float64)])
RowArray = npt.NDArray[np.void]

# Largest numbers kept: impacts, retunes, estimates, last events, first and last words.
POINTS_MOST: Final = 60_000
CHANGES_MOST: Final = 20_000
ESTIMATES_MOST: Final = 4_000
TAIL: Final = 2_000
WORDS_MOST: Final = 6


class Thinned:
    """
    Rows of a table, each kept by chance, so that at most `most` are.

    Rows are chosen by a hash of their number, not every n-th, which would show one impact only of
    an orbit with a period of n. The same rows give the same choice however they come in.
    """

    def __init__(self, kind: np.dtype, most: int) -> None:
        self._most = most
        self._count = 0
        self._below = 2**32
        self._marks = np.empty(0, np.uint32)
        self.rows = np.empty(0, kind)

    def add(self, rows: RowArray) -> None:
        numbers = np.arange(self._count, self._count + len(rows), dtype=np.uint64)
        self._count += len(rows)
        # Multiplicative hashing by the golden ratio, with the high bits mixed in.
        marks = numbers * np.uint64(0x9E3779B97F4A7C15)
        marks = ((marks ^ marks >> np.uint64(29)) * np.uint64(0xBF58476D1CE4E5B9)) >> np.uint64(32)
        kept = marks < self._below
        self.rows = np.concatenate([self.rows, rows[kept]])
        self._marks = np.concatenate([self._marks, marks[kept].astype(np.uint32)])
        while len(self.rows) > self._most:
            self._below //= 2
            kept = self._marks < self._below
            self.rows, self._marks = self.rows[kept], self._marks[kept]


@dataclasses.dataclass(frozen=True)
class Word:
    """An orbit or transient found at an impact, and the alpha then [1]."""

    impact: int
    alpha: float
    report: TransientReport


class Digest:
    """
    A run in bounded memory: impacts, retunes, exponents, orbits and transients, the last motion.

    `changes` are the first event, retunes and resets; `words` the first few and the last few
    orbits and transients; `infinite` is the reason why the last exponent is infinite; `tail` are
    the last events without a hole between them. Finite-time exponents are over `window` impacts.
    """

    def __init__(self, window: int = 1000) -> None:
        self.impacts = 0
        self.place: Place | None = None
        self.points = Thinned(POINT, POINTS_MOST)
        self.changes = Thinned(POINT, CHANGES_MOST)
        self.estimates = Thinned(ESTIMATE, ESTIMATES_MOST)
        self.words: list[Word] = []
        self.infinite = ''
        self.tail = np.empty(0, EVENT)
        self.guard = StreamGuard()
        self._lyapunov = RunningLyapunov(window)
        self._detector = TransientDetector()

    def add(self, events: EventArray) -> None:
        for piece in self.guard.split(events):
            is_first = self.place is None
            self.place = advanced(self.place, piece)
            self._add_piece(piece, self.place, is_first)

    def _add_piece(self, piece: Piece, place: Place, is_first: bool) -> None:
        events = piece.events
        self.impacts += impact_count(events)
        rows = np.empty(len(events), POINT)
        rows['impact'] = impact_numbers(events, place)
        rows['drive_time'] = drive_times(events, place)
        for name in ('phase', 'velocity', 'alpha'):
            rows[name] = events[name]
        self.points.add(rows[events['kind'] <= EventKind.STICK])
        begins = events['kind'] >= EventKind.RETUNE
        begins[0] |= is_first
        self.changes.add(rows[begins])
        whole = np.concatenate([self.tail, events]) if piece.follows else events
        self.tail = whole[-TAIL:].copy()
        # An average ends at every retune: its last value belongs in the picture as well.
        for part in np.split(events, np.flatnonzero(events['kind'] >= EventKind.RETUNE)):
            if len(part):
                self._follow(part, place)

    def _follow(self, events: EventArray, place: Place) -> None:
        self._lyapunov.update(events)
        now = self._lyapunov.report
        self.infinite = infinite_in_words(lyapunov_values(now))
        if now.impacts:
            impact = int(impact_numbers(events[-1:], place)[0])
            self.estimates.add(np.array([(
                impact, now.epoch, now.impacts, now.lambda_1, now.lambda_2, now.lambda_1_error,
                now.lambda_1_finite, now.exponent_sum, now.exact_sum)], ESTIMATE))
        for report in self._detector.update(events):
            is_transient = report.regime is Regime.TRANSIENT
            back = (int(place.event['index']) - (
                report.start if is_transient else report.index)) % 2**32
            alpha = float(events['alpha'][-1])
            # A later report of the same transient replaces the earlier one.
            last = self.words[-1].report if self.words else None
            if is_transient and last and (last.regime, last.start) == (
                    report.regime, report.start):
                alpha = self.words.pop().alpha
            self.words.append(Word(place.impact - back, alpha, report))
            if len(self.words) > 2 * WORDS_MOST:
                del self.words[WORDS_MOST]


def in_words(word: Word) -> str:
    """Return what was found as a line, with alpha and the number of the impact."""
    text = f'impact {word.impact:,}, alpha {word.alpha:g}: '
    if word.report.regime is Regime.TRANSIENT:
        known = f', {word.report.describe()}' if word.report.impacts else ''
        return f'{text}a transient begins{known}'
    text += word.report.describe_attractor()
    if word.report.regime is Regime.ORBIT and math.isfinite(word.report.multiplier):
        text += f' (multiplier {word.report.multiplier:.3f})'
    return text


def digest_of(batches: Iterable[EventArray]) -> Digest:
    """Gather what a picture of a run needs; ValueError where there is no impact in it."""
    digest = Digest()
    for events in gathered(batches):
        digest.add(events)
    if not digest.impacts:
        raise ValueError('there are no impacts in it')
    return digest


def gathered(batches: Iterable[EventArray]) -> Iterator[EventArray]:
    """Join small batches to larger ones as a run gets longer."""
    waiting: list[EventArray] = []
    count = total = 0
    for events in batches:
        waiting.append(events)
        count += len(events)
        total += len(events)
        if 1000 * count >= total:
            yield np.concatenate(waiting)
            waiting, count = [], 0
    if waiting:
        yield np.concatenate(waiting)
