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

"""A small part of benchmark/long_runs.py: samples of trajectories against scipy's DOP853."""

import importlib
from pathlib import Path
import subprocess
import sys

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
# At the end: its scripts must not hide any module.
sys.path.append(str(ROOT / 'benchmark'))
chains = importlib.import_module('peers.chains')
samples = importlib.import_module('peers.samples')
SETTINGS = np.array([(1.2, 0.1, 0.1, 0.9), (8.0, 0.0, -0.3, 0.4), (0.6, 0.3, 0.0, 0.0),
                     (2.0, 0.0, 0.2, 1.0)])
TRAJECTORIES, IMPACTS, PERIODS = 25, 10, 20


def sample_of(setting: np.ndarray, count: int, seed: int) -> np.ndarray:
    """Return a sample of this package."""
    states = samples.random_states(count, seed)
    return samples.samples(samples.own_rows(states, setting, IMPACTS, PERIODS), count, setting[3])


@pytest.mark.parametrize('setting', [
    *SETTINGS[:2], *(pytest.param(each, marks=pytest.mark.long) for each in SETTINGS[2:])])
def test_samples_and_first_impacts_equal_those_of_scipy(setting: np.ndarray) -> None:
    """Independent trajectories are of one distribution; the same ones begin equally."""
    states = samples.random_states(TRAJECTORIES, 1)
    rows = chains.by_scipy(states, setting.tolist(), IMPACTS, PERIODS * chains.TWO_PI)
    theirs = samples.samples(rows, TRAJECTORIES, setting[3])
    random = np.random.default_rng(2)
    assert samples.compare(sample_of(setting, 300, 3), theirs, random)[0] > 0.001
    count, worst = samples.path_errors(states, setting, rows, IMPACTS, PERIODS)
    assert count > 1.5 * TRAJECTORIES and worst < 1e-10


@pytest.mark.parametrize('change', [
    (0.0, 0.0, 0.0, -0.02),
    pytest.param((0.0, 0.0, -0.2, 0.0), marks=pytest.mark.long)])
def test_wrong_restitution_or_sign_of_gamma_are_seen(change: tuple[float, ...]) -> None:
    """The same comparison refuses what is a little wrong, and nothing else."""
    setting = SETTINGS[0]
    random = np.random.default_rng(6)
    right, again = sample_of(setting, 500, 4), sample_of(setting, 500, 5)
    assert samples.compare(right, again, random)[0] > 0.01
    assert samples.compare(right, sample_of(setting + change, 500, 5), random)[0] < 0.001


def test_p_is_uniform_where_nothing_is_wrong() -> None:
    """Whatever is tied: on periodic orbits many trajectories give the same numbers."""
    random = np.random.default_rng(7)
    ps = [samples.compare(*np.split(random.integers(0, 3, (40, 8)), 2), random)[0]
          for _ in range(40)]
    assert 0.3 < np.mean(ps) < 0.7 and np.min(ps) > 0.001


@pytest.mark.long
@pytest.mark.parametrize(('options', 'status'), [
    (['--only', 'scipy', 'power'], 0), (['--only', 'scipy', '--wrong', 'restitution'], 1)])
def test_the_script_agrees_and_detects_faults(options: list[str], status: int) -> None:
    """Its status shows both."""
    done = subprocess.run(
        [sys.executable, str(ROOT / 'benchmark' / 'long_runs.py'), '--quick', *options], cwd=ROOT,
        capture_output=True, text=True)
    assert done.returncode == status, done.stdout + done.stderr
