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

"""Corner cases on the walls: initial conditions, grazing, chatter, sticking, release, rest."""

import math

import mpmath as mp
import numpy as np
import pytest
from reference import DIGITS, Flight

from gear_rattle_ros.core.flight.elementary import TWO_PI
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EventArray, EventKind, Parameters, State, STICKING_SPEED


def times(events: EventArray) -> np.ndarray:
    """Return the times of events [1]."""
    return events['cycle'] * TWO_PI + events['phase']


@pytest.mark.parametrize('wall, towards', [(0.0, 1.0), (-1.0, -1.0)])
def test_a_state_moving_into_its_wall_is_an_impact_at_once(wall: float, towards: float) -> None:
    """The first impact has the phase, the place and the velocity of the initial condition."""
    simulation = Simulation(Parameters(), State(2, 1.0, wall, 0.5 * towards))
    first = simulation.advance(9, 0.0, 2)[1]
    assert (first['kind'], first['index']) == (EventKind.IMPACT, 1)
    assert (first['cycle'], first['phase'], first['displacement']) == (2, 1.0, wall)
    assert first['velocity'] == 0.5 * towards
    assert first['velocity_after'] == -0.9 * 0.5 * towards


@pytest.mark.parametrize('wall, towards', [(0.0, 1.0), (-1.0, -1.0)])
def test_a_state_moving_off_its_wall_is_no_impact(wall: float, towards: float) -> None:
    """The first impact comes later and is right in 50 digits."""
    flight = Flight(1.0, wall, -0.5 * towards, 0.48, 0.1, 0.1)
    simulation = Simulation(Parameters(), State(0, 1.0, wall, -0.5 * towards))
    first = simulation.advance(9, 0.0, 2)[1]
    with mp.workdps(DIGITS):
        d = mp.findroot(
            lambda x: flight.displacement_at(x) - float(first['displacement']),
            float(times(first)) - 1.0)
        assert d > 0.1
        assert abs(float(times(first)) - 1.0 - d) < 4e-15
        assert not [x for x in mp.linspace(d / 1000, d * 0.999, 999)
                    if not -1 < flight.displacement_at(x) < 0]


@pytest.mark.parametrize('wall, gamma', [(0.0, -0.3), (-1.0, 0.3)])
@pytest.mark.parametrize('alpha, beta', [(0.0, 0.0), (0.0, 0.1), (0.1, 0.0), (0.1, 2.0)])
def test_a_state_at_rest_on_a_wall_that_does_not_press(
        wall: float, gamma: float, alpha: float, beta: float) -> None:
    """The gear leaves at once and meets the other wall first, at the time of 50 digits."""
    first = Simulation(Parameters(alpha, beta, gamma, 0.9), State(0, 0.0, wall, 0.0)).advance(
        20, 0.0, 2)[1]
    flight = Flight(0.0, wall, 0.0, alpha, beta, gamma)
    other = -1.0 - wall
    assert first['displacement'] == other
    with mp.workdps(DIGITS):
        d = mp.findroot(lambda x: flight.displacement_at(x) - other, float(times(first)))
        assert abs(float(times(first)) - d) < 2e-15 * max(1.0, float(d))


@pytest.mark.parametrize('wall, gamma', [(0.0, 0.3), (-1.0, -0.3)])
@pytest.mark.parametrize('restitution', [0.0, 0.9, 1.0])
def test_a_state_at_rest_on_a_wall_that_always_presses(
        wall: float, gamma: float, restitution: float) -> None:
    """Without a release no event ever comes, and the end is known."""
    simulation = Simulation(Parameters(0.2, 0.1, gamma, restitution), State(0, 0.0, wall, 0.0))
    assert simulation.is_permanently_at_rest
    assert len(simulation.advance(10**6, 0.0, 100)) == 1
    assert simulation.state == State(10**6, 0.0, wall, 0.0)


@pytest.mark.parametrize('alpha', [1e-150, 1e-200, 1.2207559806784711e-255, 5e-324])
def test_the_faintest_force_releases_at_its_zero(alpha: float) -> None:
    """Its square is not a number that floats have; without load it changes sign at 0 and pi."""
    for wall, phase, zero in ((0.0, 4.0, (1, 0.0)), (-1.0, 1.0, (0, math.pi))):
        simulation = Simulation(Parameters(alpha, 0.0, 0.0, alpha), State(0, phase, wall))
        release = simulation.advance(3, 0.0, 2)[1]
        assert release['kind'] == EventKind.RELEASE
        assert (release['cycle'], release['phase']) == (
            zero[0], pytest.approx(zero[1], abs=1e-14))


@pytest.mark.parametrize('alpha, beta, gamma, wall', [
    (0.5, 0.1, 0.1, 0.0), (0.5, 0.0, 0.3, 0.0), (2.0, 0.7, -0.4, -1.0), (1.0, 0.1, 0.0, -1.0)])
def test_release_at_the_zero_of_the_force(
        alpha: float, beta: float, gamma: float, wall: float) -> None:
    """A pressed gear leaves at the next zero of a(tau, 0), to an ulp or two, with no velocity."""
    towards = 1.0 if wall == 0.0 else -1.0
    with mp.workdps(DIGITS):
        def force(tau: mp.mpf) -> mp.mpf:
            return towards * (-alpha * mp.sin(tau) + mp.mpf(alpha) * beta * mp.cos(tau) + gamma)

        pressed = [k * TWO_PI / 64 for k in range(64) if force(k * TWO_PI / 64) > 0]
        assert pressed
        for phase in pressed[::5]:
            parameters = Parameters(alpha, beta, gamma, 0.9)
            release = Simulation(parameters, State(0, phase, wall)).advance(3, 0.0, 2)[1]
            assert release['kind'] == EventKind.RELEASE
            assert release['velocity'] == release['velocity_after'] == 0.0
            found = times(release)
            assert phase <= found < phase + TWO_PI
            zero = mp.findroot(force, float(found))
            assert abs(found - zero) < 2e-15 * max(1.0, float(abs(zero)))
            assert force(zero + mp.mpf('1e-6')) < 0 < force(zero - mp.mpf('1e-6'))
            # It is the next one: pressed all the way.
            assert all(force(x) > 0 for x in np.linspace(phase, float(found) - 1e-6, 200))


@pytest.mark.parametrize('restitution', [0.3, 0.9])
@pytest.mark.parametrize('wall, gamma', [(0.0, 0.3), (-1.0, -0.3)])
def test_chatter_under_a_constant_force_is_geometric(
        restitution: float, wall: float, gamma: float) -> None:
    """Flights last 2 v/g, shrink by r, and end in all after 2 v r/(g (1 - r))."""
    towards = 1.0 if wall == 0.0 else -1.0
    g, v = abs(gamma), 0.1
    events = Simulation(Parameters(0.0, 0.0, gamma, restitution), State(0, 0.0, wall, towards * v)
                        ).advance(10**4, 0.0, 1000)[1:]
    count = math.ceil(math.log(STICKING_SPEED / v) / math.log(restitution))
    assert len(events) == count
    powers = v * restitution ** np.arange(count)
    assert np.allclose(towards * events['velocity'], powers, rtol=1e-12, atol=0.0)
    lasted = np.diff(times(events))
    assert np.allclose(lasted, 2.0 * powers[1:] / g, rtol=1e-12, atol=1e-14)
    assert times(events[-1]) == pytest.approx(
        2.0 * v * restitution / (g * (1.0 - restitution)), abs=1e-8)
    assert list(events['kind'][:-1]) == [EventKind.IMPACT] * (count - 1)
    assert events['kind'][-1] == EventKind.STICK
    assert events['velocity_after'][-1] == 0.0
    assert restitution * abs(events['velocity'][-1]) < STICKING_SPEED


def test_chatter_at_the_parameters_of_the_paper_ends_and_goes_on() -> None:
    """A chattering gear sticks, is released at the zero of the force, and rattles on."""
    parameters = Parameters(0.48, 0.1, 0.1, 0.9)
    sticking = 0
    for phase in np.linspace(4.5, 6.2, 30):
        events = Simulation(parameters, State(0, float(phase), 0.0, 0.02)).advance(30, 0.0, 4000)
        sticks = np.flatnonzero(events['kind'] == EventKind.STICK)
        sticking += len(sticks)
        for k in sticks:
            assert events['velocity_after'][k] == 0.0
            after = events[k + 1]
            assert after['kind'] == EventKind.RELEASE
            assert after['displacement'] == events['displacement'][k]
            assert after['index'] == events['index'][k]
            towards = 1.0 if after['displacement'] == 0.0 else -1.0
            zero = math.asin(0.1 / (0.48 * math.sqrt(1.01)))
            zero = (zero if towards > 0 else math.pi - zero) + math.atan(0.1)
            assert after['phase'] == pytest.approx(zero, abs=1e-14)
        assert int(events['cycle'][-1]) >= 29
    assert sticking > 0


def test_without_restitution_the_gear_sticks_or_leaves_at_once() -> None:
    """With r = 0: after an impact the velocity is zero, and pressed means stuck."""
    rng = np.random.default_rng(0)
    kinds: set[int] = set()
    for _ in range(60):
        events = Simulation(Parameters(0.8, 0.1, 0.05, 0.0), State(
            0, float(rng.uniform(0.0, TWO_PI)), -0.5, 1.5)).advance(30, 0.0, 3000)[1:]
        hits = events[events['kind'] <= EventKind.STICK]
        towards = np.where(hits['displacement'] == 0.0, 1.0, -1.0)
        force = towards * (0.8 * (0.1 * np.cos(hits['phase']) - np.sin(hits['phase'])) + 0.05)
        assert np.all(hits['velocity_after'] == 0.0)
        assert np.array_equal(hits['kind'] == EventKind.STICK, force > 0.0)
        kinds |= set(hits['kind'].tolist())
    assert kinds == {EventKind.IMPACT, EventKind.STICK}


def test_an_elastic_gear_never_sticks() -> None:
    """With r = 1 under a constant force: the same bounce again and again, however small."""
    for v in (1e-3, 1e-9, 1e-12):
        events = Simulation(Parameters(0.0, 0.0, 0.2, 1.0), State(0, 0.0, 0.0, v)).advance(
            10**4, 0.0, 500)[1:]
        assert len(events) == 499
        assert np.all(events['kind'] == EventKind.IMPACT)
        assert np.allclose(events['velocity'], v, rtol=1e-12, atol=0.0)


@pytest.mark.parametrize('beta', [0.0, 0.1])
@pytest.mark.parametrize('short', [0.0, 1e-16, 1e-13, 1e-11, 1e-9])
def test_a_load_as_strong_as_the_drive_does_not_hang(beta: float, short: float) -> None:
    """With gamma next to alpha sqrt(1 + beta^2): releases vanish, and time goes on."""
    amplitude = 0.5 * math.sqrt(1.0 + beta * beta)
    simulation = Simulation(
        Parameters(0.5, beta, amplitude * (1.0 - short), 0.9), State(0, 0.0, -0.3, 0.1))
    events = simulation.advance(40, 0.0, 20000)
    assert len(events) < 20000
    assert simulation.state.displacement == 0.0
    assert EventKind.STICK in events['kind']


@pytest.mark.parametrize('beta, velocity', [(0.0, 0.0), (0.1, 0.0), (1.0, 0.3), (100.0, -20.0)])
def test_motion_that_decays_between_the_walls(beta: float, velocity: float) -> None:
    """Without any force there is no event, and the gear stands at s0 + v0/beta."""
    simulation = Simulation(Parameters(0.0, beta, 0.0, 0.9), State(0, 0.0, -0.5, velocity))
    assert len(simulation.advance(10**4, 0.0, 100)) == 1
    state = simulation.state
    assert state.velocity == pytest.approx(0.0, abs=1e-300)
    assert state.displacement == pytest.approx(
        -0.5 + (velocity / beta if beta else 0.0), abs=1e-12)


@pytest.mark.parametrize('gamma, wall', [(-1000.0, 0.0), (1000.0, -1.0)])
def test_a_weak_drive_under_a_strong_load_passes_no_wall(gamma: float, wall: float) -> None:
    """A gear released on one wall hits the other after sqrt(2/|gamma|)."""
    first = Simulation(Parameters(1e-9, 0.0, gamma, 0.5), State(0, 0.0, wall)).advance(
        1, 0.0, 2)[1]
    assert first['displacement'] == -1.0 - wall
    assert first['phase'] == pytest.approx(math.sqrt(2.0 / 1000.0), rel=1e-9)
