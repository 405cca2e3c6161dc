"""Orbits, rest and lifetimes against an independent definition and the orbits' own Jacobians."""

import functools
import math

from hypothesis import given, strategies as st
import numpy as np
import pytest
from test_tangent import jacobian_of_equation_9

from gear_rattle_ros.core.elementary import TWO_PI
from gear_rattle_ros.core.model import EventArray, EventKind, Parameters, State
from gear_rattle_ros.core.orbits import Regime, TransientDetector, TransientReport
from gear_rattle_ros.core.simulation import Simulation

FAR = 10**8
TOLERANCE = 1e-3


def random_start(rng: np.random.Generator) -> State:
    """Return a start on the plane s = 0."""
    return State(0, float(rng.uniform(0.0, TWO_PI)), 0.0, float(rng.uniform(-1.0, 1.0)))


@functools.cache
def stories(alpha: float, count: int, length: int, seed: int = 1) -> list[EventArray]:
    """Return the first events from random starts."""
    rng = np.random.default_rng(seed)
    return [Simulation(Parameters(alpha), random_start(rng)).advance(FAR, 0.0, length)
            for _ in range(count)]


def detect(events: EventArray) -> TransientReport:
    """Return the last report on a stream."""
    detector = TransientDetector(TOLERANCE)
    detector.update(events)
    return detector.report


def apart(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return distances of impacts (side, phase, velocity, flight time) in rows."""
    turn = np.abs(a[:, 1] - b[:, 1])
    distance = np.maximum(np.minimum(turn, TWO_PI - turn), np.abs(a[:, 2:] - b[:, 2:]).max(1))
    return np.where(a[:, 0] == b[:, 0], distance, np.inf)


def section(events: EventArray) -> np.ndarray:
    """Return side, phase, velocity and flight time of the impacts; the first has none."""
    hits = events[events['kind'] <= EventKind.STICK]
    tau = hits['cycle'] * TWO_PI + hits['phase']
    return np.column_stack([
        hits['displacement'] == 0.0, hits['phase'], hits['velocity'],
        np.diff(tau, prepend=np.nan)])


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
        for tolerance, bound in ((2.0 * TOLERANCE, max), (0.5 * TOLERANCE, min)):
            # The orbit was known a quarter of the tolerance off: between twice and half.
            outside = np.flatnonzero(~(apart(impacts, along) <= tolerance))
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
        assert report.multiplier == pytest.approx(modulus, rel=0.15)
        tail = section(events)[-impacts:]
        points = np.array([[p.wall == 0, p.phase, p.velocity, p.flight_time]
                           for p in report.points])
        nearest = [apart(np.repeat(point[None], impacts, 0), tail).min() for point in points]
        assert max(nearest) < TOLERANCE
        assert math.isclose(sum(p.flight_time for p in report.points),
                            TWO_PI * report.period_drive, abs_tol=4 * TOLERANCE)
        assert [(p.wall, p.phase) for p in report.points][0] == min(
            (p.wall, p.phase) for p in report.points)
        seen += 1
    assert seen >= 3


def test_a_late_joiner_sees_the_same_orbit_but_no_approach() -> None:
    """On an orbit from the beginning on the multiplier is not known; it is never 0."""
    for alpha in (0.47, 0.48, 0.49, 0.5, 1.244, 1.25):
        for events in stories(alpha, 6, 40000 if alpha > 1 else 20000):
            report = detect(events)
            late = detect(events[-2000:])
            if report.regime is Regime.ORBIT and report.lifetime < len(events) - 4000:
                assert late.period_impacts == report.period_impacts
                assert late.start == int(events['index'][-2000])
                assert late.lifetime <= 2
                assert math.isnan(late.multiplier)


@functools.cache
def story_with_everything() -> EventArray:
    """Return a stream that settles, is retuned, kicked, reset, sticks and rests for ever."""
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
    assert simulation.is_resting_for_ever
    return np.concatenate(pieces)


def test_a_whole_story() -> None:
    """Orbit, transient by retune, kick and reset, and rest, each said once and in order."""
    events = story_with_everything()
    detector = TransientDetector(TOLERANCE)
    changes = detector.update(events)
    regimes = [change.regime for change in changes]
    assert regimes[0] is Regime.TRANSIENT and regimes[-1] is Regime.REST
    assert all(a is not b or a is Regime.TRANSIENT
               for a, b in zip(regimes[:-1], regimes[1:], strict=True))
    assert regimes.count(Regime.ORBIT) >= 3
    assert [change.epoch for change in changes] == sorted(change.epoch for change in changes)
    starts = {change.start for change in changes if change.regime is Regime.TRANSIENT}
    begun = events[np.isin(events['kind'], (EventKind.RETUNE, EventKind.RESET))]
    assert set(begun['index'].tolist()) <= starts
    # One more transient than those: the kick, noticed within the next impacts.
    noisy = np.flatnonzero(
        (events['kind'] == EventKind.IMPACT)
        & (events['velocity_after'] != -events['velocity'] * 0.9))
    kicked = starts - set(begun['index'].tolist())
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
    assert repr(found) == repr(expected)
    assert repr(pieces.report) == repr(whole.report)


def test_chatter_is_not_an_orbit() -> None:
    """Thousands of ever weaker impacts a little apart recur with everything but the drive."""
    for restitution in (0.9, 0.99, 0.999):
        simulation = Simulation(
            Parameters(0.0, 0.0, 0.3, restitution), State(0, 0.0, 0.0, 0.05))
        events = simulation.advance(10**4, 0.0, 50000)
        detector = TransientDetector(TOLERANCE)
        changes = detector.update(events)
        assert [change.regime for change in changes] == [Regime.TRANSIENT, Regime.REST]
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
        assert [change.regime for change in changes] == [Regime.TRANSIENT]


def test_nothing_is_recognised_across_a_hole() -> None:
    """A hole begins a new transient, and the report is then that of a late joiner."""
    events = next(e for e in stories(0.48, 24, 5000) if detect(e).lifetime < 300)
    detector, late = TransientDetector(TOLERANCE), TransientDetector(TOLERANCE)
    changes = detector.update(events[:2000]) + detector.update(events[2005:])
    assert [change.regime for change in changes] == [
        Regime.TRANSIENT, Regime.ORBIT, Regime.TRANSIENT, Regime.ORBIT]
    assert detector.guard.lost == 5
    assert repr(late.update(events[2005:])) == repr(changes[2:])


def test_rest_from_the_start_has_no_lifetime_to_speak_of() -> None:
    """A mass that is never released has ended before its first impact."""
    events = Simulation(Parameters(0.1, 0.1, 0.5), State(0, 1.0, 0.0, 0.0)).advance(9, 0.0, 9)
    report = detect(events)
    assert (report.regime, report.lifetime) == (Regime.REST, 0)
    assert report.describe() == 'at rest on a wall for ever, after 0 impacts'


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
