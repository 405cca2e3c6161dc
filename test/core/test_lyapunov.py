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

"""Running exponents against products of the paper's Jacobian, many runs and closed forms."""

import math

from hypothesis import given, strategies as st
import numpy as np
import pytest
from scipy.integrate import quad

from gear_rattle_ros.core.flight.elementary import TWO_PI
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EventArray, EventKind, impact_count, Parameters, State
from gear_rattle_ros.core.stream.lyapunov import RunningLyapunov
from gear_rattle_ros.core.stream.report_values import infinite_in_words, lyapunov_values

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
    return repr(running.report)


def slow_ramp(alpha: float, step: float, periods: int, start: State, noise: float = 0.0
              ) -> EventArray:
    """Return a run in which alpha moves at the end of every drive period."""
    simulation = Simulation(Parameters(alpha), start, noise=noise)
    pieces = []
    for k in range(1, periods + 1):
        pieces.append(simulation.advance(k, 0.0, 1000))
        pieces.append(simulation.retune(Parameters(alpha + k * step)))
    return np.concatenate(pieces)


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
    report = running.report
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
    assert math.isnan(running.report.lambda_1_finite)
    running.update(events[300:301])
    assert running.report.lambda_1_finite == pytest.approx(running.report.lambda_1, rel=1e-13)
    running.update(events[301:1201])
    before = running.report
    running.update(events[1201:])
    after = running.report
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
    report = running.report
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
        reports.append(running.report)
    for name in ('lambda_1', 'lambda_2'):
        scatter = float(np.std([getattr(report, name) for report in reports], ddof=1))
        stated = float(np.mean([getattr(report, f'{name}_error') for report in reports]))
        assert 0.5 < stated / scatter < 2.0


def test_errors_need_blocks_enough() -> None:
    """With too few impacts there is no error, with none no exponent either."""
    running = RunningLyapunov()
    assert math.isnan(running.report.lambda_1)
    events = Simulation(Parameters(1.2), State(0, 0.3, -0.5, 0.4)).advance(FAR, 0.0, 5000)
    running.update(events[:50])
    assert math.isnan(running.report.lambda_1_error)
    running.update(events[50:])
    assert 0.0 < running.report.lambda_1_error < 0.1


def test_a_retune_or_reset_starts_a_new_average() -> None:
    """Impacts and epoch are counted from it, and exponents are those of the new stretch."""
    simulation = Simulation(Parameters(0.57), State(0, 0.3, -0.5, 0.4))
    running = RunningLyapunov()
    running.update(simulation.advance(FAR, 0.0, 1001))
    assert (running.report.impacts, running.report.epoch) == (1000, 0)
    running.update(simulation.advance(simulation.state.cycle + 1, 0.0, 100))
    record = simulation.retune(Parameters(1.2))
    running.update(record)
    assert (running.report.impacts, running.report.epoch) == (0, 1)
    assert math.isnan(running.report.lambda_1)
    after = simulation.advance(FAR, 0.0, 3000)
    running.update(after)
    assert (running.report.impacts, running.report.epoch) == (3000, 1)
    # Time is counted from the retune in mid-flight, not from the impact before it.
    tau = [float(e['cycle'] * TWO_PI + e['phase']) for e in (record[0], after[-1])]
    mean = (tau[1] - tau[0]) / 3000
    assert running.report.mean_flight_time == pytest.approx(mean, rel=1e-12)
    assert running.report.exact_sum == pytest.approx(
        2.0 * math.log(0.9) - 0.1 * mean, abs=1e-12)
    late = RunningLyapunov()
    late.update(after)
    # A late joiner knows another beginning of the same average.
    assert late.report.impacts == 2999
    assert late.report.lambda_1 == pytest.approx(running.report.lambda_1, abs=10.0 / 3000)


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
    report = running.report
    assert report.lambda_1 == report.lambda_2 == -math.inf
    assert report.exponent_sum == report.exact_sum == -math.inf
    assert report.lambda_1_finite == -math.inf
    running.update(events[stick + 1:])
    assert running.report.lambda_1 == -math.inf
    assert impact_count(events[stick + 1:]) >= 20
    # None of the last impacts has stuck: a late joiner at the release sees the same.
    late = RunningLyapunov(window=20)
    late.update(events[stick + 1:])
    assert running.report.lambda_1_finite == late.report.lambda_1_finite
    assert math.isfinite(late.report.lambda_1_finite)


def test_no_restitution_has_one_exponent_only() -> None:
    """With r = 0: one direction dies at every impact, so lambda_2 and the sum are -inf."""
    simulation = Simulation(Parameters(8.0, 0.1, 0.0, 0.0), State(0, 0.0, -0.5, 3.0))
    events = simulation.advance(FAR, 0.0, 60)
    first_stick = int(np.argmax(events['kind'] == EventKind.STICK))
    running = RunningLyapunov()
    running.update(events[:first_stick])
    if running.report.impacts:
        assert running.report.lambda_2 == running.report.exact_sum == -math.inf


def test_kicks_are_in_the_determinant() -> None:
    """With noise the sum is still exact: ln(r v+/v-) - beta <D>."""
    events = Simulation(Parameters(1.2), State(0, 0.3, -0.5, 0.4), noise=0.05, seed=2).advance(
        FAR, 0.0, 2001)
    running = RunningLyapunov()
    running.update(events)
    tau = events['cycle'] * TWO_PI + events['phase']
    ratio = np.abs(events['velocity_after'][1:] / events['velocity'][1:])
    expected = float(np.mean(np.log(0.9 * ratio))) - 0.1 * float(tau[-1] - tau[0]) / 2000
    assert running.report.exact_sum == pytest.approx(expected, abs=1e-11)
    assert running.report.exponent_sum == pytest.approx(expected, abs=1e-8)


def test_a_window_must_hold_something() -> None:
    """An empty window is refused by name."""
    with pytest.raises(ValueError, match='^window = 0'):
        RunningLyapunov(0)


def test_finite_time_exponents_cross_the_retunes_of_a_ramp() -> None:
    """2,000 retunes from 0.57 on: few impacts are averaged, a thousand in the finite-time one."""
    running = RunningLyapunov(1000)
    events = slow_ramp(0.57, 5e-6, 2000, State(velocity=-1.0))
    running.update(events)
    report = running.report
    assert report.impacts < 4 and report.epoch == 2000
    # It ends on A: both its multipliers are complex, of modulus 0.9^3 exp(-0.1 pi) at any alpha.
    exponent = (math.log(0.81) - 0.1 * TWO_PI / 3) / 2.0
    assert report.lambda_1_finite == pytest.approx(exponent, abs=4.0 / 1000)
    # The retunes after the impact before the window, up to the last impact.
    hits = np.flatnonzero(events['kind'] <= EventKind.STICK)
    assert report.finite_retunes == int(np.count_nonzero(
        events['kind'][hits[-1001]:hits[-1]] == EventKind.RETUNE))


def test_a_retune_that_changes_nothing_leaves_the_finite_time_exponent() -> None:
    """The tangent of a change in mid-flight is the identity."""
    start = State(velocity=-0.5)
    parted = slow_ramp(0.48, 0.0, 600, start)
    whole = Simulation(Parameters(0.48), start).advance(600, 0.0, 10_000)
    running, plain = RunningLyapunov(1500), RunningLyapunov(1500)
    running.update(parted)
    plain.update(whole)
    assert running.report.lambda_1_finite == pytest.approx(
        plain.report.lambda_1_finite, rel=1e-9)
    assert plain.report.finite_retunes == 0 < running.report.finite_retunes
    # A reset forgets: there are no thousand impacts yet.
    simulation = Simulation(Parameters(0.48), start)
    plain.update(np.concatenate([simulation.advance(600, 0.0, 10_000),
                                 simulation.reset(0.0, 0.0, -1.0)]))
    assert math.isnan(plain.report.lambda_1_finite)


def test_exponent_of_a_slow_ramp_is_the_static_one() -> None:
    """Chaos at 1.2, over 8,000 impacts while alpha moves by 3e-4."""
    start = State(0, 0.3, -0.5, 0.4)
    static = growth_by_equation_9(Simulation(Parameters(1.2), start).advance(FAR, 0.0, 20_000))
    running = RunningLyapunov(8000)
    running.update(slow_ramp(1.2, 1e-7, 3000, start))
    blocks = static[:19_200].reshape(-1, 160).mean(axis=1)
    error = float(np.std(blocks, ddof=1)) * math.sqrt(160) * math.hypot(
        1.0 / math.sqrt(len(static)), 1.0 / math.sqrt(8000))
    assert running.report.finite_retunes > 2000
    assert abs(running.report.lambda_1_finite - static.mean()) < 4.0 * error


def impulses_by_quadrature(events: EventArray) -> tuple[float, float, float]:
    """Return impulse of the walls, time, and gamma times the time."""
    impulse, exact, time = [], [], 0.0
    resting = False
    for before, event in zip(events[:-1], events[1:], strict=True):
        alpha, beta, gamma = (float(before[name]) for name in ('alpha', 'beta', 'gamma'))
        d = (int(event['cycle']) - int(before['cycle'])) * TWO_PI + float(
            event['phase'] - before['phase'])
        time += d
        resting = before['kind'] == EventKind.STICK or (
            resting and before['kind'] == EventKind.RETUNE)
        if resting:
            impulse.append(quad(
                lambda t, a, b, c: -a * math.sin(t) + a * b * math.cos(t) + c,
                float(before['phase']), float(before['phase']) + d, (alpha, beta, gamma),
                epsabs=1e-13, limit=500)[0])
        elif event['kind'] <= EventKind.STICK:
            impulse.append(float(event['velocity'] - event['velocity_after']))
        ends = [float(e['velocity_after']) + beta * float(e['displacement'])
                - alpha * (math.cos(e['phase']) + beta * math.sin(e['phase']))
                for e in (before, event)]
        exact.append(gamma * d - (ends[1] - ends[0]))
    return math.fsum(impulse), time, math.fsum(exact)


@pytest.mark.parametrize('alpha, beta, gamma, restitution, noise', [
    (0.48, 0.1, 0.1, 0.9, 0.0), (1.2, 0.1, 0.1, 0.9, 0.02), (5.0, 0.0159, 2.533, 0.7, 0.0),
    (3.0, 0.1, -1.2, 0.6, 0.0), (1.5, 0.0, 0.0, 0.8, 0.1), (0.3, 0.1, 0.1, 0.05, 0.0),
    (2.0, 0.3, -0.2, 0.0, 0.0), (0.7, 0.0, 0.4, 1.0, 0.0)])
def test_impulse_balance(alpha: float, beta: float, gamma: float, restitution: float,
                         noise: float) -> None:
    """What the walls give to the gear, and what it must be; sticking, kicks and retunes."""
    rng = np.random.default_rng(7)
    simulation = Simulation(Parameters(alpha, beta, gamma, restitution), State(
        0, float(rng.uniform(0.0, 6.0)), -0.3, float(rng.uniform(-1.0, 1.0))), noise=noise)
    running = RunningLyapunov()
    parts = [simulation.advance(0, 6.2, 1)]
    running.update(parts[0])
    for k in range(4):
        # At 5.0 the gear sticks where it does so in every period.
        moment = (simulation.moment[0] + 40, 5.0 if k == 1 else float(rng.uniform(0.0, 6.0)))
        parts.append(simulation.advance(*moment, 100_000))
        running.update(parts[-1])
        stretch = np.concatenate(parts)
        impulse, time, exact = impulses_by_quadrature(stretch)
        report = running.report
        scale = 1e-13 * (len(stretch) + time) * (1.0 + alpha + abs(gamma)) / time
        assert report.impulse_balance == pytest.approx(impulse / time, abs=scale)
        assert report.exact_impulse_balance == pytest.approx(exact / time, abs=scale)
        assert report.impulse_balance == pytest.approx(report.exact_impulse_balance, abs=scale)
        # In time it is gamma: what the ends add is bounded.
        top = float(np.abs(stretch['velocity_after']).max()) + beta + alpha * (1.0 + beta)
        assert abs(report.impulse_balance - gamma) <= 0.01 + 2.0 * top / time
        parts.append(simulation.retune(Parameters(
            1.001 * alpha, 1.01 * beta, gamma + 1e-3 * k, restitution)))
        running.update(parts[-1])


def test_an_infinite_exponent_is_explained() -> None:
    """By sticking, or by no restitution; finite ones need no words."""
    events = Simulation(Parameters(5.0, 0.0159, 2.533, 0.7), State(velocity=-1.0)).advance(
        FAR, 0.0, 3000)
    running = RunningLyapunov()
    running.update(events)
    report = running.report
    assert report.sticks == np.count_nonzero(events['kind'] == EventKind.STICK) == 43
    assert infinite_in_words(lyapunov_values(report)) == (
        f'-inf: the gear stuck at 43 of {report.impacts:,} impacts, where all memory is lost '
        '(superstable)')
    no_restitution = RunningLyapunov()
    no_restitution.update(Simulation(Parameters(8.0, 0.1, 0.0, 0.0), State(
        0, 0.0, -0.5, 3.0)).advance(FAR, 0.0, 2))
    assert no_restitution.report.lambda_2 == -math.inf
    assert 'r = 0' in infinite_in_words(lyapunov_values(no_restitution.report))
    assert infinite_in_words(lyapunov_values(RunningLyapunov().report)) == ''
