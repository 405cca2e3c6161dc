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

"""Labels against 50 digits, and against what the pages report of other programs."""

import importlib
from pathlib import Path
import re
import sys

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
# At the end: its scripts must not hide any module.
sys.path.append(str(ROOT / 'benchmark'))
comparison = importlib.import_module('peers.comparison')
# Cells along an edge of the grid on the page.
CELLS = 30
SHARE = r'(\S+)(?: ± \S+)? %'
ROW = re.compile(rf'^\| ([^|]+) \| {SHARE} \| {SHARE} \| {SHARE} \| ([^|]+) \|$', re.M)
FINE = re.compile(r'(\S+) ± (\S+) % with the\s+(phase|velocity)')


@pytest.fixture(name='grid')
def small_grid():
    """Return a coarse grid."""
    return comparison.Grid(50)


@pytest.fixture(name='page', scope='module')
def words_of_page():
    """Return the page on grids, in one line where it is not a table."""
    return (ROOT / 'doc' / 'grids.md').read_text(encoding='utf-8')


def test_short_transients_have_the_labels_of_50_digits(grid):
    """No error of double precision has grown to the size of the basins within 60 impacts."""
    short = np.flatnonzero(grid.ours().lifetimes < 60)
    grid.initial = grid.initial[np.random.default_rng(1).choice(short, 10, replace=False)]
    np.testing.assert_array_equal(grid.ours().labels, grid.exact().labels)


@pytest.mark.long
def test_peer_returns_to_its_wall_and_gives_up_what_sticks(grid, tmp_path):
    """From the upper wall back to it is found; scipy has no label only where the gear sticks."""
    grid.initial = grid.initial[:2].copy()
    grid.initial['phase'], grid.initial['velocity'] = (4.08407045, 3.2044), (-0.2, -0.04)
    labels = grid.theirs('scipy', sys.executable, tmp_path, 0.0).labels
    exact = grid.exact().labels
    assert labels.tolist() == [exact[0], -1]
    assert grid.ours().labels[1] == exact[1] >= 0


def test_last_digit_changes_as_many_labels_as_the_page_reports(page):
    """Of 100 x 100 initial conditions, within four errors of the share of 400 x 400."""
    found = FINE.findall(page.replace('\n', ' '))
    assert [name for *_, name in found] == list(comparison.MOVED)
    grid = comparison.Grid(100)
    labels = grid.ours().labels
    for share, error, name in found:
        share = float(share) / 100.0
        assert float(error) == pytest.approx(100.0 * (share * (1.0 - share))**0.5 / 400, abs=0.006)
        here = np.mean(grid.ours(name).labels != labels)
        assert abs(here - share) < 4.0 * (share * (1.0 - share))**0.5 / 100


def test_pages_have_one_set_of_numbers(page):
    """Shares are whole numbers of cells of one grid, and the page on performance has the same."""
    rows = {name: rest for name, *rest in ROW.findall(page)}
    assert {'`basins`', 'heyoka', 'scipy'} < rows.keys()
    assert f'{CELLS} x {CELLS}' in page
    for *shares, _ in rows.values():
        for share in shares:
            count = float(share) / 100.0 * CELLS**2
            assert abs(count - round(count)) < 0.005 / 100.0 * CELLS**2 + 1e-6
    performance = (ROOT / 'doc' / 'performance.md').read_text(encoding='utf-8')
    for name in ('heyoka', 'scipy'):
        none, other, _, times = rows[name]
        assert (f'{name}: {times} times as long, {other} % of the labels other, {none} % none'
                in performance)
