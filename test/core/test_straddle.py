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

"""Straddle trajectories and sprinkled saddles, on maps whose saddles are known exactly."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from gear_rattle_ros.core.arrays import FloatArray, IntArray
from gear_rattle_ros.core.many.sprinkler import estimate, growths, rates_of, SaddleRates
from gear_rattle_ros.core.orbits.straddle import (
    any_change,
    FINE,
    first_change,
    longest_lived,
    straddle,
)

# A baker's map with a hole: two strips are stretched, and squeezed, by these.
STRETCH, SQUEEZE = np.array([2.5, 4.0]), np.array([0.3, 0.2])
MOST = 60


def strip(points: FloatArray) -> IntArray:
    """Return the strip of each point, -1 in the hole."""
    x = points[:, 0]
    inside = (x >= 0.0) & (x <= 1.0)
    return np.where(inside & (x < 1.0 / STRETCH[0]), 0, np.where(
        inside & (x > 1.0 - 1.0 / STRETCH[1]), 1, -1))


def bake(points: FloatArray) -> FloatArray:
    """Stretch each strip over all, and squeeze it."""
    k, (x, y) = strip(points), points.T
    return np.column_stack([
        np.where(k == 0, STRETCH[0] * x, np.where(k == 1, STRETCH[1] * (x - 1.0) + 1.0, -1.0)),
        np.where(k == 0, SQUEEZE[0] * y, SQUEEZE[1] * y + 0.7)])


def baker_lives(points: FloatArray, most: int = MOST) -> IntArray:
    """Count the steps until each point falls into the hole."""
    lives, alive = np.zeros(len(points), np.int64), np.ones(len(points), np.bool_)
    for _ in range(most):
        alive &= strip(points) >= 0
        lives += alive
        points = bake(points)
    return lives


def sprinkled(count: int, head: int, tail: int, seed: int = 1) -> SaddleRates:
    """Sprinkle the square."""
    batches, random = [], np.random.default_rng(seed)
    for _ in range(8):
        points = random.random((count // 8, 2))
        lives = baker_lives(points)
        followed = np.flatnonzero(lives > head + tail)
        points, steps = points[followed], int(lives.max())
        matrices = np.zeros((len(points), steps, 2, 2))
        for k in range(steps):
            where = np.maximum(strip(points), 0)
            matrices[:, k, 0, 0], matrices[:, k, 1, 1] = STRETCH[where], SQUEEZE[where]
            points = bake(points)
        batches.append(estimate(lives, lives >= MOST, growths(matrices), followed, head, tail))
    return rates_of(np.stack(batches))


def test_sprinkler_has_the_closed_form_of_the_baker() -> None:
    """Exact: a strip has the weight 1/stretch."""
    weight = 1.0 / STRETCH
    kappa = -math.log(weight.sum())
    one, two = (float(weight @ np.log(each) / weight.sum()) for each in (STRETCH, SQUEEZE))
    found = sprinkled(100_000, 3, 3)
    assert found.kappa[1] < 0.02 * kappa
    for value, error, exact in (
            (*found.kappa, kappa),
            (*found.lambda_1, one),
            (*found.lambda_2, two),
            (*found.dimension_1, 1.0 - kappa / one),
            (*found.dimension_2, (one - kappa) / -two)):
        assert abs(value - exact) < 3.0 * error
        assert error < 0.03 * abs(exact)


def test_exponent_is_the_box_dimension_of_the_baker() -> None:
    """Exact: sum(stretch^(a - 1)) = 1; the second cumulant comes nearer than kappa/lambda_1."""
    weight = 1.0 / STRETCH
    kappa, share = -math.log(weight.sum()), weight / weight.sum()
    one = float(share @ np.log(STRETCH))
    spread = float(share @ np.log(STRETCH)**2) - one**2
    exact = 1.0 - brentq(lambda d: np.sum(STRETCH**-d) - 1.0, 0.1, 1.0)
    value = SaddleRates((kappa, 0.0), (one, 0.0), (-1.0, 0.0), spread).exponent[0]
    assert abs(value - exact) < 0.1 * abs(kappa / one - exact)


def test_errors_of_the_sprinkler_are_those_of_its_scatter() -> None:
    """Repeated with other initial conditions, the results scatter no more than they claim."""
    found = [sprinkled(10_000, 3, 3, seed) for seed in range(12)]
    for name in ('kappa', 'lambda_1', 'lambda_2'):
        scatter = np.std([getattr(one, name)[0] for one in found], ddof=1)
        claimed = np.mean([getattr(one, name)[1] for one in found])
        assert 0.2 * claimed < scatter < 1.5 * claimed


def test_none_that_stays_gives_no_rates() -> None:
    """Cuts longer than any life leave nothing; a batch without an estimate leaves the others."""
    assert math.isnan(sprinkled(100, 100, 100).lambda_1[0])
    batches = np.full((8, 2, 6), np.nan)
    assert math.isnan(rates_of(batches).kappa[0])
    batches[:5] = [0.1, 0.5, -1.0, 0.2, 1000.0, 500.0]
    found = rates_of(batches)
    assert (found.lambda_1[0], found.spread, found.impacts) == pytest.approx((0.5, 0.2, 2500))
    assert found.kappa[0] == pytest.approx(0.1)
    assert found.kappa[1] == pytest.approx(
        0.1 / math.sqrt(-math.expm1(-0.1) * 5000.0), rel=0.01)
    # Where none escapes, one might have.
    batches[:] = [0.0, 0.5, -1.0, 0.2, 1000.0, 500.0]
    found = rates_of(batches)
    assert found.kappa == (0.0, pytest.approx(1.0 / 8000.0))
    assert found.exponent == (0.0, pytest.approx(1.0 / 8000.0 / 0.5))
    assert found.dimension_1[0] == 1.0


def henon(points: FloatArray, a: float = 2.0) -> FloatArray:
    """Map by Henon, beyond his attractor."""
    x, y = points.T
    return np.column_stack([a - x * x + 0.3 * y, x])


def henon_lives(points: FloatArray) -> IntArray:
    """Count the steps until each point is far away."""
    lives, alive = np.zeros(len(points), np.int64), np.ones(len(points), np.bool_)
    for _ in range(60):
        alive &= np.abs(points[:, 0]) < 5.0
        lives += alive
        points = np.where(alive[:, None], henon(points), points)
    return lives


def test_lifetimes_straddle_the_saddle_of_henon() -> None:
    """Every step follows the map, lives long, and the exponents add up to the determinant."""
    ends = np.array([[-2.0, 0.3], [2.0, 0.3]])
    points = straddle(ends, henon, henon_lives, longest_lived(60), 500, np.random.default_rng(1))
    assert len(points) == 500
    assert np.max(np.abs(henon(points[:-1]) - points[1:])) < 1e-5
    assert np.min(henon_lives(points)) > 10
    matrices = np.zeros((1, 500, 2, 2))
    matrices[0, :, 0, 0], matrices[0, :, 0, 1] = -2.0 * points[:, 0], 0.3
    matrices[0, :, 1, 0] = 1.0
    grown = growths(matrices)
    assert np.allclose(grown.sum(axis=2), math.log(0.3), atol=1e-12)
    assert grown[0, :, 0].mean() > 0.3


def test_labels_straddle_an_edge_state() -> None:
    """Between two fixed points it comes to the saddle between them."""
    def bistable(points: FloatArray) -> FloatArray:
        x, y = points.T
        return np.column_stack([1.5 * x - 0.5 * x**3, 0.5 * y + 0.1 * x])

    def label(points: FloatArray) -> IntArray:
        for _ in range(200):
            points = bistable(points)
        return np.sign(points[:, 0]).astype(np.int64)

    for choose, samples in ((any_change, 12), (first_change, FINE)):
        points = straddle(np.array([[-0.7, 0.9], [0.4, -0.2]]), bistable, label, choose, 100,
                          np.random.default_rng(2), samples)
        assert len(points) == 100
        assert np.max(np.abs(points[40:])) < 1e-6


def test_the_first_change_is_accessible() -> None:
    """Behind a strip of another label the boundary of the first end is not looked for."""
    def label(points: FloatArray) -> IntArray:
        return np.searchsorted([0.2, 0.3, 0.7], points[:, 0]) % 2

    def rest(points: FloatArray) -> FloatArray:
        return points

    for side, edge in ((0.0, 0.2), (1.0, 0.7)):
        ends = np.array([[side, 0.0], [0.5 + 0.1 * side - 0.05, 0.0]])
        points = straddle(ends, rest, label, first_change, 3, np.random.default_rng(3), FINE)
        assert points[:, 0] == pytest.approx(edge, abs=1e-7)


def test_a_break_between_the_ends_is_left_aside() -> None:
    """Where the images do not stay together, a shorter piece goes on; or none."""
    def torn(points: FloatArray) -> FloatArray | None:
        return None if np.ptp(points[:, 0]) > 1e-10 else points

    def nowhere(points: FloatArray) -> None:
        return None

    def label(points: FloatArray) -> IntArray:
        return (points[:, 0] > 0.123).astype(np.int64)

    ends = np.array([[0.0, 0.0], [1.0, 0.0]])
    found = straddle(ends, torn, label, any_change, 5, np.random.default_rng(4))
    assert found[:, 0] == pytest.approx(0.123, abs=1e-9)
    assert len(straddle(ends, nowhere, label, any_change, 5, np.random.default_rng(4))) == 0
    # Nothing changes on it.
    assert len(straddle(0.1 * ends, torn, label, any_change, 5, np.random.default_rng(4))) == 0
