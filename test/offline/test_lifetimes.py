"""Lifetimes: the estimate against samples with a known mean, and against a larger cap."""

import dataclasses

from grids import run_into
import numpy as np
import pytest

from gear_rattle_ros.core.classify import UNRESOLVED
from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.offline.basins import Settings
from gear_rattle_ros.offline.grid import Plane
from gear_rattle_ros.offline.lifetimes import (
    compute_lifetimes,
    distribution,
    estimate_escape,
)
from gear_rattle_ros.offline.store import open_dataset

SETTINGS = Settings(cap=1500, starts=64, hold=4000, chaotic=False)
PLANE = Plane(phases=40, velocities=40)


def test_the_estimate_is_unbiased_under_censoring():
    """Geometric lifetimes of known mean, cut off far below it: the mean is found again."""
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


@pytest.fixture(scope='module')
def grid(tmp_path_factory):
    """Compute lifetimes above the crisis."""
    return compute_lifetimes(Parameters(alpha=1.244), PLANE,
                             run_into(tmp_path_factory.mktemp('lifetimes') / 'a.zarr'), SETTINGS)


def test_a_larger_cap_agrees_with_the_estimate(grid, tmp_path):
    """What is short stays what it was; the mean of the censored run holds for the longer one."""
    store, _, escape = grid
    lifetimes, censored = store.read_all('lifetime'), store.read_all('label') == UNRESOLVED
    settings = dataclasses.replace(SETTINGS, cap=6000)
    longer, _, more = compute_lifetimes(
        Parameters(alpha=1.244), PLANE, run_into(tmp_path / 'b.zarr'), settings)
    lifetimes_2, censored_2 = (longer.read_all('lifetime'),
                               longer.read_all('label') == UNRESOLVED)
    assert np.array_equal(lifetimes[~censored], lifetimes_2[~censored])
    assert np.all(lifetimes[censored] == 1500)
    assert np.all(lifetimes_2[censored] > 1450)
    assert 0.3 < np.mean(censored_2) < np.mean(censored) < 0.9
    assert abs(escape.mean - more.mean) < 4.0 * escape.mean_error
    assert more.mean_error < escape.mean_error


def test_the_store_keeps_the_distribution(grid):
    """The dataset carries the survival and the estimate with its error."""
    store, _, escape = grid
    dataset = open_dataset(store.path)
    censored = float(np.mean(dataset['label'].values == UNRESOLVED))
    assert float(dataset['survival'][-1]) == pytest.approx(censored)
    assert int(dataset['escapes'].sum()) == escape.starts - escape.censored
    assert dataset.attrs['escape_mean'] == escape.mean
    assert dataset.attrs['escape_mean_error'] > 0.0
