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

"""Sweeps along any path: the symmetry of the model, closed forms, one path by two names."""

import math

import numpy as np
import pytest

from gear_rattle_ros import continuation, crisis, find_attractors, Parameters, Path, Plane
from gear_rattle_ros.cli.grids import basins
from gear_rattle_ros.cli.robustness import stability
from gear_rattle_ros.cli.transitions import transitions
from gear_rattle_ros.cli.transitions.continuation import main
from gear_rattle_ros.figures.draw import draw
from gear_rattle_ros.store.store import open_dataset
from gear_rattle_ros.studies.transitions.continuation import describe

SMALL = {'columns': 3, 'trajectories': 32, 'hold': 2000, 'progress': False, 'threads': 1}


def events(dataset, axis):
    """List the changes of orbits: what happens, where, the period."""
    return sorted(zip(*(dataset[f'event_{name}'].values.tolist() for name in (
        axis, 'kind', 'period_impacts', 'tolerance')), strict=True))


@pytest.mark.long
def test_a_sweep_of_the_load_is_the_mirror_image_of_that_of_its_negative():
    """The map s -> -1 - s, tau -> tau + pi turns the load round."""
    up, down = (continuation(Path.over(Parameters(0.09), gamma=window), **SMALL)
                for window in ((0.09, 0.11), (-0.11, -0.09)))
    assert up['gamma'].values == pytest.approx(-down['gamma'].values[::-1])
    one, other = events(up, 'gamma'), events(down, 'gamma')
    assert len(one) == len(other) > 0
    for (place, kind, impacts, error), (place_2, kind_2, impacts_2, _) in zip(
            one, other[::-1], strict=True):
        assert (kind, impacts) == (kind_2, impacts_2)
        assert place == pytest.approx(-place_2, abs=max(2.0 * error, 1e-9))


def test_attractors_of_the_mirrored_load_are_mirrored():
    one, other = (find_attractors(Parameters(gamma=gamma), Plane().draw(
        Parameters(gamma=gamma), 64, 1), hold=2000).orbits for gamma in (0.1, -0.1))
    assert len(one) == len(other) > 1
    for orbit in one:
        images = np.column_stack([np.mod(orbit.phases + math.pi, 2.0 * math.pi),
                                  -orbit.velocities])
        assert min(np.max(np.abs(images[np.lexsort(images.T)] - each.points[
            np.lexsort(each.points.T)])) for each in other
            if each.impacts == orbit.impacts) < 1e-9


def fold(beta, gamma, r):
    """Give alpha where the orbit of one impact a period is born, in closed form."""
    return abs(-r * 2.0 * math.pi * gamma / (1.0 + r) - gamma / beta + 2.0 * math.pi * gamma / (
        1.0 - math.exp(-2.0 * math.pi * beta)))


@pytest.mark.parametrize(('words', 'axis'), [
    pytest.param('--alpha 0.055 --gamma 0.105 0.115', 'gamma', marks=pytest.mark.long),
    pytest.param('--alpha 0.055 --restitution 0.87 0.9', 'restitution', marks=pytest.mark.long),
    pytest.param('--alpha 0.05 --beta 0.09 0.11', 'beta', marks=pytest.mark.long),
    ('--alpha 0.045 0.055 --gamma 0.09 0.095 --beta 0.11 0.1', 'path')])
def test_the_tool_finds_the_fold_along_any_path(words, axis, tmp_path):
    store = tmp_path / 'a.zarr'
    assert main([*words.split(), '--columns', '3', '--trajectories', '96', '--hold', '2000',
                 '--threads', '1', '--output', str(store)]) == 0
    dataset = open_dataset(store)
    assert dataset['share'].dims == ('sweep', axis, 'slot')
    folds = [(place, error) for place, kind, impacts, error in events(dataset, axis)
             if (kind, impacts) == ('fold', 1)]
    assert len(folds) == 1
    (place, error), = folds
    first = {name: dataset.attrs.get(f'{name}_window', [dataset.attrs.get(name)] * 2)
             for name in ('alpha', 'beta', 'gamma', 'restitution')}
    there = {name: low + (high - low) * place if axis == 'path' else
             place if name == axis else low for name, (low, high) in first.items()}
    assert fold(there['beta'], there['gamma'], there['restitution']) == pytest.approx(
        there['alpha'], abs=1e-9)
    assert error < 1e-7
    assert f'{axis} [1]  orbit' in describe(dataset)
    assert axis in draw(dataset).axes[0].get_xlabel()


# Nearly the same as a window of alpha; the tangency is known, of another program, too.
CRISIS = Path(Parameters(1.24, 0.1), Parameters(1.25, 0.1 + 1e-13))


@pytest.mark.long
def test_a_crisis_is_found_along_a_straight_path():
    found = crisis(CRISIS, escapes=16, rates=4, beyond=(4e-3, 4e-2), threads=1)
    assert found['lifetime'].dims[0] == 'path'
    assert found.attrs['tangency_path'] == pytest.approx((1.2432027802 - 1.24) / 0.01, abs=5e-8)
    assert found.attrs['tangency_uncertainty'] < 5e-7
    assert found.attrs['saddle_born_path'] == pytest.approx((1.204563662 - 1.24) / 0.01, abs=1e-6)
    assert any('law with path_c = 0.' in text.get_text()
               for text in draw(found).axes[0].get_legend().get_texts())


@pytest.mark.long
def test_transitions_of_mirrored_loads_are_mirrored(tmp_path):
    """With the doublings of the orbit of one impact, and the chaos they lead to."""
    found = []
    for window in ('0.085 0.1', '-0.1 -0.085'):
        store = tmp_path / f'{len(found)}.zarr'
        assert transitions.main([
            '--alpha', '0.105', '--gamma', *window.split(), '--columns', '4', '--trajectories',
            '64', '--hold', '2000', '--tolerance', '1e-5', '--threads', '1',
            '--output', str(store)]) == 0
        table = open_dataset(store)
        rows = table['attractor'].values[0] >= 0
        found.append(sorted(zip(*(table[name].values[0][rows].tolist() for name in (
            'gamma', 'kind', 'gamma_error')), strict=True)))
    one, other = ([row for row in rows if row[1] in ('fold', 'doubling', 'accumulation')]
                  for rows in found)
    assert len(one) == len(other) > 2
    for (place, kind, error), (place_2, kind_2, error_2) in zip(one, other[::-1], strict=True):
        assert kind == kind_2 and abs(place + place_2) <= error + error_2


@pytest.mark.long
def test_erosion_goes_along_any_parameter(tmp_path):
    store = tmp_path / 'a.zarr'
    assert stability.main([
        '--size', '20', '--initial-conditions', '200', '--hold', '2000', '--along', 'beta',
        '--erosion', '0.09', '0.12', '--columns', '3', '--trajectories', '50', '--threads', '1',
        '--picture', str(tmp_path / 'a.png'), '--output', str(store)]) == 0
    dataset = open_dataset(store)
    assert dataset['erosion_beta'].values == pytest.approx([0.09, 0.105, 0.12])
    assert 'erosion_alpha' not in dataset


def test_several_values_have_a_store_each(tmp_path, capsys):
    """The same as of one run after the other."""
    words = ['--size', '4', '--initial-conditions', '20', '--hold', '1000', '--threads', '1']
    assert basins.main([*words, '--alpha', '0.48', '0.49', '--output', str(tmp_path / 'a.zarr')]
                       ) == 0
    assert basins.main([*words, '--alpha', '0.49', '--output', str(tmp_path / 'b.zarr')]) == 0
    one, other = (open_dataset(tmp_path / f'{name}.zarr') for name in ('a-alpha-0.49', 'b'))
    assert np.array_equal(one['label'].values, other['label'].values)
    assert open_dataset(tmp_path / 'a-alpha-0.48.zarr').attrs['alpha'] == 0.48
