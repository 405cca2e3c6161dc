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

"""Sections with noise against the simulation, and distances of densities against known ones."""

import types

import numpy as np
import pytest

from gear_rattle_ros import Parameters, section, Simulation, State
from gear_rattle_ros.cli.trajectories.section import main
from gear_rattle_ros.studies.trajectories.densities import compare_densities

P = Parameters(alpha=0.48)


def test_a_trajectory_with_noise_is_that_of_the_simulator():
    """Bit for bit, however the stream is cut; the attractor is that of the core visited last."""
    dataset = section(P, initial=(0.5, -0.7, -0.2), noise=0.02, seed=7, skip=40, keep=2500)
    simulation = Simulation(P, State(0, 0.5, -0.2, -0.7), noise=0.02, seed=7)
    events = np.concatenate([simulation.advance(cycle, 0.0, 100) for cycle in range(1, 1500)])
    impacts = events[events['kind'] <= 1][40:2540]
    for name in ('phase', 'velocity'):
        assert np.array_equal(dataset[f'impact_{name}'], impacts[name])
    assert dataset['count'].values.sum() == np.sum(np.abs(impacts['velocity']) < 2.0)
    assert set(dataset['impact_attractor'].values.tolist()) <= {-1, 0, 1}
    # On A two of three impacts are on the upper wall, on B one of two.
    letters = dict(zip(dataset['attractor_label'].values, dataset['attractor_letter'].values,
                       strict=True))
    for label, letter in letters.items():
        on = dataset['impact_attractor'].values == label
        if np.count_nonzero(on) > 500:
            assert np.mean(impacts['velocity'][on] > 0.0) == pytest.approx(
                {'A': 2 / 3, 'B': 1 / 2}[letter], abs=0.03)


class Section(dict):
    """Stands in for a section: counts off periodic orbits."""

    def __init__(self, counts, **others):
        super().__init__(count=types.SimpleNamespace(values=np.stack([0 * counts, counts])))
        self.attrs = {'tool': 'section', 'alpha': 1.0, 'bins': [len(counts), 1],
                      'velocity_window': [-2.0, 2.0], **others}


def numbers(text):
    words = text.replace(':', ' ').replace(';', ' ').split()
    return float(words[words.index('+-') - 1]), float(words[words.index('+-') + 1]), float(
        text.split('would give ')[1].split()[0])


def test_distance_of_densities_is_right_within_its_error():
    """Samples of two known densities, and of one: the distance is 0.3, and what chance gives."""
    random = np.random.default_rng(11)
    p, q = np.full(1000, 1e-3), np.repeat([1.6e-3, 0.4e-3], 500)
    apart, same, errors = [], [], []
    for _ in range(60):
        distance, error, _ = numbers(compare_densities(
            Section(random.multinomial(4_000_000, p)), Section(random.multinomial(2_000_000, q))))
        apart.append(distance)
        errors.append(error)
        distance, _, chance = numbers(compare_densities(
            Section(random.multinomial(400_000, p)), Section(random.multinomial(200_000, p))))
        same.append(distance)
    assert np.mean(apart) == pytest.approx(0.3, abs=1e-3)
    assert np.std(apart) == pytest.approx(np.mean(errors), rel=0.4)
    assert np.mean(same) == pytest.approx(chance, rel=0.02)


def test_densities_that_do_not_meet_are_at_distance_1():
    text = compare_densities(Section(np.array([5, 5, 0, 0])), Section(np.array([0, 0, 1, 0])))
    assert ': 1.0000 +- ' in text and text.count('100.00%') == 2


@pytest.mark.parametrize(('other', 'named'), [
    (Section(np.array([1, 2])), 'the same --bins'),
    (Section(np.array([1, 2, 3, 4]), velocity_window=[-1.0, 1.0]), 'the same --bins'),
    (Section(np.array([0, 0, 0, 0])), 'needs impacts'),
    (Section(np.array([1, 2, 3, 4]), tool='basins'), 'needs a section')])
def test_what_cannot_be_compared_is_refused(other, named):
    with pytest.raises(ValueError, match=named):
        compare_densities(Section(np.array([1, 1, 1, 1])), other)


@pytest.mark.parametrize(('parameters', 'initial', 'impacts'), [
    (Parameters(alpha=0.05), (0.0, 0.0, 0.0), 0),  # at rest for good
    (Parameters(alpha=0.0, gamma=0.0), (0.0, 0.07, -0.6), 1)])  # it hits a wall once and stops
def test_noise_needs_impacts(parameters, initial, impacts):
    """Where there are none any more the trajectory ends."""
    dataset = section(parameters, initial=initial, noise=1e-9, skip=0, keep=500)
    assert dataset['impact_velocity'].size == impacts
    assert set(dataset['impact_attractor'].values.tolist()) <= {-1}


def test_noise_without_a_trajectory_is_refused(tmp_path, capsys):
    assert main(['--noise', '0.1', '--output', str(tmp_path / 'a.zarr')]) == 2
    assert capsys.readouterr().err == (
        'section: noise = 0.1 is for one trajectory; give its --initial\n')
