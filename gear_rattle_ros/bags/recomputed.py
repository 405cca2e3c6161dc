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

"""Recompute the exponents and transients of a bag, and compare them with those recorded live."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
import dataclasses
import re
from typing import Any, Final

import numpy as np

from .cdr import Named
from ..core.model import EventArray, EventKind
from ..core.stream.lyapunov import LyapunovReport, RunningLyapunov
from ..core.stream.report_values import hop_values, lyapunov_values, texts, transient_values
from ..core.stream.transients import TransientDetector

TOLERANCE: Final = 1e-3
WINDOW: Final = 1000
# Rounding of the mean force of the walls, relative to all that enters it [1].
ROUNDING: Final = 1e-9
# Of an orbit in a report, on which versions and libraries of linear algebra agree [rad, 1].
NEWTON: Final = 1e-9
_FLOAT: Final = re.compile(r'[-+]?(?:\d+\.\d*(?:e[-+]?\d+)?|\d+e[-+]?\d+)')
# These go on across retunes, and so rest on all events since the last reset.
CROSSING: Final = ('lambda_1_finite', 'finite_retunes', 'impulse_balance', 'exact_impulse_balance')
# Averages that a reader may have begun where it joined; more begin only in damaged bags.
_CANDIDATES: Final = 16


@dataclasses.dataclass
class Stretch:
    """The present stretch without a hole."""

    # The number of the impact that began the present epoch, and how it began.
    start: int = 0
    begun_by: int | None = None
    # Whether there was a reset in the stretch.
    is_whole: bool = False

    def begin(self, first: Any) -> None:
        """Begin a stretch; only a reset makes what was before its first record known."""
        self.start = int(first['index'])
        self.is_whole = bool(first['kind'] == EventKind.RESET)
        self.begun_by = EventKind.RESET if self.is_whole else None

    def take(self, events: EventArray) -> None:
        begins = events[events['kind'] >= EventKind.RETUNE]
        if len(begins):
            self.start, self.begun_by = int(begins[-1]['index']), int(begins[-1]['kind'])
            self.is_whole |= bool(np.any(begins['kind'] == EventKind.RESET))


class Recomputed:
    """Recorded reports, which wait for their batches."""

    def __init__(self) -> None:
        # Reproduced bit for bit; resting on what is not in the bag; the first that is wrong.
        self.found = self.beyond = 0
        self.fault = ''
        self._pending: defaultdict[Any, list[Any]] = defaultdict(list)
        self._joins: set[Any] = set()

    def finish(self) -> None:
        """Count the reports whose batches are not in the bag."""
        self.beyond += sum(len(reports) for reports in self._pending.values())
        self._pending.clear()


class Exponents(Recomputed):
    """Recompute every estimate of the Lyapunov node."""

    # Its average begins at a retune or reset, where the node joined, or after a hole; the last
    # two are at the first record of a batch, which the estimate itself names by index and epoch.
    def __init__(self, reports: Sequence[Named]) -> None:
        super().__init__()
        self._window = WINDOW
        for report in reports:
            values = report.values
            try:
                key = tuple(int(values[name]) for name in ('epoch', 'index', 'impacts'))
                self._window = max(int(values['window']), 1)
            except (KeyError, ValueError, OverflowError):
                self.fault = self.fault or (f'an estimate with the stamp {report.stamp} ns has no '
                                            'epoch, index, impacts or window')
                continue
            self._pending[report.stamp, key[0], key[1]].append(report)
            self._joins.add((key[0], (key[1] - key[2]) % 2**32))
        self._is_proven = False
        self._stretch, self._running = Stretch(), RunningLyapunov(self._window)
        self._candidates: list[RunningLyapunov] = []
        # The largest difference of the mean force of the walls from what it must be [1].
        self.imbalance = 0.0

    def take(self, events: EventArray, stamp: int, is_first: bool) -> None:
        """Take the next batch; `is_first` if it begins a stretch without a hole."""
        first, last = events[0], events[-1]
        if is_first:
            self._is_proven, self._candidates = False, []
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
        # The impulse balance is exact up to the rounding at every impact.
        apart = abs(now.impulse_balance - now.exact_impulse_balance)
        time = now.impacts * now.mean_flight_time
        if not apart >= 0.0 or not time > 1.0:
            return
        self.imbalance = max(self.imbalance, apart)
        scale = 1.0 + float(last['alpha']) + abs(float(last['gamma']))
        if apart > ROUNDING * scale * (1.0 + now.impacts / time) and not self.fault:
            self.fault = (
                f'the mean force of the walls up to impact {now.index}, epoch {now.epoch}, is '
                f'{now.impulse_balance!r}, expected {now.exact_impulse_balance!r}')

    def _compare(self, report: Named) -> None:
        expected = lyapunov_values(self._running.report)
        wrong = _difference(report.values, expected)
        within = {name: value for name, value in expected.items() if name not in CROSSING}
        is_found = not wrong or (
            not self._stretch.is_whole and not _difference(report.values, within))
        for candidate in [] if is_found else self._candidates:
            if not _difference(report.values, lyapunov_values(candidate.report)):
                self._running, is_found = candidate, True
                break
        if is_found:
            self.found += 1
            self._is_proven, self._candidates = True, []
        elif not self._is_proven and self._is_beyond(expected, report):
            self.beyond += 1
        elif not self.fault:
            self.fault = (
                f'the estimate at impact {report.values["index"]:.0f}, epoch '
                f'{report.values["epoch"]:.0f}: {wrong}')

    def _is_beyond(self, expected: Mapping[str, float], report: Named) -> bool:
        # The tangent vectors depend on earlier impacts, unless a reset has made them anew.
        stretch = self._stretch
        if stretch.begun_by is None:
            return report.values['impacts'] >= expected['impacts']
        start = (int(report.values['index']) - int(report.values['impacts'])) % 2**32
        return start == stretch.start and stretch.begun_by == EventKind.RETUNE


class Transients(Recomputed):
    """Recompute every report of the transient node, and its counts of hops."""

    # The topic is latched, one deep: of reports in quick succession only the last may have been
    # published, so the recorded ones are looked for among the computed ones.
    def __init__(self, reports: Sequence[Named], counts: Sequence[Named]) -> None:
        super().__init__()
        self.hops = 0  # Counts that were reproduced.
        for count in counts:
            self._pending[count.stamp].append(texts(count.values))
        self._tolerance = TOLERANCE
        for report in reports:
            values = dict(report.values)
            try:
                self._tolerance = float(values.pop('tolerance', self._tolerance))
            except ValueError:
                self.fault = f'tolerance = {report.values["tolerance"]!r} is not a number'
            # The letter follows from the orbit; bags of before have none.
            values.pop('letter', None)
            self._pending[report.stamp].append(values)
            self._joins.add(values.get('start'))
        self._stamp: int | None = None
        # The epoch of the reset from which on everything is known.
        self._known_from: int | None = None
        self._tolerance = min(max(self._tolerance, 1e-9), 0.1)
        self._detectors = [TransientDetector(self._tolerance)]

    def take(self, events: EventArray, stamp: int, is_first: bool) -> None:
        first = events[0]
        if stamp != self._stamp:
            self._end_stamp()
            self._stamp = stamp
        if is_first:
            self._detectors = self._detectors[:1]
            self._known_from = None
        if self._known_from is None:
            resets = events['epoch'][events['kind'] == EventKind.RESET]
            self._known_from = int(resets[0]) if len(resets) else None
        changes = [change for detector in self._detectors for change in detector.update(events)]
        if first['kind'] != EventKind.RESET and str(first['index']) in self._joins:
            # A node may have joined here.
            self._detectors = [*self._detectors, TransientDetector(self._tolerance)][-_CANDIDATES:]
            changes += self._detectors[-1].update(events)
        if pending := self._pending.get(stamp):
            found = [texts(transient_values(change)) for change in changes] + [
                texts(hop_values(each.hops, each.index)) for each in self._detectors
                if each.hops.known]
            # Batches may share a stamp: what is not found here is looked for in the next.
            left = [report for report in pending if not any(
                _agree(report, one) for one in found)]
            reports = sum('state' in report for report in pending) - sum(
                'state' in report for report in left)
            self._pending[stamp] = left
            self.found += reports
            self.hops += len(pending) - len(left) - reports

    def finish(self) -> None:
        """Judge the reports that are left."""
        self._end_stamp()
        super().finish()

    def _end_stamp(self) -> None:
        for report in self._pending.pop(self._stamp, ()):
            # If it began before the bag or in a hole, the node may have seen more of it.
            epoch = report.get('epoch') or ''
            if self._known_from is None or epoch.isdigit() and int(epoch) < self._known_from:
                self.beyond += 1
            elif not self.fault:
                self.fault = (
                    f'the report {report.get("state", "hops")!r} at impact {report.get("index")}, '
                    f'epoch {report.get("epoch")}, does not follow from the events: {report}')


def _agree(report: Mapping[str, str], expected: Mapping[str, str]) -> bool:
    def agree(text: str, other: str) -> bool:
        numbers, others = (np.array(_FLOAT.findall(each), np.float64) for each in (text, other))
        return _FLOAT.split(text) == _FLOAT.split(other) and bool(
            np.allclose(numbers, others, rtol=NEWTON, atol=NEWTON))

    return report.keys() == expected.keys() and all(
        text == expected[name] or agree(text, expected[name]) for name, text in report.items())


def _difference(found: Mapping[str, float], expected: Mapping[str, float]) -> str:
    for name, value in expected.items():
        value = float(value)
        there = found.get(name)
        if there is None:
            return f'{name} is missing: verify it with the version that recorded it'
        if there != value and not (there != there and value != value):
            return f'{name} is {there!r}, expected {value!r}'
    return ''
