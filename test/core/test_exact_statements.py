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

"""The exact statements of the model, about trajectories: energy, bounces, symmetry, orbits."""

import functools
import math

from hypothesis import given, strategies as st
import numpy as np
import pytest

from gear_rattle_ros.core.flight.elementary import TWO_PI
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EventArray, EventKind, Parameters, State
from gear_rattle_ros.core.stream.lyapunov import RunningLyapunov
from gear_rattle_ros.core.stream.transients import Regime, TransientDetector, TransientReport

FAR = 10**8


def times(events: EventArray) -> np.ndarray:
    """Return the times of events [1]."""
    return events['cycle'] * TWO_PI + events['phase']


@functools.cache
def settled(alpha: float, period: int) -> tuple[EventArray, TransientReport]:
    """Return 3000 events on an orbit of `period` impacts at the paper's beta, gamma and r."""
    rng = np.random.default_rng(1)
    for _ in range(60):
        simulation = Simulation(Parameters(alpha), State(
            0, float(rng.uniform(0.0, TWO_PI)), 0.0, float(rng.uniform(-1.0, 1.0))))
        detector = TransientDetector()
        for _ in range(25):
            detector.update(simulation.advance(FAR, 0.0, 4000))
            if detector.report.regime is Regime.ORBIT:
                break
        if detector.report.period_impacts == period:
            return simulation.advance(FAR, 0.0, 3000), detector.report
    raise AssertionError(f'no orbit of {period} impacts at alpha {alpha}')


@pytest.mark.parametrize('gamma', [-0.3, 0.0, 0.2])
def test_energy_is_conserved_across_elastic_impacts(gamma: float) -> None:
    """With alpha = beta = 0, r = 1: v^2/2 - gamma s is the same at every event."""
    simulation = Simulation(Parameters(0.0, 0.0, gamma, 1.0), State(0, 0.0, -0.4, 0.9))
    events = simulation.advance(FAR, 0.0, 5000)
    energy = 0.5 * events['velocity']**2 - gamma * events['displacement']
    assert np.allclose(energy, 0.5 * 0.9**2 + 0.4 * gamma, rtol=0.0, atol=2e-13)
    assert set(events['displacement'][1:].tolist()) == {0.0, -1.0}


@given(velocity=st.floats(1e-3, 100.0), restitution=st.floats(0.8, 1.0))
def test_bounces_without_any_force(velocity: float, restitution: float) -> None:
    """Without any force: from wall to wall in 1/v, and v shrinks by r at each."""
    simulation = Simulation(Parameters(0.0, 0.0, 0.0, restitution), State(0, 0.0, -1.0, velocity))
    events = simulation.advance(FAR, 0.0, 21)[1:]
    speeds = velocity * restitution ** np.arange(20)
    assert np.allclose(np.abs(events['velocity']), speeds, rtol=1e-13, atol=0.0)
    assert np.allclose(times(events), np.cumsum(1.0 / speeds), rtol=1e-13, atol=0.0)
    assert list(events['displacement'][:4]) == [0.0, -1.0, 0.0, -1.0]


def test_bounces_with_friction_only() -> None:
    """Without drive and load v falls by beta over the gap and by r at the wall."""
    beta, restitution, v = 0.1, 0.8, 2.0
    simulation = Simulation(Parameters(0.0, beta, 0.0, restitution), State(0, 0.0, -1.0, v))
    events = simulation.advance(10**5, 0.0, 100)[1:]
    speed, elapsed = v, 0.0
    for event in events:
        elapsed -= math.log1p(-beta / speed) / beta
        speed -= beta
        assert abs(event['velocity']) == pytest.approx(speed, rel=1e-12)
        assert times(event) == pytest.approx(elapsed, rel=1e-12)
        speed *= restitution
    assert speed < beta


@given(
    alpha=st.floats(0.0, 5.0), beta=st.floats(0.0, 2.0), gamma=st.floats(-1.0, 1.0),
    restitution=st.floats(0.1, 1.0), phase=st.floats(0.0, 3.0), displacement=st.floats(-1.0, 0.0),
    velocity=st.one_of(st.floats(-3.0, -0.05), st.floats(0.05, 3.0)))
def test_mirror_symmetry(alpha: float, beta: float, gamma: float, restitution: float,
                         phase: float, displacement: float, velocity: float) -> None:
    """The map s -> -1 - s, tau -> tau + pi, gamma -> -gamma maps trajectories to trajectories."""
    plain = Simulation(Parameters(alpha, beta, gamma, restitution), State(
        0, phase, displacement, velocity)).advance(3, 0.0, 4)[1:]
    mirrored = Simulation(Parameters(alpha, beta, -gamma, restitution), State(
        0, phase + math.pi, -1.0 - displacement, -velocity)).advance(3, math.pi, 4)[1:]
    # Shifted phases are rounded: strong impacts only, and no more than a few.
    for a, b in zip(plain, mirrored, strict=False):
        if abs(a['velocity']) < 0.05:
            break
        assert a['kind'] == b['kind']
        assert b['displacement'] == -1.0 - a['displacement']
        assert b['velocity'] == pytest.approx(-a['velocity'], abs=1e-10)
        assert times(b) == pytest.approx(times(a) + math.pi, abs=1e-10)


@pytest.mark.parametrize('alpha, impacts, exponent', [
    (0.48, 3, -0.2100802), (1.244, 4, -0.1839003)])
def test_exponents_of_orbits_with_complex_multipliers(
        alpha: float, impacts: int, exponent: float) -> None:
    """Both are (2 ln r - beta 2 pi p/q)/2: of A, and of the orbit that follows the crisis."""
    assert (math.log(0.81) - 0.1 * TWO_PI / impacts) / 2.0 == pytest.approx(exponent, abs=1e-7)
    events, report = settled(alpha, impacts)
    assert (report.period_impacts, report.period_drive) == (impacts, 1)
    running = RunningLyapunov()
    running.update(events[:2999 // impacts * impacts + 1])
    found = running.report
    # A bounded end term is left in the means, not in their sum over whole orbits.
    assert found.lambda_1 == pytest.approx(exponent, abs=2e-3)
    assert found.lambda_2 == pytest.approx(exponent, abs=2e-3)
    assert found.exponent_sum == pytest.approx(2.0 * exponent, abs=1e-6)


@pytest.mark.parametrize('alpha, impacts', [(0.48, 2), (0.48, 3), (1.244, 4)])
def test_mean_flight_time_of_an_orbit(alpha: float, impacts: int) -> None:
    """An orbit of q impacts in p drive periods has <D> = 2 pi p/q."""
    events, report = settled(alpha, impacts)
    whole = (len(events) - 1) // impacts * impacts
    mean = (times(events[whole:whole + 1])[0] - times(events[:1])[0]) / whole
    assert mean == pytest.approx(TWO_PI * report.period_drive / impacts, rel=1e-8)


@given(
    alpha=st.floats(0.3, 3.0), beta=st.floats(0.0, 0.5), gamma=st.floats(-0.3, 0.3),
    restitution=st.floats(0.5, 1.0), velocity=st.floats(0.1, 2.0))
def test_sum_of_the_exponents(alpha: float, beta: float, gamma: float, restitution: float,
                              velocity: float) -> None:
    """lambda_1 + lambda_2 = 2 ln r - beta <D> for every trajectory, to rounding."""
    simulation = Simulation(
        Parameters(alpha, beta, gamma, restitution), State(0, 1.0, 0.0, -velocity))
    # Some come to swing between the walls without any impact, so the time is limited.
    events = simulation.advance(2000, 0.0, 400)
    if len(events) < 2 or EventKind.STICK in events['kind'] or (events['velocity'] == 0.0).any():
        return
    running = RunningLyapunov()
    running.update(events)
    found = running.report
    mean = (times(events[-1:])[0] - times(events[:1])[0]) / (len(events) - 1)
    expected = 2.0 * math.log(restitution) - beta * mean
    assert found.exact_sum == pytest.approx(expected, abs=1e-12)
    # Steep impacts (a/v large) cost digits of the smaller growth, not of the identity.
    steep = float(np.max(1.0 / np.abs(events['velocity'][1:])))
    assert found.exponent_sum == pytest.approx(expected, abs=1e-14 * steep**2 + 1e-12)
    assert found.mean_flight_time == pytest.approx(mean, rel=1e-12)
