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

"""The closed-form flight and the first impact against 50-digit arithmetic, scipy and itself."""

import math

from hypothesis import given, strategies as st
import mpmath as mp
import numpy as np
import pytest
from reference import DIGITS, Flight, roots
from scipy.integrate import solve_ivp

from gear_rattle_ros.core.flight.closed_form import (
    acceleration,
    displace,
    elapsed,
    later,
    LOWER,
    NO_WALL,
    rebound,
    UPPER,
)
from gear_rattle_ros.core.flight.elementary import sine_cosine, TWO_PI
from gear_rattle_ros.core.flight.first_impact import search_impact
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EventKind, Model, Parameters, State

EPS = 2.0**-52


def random_flight(rng: np.random.Generator, scale: float = 1.0) -> Flight:
    """Return a flight from a random state; one parameter in five is exactly zero."""
    def some(value: float) -> float:
        return 0.0 if rng.random() < 0.2 else float(value)

    wall = rng.random()
    displacement = float(-rng.random()) if wall < 0.5 else (0.0 if wall < 0.75 else -1.0)
    return Flight(
        phase=float(rng.uniform(0.0, TWO_PI)), displacement=displacement,
        velocity=float(rng.normal(0.0, scale)), alpha=some(10.0**rng.uniform(-2, 1)),
        beta=some(10.0**rng.uniform(-4, 0.5)), gamma=some(rng.normal(0.0, 0.5)))


def first_impact(flight: Flight, stop: float) -> tuple[float, float, int]:
    """Search from the beginning of a flight."""
    d, _, velocity, wall = search_impact(
        0.0, 0, stop, flight.phase, flight.displacement, flight.velocity, flight.model)
    return d, velocity, wall


def scanned_displacement(flight: Flight, d: np.ndarray) -> np.ndarray:
    """Evaluate eq. (4) as it stands in the paper, in numpy."""
    f = flight
    if f.beta == 0.0:
        fall, pull = d, f.gamma * d * d / 2
    else:
        fall = -np.expm1(-f.beta * d) / f.beta
        pull = f.gamma / f.beta * (d - fall)
    return (f.displacement + f.alpha * (np.sin(f.phase + d) - np.sin(f.phase)) + pull
            + fall * (f.velocity - f.alpha * np.cos(f.phase)))


def test_equations_4_and_5_to_the_last_digits() -> None:
    """Displacement and velocity equal the paper's formulas in 50 digits."""
    rng = np.random.default_rng(4)
    with mp.workdps(DIGITS):
        for _ in range(300):
            f = random_flight(rng)
            d = float(10.0**rng.uniform(-9, 2))
            moved, velocity, sine, cosine = displace(
                d, *sine_cosine(f.phase), f.velocity, f.model)
            fast = abs(f.velocity) + f.alpha + abs(f.gamma) * d
            size = (abs(f.velocity) + f.alpha + abs(f.gamma) * d + 1e-3) * min(d, 1 + d)
            assert abs(moved - (f.displacement_at(d) - f.displacement)) < 8 * EPS * size
            assert abs(velocity - f.velocity_at(d)) < 8 * EPS * fast
            assert abs(sine - mp.sin(mp.mpf(f.phase) + d)) < 6 * EPS
            assert abs(cosine - mp.cos(mp.mpf(f.phase) + d)) < 6 * EPS


def test_equations_4_and_5_satisfy_the_differential_equation() -> None:
    """The derivatives of (4) and (5) are v and a(tau, v)."""
    rng = np.random.default_rng(5)
    for _ in range(100):
        f = random_flight(rng)
        d, h = float(rng.uniform(0.1, 5.0)), 1e-4
        near = [displace(d + k * h, *sine_cosine(f.phase), f.velocity, f.model)
                for k in (-2, -1, 0, 1, 2)]
        s_dot, v_dot = (
            (near[0][i] - 8 * near[1][i] + 8 * near[3][i] - near[4][i]) / (12 * h) for i in (0, 1))
        _, v, sine, cosine = near[2]
        size = 1.0 + f.alpha + abs(f.velocity) + abs(f.gamma)
        assert s_dot == pytest.approx(v, abs=1e-10 * size)
        assert v_dot == pytest.approx(
            acceleration(sine, cosine, v, f.model), abs=1e-10 * size)


@pytest.mark.parametrize('alpha, beta, gamma', [
    (0.48, 0.1, 0.1), (1.244, 0.1, 0.1), (3.0, 0.0, -0.4), (0.7, 0.5, 0.0)])
def test_a_handful_of_impacts_by_scipy(alpha: float, beta: float, gamma: float) -> None:
    """Impact by impact the events are those of an integrator with event detection."""
    def right_side(tau: float, y: np.ndarray) -> tuple[float, float]:
        return y[1], (-alpha * math.sin(tau) + alpha * beta * math.cos(tau) + gamma - beta * y[1])

    def upper(tau: float, y: np.ndarray) -> float:
        return y[0]

    def lower(tau: float, y: np.ndarray) -> float:
        return y[0] + 1.0

    upper.terminal = lower.terminal = True  # type: ignore[attr-defined]
    upper.direction, lower.direction = 1.0, -1.0  # type: ignore[attr-defined]
    tau, y = 0.3, [-0.5, 0.4]
    simulation = Simulation(Parameters(alpha, beta, gamma, 0.9), State(0, tau, *y))
    events = simulation.advance(10, 0.0, 8)[1:]
    assert len(events) == 7
    for event in events:
        flight = solve_ivp(right_side, (tau, tau + 50.0), y, 'DOP853', rtol=1e-13, atol=1e-14,
                           events=(upper, lower))
        hit_upper = len(flight.t_events[0]) > 0
        tau, velocity = flight.t[-1], flight.y[1, -1]
        assert event['displacement'] == (0.0 if hit_upper else -1.0)
        assert event['cycle'] * TWO_PI + event['phase'] == pytest.approx(tau, abs=1e-9)
        assert event['velocity'] == pytest.approx(velocity, abs=1e-9)
        y = [float(event['displacement']), -0.9 * velocity]


@pytest.mark.parametrize('scale, count', [(1.0, 150), (0.02, 60), (30.0, 30)])
def test_first_impact_in_50_digits(scale: float, count: int) -> None:
    """Time and velocity are right to a few ulp, and no earlier crossing exists."""
    rng = np.random.default_rng(int(100 * scale))
    compared = 0
    with mp.workdps(DIGITS):
        for _ in range(count):
            f = random_flight(rng, scale)
            d, velocity, wall = first_impact(f, 300.0)
            if wall == NO_WALL:
                continue
            level = 0.0 if wall == UPPER else -1.0
            # No earlier crossing: neither in a dense scan nor, by its turning points, between.
            times = np.linspace(0.0, d, 20001)[1:-1]
            path = scanned_displacement(f, times)
            assert path.max(initial=-1.0) <= 2e-14 * max(1.0, d)
            assert path.min(initial=0.0) >= -1.0 - 2e-14 * max(1.0, d)
            if d == 0.0:
                assert f.displacement == level
                continue
            root = mp.findroot(lambda x, f=f, level=level: f.displacement_at(x) - level, d,
                               verify=False)
            speed = abs(f.velocity_at(root))
            if speed < 1e-3:
                continue
            compared += 1
            # The rounding of the displacement as a time, and a few ulp of the phase.
            rough = 4 * EPS * (1.0 + f.alpha + abs(f.gamma) * d + abs(f.velocity) * min(d, 1.0))
            assert abs(d - root) < 4 * EPS * (d + 1.0) + rough / speed
            assert abs(velocity - f.velocity_at(root)) < (
                8 * EPS * (abs(f.velocity) + f.alpha + abs(f.gamma) * d)
                + abs(f.acceleration_at(root)) * abs(d - root))
            assert velocity * (1.0 if wall == UPPER else -1.0) > 0.0
    assert compared > count / 2


@pytest.mark.parametrize('beta', [10.0, 100.0])
def test_first_impact_under_strong_damping(beta: float) -> None:
    """Where the fourth derivative is largest the phase is still right to a few ulp."""
    rng = np.random.default_rng(int(beta))
    with mp.workdps(DIGITS):
        for _ in range(60):
            f = Flight(float(rng.uniform(0.0, TWO_PI)), 0.0, -float(rng.uniform(1.1, 3.0)) * beta,
                       float(rng.uniform(0.0, 5.0)), beta, float(rng.normal()))
            d, velocity, wall = first_impact(f, 300.0)
            assert wall != NO_WALL
            level = 0 if wall == UPPER else -1
            root = mp.findroot(lambda x, f=f, y=level: f.displacement_at(x) - y, d, verify=False)
            if abs(velocity) > 0.05 * beta:
                assert abs(d - root) < 4 * math.ulp(f.phase + d)
                assert velocity == pytest.approx(float(f.velocity_at(root)), rel=1e-12)


@pytest.mark.parametrize('offset', [
    1e-6, 1e-12, *(pytest.param(offset, marks=pytest.mark.long) for offset in (1e-3, 1e-9))])
@pytest.mark.parametrize('upper', [True, False])
def test_grazing_is_neither_missed_nor_invented(offset: float, upper: bool) -> None:
    """A flight that turns a hair beyond the wall hits it; a hair before, it does not."""
    rng = np.random.default_rng(7)
    towards = 1.0 if upper else -1.0
    tried = 0
    with mp.workdps(DIGITS):
        while tried < 15:
            alpha = float(rng.uniform(0.3, 3.0))
            beta = float(rng.choice([0.0, 0.1, 0.5]))
            gamma = float(rng.normal(0.0, 0.3))
            phase = float(rng.uniform(0.0, TWO_PI))
            backwards = -float(rng.uniform(0.1, 0.5))
            # The turning point is at the wall, give or take the offset; its past is exact.
            turn = Flight(phase, 0.0 if upper else -1.0, 0.0, alpha, beta, gamma)
            if towards * turn.acceleration_at(mp.mpf(0)) > -0.1:
                continue
            start = (turn.displacement_at(backwards), turn.velocity_at(backwards))
            inside = [turn.displacement_at(backwards * k / 200) for k in range(1, 201)]
            if phase + backwards < 0.0 or not all(-1 < s < 0 for s in inside):
                continue
            tried += 1
            for sign in (1.0, -1.0):
                displacement = float(start[0]) + sign * towards * offset
                f = Flight(phase + backwards, displacement, float(start[1]), alpha, beta, gamma)
                # The extremum of the flight that was really started, rounding included.
                crest = mp.findroot(f.velocity_at, -backwards)
                beyond = towards * (f.displacement_at(crest) - turn.displacement)
                d, velocity, wall = first_impact(f, 30.0)
                if beyond > 1e-15:
                    first = next(roots(
                        lambda x, f=f: f.displacement_at(x) - (0 if upper else -1),
                        [0.0, float(crest)]))
                    assert wall == (UPPER if upper else LOWER)
                    speed = float(mp.sqrt(2 * beyond * abs(f.acceleration_at(crest))))
                    assert d <= crest
                    assert abs(d - first) < 1e-14 + 20 * EPS / speed
                    assert abs(velocity) == pytest.approx(
                        abs(float(f.velocity_at(first))), abs=1e-13 + 60 * EPS / speed)
                elif beyond < -1e-15:
                    assert wall == NO_WALL or d > crest
                    path = scanned_displacement(f, np.linspace(0.0, d, 5000)[1:-1])
                    assert path.min() > -1.0 - 1e-13 and path.max() < 1e-13


@given(
    phase=st.floats(0.0, TWO_PI, exclude_max=True), displacement=st.floats(-1.0, 0.0),
    velocity=st.floats(-20.0, 20.0), alpha=st.floats(0.0, 20.0), beta=st.floats(0.0, 5.0),
    gamma=st.floats(-5.0, 5.0), cuts=st.lists(st.floats(0.0, 50.0), max_size=5))
def test_a_search_may_be_stopped_and_resumed(
        phase: float, displacement: float, velocity: float, alpha: float, beta: float,
        gamma: float, cuts: list[float]) -> None:
    """The impact is the same to the bit, wherever the search was stopped."""
    force = alpha + abs(gamma)
    if force == 0.0 and (velocity == 0.0 or beta > 0.0):
        return  # Flights without end have their own tests.
    f = Flight(phase, displacement, velocity, alpha, beta, gamma)
    whole = first_impact(f, 60.0)
    d, effort, found, wall = 0.0, 0, velocity, NO_WALL
    for cut in [*sorted(cuts), 60.0]:
        if wall == NO_WALL and d < cut:
            d, effort, found, wall = search_impact(
                d, effort, cut, phase, displacement, velocity, f.model)
    assert (d, wall) == (whole[0], whole[2])
    assert found == whole[1]


def test_impact_law() -> None:
    """v+ = -r v- at either wall, exactly; a kick never drives the gear through the wall."""
    model = Model(0.5, 0.1, 0.1, 0.9)
    assert rebound(0.7, 1.0, model, 0.0) == -0.9 * 0.7
    assert rebound(-0.7, 1.0, model, 0.0) == 0.9 * 0.7
    for kick in (-5.0, -0.1, 0.1, 5.0):
        assert rebound(0.7, 1.0, model, kick) == -abs(-0.9 * 0.7 + kick)
        assert rebound(-0.7, 1.0, model, kick) == abs(0.9 * 0.7 + kick)


@given(phase=st.floats(0.0, TWO_PI, exclude_max=True), d=st.floats(0.0, 1e5))
def test_phase_after_a_time(phase: float, d: float) -> None:
    """Phase and periods are those of 50-digit arithmetic, to an ulp of phase and of the time."""
    periods, rest = later(phase, d)
    assert 0.0 <= rest < TWO_PI
    with mp.workdps(DIGITS):
        exact = mp.mpf(phase) + mp.mpf(d)
        assert abs(periods * 2 * mp.pi + rest - exact) < 2.5 * EPS * (1 + rest) + math.ulp(d)


def test_elapsed_time() -> None:
    """Time between two moments counts whole periods and phases."""
    assert elapsed(0, 1.0, 2.5) == 1.5
    assert elapsed(1, 6.0, 0.5) == pytest.approx(0.5 + TWO_PI - 6.0, rel=1e-15)
    assert elapsed(0, 2.5, 1.0) == -1.5


def test_the_first_record_is_the_initial_condition() -> None:
    """A stream begins with the state it was given, bit for bit."""
    state = State(3, 1.25, -0.375, 0.1)
    record = Simulation(Parameters(), state).advance(3, 1.25, 1)[0]
    assert record['kind'] == EventKind.RESET
    assert (record['cycle'], record['phase']) == (3, 1.25)
    assert (record['displacement'], record['velocity_after']) == (-0.375, 0.1)
