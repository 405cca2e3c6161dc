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

"""Flight and impact matrices against the paper's Jacobian and finite differences of the flow."""

import math

import numpy as np
import pytest

from gear_rattle_ros.core.flight.closed_form import elapsed, model_of
from gear_rattle_ros.core.flight.elementary import TWO_PI
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.flight.tangent import flight_matrix, impact_matrix, log_determinant
from gear_rattle_ros.core.model import EventArray, EventKind, Model, Parameters, State


def between(before: np.void, after: np.void) -> float:
    """Return the time between two events."""
    return elapsed(int(after['cycle']) - int(before['cycle']), before['phase'], after['phase'])


def matrices(before: np.void, after: np.void) -> tuple[np.ndarray, np.ndarray]:
    """Return F of the flight to an impact and S of the impact."""
    integral, decay = flight_matrix(between(before, after), before['beta'])
    s11, s21, s22 = impact_matrix(
        after['phase'], after['velocity'], after['velocity_after'], model_of(before))
    return np.array([[1.0, integral], [0.0, decay]]), np.array([[s11, 0.0], [s21, s22]])


def jacobian_of_equation_9(before: np.void, after: np.void) -> np.ndarray:
    """Return the paper's Jacobian of (tau1, v1) by (tau0, v0), velocities before impact."""
    alpha, beta, gamma, r = (
        float(before[name]) for name in ('alpha', 'beta', 'gamma', 'restitution'))
    d, v0, v1 = between(before, after), float(before['velocity']), float(after['velocity'])
    tau0, tau1 = float(before['phase']), float(after['phase'])
    decay = math.exp(-beta * d)
    g, fall = gamma / beta, (1.0 - decay) / beta
    w = -r * v0 - alpha * math.cos(tau0) - g
    a1 = -alpha * math.sin(tau1) + alpha * beta * math.cos(tau1) + gamma - beta * v1
    tau_tau = -(-alpha * math.cos(tau0) - g - decay * w + fall * alpha * math.sin(tau0)) / v1
    tau_v = r * fall / v1
    return np.array([
        [tau_tau, tau_v],
        [decay * alpha * math.sin(tau0) + beta * w * decay + a1 * tau_tau,
         -r * decay + a1 * tau_v]])


def rattling(alpha: float, count: int, beta: float = 0.1, restitution: float = 0.9) -> EventArray:
    """Return impacts of a chaotic transient."""
    simulation = Simulation(
        Parameters(alpha, beta, 0.1, restitution), State(0, 0.5, -0.5, 0.7))
    events = simulation.advance(10**6, 0.0, count + 20)[20:]
    assert np.all(events['kind'] == EventKind.IMPACT)
    return events


@pytest.mark.parametrize('alpha', [0.57, 1.2, 3.0])
def test_determinants_impact_by_impact(alpha: float) -> None:
    """Exactly det F = E, det S = r^2, det D_n = r^2 E v_n/v_(n+1)."""
    events = rattling(alpha, 200)
    for before, after in zip(events[:-1], events[1:], strict=True):
        flight, impact = matrices(before, after)
        decay = math.exp(-0.1 * between(before, after))
        assert np.linalg.det(flight) == pytest.approx(decay, rel=1e-14)
        assert np.linalg.det(impact) == pytest.approx(0.81, rel=1e-12)
        assert log_determinant(
            after['velocity'], after['velocity_after'], 0.9, 2.0 * math.log(0.9)) == (
                2.0 * math.log(0.9))
        jacobian = jacobian_of_equation_9(before, after)
        size = float(np.abs(jacobian).max())**2
        assert np.linalg.det(jacobian) == pytest.approx(
            0.81 * decay * before['velocity'] / after['velocity'], rel=1e-11, abs=1e-14 * size)


@pytest.mark.parametrize('alpha', [0.57, 1.2, 3.0])
def test_jacobian_of_equation_9_is_the_tangent_in_section_coordinates(alpha: float) -> None:
    """(tau, v) on the section becomes (s, s') just after the impact: D_n = T^-1 F S T'."""
    events = rattling(alpha, 100)
    p = {name: float(events[0][name]) for name in ('alpha', 'beta', 'gamma')}

    def to_fixed_time(event: np.void) -> np.ndarray:
        # A trajectory that hits dtau later with dv more, seen just before the impact.
        tau, v = float(event['phase']), float(event['velocity'])
        a = (-p['alpha'] * math.sin(tau) + p['alpha'] * p['beta'] * math.cos(tau) + p['gamma']
             - p['beta'] * v)
        return np.array([[-v, 0.0], [-a, 1.0]])

    for first, before, after in zip(events[:-2], events[1:-1], events[2:], strict=True):
        _, impact = matrices(first, before)
        flight, _ = matrices(before, after)
        carried = np.linalg.inv(to_fixed_time(after)) @ flight @ impact @ to_fixed_time(before)
        expected = jacobian_of_equation_9(before, after)
        assert np.allclose(carried, expected, rtol=1e-10, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize('alpha', [0.57, 1.2])
def test_jacobian_of_equation_9_by_finite_differences(alpha: float) -> None:
    """The next impact's (tau, v), differentiated by those of the one before."""
    h = 1e-6
    for before, after in zip(*(rattling(alpha, 40)[k:39 + k] for k in (0, 1)), strict=True):
        columns = []
        for dtau, dv in ((h, 0.0), (0.0, h)):
            ends = []
            for sign in (1.0, -1.0):
                phase = float(before['phase']) + sign * dtau
                start = State(1, phase % TWO_PI, float(before['displacement']),
                              float(before['velocity']) + sign * dv)
                event = Simulation(Parameters(alpha), start).advance(99, 0.0, 3)[2]
                tau = elapsed(int(event['cycle']) - 1, phase % TWO_PI, event['phase'])
                ends.append((tau + sign * dtau, float(event['velocity'])))
            columns.append(np.subtract(*ends) / (2 * h))
        jacobian = jacobian_of_equation_9(before, after)
        scale = np.abs(jacobian).max()
        if abs(float(after['velocity'])) > 0.05:
            assert np.allclose(np.transpose(columns), jacobian, rtol=0.0, atol=3e-6 * scale**2)


def advanced(parameters: Parameters, start: State,
             end: tuple[int, float]) -> tuple[State, EventArray]:
    """Return the state at a moment and the events on the way."""
    simulation = Simulation(parameters, start)
    events = simulation.advance(*end, 100)
    return simulation.state, events


@pytest.mark.parametrize('parameters', [
    Parameters(0.57), Parameters(1.2), Parameters(3.0, 0.0, -0.2, 1.0),
    Parameters(0.8, 1.0, 0.0, 0.4)])
def test_product_of_matrices_is_the_derivative_of_the_flow(parameters: Parameters) -> None:
    """(ds, dv) at a fixed time through a few impacts, by central differences."""
    rng = np.random.default_rng(3)
    h, compared = 1e-7, 0
    for _ in range(80):
        phase, s, v = rng.uniform(0.0, TWO_PI), rng.uniform(-0.9, -0.1), rng.normal()
        end = (1, float(rng.uniform(0.0, TWO_PI)))
        _, events = advanced(parameters, State(0, phase, s, v), end)
        speeds = np.abs(events['velocity'][1:])
        if len(speeds) == 0 or speeds.min() < 0.1 or len(speeds) > 8:
            continue
        product = np.eye(2)
        for before, after in zip(events[:-1], events[1:], strict=True):
            flight, impact = matrices(before, after)
            product = impact @ flight @ product
        left = elapsed(end[0] - int(events[-1]['cycle']), events[-1]['phase'], end[1])
        integral, decay = flight_matrix(left, parameters.beta)
        product = np.array([[1.0, integral], [0.0, decay]]) @ product
        columns = []
        for ds, dv in ((h, 0.0), (0.0, h)):
            ahead, behind = (
                advanced(parameters, State(0, phase, s + sign * ds, v + sign * dv), end)[0]
                for sign in (1.0, -1.0))
            columns.append([(ahead.displacement - behind.displacement) / (2 * h),
                            (ahead.velocity - behind.velocity) / (2 * h)])
        scale = max(1.0, float(np.abs(product).max()))
        assert np.allclose(np.transpose(columns), product, rtol=0.0, atol=1e-6 * scale**2)
        compared += 1
    assert compared >= 5


def test_an_impact_with_a_kick() -> None:
    """With a kick S is the derivative of a rebound that comes -ds/v later."""
    alpha, beta, gamma, r = 0.6, 0.1, 0.1, 0.9
    phase, v, kick, h = 1.0, 0.8, 0.3, 1e-6

    def force(tau: float, velocity: float) -> float:
        return (-alpha * math.sin(tau) + alpha * beta * math.cos(tau) + gamma - beta * velocity)

    after = -r * v + kick
    s11, s21, s22 = impact_matrix(phase, v, after, Model(alpha, beta, gamma, r))

    def shifted(ds: float, dv: float) -> tuple[float, float]:
        # To first order in the delay: hit later, rebound, and come back to the same time.
        delay = -ds / v
        hit = v + dv + force(phase, v) * delay
        back = -r * hit + kick
        return -back * delay, back - force(phase, after) * delay

    for ds, dv, column in ((h, 0.0, (s11, s21)), (0.0, h, (0.0, s22))):
        difference = np.subtract(shifted(ds, dv), shifted(-ds, -dv)) / (2 * h)
        assert np.allclose(difference, column, rtol=1e-6, atol=1e-6)
    assert log_determinant(v, after, r, 0.0) == pytest.approx(math.log(abs(s11 * s22)), rel=1e-14)
