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

"""Estimators of boundaries against closed forms and the published values of other maps."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import chi2

from gear_rattle_ros.core.boundaries.entropy import (
    basin_entropies,
    disc_entropy,
    is_smooth,
    SMOOTH,
)
from gear_rattle_ros.core.boundaries.uncertainty import (
    chance,
    count_cut,
    fit_power_law,
    PROBES,
)
from gear_rattle_ros.core.boundaries.wada import (
    follow_unstable,
    merge_basins,
    refine_boundary,
)

SQUARE = ((-1.0, 1.0), (-1.0, 1.0))
CYLINDER = ((0.0, 2.0 * math.pi), (-0.5, 0.5))
STRIPES = np.array([-0.4, 0.3])


def grebogi(x, y):
    """Iterate the map of Grebogi, McDonald, Ott and Yorke (1983); attractors at 0 and pi."""
    for _ in range(150):
        x, y = ((x + 1.32 * np.sin(2.0 * x) - 0.9 * np.sin(4.0 * x) - y * np.sin(x))
                % (2.0 * math.pi), -0.3 * np.cos(x))
    return (np.cos(x) < 0.0).astype(np.int64)


def newton(x, y):
    """Find the cube root of one to which Newton's method leads; the basins are lakes of Wada."""
    z = x + 1j * y
    for _ in range(60):
        z = z - (z**3 - 1.0) / (3.0 * z**2)
    return np.round(np.angle(z) / (2.0 * math.pi / 3.0)).astype(np.int64)


def wave(x, y):
    return (y > 0.3 * np.sin(3.0 * x)).astype(np.int64)


def stripes(x, y):
    return np.digitize(y, STRIPES)


def grid(label, window, size):
    x, y = (low + (high - low) * (np.arange(size) + 0.5) / size for low, high in window)
    return label(np.tile(x, size), np.repeat(y, size)).reshape(size, size)


def exponent(label, window, probe, sizes):
    rng = np.random.default_rng(1)
    counts = np.array([count_cut(label, window, probe, size, 0.04, 50_000, rng)
                       for size in sizes])
    return fit_power_law(sizes, *counts.T)


@pytest.mark.parametrize('probe, share', [('triplet', 4.0 / math.pi), ('box', 1.0)])
def test_the_share_of_probes_that_a_straight_line_cuts(probe, share):
    """A line along the window of height 2: triplets reach eps |sin| on either side, boxes eps."""
    cut, probes = count_cut(lambda x, y: (y > 0.1).astype(np.int64), SQUARE, probe, 0.1, 0.03,
                            100_000, np.random.default_rng(4))
    expected = 0.1 * share / 2.0
    assert cut / probes == pytest.approx(
        expected, abs=4.0 * math.sqrt(expected * (1.0 - expected) / probes))
    assert math.sqrt((1.0 - cut / probes) / cut) < 0.031


def test_a_share_out_of_reach_is_given_up():
    assert count_cut(wave, SQUARE, 'triplet', 1e-9, 0.03, 100_000,
                     np.random.default_rng(1)) == (0, 2000)


@pytest.mark.parametrize('probe', PROBES)
def test_uncertainty_exponent_of_grebogis_map(probe):
    """Published: about 0.2."""
    law = exponent(grebogi, CYLINDER, probe, 10.0**np.arange(-5.0, -0.9))
    assert law.exponent == pytest.approx(0.2, abs=0.02)
    assert law.error < 0.008


@pytest.mark.parametrize('probe', PROBES)
def test_uncertainty_exponent_of_newtons_method(probe):
    """Published: 0.55 to 0.65, from a box counting dimension of 1.42."""
    law = exponent(newton, SQUARE, probe, 10.0**np.arange(-3.0, -0.9, 0.5))
    assert 0.53 < law.exponent < 0.65


@pytest.mark.parametrize('probe', PROBES)
def test_uncertainty_exponent_of_a_smooth_boundary_is_1(probe):
    law = exponent(wave, SQUARE, probe, 10.0**np.arange(-2.5, -0.9, 0.25))
    assert law.exponent == pytest.approx(1.0, abs=4.0 * law.error)


def test_a_range_that_is_too_wide_bends():
    """Shares as at 0.48, where those of the largest three sizes are 8, 14 and 27 % too large."""
    sizes = 10.0**-np.arange(1.0, 9.1, 0.5)
    shares = 0.49 * sizes**0.0735 * np.append([1.27, 1.14, 1.08, 1.02], np.ones(13))
    random, off = np.random.default_rng(6), []
    for _ in range(200):
        law = fit_power_law(sizes, random.binomial(2000, shares), np.full(17, 2000))
        off.append((law.exponent - 0.0735) / law.error)
    # By chi^2 alone one in five is off by three errors, and the mean by 1.7.
    assert np.mean(np.abs(off) > 3.0) < 0.1 and abs(np.mean(off)) < 0.8


def test_the_range_of_a_power_law():
    """Shares 0.5 x^0.3 below x = 1e-3 and constant above; and the line is exact without noise."""
    sizes = 10.0**np.arange(-9.0, -0.9, 0.5)
    probes = np.full(len(sizes), 20_000)
    shares = 0.5 * np.minimum(sizes, 1e-3)**0.3
    law = fit_power_law(sizes, np.random.default_rng(3).binomial(probes, shares), probes)
    assert law.low < 1e-8 and 2e-4 < law.high < 1.001e-3
    assert law.exponent == pytest.approx(0.3, abs=4.0 * law.error)
    assert law.probability > 0.05
    exact = fit_power_law(sizes[:6], shares[:6] * probes[:6], probes[:6])
    assert (exact.exponent, exact.constant) == pytest.approx((0.3, 0.5))
    assert exact.chi_squared < 1e-20
    assert fit_power_law(sizes, np.full(len(sizes), 3), probes) is None


def test_probability_of_chi_squared():
    for freedom in range(1, 30):
        for value in (0.0, 0.3, 5.0, 40.0):
            assert chance(value, freedom) == pytest.approx(chi2.sf(value, freedom), rel=1e-12)


def test_basin_entropy_of_grebogis_map():
    """Published, on 300 x 300 cells in boxes of 6: S_b 0.40 to 0.42, S_bb 0.60 to 0.61."""
    labels = grid(grebogi, CYLINDER, 300)
    of_six = basin_entropies(labels, (6,))[0]
    assert 0.39 < of_six.mean < 0.43
    assert 0.59 < of_six.boundary < 0.62
    assert not of_six.exceeds_ln_2
    assert not is_smooth(*disc_entropy(labels, 20, 2000, np.random.default_rng(2)), 20)


def test_entropy_of_boxes_by_hand():
    """A column of boxes is cut by a line: in half, or a quarter off."""
    labels = np.zeros((100, 100), np.int64)
    labels[:, 5:] = 1
    ten, twenty = (basin_entropies(labels, (edge,))[0] for edge in (10, 20))
    assert (ten.mean, ten.boundary) == pytest.approx((0.1 * math.log(2.0), math.log(2.0)))
    assert twenty.boundary == pytest.approx(math.log(4.0) - 0.75 * math.log(3.0))


def test_smooth_boundary():
    """The constant is the mean over straight lines through a disc; a curve has it, too."""
    def entropy(distance):
        share = (math.acos(distance) - distance * math.sqrt(1.0 - distance**2)) / math.pi
        return -sum(part * math.log(part) for part in (share, 1.0 - share) if part > 0.0)

    assert quad(entropy, 0.0, 1.0)[0] == pytest.approx(SMOOTH, abs=1e-6)
    labels = grid(wave, SQUARE, 800)
    mean, error = disc_entropy(labels, 20, 5000, np.random.default_rng(2))
    assert mean == pytest.approx(SMOOTH, abs=0.03) and error < 0.02
    assert is_smooth(mean, error, 20)
    assert math.isnan(disc_entropy(0 * labels, 20, 100, np.random.default_rng(2))[0])


@pytest.mark.parametrize('label, window, basins, is_wada', [
    (newton, SQUARE, [-1, 0, 1], True), (stripes, SQUARE, [0, 1, 2], False),
    (wave, SQUARE, [0, 1], None)])
def test_wada(label, window, basins, is_wada):
    """Newton's method has lakes of Wada, stripes have not; two basins cannot."""
    labels = grid(label, window, 200)
    merging = merge_basins(labels, basins, 10)
    refined = refine_boundary(label, window, labels, basins, 8, 300, np.random.default_rng(1))
    if is_wada is None:
        assert (merging, refined) == ([], [])
    elif is_wada:
        assert merging[-1] == 1.0 and len(merging) <= 6
        assert refined[-1] > 0.9 > refined[4] > refined[0]
    else:
        assert set(merging) == {0.0} and len(merging) == 11
        assert set(refined) == {0.0}


def test_the_unstable_manifold_of_a_saddle_between_two_of_three_basins():
    """Flows along y of a product map: each saddle leads to its neighbours in equal parts."""
    for saddle, shares in ((STRIPES[0], [0.5, 0.5, 0.0]), (STRIPES[1], [0.0, 0.5, 0.5])):
        assert follow_unstable(stripes, np.array([0.2, saddle]), np.array([0.0, 1.0]), 1.7,
                               [0, 1, 2]) == shares
