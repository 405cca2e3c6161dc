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

"""The short way to an impact: its bounds, and its impacts, in 50 digits."""

import itertools
import math

import mpmath as mp
import numba
import numpy as np
import pytest
from reference import DIGITS, Flight

from gear_rattle_ros.core.flight.closed_form import LOWER, NO_WALL, UPPER
from gear_rattle_ros.core.flight.elementary import sine_cosine, TWO_PI
from gear_rattle_ros.core.flight.first_impact import bisect_on, search_impact
from gear_rattle_ros.core.flight.stretches import (
    BLUR,
    DECAY_MAXIMUM,
    interpolate,
    relax_short,
    REMAINDER,
    REMAINDER_1,
    short_way,
    slope_at,
    stretches_of,
)
from gear_rattle_ros.core.model import Model

# Of the relaxation functions, as doc/steps.md has it.
SERIES_ERROR = 8.8e-9


@numba.njit
def shortly_relaxed(d, beta):  # type: ignore[no-untyped-def]
    """Return the relaxation functions of the stretches."""
    return relax_short(d, beta)


@numba.njit
def fitted(h, a, b, sines, beta, gamma):  # type: ignore[no-untyped-def]
    """Return the polynomial of a stretch, and its slope, at 33 places."""
    c = interpolate(h, a[0], a[1], sines[0], sines[1], b[0], b[1], sines[2], sines[3], beta, gamma)
    values, slopes = np.empty(33), np.empty(33)
    for k in range(33):
        x = k / 32.0
        values[k] = a[0] + x * (c[0] + x * (c[1] + x * (c[2] + x * (c[3] + x * (c[4] + x * (
            c[5] + x * c[6]))))))
        slopes[k] = slope_at(x, c[0], c[1], c[2], c[3], c[4], c[5], c[6])
    return values, slopes


@numba.njit
def by_short_way(flights, found):  # type: ignore[no-untyped-def]
    """Write whether the short way found an impact, its time and velocity."""
    for i in range(len(flights)):
        phase, s, v, alpha, beta, gamma = flights[i]
        model = Model(alpha, beta, gamma, 1.0)
        sine, cosine = sine_cosine(phase)
        hits, d, velocity = short_way(phase, sine, cosine, s, v, model, stretches_of(model))
        found[i] = np.array((1.0 if hits else 0.0, d, velocity))


@numba.njit
def by_bisection(flights, found):  # type: ignore[no-untyped-def]
    """Write the first impacts by bisection from zero to zero: wall, time and velocity."""
    for i in range(len(flights)):
        phase, s, v, alpha, beta, gamma = flights[i]
        model = Model(alpha, beta, gamma, 1.0)
        d, speed, wall = 1e-12, 0.0, NO_WALL
        while wall == NO_WALL and d < 20.0:
            step, speed, wall, _ = bisect_on(d, phase, s, v, model)
            d += step
        found[i] = np.array((float(wall), d, speed if wall == UPPER else -speed))


def drawn(seed: int, count: int) -> np.ndarray:
    """Draw flights from both walls and between them, over the range in which this is used."""
    rng = np.random.default_rng(seed)
    s = rng.choice([0.0, -1.0, -0.5], count)
    s[s == -0.5] = -rng.random(np.count_nonzero(s == -0.5))
    v = rng.normal(0.0, 1.0, count) * 10.0**rng.uniform(-2.0, 0.5, count)
    v = np.where(s == 0.0, -np.abs(v), np.where(s == -1.0, np.abs(v), v))
    alpha = 10.0**rng.uniform(-2.0, 2.0, count)
    return np.column_stack([
        rng.uniform(0.0, TWO_PI, count), s, v, alpha,
        np.where(rng.random(count) < 0.2, 0.0, 10.0**rng.uniform(-3.0, -0.2, count)),
        alpha * rng.normal(0.0, 0.5, count)])


def grazing(seed: int, count: int) -> np.ndarray:
    """Draw flights that turn next to a wall: nearer and nearer, on both sides of it."""
    rng = np.random.default_rng(seed)
    flights: list[tuple[float, ...]] = []
    while len(flights) < count:
        alpha, beta = 10.0**rng.uniform(-1.0, 1.0), rng.choice([0.0, 0.05, 0.1, 0.3])
        gamma = alpha * rng.normal(0.0, 0.4)
        wall = rng.choice([0.0, -1.0])
        # Back from the turn to the other wall, or for a while.
        there = Flight(rng.uniform(0.0, TWO_PI), wall, 0.0, alpha, beta, gamma)
        back = rng.uniform(0.3, 5.0)
        s = float(there.displacement_at(mp.mpf(-back)))
        off = rng.choice([-1.0, 1.0]) * 10.0**rng.uniform(-15.0, -2.0)
        if -1.0 < s + off < 0.0:
            flights.append(((there.phase - back) % TWO_PI, s + off,
                            float(there.velocity_at(mp.mpf(-back))), alpha, beta, gamma))
    return np.array(flights)


def test_series_at_the_zeros() -> None:
    """E, B/d and C/d^2 are as near as the bound of the blur takes for granted."""
    with mp.workdps(DIGITS):
        for d, x in itertools.product((0.01, 1.0, 6.0), np.linspace(1e-6, DECAY_MAXIMUM, 200)):
            beta = mp.mpf(float(x)) / d
            decay, integral, second = shortly_relaxed(d, float(beta))
            beta = mp.mpf(float(beta))
            exact = mp.exp(-beta * d)
            b = (1 - exact) / beta
            assert abs(decay - exact) < 2 * SERIES_ERROR
            assert abs(integral - b) < 1.5 * SERIES_ERROR * d
            assert abs(second - (d - b) / beta) < SERIES_ERROR * d * d
    assert 26 * 2 * SERIES_ERROR < 0.05 * BLUR


def test_polynomials_keep_to_hermites_remainder() -> None:
    """Between zeros of the force, with their slopes, in 50 digits."""
    with mp.workdps(DIGITS):
        for phase, s, v, alpha, beta, gamma in drawn(1, 60).tolist():
            h = float(np.random.default_rng(int(1e6 * phase)).uniform(0.5, 6.0))
            f = Flight(phase, s, v, alpha, beta, gamma)
            a = np.array([s, v])
            b = np.array([float(f.displacement_at(mp.mpf(h))), float(f.velocity_at(mp.mpf(h)))])
            sines = alpha * np.array([math.sin(phase), math.cos(phase), math.sin(phase + h),
                                      math.cos(phase + h)])
            values, slopes = fitted(h, a, b, sines, beta, gamma)
            snap = alpha + beta**6 * abs(gamma - beta * (v - alpha * math.cos(phase)))
            size = 1e-12 * (1.0 + alpha + abs(gamma) * h + abs(v)) * (1.0 + h)**2
            for k in range(33):
                d = mp.mpf(h) * k / 32
                assert abs(values[k] - f.displacement_at(d)) <= snap * h**8 * REMAINDER + size
                assert abs(slopes[k] - h * f.velocity_at(d)) <= snap * h**8 * REMAINDER_1 + size


def test_the_force_grows_as_stated_in_the_first_third() -> None:
    """From either zero, in 1,000 places, for loads up to the largest that leaves it zeros."""
    rng = np.random.default_rng(2)
    for _ in range(300):
        alpha, beta = 10.0**rng.uniform(-2.0, 2.0), rng.choice([0.0, 0.1, 0.5])
        amplitude = alpha * math.sqrt(1.0 + beta * beta)
        gamma = amplitude * (1.0 - 10.0**rng.uniform(-6.0, 0.0)) * rng.choice([-1.0, 1.0])
        z = stretches_of(Model(alpha, beta, gamma, 1.0))
        for phase, other, growth in ((z.fall, z.rise, z.low_growth), (z.rise, z.fall,
                                                                      z.high_growth)):
            t = np.linspace(0.0, (other - phase) % TWO_PI / 3.0, 1001)[1:]
            tau = phase + t
            force = np.abs(gamma + alpha * (beta * np.cos(tau) - np.sin(tau)))
            assert np.all(force >= growth * t - 1e-14 * amplitude)


@pytest.mark.parametrize('flights', [drawn(3, 300), grazing(4, 300)], ids=['drawn', 'grazing'])
def test_impacts_in_50_digits(flights: np.ndarray) -> None:
    """They are at the wall, to rounding, and no wall was reached before."""
    found = np.zeros((len(flights), 3))
    by_short_way(flights, found)
    assert found[:, 0].mean() > 0.25
    with mp.workdps(DIGITS):
        for flight, (hits, d, velocity) in zip(flights.tolist(), found.tolist(), strict=True):
            f = Flight(*flight)
            size = abs(f.velocity) + (f.alpha * (1.0 + f.beta) + abs(f.gamma)) * max(d, 1.0)
            rounding = 1e-14 * (1.0 + size * max(d, 1.0))
            times = [mp.mpf(d) * k / 100 for k in range(101)]
            turns = [
                mp.findroot(f.velocity_at, (a, b), solver='anderson', tol=1e-60, verify=False)
                for a, b in itertools.pairwise(times) if f.velocity_at(a) * f.velocity_at(b) < 0]
            for t in [*times[:-1], *turns]:
                assert -1 - rounding <= f.displacement_at(t) <= rounding
            if hits:
                wall = 0 if velocity > 0.0 else -1
                assert abs(f.displacement_at(mp.mpf(d)) - wall) <= rounding
                assert abs(f.velocity_at(mp.mpf(d)) - velocity) <= rounding


@pytest.mark.parametrize('flights', [drawn(5, 4000), grazing(6, 4000)], ids=['drawn', 'grazing'])
def test_impacts_by_bisection(flights: np.ndarray) -> None:
    """The stretches bisected one by one give the same impacts, at the same walls."""
    found, bisected = np.zeros((len(flights), 3)), np.zeros((len(flights), 3))
    by_short_way(flights, found)
    by_bisection(flights, bisected)
    hits = found[:, 0] == 1.0
    assert np.array_equal(found[hits, 2] > 0.0, bisected[hits, 0] == UPPER)
    size = 1.0 + flights[:, 3] + np.abs(flights[:, 5]) * (1.0 + bisected[:, 1]) + np.abs(
        flights[:, 2])
    late = np.abs(found[:, 1] - bisected[:, 1]) * np.abs(found[:, 2])
    assert np.all((late < 1e-13 * size * (1.0 + bisected[:, 1]))[hits])
    # And before the time that is free elsewhere there is none.
    assert np.all(bisected[~hits, 1] >= found[~hits, 1] - 1e-9)


def test_what_is_not_for_the_short_way() -> None:
    """Strong damping has no use for it, and a beginning into the wall is an impact at once."""
    assert stretches_of(Model(0.48, 3.0, 0.1, 0.9)).use == 0.0
    for s, v in ((0.0, 0.5), (-1.0, -0.5)):
        d, _, velocity, wall = search_impact(0.0, 0, 9.0, 1.0, s, v, Model(0.48, 0.1, 0.1, 0.9))
        assert (d, velocity, wall) == (0.0, v, UPPER if s == 0.0 else LOWER)
