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

"""The bound of the search for an impact (doc/steps.md): each inequality, and what is found."""

from collections.abc import Iterator
import itertools
import math
from typing import Any

import mpmath as mp
import numba
import numpy as np
import pytest
from reference import DIGITS, Flight

from gear_rattle_ros.core.flight.closed_form import LEG, NO_WALL, stays_clear, UPPER
from gear_rattle_ros.core.flight.elementary import TWO_PI
from gear_rattle_ros.core.flight.first_impact import (
    bisect_on,
    force_zero_delay,
    HALVINGS,
    middle,
    search_impact,
)
from gear_rattle_ros.core.model import Model

EPS = 2.0**-52
Array = np.ndarray[Any, Any]


def proved_bound(d: float) -> float:
    """Return the bound of doc/steps.md, with its numbers as they stand there."""
    return 338.0 + (4.0 + 69.0 / math.pi) * d


def random_states(seed: int, count: int) -> Array:
    """Return phase, s, v, alpha, beta, gamma of any size, some of them exactly zero."""
    rng = np.random.default_rng(seed)

    def some(values: Array) -> Array:
        return np.where(rng.random(count) < 0.15, 0.0, values)

    place = rng.integers(0, 4, count)
    return np.column_stack([
        rng.uniform(0.0, TWO_PI, count),
        np.select([place == 2, place == 3], [0.0, -1.0], -rng.random(count)),
        rng.normal(0.0, 1.0, count) * 10.0**rng.uniform(-12.0, 4.0, count),
        some(10.0**rng.uniform(-3.0, 3.0, count)),
        some(10.0**rng.uniform(-3.0, 2.0, count)),
        some(rng.normal(0.0, 1.0, count) * 10.0**rng.uniform(-3.0, 3.0, count))])


def tangencies(seed: int, count: int) -> Iterator[Flight]:
    """Yield flights from the upper wall and between the walls that nearly touch it, v = a = 0."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        alpha = 10.0**rng.uniform(-3.0, 3.0)
        nearly = 1.0 + rng.choice([-1.0, 1.0]) * 10.0**rng.uniform(-16.0, -1.0)
        if k % 2 == 0:
            # s is about -alpha/24 t (T - t)^3.
            duration = 10.0**rng.uniform(-7.0, -0.5)
            yield Flight(0.5 * math.pi - 0.75 * duration, 0.0,
                         -alpha * duration**3 / 24.0 * nearly, alpha, 0.0,
                         alpha * math.cos(0.25 * duration))
            continue
        beta = float(rng.choice([0.0, 0.1, 1.0]))
        amplitude = alpha * math.sqrt(1.0 + beta * beta)
        gamma = amplitude * rng.uniform(-1.0, 1.0)
        phase = math.pi - math.asin(gamma / amplitude) + math.atan(beta)
        back = 10.0**rng.uniform(-3.0, 0.0)
        there = Flight(phase, 0.0, 0.0, alpha, beta, gamma)
        s0 = float(there.displacement_at(mp.mpf(-back))) * nearly
        if -1.0 <= s0 <= 0.0:
            yield Flight((phase - back) % TWO_PI, s0, float(there.velocity_at(mp.mpf(-back))),
                         alpha, beta, gamma)


def test_force_changes_its_sign_where_predicted_and_not_before() -> None:
    """At most two zeros of a(tau, 0) in a drive period: the next is returned, in 50 digits."""
    with mp.workdps(DIGITS):
        for phase, _, _, alpha, beta, gamma in random_states(1, 100).tolist():
            f = Flight(phase, 0.0, 0.0, alpha, beta, gamma)
            delay = force_zero_delay(phase, 1e-14, f.model)
            size = alpha * (1.0 + beta) + abs(gamma)

            def force(t: Any, f: Flight = f) -> Any:
                """Return a(tau, 0), eq. (3)."""
                return (f.alpha * (f.beta * mp.cos(f.phase + t) - mp.sin(f.phase + t)) + f.gamma)

            assert 0.0 < delay <= TWO_PI + 1e-14
            if abs(gamma) < alpha * math.sqrt(1.0 + beta * beta):
                assert abs(force(mp.mpf(delay))) < 20 * EPS * size
            signs = {mp.sign(force(delay * mp.mpf(k) / 60)) for k in range(1, 60)}
            assert len(signs) == 1


def test_a_flight_turns_once_at_most_between_zeros_of_the_force() -> None:
    """exp(beta t) v has the derivative exp(beta t) a(tau, 0), so v changes its sign once."""
    with mp.workdps(DIGITS):
        for phase, s, v, alpha, beta, gamma in random_states(2, 40).tolist():
            f = Flight(phase, s, v, alpha, beta, gamma)
            delay = force_zero_delay(phase, 1e-14, f.model)
            t = mp.mpf(delay) / 3

            def grown(x: Any, f: Flight = f) -> Any:
                """Return exp(beta x) v(x)."""
                return mp.exp(f.beta * x) * f.velocity_at(x)

            slope = mp.diff(grown, t)
            rest = alpha * (beta * mp.cos(phase + t) - mp.sin(phase + t)) + gamma
            assert abs(slope - mp.exp(beta * t) * rest) < 1e-12 * abs(slope) + 1e-20
            velocities = [f.velocity_at(delay * mp.mpf(k) / 100) for k in range(101)]
            assert sum(a * b < 0 for a, b in itertools.pairwise(velocities)) <= 1


def test_halvings_end_at_neighbours() -> None:
    """No bracket of positive times up to 1e3 takes more than 66 halvings, towards either end."""
    rng = np.random.default_rng(3)
    lows = [5e-324, 2.3e-308, 1e-300, 1e-16, 1.0, 511.0, *10.0**rng.uniform(-323, 2.9, 300)]
    for low in lows:
        for target in (low, 1e3, *(low**w * 1e3**(1.0 - w) for w in rng.random(5))):
            a, b = float(low), 1e3
            for count in range(HALVINGS + 1):  # noqa: B007
                time = middle(a, b)
                if not a < time < b:
                    break
                a, b = (time, b) if time <= target else (a, time)
            assert count <= HALVINGS == 66
            assert b == math.nextafter(a, math.inf)


@numba.njit
def by_bisection(states, found):  # type: ignore[no-untyped-def]
    """Write impacts found by bisection alone: d, velocity, wall, stretches, most evaluations."""
    for i in range(len(states)):
        phase, s, v, alpha, beta, gamma = states[i]
        model = Model(alpha, beta, gamma, 1.0)
        d, _, velocity, wall = search_impact(0.0, 0, 0.0, phase, s, v, model)
        stretches = most = last = 0
        while wall == NO_WALL and d < LEG:
            most = max(most, last)
            step, speed, wall, last = bisect_on(d, phase, s, v, model)
            d += step
            velocity = speed if wall == UPPER else -speed
            stretches += 1
        # One by one: to copy an array takes seconds to compile.
        found[i, 0], found[i, 1], found[i, 2] = d, velocity, wall
        found[i, 3], found[i, 4], found[i, 5] = stretches, most, last


@numba.njit
def by_search(states, found):  # type: ignore[no-untyped-def]
    """Write impacts found by the search: d, velocity, wall, effort."""
    for i in range(len(states)):
        phase, s, v, alpha, beta, gamma = states[i]
        d, effort, velocity, wall = search_impact(
            0.0, 0, LEG, phase, s, v, Model(alpha, beta, gamma, 1.0))
        found[i, 0], found[i, 1], found[i, 2], found[i, 3] = d, velocity, wall, effort


@pytest.mark.long
def test_bisection_alone_finds_the_impacts_of_the_search() -> None:
    """Of 50,000 flights, in as many stretches and evaluations as are proved."""
    states = random_states(4, 50_000)
    bisected, searched = np.zeros((len(states), 6)), np.zeros((len(states), 4))
    by_bisection(states, bisected)
    by_search(states, searched)
    d, velocity, wall, stretches, most, last = bisected.T
    assert np.all(stretches <= d / math.pi + 3.0)
    assert most.max() <= HALVINGS + 2 == 68
    assert last.max() <= HALVINGS + 2 + HALVINGS
    assert np.all(searched[:, 3] <= proved_bound(searched[:, 0]))
    hit = (d < LEG) | (searched[:, 0] < LEG)
    assert np.array_equal(wall[hit], searched[hit, 2])
    assert np.count_nonzero(hit) > 20_000
    late = np.abs(d - searched[:, 0])[hit]
    # Times are as uncertain as the displacement, by the velocity of the impact.
    size = 1.0 + states[hit, 3] + np.abs(states[hit, 5]) + np.abs(states[hit, 2])
    speed = np.abs(searched[hit, 1])
    assert np.all(late * speed < 1e3 * EPS * size * (1.0 + d[hit]))


@numba.njit
def which_are_clear(states, found):  # type: ignore[no-untyped-def]
    """Write which legs cannot come near a wall."""
    for i in range(len(states)):
        phase, s, v, alpha, beta, gamma = states[i]
        model = Model(alpha, beta, gamma, 1.0)
        found[i] = stays_clear(math.sin(phase), math.cos(phase), s, v, model)


def test_no_leg_that_is_clear_of_the_walls_has_an_impact() -> None:
    """None by bisection, of 2,000; and most legs without an impact are clear of them."""
    rng = np.random.default_rng(6)
    states = random_states(6, 2_000)
    # Near the oscillation between the walls, where legs without an impact are.
    states[:, 3] = 0.6 * rng.random(len(states))
    states[:, 4] *= rng.random(len(states)) < 0.5
    states[:, 5] *= 1e-6
    states[:, 2] = states[:, 3] * np.cos(states[:, 0]) + states[:, 2] * 1e-4
    clear, bisected = np.zeros(len(states), bool), np.zeros((len(states), 6))
    which_are_clear(states, clear)
    by_bisection(states, bisected)
    without = bisected[:, 2] == NO_WALL
    assert np.count_nonzero(clear) > 200
    assert not np.any(clear & ~without)
    assert np.count_nonzero(clear) > 0.8 * np.count_nonzero(without)


def test_tangencies_end_within_the_bound_and_at_the_wall() -> None:
    """Where steps shrink without end: no impact is made off a wall and none is missed."""
    slow = 0
    with mp.workdps(DIGITS):
        for f in tangencies(5, 100):
            d, effort, _, wall = search_impact(
                0.0, 0, 20.0, f.phase, f.displacement, f.velocity, f.model)
            slow += effort > 64 + 4 * d
            assert effort <= proved_bound(d)
            size = abs(f.velocity) + (f.alpha * (1.0 + f.beta) + abs(f.gamma)) * d
            # Rounding of the displacement since the beginning, and of the initial condition.
            rounding = 16 * EPS * (size * d + abs(f.displacement))
            for k in range(1, 100):
                s = f.displacement_at(d * mp.mpf(k) / 100)
                assert -1 - rounding <= s <= rounding
            if wall != NO_WALL:
                s = f.displacement_at(mp.mpf(d))
                assert abs(s - (0 if wall == UPPER else -1)) <= rounding
    assert slow > 6


@pytest.mark.parametrize('cuts', [(1e-9, 1e-6, 1e-3, 0.1), (0.5, 0.9, 0.99, 1.0, 1.0 + 1e-9)])
def test_a_slow_search_may_be_stopped_and_resumed(cuts: tuple[float, ...]) -> None:
    """It is the same to the bit, effort and all, wherever it was stopped."""
    for f in tangencies(6, 300):
        flight = (f.phase, f.displacement, f.velocity, f.model)
        whole = search_impact(0.0, 0, 20.0, *flight)
        d, effort, velocity, wall = 0.0, 0, 0.0, NO_WALL
        for cut in [*(c * whole[0] for c in cuts), 20.0]:
            if wall == NO_WALL and d < cut:
                d, effort, velocity, wall = search_impact(d, effort, cut, *flight)
        assert (d, effort, velocity, wall) == whole
