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

"""Orbits, rest and lifetimes against an independent definition and the orbits' own Jacobians."""

import functools
import math

from hypothesis import given, strategies as st
import numpy as np
import pytest
from test_tangent import jacobian_of_equation_9

from gear_rattle_ros.core.flight.elementary import TWO_PI
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EventArray, EventKind, Parameters, State, Wall
from gear_rattle_ros.core.stream.lyapunov import RunningLyapunov
from gear_rattle_ros.core.stream.report_values import texts, transient_values
from gear_rattle_ros.core.stream.transients import Regime, TransientDetector, TransientReport

FAR = 10**8
TOLERANCE = 1e-3


def random_state(rng: np.random.Generator) -> State:
    """Return an initial condition on the plane s = 0."""
    return State(0, float(rng.uniform(0.0, TWO_PI)), 0.0, float(rng.uniform(-1.0, 1.0)))


@functools.cache
def stories(alpha: float, count: int, length: int, seed: int = 1) -> list[EventArray]:
    """Return the first events from random initial conditions."""
    rng = np.random.default_rng(seed)
    return [Simulation(Parameters(alpha), random_state(rng)).advance(FAR, 0.0, length)
            for _ in range(count)]


def detect(events: EventArray) -> TransientReport:
    """Return the last report on a stream."""
    detector = TransientDetector(TOLERANCE)
    detector.update(events)
    return detector.report


def bits(reports: list[TransientReport]) -> list[dict[str, str]]:
    """Return reports with all their digits."""
    return [texts(transient_values(report)) for report in reports]


def name_at_the_end(events: EventArray, impacts: int) -> str:
    """Return the name of the orbit that a trajectory has long been on."""
    hits = events[events['kind'] <= EventKind.STICK][-impacts:]
    # Of its points the one with the least (wall, phase); the upper wall comes first.
    wall, phase, velocity = min(
        (-float(hit['displacement']), float(hit['phase']), float(hit['velocity']))
        for hit in hits)
    hits = events[events['kind'] <= EventKind.STICK]
    turns = int(hits['cycle'][-1] - hits['cycle'][-1 - impacts])
    return f'orbit-{impacts}-{turns}-{"UL"[int(wall)]}{phase:.4f}{velocity:+.4f}'


def apart(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return distances of impacts (side, phase, velocity) in rows."""
    turn = np.abs(a[:, 1] - b[:, 1])
    distance = np.maximum(np.minimum(turn, TWO_PI - turn), np.abs(a[:, 2:] - b[:, 2:]).max(1))
    return np.where(a[:, 0] == b[:, 0], distance, np.inf)


def section(events: EventArray) -> np.ndarray:
    """Return side, phase and velocity of the impacts."""
    hits = events[events['kind'] <= EventKind.STICK]
    return np.column_stack([hits['displacement'] == 0.0, hits['phase'], hits['velocity']])


@pytest.mark.parametrize('alpha, orbits', [
    (0.48, {(2, 1), (3, 1)}), (0.52, {(2, 1), (3, 1)}), (1.244, {(4, 1)})])
def test_orbits_of_the_paper(alpha: float, orbits: set[tuple[int, int]]) -> None:
    """A: 3 impacts a period; B: 2, also where it is approached slowly; 4 after the crisis."""
    length = 60000 if alpha > 1 else 5000
    found = [detect(events) for events in stories(alpha, 24, length)]
    settled = [report for report in found if report.regime is Regime.ORBIT]
    assert len(settled) >= (8 if alpha > 1 else 24)
    assert {(r.period_impacts, r.period_drive) for r in settled} == orbits


@pytest.mark.parametrize('alpha', [0.505, 0.51, 0.515, 0.518, 0.521])
def test_a_period_is_never_a_multiple_of_the_true_one(alpha: float) -> None:
    """The impacts of a long time after do not recur any earlier."""
    for events in stories(alpha, 20, 12000):
        report = detect(events)
        if report.regime is not Regime.ORBIT:
            continue
        tail = section(events)[-600:]
        recurring = [q for q in range(1, report.period_impacts + 1)
                     if apart(tail[q:], tail[:-q]).max() < TOLERANCE]
        assert recurring[:1] == [report.period_impacts]


@pytest.mark.parametrize('alpha, length', [(0.48, 3000), (0.52, 4000), (1.244, 40000)])
def test_lifetimes(alpha: float, length: int) -> None:
    """The first impact from which on all lie within the tolerance of the orbit."""
    compared = 0
    for events in stories(alpha, 12, length):
        report = detect(events)
        if report.regime is not Regime.ORBIT:
            continue
        impacts, q = section(events), report.period_impacts
        assert len(impacts) == events['index'][-1]
        # The orbit as it is at the end, laid along all impacts.
        orbit = impacts[-q:]
        along = orbit[np.arange(-len(impacts), 0) % q]
        hits = events[events['kind'] <= EventKind.STICK]
        times = np.diff(hits['cycle'] * TWO_PI + hits['phase'], prepend=np.nan)
        late = np.abs(times - times[-q:][np.arange(-len(times), 0) % q])
        for tolerance, bound in ((1.001 * TOLERANCE, max), (0.999 * TOLERANCE, min)):
            outside = np.flatnonzero(~(np.maximum(apart(impacts, along), late) <= tolerance))
            limit = int(outside[-1]) + 2
            assert report.lifetime is not None
            assert bound(report.lifetime, limit) == report.lifetime
        compared += 1
    assert compared >= 3


@pytest.mark.parametrize('alpha, impacts', [(0.48, 2), (0.48, 3), (0.52, 2), (1.244, 4)])
def test_points_and_multiplier_of_an_orbit(alpha: float, impacts: int) -> None:
    """The points recur at the end; the multiplier is an eigenvalue of their Jacobians."""
    length = 40000 if alpha > 1 else 5000
    seen = 0
    for events in stories(alpha, 24, length):
        report = detect(events)
        if report.period_impacts != impacts:
            continue
        hits = events[-impacts - 1:]
        product = np.eye(2)
        for before, after in zip(hits[:-1], hits[1:], strict=True):
            product = jacobian_of_equation_9(before, after) @ product
        modulus = float(np.abs(np.linalg.eigvals(product)).max())
        # Exact: the orbit is refined, however far the approach was when it was recognised.
        assert report.multiplier == pytest.approx(modulus, rel=1e-6)
        assert report.orbit is not None
        assert np.prod(report.orbit.multipliers).real == pytest.approx(
            0.9 ** (2 * impacts) * math.exp(-0.1 * TWO_PI * report.period_drive), rel=1e-9)
        points = list(zip(report.orbit.walls, *report.orbit.points.T, strict=True))
        for wall, phase, velocity in points:
            nearest = min(abs(hit['phase'] - phase) + abs(hit['velocity'] - velocity)
                          for hit in events[-impacts:] if hit['displacement'] == -float(wall))
            assert nearest < 1e-9
        assert points[0][:2] == min(point[:2] for point in points)
        assert report.key == name_at_the_end(events, impacts)
        seen += 1
    assert seen >= 3


def test_a_late_joiner_sees_the_same_orbit() -> None:
    """On an orbit from the beginning on, nothing of the approach is needed."""
    for alpha in (0.47, 0.48, 0.49, 0.5, 1.244, 1.25):
        for events in stories(alpha, 6, 40000 if alpha > 1 else 20000):
            report = detect(events)
            late = detect(events[-2000:])
            if report.regime is Regime.ORBIT and report.lifetime < len(events) - 4000:
                assert late.period_impacts == report.period_impacts
                assert late.start == int(events['index'][-2000])
                assert late.lifetime <= 2
                assert late.multiplier == pytest.approx(report.multiplier, rel=1e-9)
                assert late.key == report.key


@functools.cache
def story_with_everything() -> EventArray:
    """Return a stream that settles, is retuned, kicked, reset, sticks and rests permanently."""
    simulation = Simulation(Parameters(0.48), State(0, 1.0, 0.0, -0.6))
    pieces = [simulation.advance(FAR, 0.0, 900), simulation.retune(Parameters(1.244)),
              simulation.advance(FAR, 0.0, 9000), simulation.retune(Parameters(0.48)),
              simulation.advance(FAR, 0.0, 900)]
    simulation.noise = 0.5
    pieces += [simulation.advance(FAR, 0.0, 3)]
    simulation.noise = 0.0
    pieces += [simulation.advance(FAR, 0.0, 900), simulation.reset(5.0, 0.0, 0.02),
               simulation.advance(FAR, 0.0, 900), simulation.retune(Parameters(0.1, 0.1, 0.5)),
               simulation.advance(simulation.state.cycle + 500, 0.0, 3000)]
    assert simulation.is_permanently_at_rest
    return np.concatenate(pieces)


def test_a_whole_story() -> None:
    """Orbit, transient by retune, kick and reset, and rest, each reported once and in order."""
    events = story_with_everything()
    detector = TransientDetector(TOLERANCE)
    changes = detector.update(events)
    regimes = [change.regime for change in changes]
    assert regimes[0] is Regime.TRANSIENT and regimes[-1] is Regime.REST
    assert all(a is not b or a is Regime.TRANSIENT
               for a, b in zip(regimes[:-1], regimes[1:], strict=True))
    assert regimes.count(Regime.ORBIT) >= 3
    assert [change.epoch for change in changes] == sorted(change.epoch for change in changes)
    starts = {change.start for change in changes}
    begun = events[np.isin(events['kind'], (EventKind.RETUNE, EventKind.RESET))]
    assert set(begun['index'].tolist()) <= starts
    # One more transient than those: the kick, noticed within the next impacts.
    noisy = np.flatnonzero(
        (events['kind'] == EventKind.IMPACT)
        & (events['velocity_after'] != -events['velocity'] * 0.9))
    kicked = starts - set(begun['index'].tolist()) - {0}
    assert len(kicked) >= 1
    first = int(events['index'][noisy[0]])
    assert all(first <= index <= first + 10 for index in kicked)
    rest = changes[-1]
    assert rest.lifetime == int(events['index'][-1]) - int(begun['index'][-1])


@given(st.lists(st.integers(0, 10**5), max_size=12))
def test_cuts_change_no_bit(cuts: list[int]) -> None:
    """Batches of any size give the same changes."""
    events = story_with_everything()
    whole, pieces = TransientDetector(TOLERANCE), TransientDetector(TOLERANCE)
    expected = whole.update(events)
    bounds = [0, *sorted(cut % len(events) for cut in cuts), len(events)]
    found = [change for start, stop in zip(bounds[:-1], bounds[1:], strict=True)
             for change in pieces.update(events[start:stop])]
    assert bits(found) == bits(expected)
    assert bits([pieces.report]) == bits([whole.report])


def test_chatter_is_not_an_orbit() -> None:
    """Thousands of ever weaker impacts a little apart recur with everything but the drive."""
    for restitution in (0.9, 0.99, 0.999):
        simulation = Simulation(
            Parameters(0.0, 0.0, 0.3, restitution), State(0, 0.0, 0.0, 0.05))
        events = simulation.advance(10**4, 0.0, 50000)
        detector = TransientDetector(TOLERANCE)
        changes = detector.update(events)
        assert {change.regime for change in changes[:-1]} == {Regime.TRANSIENT}
        assert changes[-1].regime is Regime.REST
        assert changes[-1].lifetime == int(events['index'][-1])


def test_chaos_is_not_an_orbit() -> None:
    """Attractor B at 0.57 in 3e5 impacts, and the chaos before the crisis in 1e5."""
    for alpha, count in ((0.57, 300_000), (1.2, 100_000)):
        for events in stories(alpha, 20, 4000):
            if detect(events).regime is Regime.TRANSIENT:
                break
        start = events[-1]
        simulation = Simulation(Parameters(alpha), State(
            0, *(float(start[name]) for name in ('phase', 'displacement', 'velocity_after'))))
        detector = TransientDetector(TOLERANCE)
        changes = detector.update(simulation.advance(FAR, 0.0, count))
        assert {change.regime for change in changes} == {Regime.TRANSIENT}
        # A report comes whenever the number of impacts has doubled.
        assert [change.impacts for change in changes[1:]] == [
            1000 * 2**k for k in range(len(changes) - 1)]
        assert len(changes) == 1 + math.ceil(math.log2(count / 1000))


def test_nothing_is_recognised_across_a_hole() -> None:
    """A hole begins a new transient, and the report is then that of a late joiner."""
    events = next(e for e in stories(0.48, 24, 5000) if detect(e).lifetime < 300)
    detector, late = TransientDetector(TOLERANCE), TransientDetector(TOLERANCE)
    changes = detector.update(events[:2000]) + detector.update(events[2005:])
    assert [change.regime for change in changes] == [
        Regime.TRANSIENT, Regime.ORBIT, Regime.TRANSIENT, Regime.ORBIT]
    assert detector.guard.lost == 5
    assert bits(late.update(events[2005:])) == bits(changes[2:])


def test_rest_from_the_beginning_has_no_lifetime() -> None:
    """A gear that is never released is at rest before its first impact."""
    events = Simulation(Parameters(0.1, 0.1, 0.5), State(0, 1.0, 0.0, 0.0)).advance(9, 0.0, 9)
    report = detect(events)
    assert (report.regime, report.lifetime) == (Regime.REST, 0)
    assert report.describe() == 'permanently at rest on a wall, after 0 impacts'


@pytest.mark.parametrize('restitution, alpha, gamma, impacts', [
    (0.0, 0.3, 0.1, 1), (0.0, 0.2, 0.2, 1), (0.05, 0.3, 0.1, 8), (0.05, 0.5, 0.05, 9)])
def test_an_orbit_that_sticks(
        restitution: float, alpha: float, gamma: float, impacts: int) -> None:
    """Little restitution: chatter, rest and release in every period; multiplier 0."""
    events = Simulation(Parameters(alpha, 0.1, gamma, restitution), State(
        0, 0.3, -0.5, 0.1)).advance(FAR, 0.0, 3000)
    assert EventKind.STICK in events['kind'][-200:]
    report = detect(events)
    assert (report.regime, report.period_impacts) == (Regime.ORBIT, impacts)
    assert report.multiplier == 0.0


@pytest.mark.parametrize('tolerance', [0.0, 1.0, -1e-3, math.nan])
def test_impossible_tolerances_are_refused(tolerance: float) -> None:
    """A ValueError names it."""
    with pytest.raises(ValueError, match='^tolerance = '):
        TransientDetector(tolerance)


def test_the_whole_round_of_chatter_is_an_orbit() -> None:
    """68 impacts a period at r = 0.7: what follows a release is always the same."""
    events = Simulation(Parameters(5.0, 0.0159, 2.533, 0.7), State(velocity=-1.0)).advance(
        FAR, 0.0, 3000)
    hits = events[events['kind'] <= EventKind.STICK]
    sticks = np.flatnonzero(hits['kind'] == EventKind.STICK)
    assert set(np.diff(sticks)) == {68}
    detector = TransientDetector(TOLERANCE)
    assert [change.regime for change in detector.update(events)] == [
        Regime.TRANSIENT, Regime.ORBIT]
    report = detector.report
    assert (report.period_impacts, report.period_drive) == (68, 1)
    assert report.key == name_at_the_end(events, 68)
    assert report.multiplier == 0.0 and report.orbit is not None
    assert report.orbit.sticks == Wall.UPPER
    # From the first release on all is the same; the flight to the impact after it is counted
    # from the stick itself. The sticks are the same from the second one on.
    assert report.lifetime == sticks[0] + 3 and report.index == sticks[3] + 1
    assert 'sticks in every period' in report.describe()


@pytest.mark.parametrize('parameters', [
    Parameters(5.0, 0.0159, 2.533, 0.9), Parameters(5.0, 0.0159, 2.533, 0.8),
    Parameters(3.0, 0.1, -1.2, 0.7), Parameters(3.0, 0.1, 1.2, 0.5)])
def test_orbits_that_stick_repeat_whatever_their_length(parameters: Parameters) -> None:
    """The shortest lag at which all impacts recur, found by trying them all."""
    events = Simulation(parameters, State(velocity=-1.0)).advance(FAR, 0.0, 5000)
    report = detect(events)
    tail = section(events)[-2000:]
    lag = next(q for q in range(1, 1000) if apart(tail[q:], tail[:-q]).max() < 1e-9)
    assert EventKind.STICK in events['kind'][-1000:]
    assert (report.regime, report.period_impacts, report.multiplier) == (Regime.ORBIT, lag, 0.0)


@pytest.mark.parametrize('noise, seed', [(1e-6, 1), (1e-6, 2), (1e-5, 1), (1e-5, 2)])
def test_an_orbit_is_recognised_through_noise(noise: float, seed: int) -> None:
    """B at 0.48, once and for all, with the spread of its impacts; the orbit is that without."""
    simulation = Simulation(Parameters(0.48), State(velocity=-1.0), noise=noise, seed=seed)
    events = simulation.advance(FAR, 0.0, 30_000)
    detector = TransientDetector(TOLERANCE)
    changes = detector.update(events)
    assert [change.regime for change in changes] == [Regime.TRANSIENT, Regime.ORBIT]
    report = detector.report
    quiet = Simulation(Parameters(0.48), State(velocity=-1.0)).advance(FAR, 0.0, 3000)
    assert report.key == detect(quiet).key == name_at_the_end(quiet, 2)
    assert report.lifetime == pytest.approx(detect(quiet).lifetime, abs=6)
    # The scatter of the impacts after it, each about the one that a quiet trajectory meets.
    impacts, orbit = section(events)[1000:], section(quiet)[-2:]
    orbit = orbit if apart(impacts[-2:], orbit).max() < 0.1 else orbit[::-1]
    scatter = apart(impacts, orbit[np.arange(-len(impacts), 0) % 2])
    assert report.spread_rms == pytest.approx(math.sqrt(np.mean(scatter**2)), rel=0.35)
    assert report.spread_rms < report.spread_largest < 1.5 * scatter.max() < 1.5 * TOLERANCE
    assert 'spread by noise' in report.describe()


def test_a_hop_is_a_report_of_its_own() -> None:
    """A burst of noise throws the gears from A to B: from where, to where, and how long."""
    simulation = Simulation(Parameters(0.48), State(velocity=-0.5), noise=1e-6, seed=5)
    pieces = [simulation.advance(FAR, 0.0, 6000)]
    detector, hops = TransientDetector(TOLERANCE), []
    for _ in range(40):
        simulation.noise = 0.3
        pieces.append(simulation.advance(FAR, 0.0, 3))
        simulation.noise = 1e-6
        pieces.append(simulation.advance(FAR, 0.0, 1200))
    events = np.concatenate(pieces)
    orbits = [change for change in detector.update(events) if change.regime is Regime.ORBIT]
    names = [change.key for change in orbits]
    assert {name[:9] for name in names} == {'orbit-3-1', 'orbit-2-1'}
    assert orbits[0].previous == ''
    entered = orbits[0]
    for before, now in zip(orbits[:-1], orbits[1:], strict=True):
        if now.key == before.key:
            # Thrown off and back: no hop.
            assert (now.previous, now.residence) == (before.previous, before.residence) or (
                not now.previous)
            continue
        hops.append(now)
        assert now.previous == before.key
        first = [each.start + (each.lifetime or 0) for each in (entered, now)]
        assert now.residence == first[1] - first[0]
        assert f'from {before.key} after {now.residence:,} impacts' in now.describe()
        entered = now
    assert len(hops) >= 3


def ramp(alpha: float, step: float, periods: int, settled: int = 0, after: int = 0,
         noise: float = 0.0) -> EventArray:
    """Return a run in which alpha moves at the end of every drive period."""
    simulation = Simulation(Parameters(alpha), State(velocity=-1.0), noise=noise, seed=1)
    pieces = [simulation.advance(settled, 0.0, FAR // 1000)] if settled else []
    for k in range(1, periods + 1):
        pieces.append(simulation.advance(simulation.moment[0] + 1, 0.0, 1000))
        pieces.append(simulation.retune(Parameters(alpha + k * step)))
    pieces.append(simulation.advance(simulation.moment[0] + after, 0.0, FAR // 1000))
    return np.concatenate(pieces)


def test_a_ramp_through_chaos_has_one_report_for_each_regime() -> None:
    """2,000 retunes from 0.57 on: B until it ends, A, and A once more at the last alpha."""
    events = ramp(0.57, 5e-6, 2000, after=300)
    changes = TransientDetector(TOLERANCE).update(events)
    said = [change for change in changes if change.impacts == 0]
    assert [change.regime for change in said] == [Regime.TRANSIENT, Regime.ORBIT, Regime.ORBIT]
    assert len(changes) <= len(said) + 2
    assert all(change.start == 0 for change in changes)
    fallen, at_rest = said[1:]
    assert (fallen.period_impacts, at_rest.period_impacts) == (3, 3)
    # A exists over the whole range: from the first impact on it no other is far from its orbit.
    assert fallen.lifetime == at_rest.lifetime
    assert at_rest.retunes == 2000 == at_rest.epoch
    assert at_rest.key == name_at_the_end(events, 3)
    assert at_rest.orbit is not None and at_rest.orbit.parameters.alpha == pytest.approx(0.58)


def test_an_orbit_that_is_followed_through_a_ramp_is_one_orbit() -> None:
    """A from 0.48 to 0.58, also through noise: nothing is reported until the ramp is over."""
    for noise in (0.0, 1e-6):
        simulation = Simulation(Parameters(0.48), State(velocity=-0.5), noise=noise, seed=1)
        pieces = [simulation.advance(300, 0.0, 10_000)]
        for k in range(1, 2001):
            pieces += [simulation.advance(300 + k, 0.0, 1000),
                       simulation.retune(Parameters(0.48 + 5e-5 * k))]
        detector = TransientDetector(TOLERANCE)
        changes = detector.update(np.concatenate(pieces))
        assert [change.regime for change in changes] == [Regime.TRANSIENT, Regime.ORBIT]
        tail = simulation.advance(3000, 0.0, 10_000)
        (again,) = detector.update(tail)
        assert (again.regime, again.lifetime, again.start) == (
            Regime.ORBIT, changes[1].lifetime, 0)
        if not noise:
            assert again.key == name_at_the_end(tail, 3)
        assert again.orbit is not None and again.orbit.parameters.alpha == pytest.approx(0.58)


def test_a_change_of_alpha_begins_a_transient_where_it_was_made() -> None:
    """Off an orbit, and again in mid-transient; a step within the tolerance begins nothing."""
    simulation = Simulation(Parameters(0.48), State(velocity=-1.0))
    pieces = [simulation.advance(500, 0.0, 10_000), simulation.retune(Parameters(0.57)),
              simulation.advance(1500, 0.0, 10_000), simulation.retune(Parameters(0.5705)),
              simulation.advance(2000, 0.0, 10_000), simulation.retune(Parameters(1.2)),
              simulation.advance(3000, 0.0, 10_000)]
    events = np.concatenate(pieces)
    retunes = events['index'][events['kind'] == EventKind.RETUNE].tolist()
    changes = TransientDetector(TOLERANCE).update(events)
    assert [change.start for change in changes if change.regime is Regime.TRANSIENT] == [
        0, *[retunes[0]] * (len(changes) - 2 - sum(c.start == retunes[2] for c in changes)),
        *[retunes[2]] * sum(c.start == retunes[2] for c in changes)]
    assert changes[-1].start == retunes[2]
    left = next(change for change in changes if change.start == retunes[0])
    # Seen within one period of the orbit.
    assert left.index <= retunes[0] + 3


def test_words_for_chaos_have_the_exponent_of_their_impacts() -> None:
    """The number of impacts without an orbit, and the exponent that another average gives."""
    simulation = Simulation(Parameters(0.57), State(velocity=-1.0))
    events = simulation.advance(FAR, 0.0, 40_001)
    detector = TransientDetector(TOLERANCE)
    last = detector.update(events)[-1]
    assert last.impacts == 32_000 and last.regime is Regime.TRANSIENT
    running = RunningLyapunov()
    running.update(events[:32_001])
    found = running.report
    assert (last.exponent, last.exponent_error) == (found.lambda_1, found.lambda_1_error)
    assert last.describe() == (
        f'no orbit in 32,000 impacts (chaos or a long transient), largest exponent '
        f'{found.lambda_1:+.4f} ± {found.lambda_1_error:.4f}')
    assert detector.report.impacts == 40_000


def test_an_orbit_is_distinguished_from_its_doubling() -> None:
    """A split far below the tolerance: of B's doubled orbit, not of the unstable one between."""
    # Just beyond the doubling of B, whose place follows from the multiplier of the orbit of two.
    for alpha in np.linspace(0.518, 0.5215, 8):
        simulation = Simulation(Parameters(float(alpha)), State(velocity=-1.0))
        simulation.advance(FAR, 0.0, 60_000)
        state = simulation.state
        events = Simulation(Parameters(float(alpha)), state).advance(FAR, 0.0, 4000)
        report = detect(events)
        if report.regime is Regime.ORBIT:
            tail = section(events)[-400:]
            lag = next(q for q in range(1, 65) if apart(tail[q:], tail[:-q]).max() < 1e-7)
            assert report.period_impacts == lag
            assert report.multiplier < 1.0


def test_an_orbit_of_128_impacts_is_found_when_a_transient_is_reported() -> None:
    """B at 0.56476, after period doublings: the shortest lag of all impacts, and stable."""
    simulation = Simulation(Parameters(0.56476), State(velocity=-0.8))
    events = simulation.advance(FAR, 0.0, 20_000)
    detector = TransientDetector(TOLERANCE)
    report = detector.update(events)[-1]
    tail = section(events)[-2000:]
    lag = next(q for q in range(1, 300) if apart(tail[q:], tail[:-q]).max() < 1e-6)
    assert (report.period_impacts, lag) == (128, 128)
    assert report.multiplier < 1.0 and report.key == name_at_the_end(events, 128)
