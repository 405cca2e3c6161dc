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

"""Orbits, balances and chatter whose values are known in closed form."""

import math

import numpy as np
import pytest

from gear_rattle_ros.attractors.finding import find_attractors
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.core.flight.elementary import TWO_PI
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EventKind, Parameters, State, Wall
from gear_rattle_ros.core.orbits.orbit import close_orbit, orbit_at

FAR = 10**8
UPPER = np.array([Wall.UPPER])


def one_impact(p: Parameters, periods: int = 1) -> tuple[float, float]:
    """Return velocity and ``alpha cos tau`` of the orbit of one impact on the upper wall."""
    velocity = TWO_PI * periods * p.gamma / (1.0 + p.restitution)
    if p.beta == 0.0:
        return velocity, 0.5 * (1.0 - p.restitution) * velocity
    decay = math.expm1(-TWO_PI * periods * p.beta)
    return velocity, -p.restitution * velocity - p.gamma / p.beta - (
        TWO_PI * periods * p.gamma / decay)


@pytest.mark.parametrize('p', [
    Parameters(0.06), Parameters(0.1), Parameters(0.1176), Parameters(0.11, 0.0, 0.16, 0.8),
    Parameters(0.12, 0.4, 0.05, 0.5)])
def test_the_orbit_of_one_impact(p: Parameters) -> None:
    """Its velocity is 2 pi gamma/(1 + r); its two phases, born in a fold, have the cosine c."""
    velocity, c = one_impact(p)
    turn = math.acos(c / p.alpha)
    stable = 0
    for phase in (turn, TWO_PI - turn):
        orbit = close_orbit(UPPER, np.array([[phase + 1e-4, velocity * (1.0 + 1e-4)]]), p)
        assert orbit is not None and (orbit.impacts, orbit.drive_periods) == (1, 1)
        assert np.allclose(orbit.points, [[phase, velocity]], rtol=0.0, atol=1e-13)
        stable += orbit.is_stable
        # A simulation that begins on it stays, as far as its multipliers let it.
        events = Simulation(p, State(0, phase, 0.0, -p.restitution * velocity)).advance(
            FAR, 0.0, 4)
        growth = max(1.0, float(np.max(np.abs(orbit.multipliers))))**4
        assert np.allclose(events['velocity'][1:], velocity, rtol=0.0, atol=1e-13 * growth)
        assert np.allclose(events['phase'][1:], phase, rtol=0.0, atol=1e-13 * growth)
        assert np.array_equal(np.diff(events['cycle']), [1, 1, 1])
    assert stable <= 1


@pytest.mark.parametrize('restitution', [0.3, 0.7, 0.9])
@pytest.mark.parametrize('periods', [1, 2])
def test_multipliers_of_one_impact_without_drag(restitution: float, periods: int) -> None:
    """Their product is r^2 and their sum runs evenly in alpha sin tau from fold to doubling."""
    r, gamma = restitution, 0.02
    velocity, c = one_impact(Parameters(0.0, 0.0, gamma, r), periods)
    last = 2.0 * (1.0 + r * r) / (1.0 + r)**2
    for share in (0.05, 0.3, 0.5, 0.8, 0.99, 1.05):
        p = Parameters(math.hypot(c, gamma * last * share), 0.0, gamma, r)
        orbit = orbit_at(UPPER, np.array([[math.atan2(gamma * last * share, c), velocity]]), p)
        assert orbit is not None
        trace = (1.0 + r * r) * (1.0 - 2.0 * share)
        first, second = orbit.multipliers
        assert complex(first + second) == pytest.approx(trace, abs=1e-11)
        assert complex(first * second) == pytest.approx(r * r, abs=1e-11)
        if abs(trace) < 2.0 * r:
            assert np.allclose(np.abs(orbit.multipliers), r, rtol=1e-10)
        assert orbit.is_stable == (share < 1.0)


@pytest.mark.parametrize('p', [
    Parameters(0.57), Parameters(1.244), Parameters(3.0, 0.0, 0.0, 0.95), Parameters(0.09),
    Parameters(0.9, 0.3, -0.2, 0.4), Parameters(2.0, 0.1, 0.5, 0.0)])
def test_impulses_balance_the_load(p: Parameters) -> None:
    """
    The walls' impulses over a time T are gamma T, but for a bounded rest that is known, too.

    Every flight has s'' + beta s' = d/dtau (alpha cos tau + alpha beta sin tau + gamma tau).
    """
    events = Simulation(p, State(0, 1.0, -0.5, 0.7)).advance(FAR, 0.0, 20_000)
    tau = events['cycle'] * TWO_PI + events['phase']
    push = p.alpha * (np.cos(events['phase']) + p.beta * np.sin(events['phase']))
    hits = events['kind'] <= EventKind.STICK
    impulse = np.sum((events['velocity'] - events['velocity_after'])[hits])
    held = np.flatnonzero(events['kind'] == EventKind.RELEASE)
    impulse += np.sum(push[held] - push[held - 1] + p.gamma * (tau[held] - tau[held - 1]))
    duration = tau[-1] - tau[0]
    rest = (push[-1] - push[0] - p.beta * (events['displacement'][-1] - events['displacement'][0])
            - (events['velocity_after'][-1] - events['velocity_after'][0]))
    assert impulse == pytest.approx(p.gamma * duration + rest, rel=1e-12, abs=1e-9)
    assert abs(impulse / duration - p.gamma) < 10.0 * (1.0 + p.alpha) / duration
    assert len(held) > 5 or p.restitution > 0.5


@pytest.mark.parametrize(('p', 'orbits'), [
    (Parameters(0.48), {(3, 1), (2, 1)}), (Parameters(1.25), {(4, 1)}),
    (Parameters(1.6, 0.02, 0.2, 0.6), set())])
def test_determinant_of_an_orbit(p: Parameters, orbits: set[tuple[int, int]]) -> None:
    """Multipliers of q impacts in p periods have the product r^(2 q) exp(-2 pi beta p)."""
    found = find_attractors(
        p, Plane().draw(p, 48, 1), hold=4000, chaotic=False).orbits
    assert found and orbits <= {(orbit.impacts, orbit.drive_periods) for orbit in found}
    for orbit in found:
        exact = p.restitution**(2 * orbit.impacts) * math.exp(
            -TWO_PI * p.beta * orbit.drive_periods)
        assert complex(np.prod(orbit.multipliers)) == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize('velocity', [1e-3, 0.1, 0.4])
@pytest.mark.parametrize('restitution', [0.2, 0.9])
def test_chatter_under_the_load_alone_ends_at_a_known_time(
        velocity: float, restitution: float) -> None:
    """Without drive and drag the gear sticks at 2 v/(gamma (1 - r)), and rests permanently."""
    simulation = Simulation(Parameters(0.0, 0.0, 0.1, restitution), State(0, 0.0, 0.0, -velocity))
    events = simulation.advance(FAR, 0.0, 10_000)
    assert events['kind'][-1] == EventKind.STICK and simulation.is_permanently_at_rest
    stuck = events['cycle'][-1] * TWO_PI + events['phase'][-1]
    # It sticks when it is slower than 1e-10.
    assert stuck == pytest.approx(2.0 * velocity / (0.1 * (1.0 - restitution)), abs=1e-7)
    assert events['displacement'][-1] == 0.0
