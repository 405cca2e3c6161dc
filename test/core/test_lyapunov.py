"""Running exponents against products of the paper's Jacobian, many runs and closed forms."""

import math

from hypothesis import given, strategies as st
import numpy as np
import pytest

from gear_rattle_ros.core.elementary import TWO_PI
from gear_rattle_ros.core.lyapunov import RunningLyapunov
from gear_rattle_ros.core.model import EventArray, EventKind, impact_count, Parameters, State
from gear_rattle_ros.core.simulation import Simulation

FAR = 10**8


def whole_story() -> EventArray:
    """Return a stream with impacts, chatter, sticking, releases, retunes, a reset and noise."""
    simulation = Simulation(Parameters(0.48), State(0, 5.0, 0.0, 0.02), noise=0.0)
    pieces = [simulation.advance(40, 0.0, 5000)]
    pieces += [simulation.retune(Parameters(1.2)), simulation.advance(300, 1.0, 5000)]
    pieces += [simulation.reset(2.0, -0.4, 0.3), simulation.advance(400, 0.0, 5000)]
    simulation.noise = 0.02
    pieces += [simulation.retune(Parameters(1.23)), simulation.advance(900, 0.0, 5000)]
    events = np.concatenate(pieces)
    assert set(events['kind'].tolist()) == set(EventKind)
    return events


STORY = whole_story()


def fields(running: RunningLyapunov) -> str:
    """Return everything reported, to the last bit."""
    return repr(running.report())


@given(st.lists(st.integers(0, len(STORY)), max_size=12), st.integers(1, len(STORY)))
def test_cuts_change_no_bit(cuts: list[int], end: int) -> None:
    """Batches of any size, the empty one too, give the same report."""
    whole, pieces = RunningLyapunov(50), RunningLyapunov(50)
    whole.update(STORY[:end])
    bounds = [0, *sorted(min(cut, end) for cut in cuts), end]
    for start, stop in zip(bounds[:-1], bounds[1:], strict=True):
        pieces.update(STORY[start:stop])
    assert fields(whole) == fields(pieces)


def test_one_record_at_a_time_changes_no_bit() -> None:
    """So do batches of one."""
    whole, single = RunningLyapunov(50), RunningLyapunov(50)
    whole.update(STORY)
    for k in range(len(STORY)):
        single.update(STORY[k:k + 1])
    assert fields(whole) == fields(single)


def growth_by_equation_9(events: EventArray) -> np.ndarray:
    """Return the growth of a vector per impact by the paper's Jacobian, in plain numpy."""
    vector = np.array([1.0, 0.3])
    growths = []
    for before, after in zip(events[:-1], events[1:], strict=True):
        alpha, beta, gamma, r = (
            float(before[name]) for name in ('alpha', 'beta', 'gamma', 'restitution'))
        d = (int(after['cycle']) - int(before['cycle'])) * TWO_PI + (
            after['phase'] - before['phase'])
        decay, g = math.exp(-beta * d), gamma / beta
        fall = (1 - decay) / beta
        tau0, v0, v1 = before['phase'], before['velocity'], after['velocity']
        w = -r * v0 - alpha * math.cos(tau0) - g
        a1 = (-alpha * math.sin(after['phase']) + alpha * beta * math.cos(after['phase'])
              + gamma - beta * v1)
        first = np.array([-(-alpha * math.cos(tau0) - g - decay * w
                            + fall * alpha * math.sin(tau0)) / v1, r * fall / v1])
        second = np.array([decay * alpha * math.sin(tau0) + beta * w * decay, -r * decay])
        vector = np.array([first @ vector, second @ vector + a1 * (first @ vector)])
        size = float(np.linalg.norm(vector))
        growths.append(math.log(size))
        vector /= size
    return np.array(growths)


@pytest.mark.parametrize('alpha', [0.57, 1.2])
def test_largest_exponent_is_that_of_equation_9(alpha: float) -> None:
    """The mean over all, and over the last window, differ by a bounded end term only."""
    simulation = Simulation(Parameters(alpha), State(0, 0.3, -0.5, 0.4))
    simulation.advance(FAR, 0.0, 500)
    events = simulation.advance(FAR, 0.0, 5001)
    running = RunningLyapunov(window=2000)
    running.update(events)
    report = running.report()
    growths = growth_by_equation_9(events)
    assert report.impacts == 5000
    # log(1/v) and the angle between two coordinates at either end.
    ends = 2.0 * abs(math.log(np.abs(events['velocity']).min())) + 6.0
    assert report.lambda_1 == pytest.approx(growths.mean(), abs=ends / 5000)
    assert report.lambda_1_finite == pytest.approx(growths[-2000:].mean(), abs=ends / 2000)


def test_finite_window_is_the_mean_of_the_last_impacts() -> None:
    """lambda_1 over n and over n + window impacts give the window's own, exactly."""
    events = Simulation(Parameters(1.2), State(0, 0.3, -0.5, 0.4)).advance(FAR, 0.0, 1501)
    running = RunningLyapunov(window=300)
    running.update(events[:300])
    assert math.isnan(running.report().lambda_1_finite)
    running.update(events[300:301])
    assert running.report().lambda_1_finite == pytest.approx(running.report().lambda_1, rel=1e-13)
    running.update(events[301:1201])
    before = running.report()
    running.update(events[1201:])
    after = running.report()
    assert after.impacts == 1500
    assert after.lambda_1_finite == pytest.approx(
        (1500 * after.lambda_1 - 1200 * before.lambda_1) / 300, rel=1e-11)


@pytest.mark.parametrize('beta, restitution', [(0.0, 0.95), (0.01, 0.99)])
def test_exponents_without_any_force(beta: float, restitution: float) -> None:
    """With alpha = gamma = 0: F and S are triangular, so the exponents have a closed form."""
    simulation = Simulation(Parameters(0.0, beta, 0.0, restitution), State(0, 0.0, -1.0, 100.0))
    count = 60
    events = simulation.advance(FAR, 0.0, count + 1)
    running = RunningLyapunov()
    running.update(events)
    report = running.report()
    # Here the product of matrices is small enough to be multiplied out.
    product = np.eye(2)
    for before, after in zip(events[:-1], events[1:], strict=True):
        d = (int(after['cycle']) - int(before['cycle'])) * TWO_PI + (
            after['phase'] - before['phase'])
        decay = math.exp(-beta * d)
        fall = (1 - decay) / beta if beta else d
        jump = (restitution * -beta * after['velocity'] - beta * after['velocity_after']) / (
            after['velocity'])
        impact = np.array([[-restitution, 0.0], [jump, -restitution]])
        product = impact @ np.array([[1.0, fall], [0.0, decay]]) @ product
    assert report.exponent_sum == pytest.approx(
        math.log(np.linalg.det(product)) / count, abs=1e-12)
    assert report.lambda_1 == pytest.approx(
        math.log(np.linalg.norm(product @ [1.0, 0.0])) / count, abs=1e-12)


def test_stated_errors_are_those_of_many_runs() -> None:
    """The error by block means is the scatter of independent runs within a factor of 2."""
    rng = np.random.default_rng(12)
    reports = []
    for _ in range(40):
        simulation = Simulation(Parameters(1.2), State(
            0, float(rng.uniform(0.0, TWO_PI)), 0.0, float(rng.uniform(-1.0, 0.0))))
        simulation.advance(FAR, 0.0, 300)
        running = RunningLyapunov()
        running.update(simulation.advance(FAR, 0.0, 20001))
        reports.append(running.report())
    for name in ('lambda_1', 'lambda_2'):
        scatter = float(np.std([getattr(report, name) for report in reports], ddof=1))
        stated = float(np.mean([getattr(report, f'{name}_error') for report in reports]))
        assert 0.5 < stated / scatter < 2.0


def test_errors_need_blocks_enough() -> None:
    """With too few impacts there is no error, with none no exponent either."""
    running = RunningLyapunov()
    assert math.isnan(running.report().lambda_1)
    events = Simulation(Parameters(1.2), State(0, 0.3, -0.5, 0.4)).advance(FAR, 0.0, 5000)
    running.update(events[:50])
    assert math.isnan(running.report().lambda_1_error)
    running.update(events[50:])
    assert 0.0 < running.report().lambda_1_error < 0.1


def test_a_retune_or_reset_starts_a_new_average() -> None:
    """Impacts and epoch are counted from it, and exponents are those of the new stretch."""
    simulation = Simulation(Parameters(0.57), State(0, 0.3, -0.5, 0.4))
    running = RunningLyapunov()
    running.update(simulation.advance(FAR, 0.0, 1001))
    assert (running.report().impacts, running.report().epoch) == (1000, 0)
    running.update(simulation.advance(simulation.state.cycle + 1, 0.0, 100))
    record = simulation.retune(Parameters(1.2))
    running.update(record)
    assert (running.report().impacts, running.report().epoch) == (0, 1)
    assert math.isnan(running.report().lambda_1)
    after = simulation.advance(FAR, 0.0, 3000)
    running.update(after)
    assert (running.report().impacts, running.report().epoch) == (3000, 1)
    # Time is counted from the retune in mid-flight, not from the impact before it.
    tau = [float(e['cycle'] * TWO_PI + e['phase']) for e in (record[0], after[-1])]
    mean = (tau[1] - tau[0]) / 3000
    assert running.report().mean_flight_time == pytest.approx(mean, rel=1e-12)
    assert running.report().exact_sum == pytest.approx(
        2.0 * math.log(0.9) - 0.1 * mean, abs=1e-12)
    late = RunningLyapunov()
    late.update(after)
    # A late joiner knows another beginning of the same average.
    assert late.report().impacts == 2999
    assert late.report().lambda_1 == pytest.approx(running.report().lambda_1, abs=10.0 / 3000)


def test_nothing_is_computed_across_a_hole() -> None:
    """After a hole the report is that of a late joiner, to the bit; the loss is counted."""
    events = Simulation(Parameters(1.2), State(0, 0.3, -0.5, 0.4)).advance(FAR, 0.0, 4000)
    running, late = RunningLyapunov(), RunningLyapunov()
    running.update(events[:1000])
    running.update(events[1017:])
    late.update(events[1017:])
    assert fields(running) == fields(late)
    assert (running.guard.lost, running.guard.gaps) == (17, 1)


def test_sticking_is_superstable() -> None:
    """All memory is lost: -inf over a stretch that sticks, and no nan on the way."""
    simulation = Simulation(Parameters(0.48), State(0, 5.0, 0.0, 0.02))
    events = simulation.advance(40, 0.0, 4000)
    stick = int(np.flatnonzero(events['kind'] == EventKind.STICK)[-1])
    running = RunningLyapunov(window=20)
    running.update(events[:stick + 1])
    report = running.report()
    assert report.lambda_1 == report.lambda_2 == -math.inf
    assert report.exponent_sum == report.exact_sum == -math.inf
    assert report.lambda_1_finite == -math.inf
    running.update(events[stick + 1:])
    assert running.report().lambda_1 == -math.inf
    assert impact_count(events[stick + 1:]) >= 20
    # Of the last impacts alone none has stuck: a joiner at the release sees the same.
    late = RunningLyapunov(window=20)
    late.update(events[stick + 1:])
    assert running.report().lambda_1_finite == late.report().lambda_1_finite
    assert math.isfinite(late.report().lambda_1_finite)


def test_no_restitution_has_one_exponent_only() -> None:
    """With r = 0: one direction dies at every impact, so lambda_2 and the sum are -inf."""
    simulation = Simulation(Parameters(8.0, 0.1, 0.0, 0.0), State(0, 0.0, -0.5, 3.0))
    events = simulation.advance(FAR, 0.0, 60)
    first_stick = int(np.argmax(events['kind'] == EventKind.STICK))
    running = RunningLyapunov()
    running.update(events[:first_stick])
    if running.report().impacts:
        assert running.report().lambda_2 == running.report().exact_sum == -math.inf


def test_kicks_are_in_the_determinant() -> None:
    """With noise the sum is still exact: ln(r v+/v-) - beta <D>."""
    events = Simulation(Parameters(1.2), State(0, 0.3, -0.5, 0.4), noise=0.05, seed=2).advance(
        FAR, 0.0, 2001)
    running = RunningLyapunov()
    running.update(events)
    tau = events['cycle'] * TWO_PI + events['phase']
    ratio = np.abs(events['velocity_after'][1:] / events['velocity'][1:])
    expected = float(np.mean(np.log(0.9 * ratio))) - 0.1 * float(tau[-1] - tau[0]) / 2000
    assert running.report().exact_sum == pytest.approx(expected, abs=1e-11)
    assert running.report().exponent_sum == pytest.approx(expected, abs=1e-8)


def test_a_window_must_hold_something() -> None:
    """An empty window is refused by name."""
    with pytest.raises(ValueError, match='^window = 0'):
        RunningLyapunov(0)
