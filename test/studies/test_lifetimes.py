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

"""Lifetimes: the estimate against samples with a known mean, and against a larger cap."""


import numpy as np
import pytest

from gear_rattle_ros.attractors.catalogue import Catalogue, follow_here
from gear_rattle_ros.attractors.finding import find_attractors
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.many.settling import RESULT, UNSETTLED
from gear_rattle_ros.core.model import EventKind, Parameters, State
from gear_rattle_ros.studies.grids.lifetimes import (
    distribution,
    escape_of,
    estimate_escape,
    lifetimes,
    Merged,
    tally,
)

SETTINGS = {'cap': 1500, 'initial_conditions': 64, 'hold': 4000}
PLANE = Plane(phases=32, velocities=32)


def test_the_estimate_is_unbiased_under_censoring():
    """Geometric lifetimes of known mean, cut off far below it: the mean is recovered."""
    random = np.random.default_rng(5)
    pulls = []
    for _ in range(200):
        full = random.geometric(1.0 / 4000.0, 2000)
        cut = np.minimum(full, 1500)
        escape = estimate_escape(np.bincount(cut[full <= 1500], minlength=1501),
                                 int(np.sum(full > 1500)), 100)
        pulls.append((escape.mean - 4000.0) / escape.mean_error)
    assert abs(np.mean(pulls)) < 0.25
    assert 0.85 < np.std(pulls) < 1.15


def test_without_censoring_it_is_the_mean():
    """Where everything escapes nothing has to be supposed."""
    lifetimes = np.random.default_rng(6).integers(1, 900, 500)
    counts = np.bincount(lifetimes, minlength=1001)
    assert estimate_escape(counts, 0, 300).mean == pytest.approx(np.mean(lifetimes), rel=1e-12)
    escape = estimate_escape(counts, 0, 950)
    assert escape.mean == pytest.approx(np.mean(lifetimes), rel=1e-12)
    assert escape.mean_error == pytest.approx(np.std(lifetimes) / np.sqrt(500.0))


def test_nothing_that_escapes_means_no_end():
    """A mean is not made up where no escape was seen."""
    escape = estimate_escape(np.zeros(101, np.int64), 50, 10)
    assert escape.mean == np.inf
    with pytest.raises(ValueError, match='below the cap'):
        estimate_escape(np.zeros(101, np.int64), 50, 100)


def test_the_distribution_counts_every_escape():
    """Counts add up, and the survival falls to the censored share."""
    escaped = np.bincount([0, 1, 1, 2, 5, 700, 1000], minlength=1001)
    edges, counts, survival = distribution(escaped, 1)
    assert counts.sum() == 7
    assert survival[0] == 1.0
    assert survival[-1] == 1.0 / 8.0
    assert np.all(np.diff(edges) > 0)


def test_brief_lifetimes_and_their_neighbours_are_counted():
    """Cell by cell, with the four neighbours of each."""
    dataset = lifetimes(Parameters(alpha=1.244), Plane(phases=30, velocities=24), cap=400,
                        initial_conditions=64, hold=4000)
    brief = (dataset['lifetime'].values < 100) & (dataset['label'].values >= 0)
    seen = [brief[k + dk, m + dm] for k, m in np.argwhere(brief)
            for dk, dm in ((0, 1), (0, -1), (1, 0), (-1, 0))
            if 0 <= k + dk < 24 and 0 <= m + dm < 30]
    assert dataset.attrs['brief'] == np.sum(brief) > 20
    assert dataset.attrs['brief_neighbours'] == pytest.approx(np.mean(seen), rel=1e-12)
    assert dataset.attrs['longest'] == dataset['lifetime'].values[dataset['label'] >= 0].max()


def estimates(parameters, plane, cap, seeds, count):
    """Estimate escapes from random initial conditions, once for each seed."""
    table = find_attractors(parameters, plane.draw(parameters, 64, 1), hold=4000,
                            chaotic=False).table
    for seed in seeds:
        initial, results = plane.draw(parameters, count, seed), np.zeros(count, RESULT)
        follow_here(initial, cap, table, results)
        counts, censored, merged = tally([(initial, results)], table, cap)
        yield estimate_escape(counts[0], int(censored[0]), cap // 10, merged)


@pytest.mark.parametrize(('alpha', 'cap'), [
    pytest.param(1.26, 600, marks=pytest.mark.long), (1.3, 300)])
def test_estimates_scatter_as_their_errors_say(alpha, cap):
    """Twenty seeds: chi^2 of mean and rate lies between its 0.1 % and 99.9 % quantiles."""
    found = list(estimates(Parameters(alpha), Plane(), cap, range(20), 1600))
    assert all(escape.merged > 10 and escape.censored > 10 for escape in found)
    for values, errors in (([each.mean for each in found], [each.mean_error for each in found]),
                           ([each.rate for each in found], [each.rate_error for each in found])):
        weights = 1.0 / np.square(errors)
        middle = np.average(values, weights=weights)
        assert 5.41 < np.sum(weights * (values - middle)**2) < 43.82


def test_those_that_go_on_as_one_count_as_one():
    """Slow initial conditions stick: what lies beyond the cap is one trajectory's, not many's."""
    slow = Plane(velocity=(-0.1, 0.0))
    short, long = (next(estimates(Parameters(1.244), slow, cap, [3], 400))
                   for cap in (1_000, 200_000))
    assert short.merged == long.merged > 100 > 10 > short.trajectories
    assert long.censored == 0 and short.censored > short.merged / 2
    assert abs(short.mean - long.mean) < 4.0 * short.mean_error
    assert short.rate_error > short.rate / np.sqrt(short.escapes + 1) / 2
    # Alone they are known without an error of the tail.
    merged = Merged(np.array([200]), np.array([9_800]), np.array([50]), np.array([50]),
                    np.array([0]), np.array([False]))
    alone = estimate_escape(np.zeros(1001, np.int64), 0, 500, merged)
    assert (alone.mean, alone.mean_error, alone.censored) == (10_000.0, 0.0, 50)
    assert np.isnan(alone.rate) and 'from 50 of them the driven gear sticks' in alone.describe()


def test_a_shared_trajectory_without_an_end_has_the_error_of_one():
    """Given up far beyond the cap, it lasts another mean lifetime, give or take as much."""
    counts = np.bincount(np.random.default_rng(7).geometric(0.01, 100_000), minlength=4001)
    merged = Merged(np.array([200]), np.array([400_000]), np.array([10_000]), np.array([10_000]),
                    np.array([0]), np.array([True]))
    with_it, without = estimate_escape(counts, 0, 10, merged), estimate_escape(counts, 0, 10)
    assert with_it.rate == without.rate
    assert with_it.mean == pytest.approx((100_000 * 100.0 + 10_000 * 400_300.0) / 110_000, 0.01)
    spread = 400_200.0 * np.sqrt(10 / 121) / np.sqrt(110_000)
    assert with_it.mean_error == pytest.approx(np.hypot(spread, 100.0 / 11.0), rel=0.05)


@pytest.mark.parametrize('parameters', [Parameters(1.244), Parameters(0.9, 0.3, -0.2, 0.4)])
def test_sticks_are_those_of_the_simulator(parameters):
    """Impacts until the gear first sticks, and the phase at which it leaves, to the bit."""
    plane = Plane(velocity=(-0.1, 0.1), phases=6, velocities=5)
    initial, results = plane.cells(parameters, slice(0, 5), slice(0, 6)), np.zeros(30, RESULT)
    follow_here(initial, 400, Catalogue(parameters).table, results)
    stuck = 0
    for state, result in zip(initial, results, strict=True):
        events = Simulation(parameters, State(
            0, state['phase'], state['displacement'], state['velocity'])).advance(400, 0.0, 2000)
        impacts = np.cumsum(events['kind'] <= EventKind.STICK)
        release = np.flatnonzero((events['kind'] == EventKind.RELEASE) & (impacts <= 400))
        if len(release):
            stuck += 1
            assert result['stick'] == impacts[release[0]]
            assert result['release'] == events['phase'][release[0]]
        else:
            assert result['stick'] == -1 and np.isnan(result['release'])
    assert stuck > 5


@pytest.mark.long
def test_a_cap_and_none_agree_beyond_the_crisis():
    """The mean with a cap of less than a lifetime is that without one, within the errors."""
    short, long = (next(estimates(Parameters(1.244), Plane(), cap, [4], 20_000))
                   for cap in (5_000, 1_000_000))
    assert long.censored == 0 and short.merged == long.merged > 300
    assert abs(short.mean - long.mean) < 3.0 * np.hypot(short.mean_error, long.mean_error)


@pytest.fixture(scope='module')
def grid(tmp_path_factory):
    """Compute lifetimes above the crisis."""
    return lifetimes(Parameters(alpha=1.244), PLANE, **SETTINGS)


def test_a_larger_cap_agrees_with_the_estimate(grid):
    """What is short stays what it was; the mean of the censored run holds for the longer one."""
    escape, censored = escape_of(grid), grid['label'].values == UNSETTLED
    longer = lifetimes(Parameters(alpha=1.244), PLANE, **SETTINGS | {'cap': 6000})
    more, censored_2 = escape_of(longer), longer['label'].values == UNSETTLED
    assert np.array_equal(grid['lifetime'].values[~censored], longer['lifetime'].values[~censored])
    assert np.all(grid['lifetime'].values[censored] == 1500)
    assert np.all(longer['lifetime'].values[censored] > 1450)
    assert 0.3 < np.mean(censored_2) < np.mean(censored) < 0.9
    assert abs(escape.mean - more.mean) < 4.0 * escape.mean_error
    assert more.mean_error < escape.mean_error


def test_the_store_keeps_the_distribution(grid):
    """The dataset carries the survival and the estimate with its error."""
    escape = escape_of(grid)
    censored = float(np.mean(grid['label'].values == UNSETTLED))
    assert float(grid['survival'][-1]) == pytest.approx(censored)
    assert int(grid['escapes'].sum()) == escape.initial_conditions - escape.censored
    assert grid.attrs['escape_mean'] == escape.mean
    assert grid.attrs['escape_mean_error'] > 0.0
