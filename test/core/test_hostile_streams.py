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

"""Records of any order and value: nothing is computed across a hole, and losses are exact."""

import dataclasses
import math
from typing import Any

from hypothesis import assume, given, settings, strategies as st
import numpy as np
import pytest

from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EVENT, EventArray, EventKind, Parameters, State
from gear_rattle_ros.core.stream.guard import GUARDED, StreamGuard
from gear_rattle_ros.core.stream.lyapunov import RunningLyapunov
from gear_rattle_ros.core.stream.report_values import texts, transient_values
from gear_rattle_ros.core.stream.succession import Succession
from gear_rattle_ros.core.stream.transients import Regime, TransientDetector

TWO_PI = 2.0 * math.pi
COUNTED = (EventKind.IMPACT, EventKind.STICK)
BEGINS = (EventKind.RETUNE, EventKind.RESET)


def story(alpha: float, start: float) -> EventArray:
    """Return a run with a retune and a reset."""
    simulation = Simulation(Parameters(alpha), State(0, start, 0.0, -0.5))
    return np.concatenate([
        simulation.advance(10**6, 0.0, 60), simulation.retune(Parameters(alpha + 0.1)),
        simulation.advance(10**6, 0.0, 60), simulation.reset(1.0, -0.5, 0.5),
        simulation.advance(10**6, 0.0, 60)])


RUNS = [story(0.57, 0.3), story(1.2, 2.0), story(0.2, 5.0)]
# On an orbit from its first impacts on.
SETTLED = Simulation(Parameters(0.48, 0.1, 0.1, 0.9), State(velocity=-0.5)).advance(
    10**6, 0.0, 900)
EDGES = st.sampled_from([0, 1, 2, 2**31 - 1, 2**31, 2**31 + 1, 2**32 - 2, 2**32 - 1])
NUMBERS = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True), st.floats(-1.0, 7.0),
    st.sampled_from([0.0, -0.0, 5e-324, 1e-300, 1e300, math.nan, math.inf, -math.inf, TWO_PI]))
# What a batch that has come in may hold: `check_events` lets nothing else through.
CHECKED = {
    'phase': st.floats(0.0, TWO_PI), 'displacement': st.sampled_from([0.0, -1.0]),
    'velocity': st.one_of(st.floats(-1e300, 1e300), st.sampled_from([0.0, 1e-300, 5e-324])),
    'velocity_after': st.one_of(st.floats(-1e300, 1e300), st.sampled_from([0.0, 1e-300])),
    'alpha': st.floats(0.0, 1000.0), 'beta': st.floats(0.0, 100.0),
    'gamma': st.floats(-1000.0, 1000.0), 'restitution': st.floats(0.0, 1.0)}


@st.composite
def streams(draw: st.DrawFn, numbers: bool, unchecked: bool = False, long: bool = False
            ) -> list[EventArray]:
    """Draw batches: stretches of runs in any order, again and backwards, with fields changed."""
    pieces = []
    for _ in range(draw(st.integers(1, 5))):
        run = SETTLED if long and draw(st.booleans()) else draw(st.sampled_from(RUNS))
        first = draw(st.integers(0, len(run) - 1))
        piece = run[first:first + draw(st.integers(0, len(run) if long else 80))].copy()
        what = draw(st.sampled_from(['', '', 'drop', 'shift', 'reverse', 'repeat', 'epochs']))
        if what == 'drop' and len(piece):
            piece = np.delete(piece, draw(st.lists(st.integers(0, len(piece) - 1), max_size=5)))
        elif what == 'shift':
            for name in ('index', 'epoch', 'cycle'):
                piece[name] += np.uint32(draw(EDGES) if draw(st.booleans()) else 0)
        elif what == 'reverse':
            piece = piece[::-1].copy()
        elif what == 'repeat':
            piece = np.repeat(piece, 2)
        elif what == 'epochs':
            piece['epoch'] = np.arange(len(piece)) % 3
        pieces.append(piece)
    stream = np.concatenate(pieces)
    for _ in range(draw(st.integers(0, 4)) if len(stream) else 0):
        place = draw(st.integers(0, len(stream) - 1))
        whole = {'kind': st.integers(0, 4), 'index': EDGES, 'epoch': EDGES, 'cycle': EDGES}
        choice = {**whole, **(dict.fromkeys(CHECKED, NUMBERS) if unchecked else CHECKED)
                  } if numbers else whole
        name = draw(st.sampled_from(sorted(choice)))
        stream[name][place] = draw(choice[name])
    cuts = sorted(draw(st.lists(st.integers(0, len(stream)), max_size=6)))
    return [stream[a:b] for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True)]


@dataclasses.dataclass
class Referee:
    """A slow guard in plain integers, from the words of the design alone."""

    lost: int = 0
    gaps: int = 0
    restarts: int = 0
    last: dict[str, Any] | None = None

    def cut(self, records: EventArray) -> list[str]:
        """Return for every record why it does not follow, or nothing."""
        return [self._judge(dict(zip(GUARDED, row, strict=True)))
                for row in zip(*(records[name].tolist() for name in GUARDED), strict=True)]

    def _judge(self, now: dict[str, Any]) -> str:
        before, self.last = self.last, now
        if before is None:
            return 'start'
        index = (now['index'] - before['index'] - (now['kind'] in COUNTED)) % 2**32
        epoch = (now['epoch'] - before['epoch']) % 2**32
        turns = (now['cycle'] - before['cycle']) % 2**32
        is_earlier = turns >= 2**31 or (turns == 0 and now['phase'] < before['phase'])
        misses_release = before['kind'] == EventKind.STICK and now['kind'] in COUNTED
        if index == 0 and epoch == (now['kind'] in BEGINS) and not is_earlier and (
                not misses_release):
            return ''
        is_first = now['kind'] == EventKind.RESET and now['index'] == 0
        if index >= 2**31 or epoch >= 2**31 or is_earlier or is_first:
            self.restarts += 1
            return 'restart'
        self.gaps += 1
        self.lost += index
        return 'gap'


@settings(max_examples=100, deadline=None)
@given(streams(numbers=True, unchecked=True))
def test_the_guard_agrees_with_plain_integers(batches: list[EventArray]) -> None:
    """Every cut, every loss and every restart, whatever stands in the records."""
    guard, referee = StreamGuard(), Referee()
    for batch in batches:
        expected = referee.cut(batch)
        pieces = guard.split(batch)
        assert sum(len(piece.events) for piece in pieces) == len(batch)
        found = [reason for piece in pieces
                 for reason in (piece.reason, *[''] * (len(piece.events) - 1))]
        assert found == expected
        assert all(piece.follows == (not piece.reason) for piece in pieces)
    assert (guard.lost, guard.gaps, guard.restarts) == (
        referee.lost, referee.gaps, referee.restarts)
    assert sum(hole.lost for hole in guard.holes) == guard.lost
    assert all('\n' not in hole.describe() for hole in guard.holes)


def since_last_break(batches: list[EventArray]) -> EventArray:
    """Return the records after the last hole, by the referee."""
    stream, referee = np.concatenate(batches), Referee()
    breaks = [i for i, reason in enumerate(referee.cut(stream)) if reason]
    return stream[breaks[-1]:] if breaks else stream


def exponents(records: EventArray) -> tuple[int, float, float, float]:
    """Return impacts, exponents and exact sum by matrices and numpy's QR."""
    basis, total, exact, count = np.eye(2), np.zeros(2), 0.0, 0
    rows = [dict(zip(EVENT.names or (), row.item(), strict=True)) for row in records]
    for before, now in zip(rows[:-1], rows[1:], strict=True):
        cycles = (now['cycle'] - before['cycle'] + 2**31) % 2**32 - 2**31
        d = cycles * TWO_PI + (now['phase'] - before['phase'])
        kind, alpha, beta, gamma, r = now['kind'], *(
            before[name] for name in ('alpha', 'beta', 'gamma', 'restitution'))
        if kind in (EventKind.RESET, EventKind.RELEASE):
            basis = np.eye(2)
        else:
            growth = -math.expm1(-beta * d) / beta
            basis = np.array([[1.0, growth], [0.0, math.exp(-beta * d)]]) @ basis
            exact -= beta * d
        if kind in BEGINS:
            basis, total, exact, count = np.linalg.qr(basis)[0], np.zeros(2), 0.0, 0
        elif kind == EventKind.STICK:
            basis, total, exact, count = np.eye(2), total - np.inf, -np.inf, count + 1
        elif kind == EventKind.IMPACT:
            v, after = now['velocity'], now['velocity_after']
            drive = alpha * (beta * math.cos(now['phase']) - math.sin(now['phase'])) + gamma
            shear = (drive - beta * after + r * (drive - beta * v)) / v
            basis, triangle = np.linalg.qr(np.array([[after / v, 0.0], [shear, -r]]) @ basis)
            total += np.log(np.abs(np.diag(triangle)))
            exact += math.log(abs(after / v * r))
            count += 1
    if not count:
        return 0, math.nan, math.nan, math.nan
    return count, *(float(value) / count for value in total), exact / count


@settings(max_examples=60, deadline=None)
@given(streams(numbers=True))
def test_no_exponent_over_a_hole(batches: list[EventArray]) -> None:
    """The estimate is that of the records after the last hole alone, to the bit."""
    running, fresh = RunningLyapunov(50), RunningLyapunov(50)
    for batch in batches:
        running.update(batch)
    tail = since_last_break(batches)
    fresh.update(tail)
    report = running.report
    assert repr(report) == repr(fresh.report)
    begun = [i for i, kind in enumerate(tail['kind']) if i and kind in BEGINS]
    counted = tail[(begun[-1] if begun else 0) + 1:]
    assert report.impacts == np.count_nonzero(np.isin(counted['kind'], COUNTED))
    assert report.impacts or math.isnan(report.lambda_1)


@settings(max_examples=60, deadline=None)
@given(streams(numbers=False))
def test_exponents_agree_with_plain_matrices(batches: list[EventArray]) -> None:
    """Those of the records after the last hole, by another decomposition."""
    running = RunningLyapunov(50)
    for batch in batches:
        running.update(batch)
    tail = since_last_break(batches)
    # A longer flight leaves nothing of one direction but rounding.
    assume((np.diff(tail['cycle'].astype(np.int64)) % 2**32).max(initial=0) < 5)
    assume((tail['velocity'][1:][tail['kind'][1:] == EventKind.IMPACT] != 0.0).all())
    count, *numbers = exponents(tail)
    report = running.report
    assert report.impacts == count
    assert [report.lambda_1, report.lambda_2, report.exact_sum] == pytest.approx(
        numbers, rel=1e-6, abs=1e-6, nan_ok=True)


@pytest.mark.parametrize('velocity, after', [
    (5e-324, 0.5), (1e308, 0.5), (-0.5, 1e308), (-0.5, -1e308), (5e-324, 1e308), (1e308, 1e308),
    (-0.5, 0.0), (0.0, 0.5), (1e308, 5e-324)])
def test_an_absurd_velocity_spoils_its_epoch_only(velocity: float, after: float) -> None:
    """Finite, and so taken; after the next retune the exponents are right again."""
    events, whole, spoilt = RUNS[1].copy(), RunningLyapunov(), RunningLyapunov()
    whole.update(events[:120])
    hit = int(np.flatnonzero(events['kind'] == EventKind.IMPACT)[20])
    events['velocity'][hit], events['velocity_after'][hit] = velocity, after
    spoilt.update(events[:120])
    assert spoilt.report.impacts == whole.report.impacts > 40
    assert spoilt.report.lambda_1 == pytest.approx(whole.report.lambda_1, abs=0.2)
    assert spoilt.report.exact_sum == whole.report.exact_sum


@settings(max_examples=60, deadline=None)
@given(streams(numbers=True, long=True))
def test_no_orbit_over_a_hole(batches: list[EventArray]) -> None:
    """Reports follow from the records after the last hole; what they state of an orbit fits."""
    detector, fresh = TransientDetector(), TransientDetector()
    said = [report for batch in batches for report in detector.update(batch)]
    fresh.update(since_last_break(batches))
    assert texts(transient_values(detector.report)) == texts(transient_values(fresh.report))
    assert detector.impacts == fresh.impacts
    for report in said:
        assert '\n' not in report.describe()
        if report.regime is Regime.ORBIT:
            assert report.lifetime is not None and report.lifetime >= 0
            assert report.orbit is not None and report.period_impacts >= 1 <= report.period_drive
            assert not report.multiplier < 0.0
            assert np.isfinite(report.orbit.points).all()


@settings(max_examples=60, deadline=None)
@given(streams(numbers=True))
def test_a_contradiction_is_one_line(batches: list[EventArray]) -> None:
    """Rebuilding what cannot have been ends with the first record that does not follow."""
    stream = np.concatenate(batches)
    # So long a flight without an impact takes as long to rebuild as it took to simulate.
    far = np.diff(stream['cycle'].astype(np.int64)) % 2**32 > 10**4
    stream = stream[:int(np.argmax([*far, True])) + 1]
    check = Succession()
    for start in range(0, len(stream), 50):
        batch = stream[start:start + 50]
        found = check.take(batch)
        if found is not None:
            assert '\n' not in found.what and -1 <= found.place < len(batch)
            break
    else:
        assert check.events == len(stream)
    assert check.kicked <= check.impacts <= check.events <= len(stream)
