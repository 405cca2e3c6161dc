"""Exponents and transients of a bag computed anew, and held against what was recorded live."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
import dataclasses
from typing import Any, Final

import numpy as np

from .small_messages import Named
from ..core.model import EventArray, EventKind
from ..core.stream.lyapunov import LyapunovReport, RunningLyapunov
from ..core.stream.report_values import lyapunov_values, texts, transient_values
from ..core.stream.transients import TransientDetector

TOLERANCE: Final = 1e-3
WINDOW: Final = 1000
# Of the mean force of the walls, beside all that enters it [1].
ROUNDING: Final = 1e-9
# What crosses retunes, and so rests on all since the last reset.
CROSSING: Final = ('lambda_1_finite', 'finite_retunes', 'impulse_balance', 'exact_impulse_balance')
# Averages kept that a reader may have begun where it came in; more begin only in damaged bags.
_CANDIDATES: Final = 16


@dataclasses.dataclass
class Tally:
    """
    How many reports were found again, bit for bit, and the first that was not.

    `beyond` counts reports that rest on what is not in the bag.
    """

    found: int = 0
    beyond: int = 0
    fault: str = ''


class Stretch:
    """Where the present stretch without a hole, and the present epoch in it, began."""

    def __init__(self) -> None:
        # The number, in the stretch, of the impact that began the epoch, and how it began.
        self.epoch = -1
        self.start = 0
        self.begun_by: int | None = None
        # Whether there was a reset in it.
        self.is_whole = False

    def begin(self, first: Any) -> None:
        """Begin a stretch; what was before its first record is not known, but at a reset."""
        self.epoch, self.start = int(first['epoch']), int(first['index'])
        self.is_whole = bool(first['kind'] == EventKind.RESET)
        self.begun_by = EventKind.RESET if self.is_whole else None

    def take(self, events: EventArray) -> None:
        """Follow the epochs."""
        begins = events[events['kind'] >= EventKind.RETUNE]
        if len(begins):
            last = begins[-1]
            self.epoch, self.start = int(last['epoch']), int(last['index'])
            self.begun_by = int(last['kind'])
            self.is_whole |= bool(np.any(begins['kind'] == EventKind.RESET))


class Recomputed:
    """What both have: the tally, and the reports that wait for their batches."""

    def __init__(self) -> None:
        self.tally = Tally()
        self._pending: defaultdict[Any, list[Any]] = defaultdict(list)
        self._joins: set[Any] = set()

    def finish(self) -> Tally:
        """Count the reports whose batches are not in the bag."""
        self.tally.beyond += sum(len(reports) for reports in self._pending.values())
        self._pending.clear()
        return self.tally


class Exponents(Recomputed):
    """
    Recompute every estimate of the Lyapunov node.

    Its average begins at a retune or reset, where the node came in, or behind a hole; the last two
    at the first record of a batch, which the estimate itself names by index and epoch.
    """

    def __init__(self, reports: Sequence[Named]) -> None:
        super().__init__()
        self._window = WINDOW
        for report in reports:
            values = report.values
            try:
                key = tuple(int(values[name]) for name in ('epoch', 'index', 'impacts'))
                self._window = max(int(values['window']), 1)
            except (KeyError, ValueError, OverflowError):
                self.tally.fault = self.tally.fault or (
                    f'an estimate with the stamp {report.stamp} ns has no epoch, index, impacts '
                    'or window')
                continue
            self._pending[report.stamp, key[0], key[1]].append(report)
            self._joins.add((key[0], (key[1] - key[2]) % 2**32))
        self._is_proven = False
        self._stretch = Stretch()
        self._running = RunningLyapunov(self._window)
        self._candidates: list[RunningLyapunov] = []
        # How far the mean force of the walls was from what it must be, at the most [1].
        self.imbalance = 0.0

    def take(self, events: EventArray, stamp: int, is_first: bool) -> None:
        """Take the next batch [stamp in ns]; is_first where a stretch without a hole begins."""
        first, last = events[0], events[-1]
        if is_first:
            self._is_proven = False
            self._candidates = []
            self._stretch.begin(first)
        for candidate in self._candidates:
            candidate.update(events)
        if (int(first['epoch']), int(first['index'])) in self._joins:
            fresh = RunningLyapunov(self._window)
            fresh.update(events)
            self._candidates = [*self._candidates, fresh][-_CANDIDATES:]
        self._running.update(events)
        self._weigh(self._running.report, last)
        self._stretch.take(events)
        for report in self._pending.pop((stamp, int(last['epoch']), int(last['index'])), ()):
            self._compare(report)

    def _weigh(self, now: LyapunovReport, last: Any) -> None:
        # The impulse balance is exact, to the rounding of every impact.
        apart = abs(now.impulse_balance - now.exact_impulse_balance)
        time = now.impacts * now.mean_flight_time
        if not apart >= 0.0 or not time > 1.0:
            return
        self.imbalance = max(self.imbalance, apart)
        scale = 1.0 + float(last['alpha']) + abs(float(last['gamma']))
        if apart > ROUNDING * scale * (1.0 + now.impacts / time) and not self.tally.fault:
            self.tally.fault = (
                f'the mean force of the walls up to impact {now.index}, epoch {now.epoch}, is '
                f'{now.impulse_balance!r}, expected {now.exact_impulse_balance!r}')

    def _compare(self, report: Named) -> None:
        expected = lyapunov_values(self._running.report)
        wrong = _difference(report.values, expected)
        within = {name: value for name, value in expected.items() if name not in CROSSING}
        if not wrong or not self._stretch.is_whole and not _difference(report.values, within):
            self._accept()
            return
        for candidate in self._candidates:
            if not _difference(report.values, lyapunov_values(candidate.report)):
                self._running = candidate
                self._accept()
                return
        start = (int(report.values['index']) - int(report.values['impacts'])) % 2**32
        if not self._is_proven and self._is_beyond(start, expected, report):
            self.tally.beyond += 1
        elif not self.tally.fault:
            self.tally.fault = (
                f'the estimate at impact {report.values["index"]:.0f}, epoch '
                f'{report.values["epoch"]:.0f}: {wrong}')

    def _accept(self) -> None:
        self.tally.found += 1
        self._is_proven = True
        self._candidates = []

    def _is_beyond(self, start: int, expected: Mapping[str, float], report: Named) -> bool:
        # The tangent vectors come from before, unless all was forgotten at a reset.
        stretch = self._stretch
        if stretch.begun_by is None:
            return report.values['impacts'] >= expected['impacts']
        return start == stretch.start and stretch.begun_by == EventKind.RETUNE


class Transients(Recomputed):
    """
    Recompute every report of the transient node.

    The topic is latched, one deep: of reports in quick succession the last may be all that was
    published, so those recorded are looked for among those computed.
    """

    def __init__(self, reports: Sequence[Named]) -> None:
        super().__init__()
        self._tolerance = TOLERANCE
        for report in reports:
            values = dict(report.values)
            try:
                self._tolerance = float(values.pop('tolerance', self._tolerance))
            except ValueError:
                self.tally.fault = f'tolerance = {report.values["tolerance"]!r} is no number'
            self._pending[report.stamp].append(values)
            self._joins.add(values.get('start'))
        # All is known from a reset in this epoch on; None where there was none.
        self._known_from: int | None = None
        self._detectors = [self._fresh()]

    def take(self, events: EventArray, stamp: int, is_first: bool) -> None:
        """Take the next batch, as `Exponents.take` does."""
        first = events[0]
        if is_first:
            self._detectors = self._detectors[:1]
            self._known_from = None
        if self._known_from is None:
            resets = events['epoch'][events['kind'] == EventKind.RESET]
            self._known_from = int(resets[0]) if len(resets) else None
        changes = [change for detector in self._detectors for change in detector.update(events)]
        if first['kind'] != EventKind.RESET and str(first['index']) in self._joins:
            # A node may have come in here.
            self._detectors = [*self._detectors, self._fresh()][-_CANDIDATES:]
            changes += self._detectors[-1].update(events)
        pending = self._pending.get(stamp)
        if pending:
            found = [texts(transient_values(change)) for change in changes]
            # Several batches may have a stamp: what is not found here is looked for in the next.
            self._pending[stamp] = [report for report in pending if report not in found]
            self.tally.found += len(pending) - len(self._pending[stamp])

    def end_stamp(self, stamp: int) -> None:
        """Judge what was not found in the batches of a stamp."""
        for report in self._pending.pop(stamp, ()):
            # What began before the bag or in a hole: the node may have seen more of it.
            if self._known_from is None or not self._is_known(report.get('epoch')):
                self.tally.beyond += 1
            elif not self.tally.fault:
                self.tally.fault = (
                    f'the report {report.get("state")!r} at impact {report.get("index")}, epoch '
                    f'{report.get("epoch")}, is not what the events say: {report}')

    def _is_known(self, epoch: str | None) -> bool:
        return not epoch or not epoch.isdigit() or int(epoch) >= (self._known_from or 0)

    def _fresh(self) -> TransientDetector:
        return TransientDetector(min(max(self._tolerance, 1e-9), 0.1))


def _difference(found: Mapping[str, float], expected: Mapping[str, float]) -> str:
    for name, value in expected.items():
        value = float(value)
        there = found.get(name)
        if there is None:
            return f'{name} is missing: verify it with the version that recorded it'
        if there != value and not (there != there and value != value):
            return f'{name} is {there!r}, expected {value!r}'
    return ''
