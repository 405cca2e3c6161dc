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

"""Boundaries of the model: routes that agree, three basins, none at all."""

import dataclasses
import functools
import math
import re

import numpy as np
import pytest

from gear_rattle_ros import boundary, find_attractors, Parameters, Plane
from gear_rattle_ros.cli.skeleton.boundary import main
from gear_rattle_ros.cli.transitions.continuation import main as follow
from gear_rattle_ros.core.boundaries.uncertainty import count_cut
from gear_rattle_ros.store.store import Store
from gear_rattle_ros.studies.skeleton.boundary import describe, labels_of, law_of, measure, PROBES

QUICK = {'initial_conditions': 60, 'hold': 2000, 'cap': 4000}
# An impact of B is in this window, in which all initial conditions settle alike.
QUIET = Plane(0.0, (5.455, 5.456), (0.858, 0.859), 40, 40)


@pytest.mark.long
@pytest.mark.parametrize('alpha', [0.48, 0.57])
def test_triplets_boxes_and_the_saddle_agree(alpha):
    """One exponent, by the first two to 3 %; 1e-9 is far above what a last digit changes."""
    dataset = boundary(Parameters(alpha=alpha), Plane(phases=50, velocities=50))
    values, errors = dataset['exponent'].values, dataset['exponent_error'].values
    assert np.all(errors < 0.03 * values)
    assert abs(values[0] - values[1]) < 3.0 * math.hypot(*errors)
    assert abs(values[0] - dataset['saddle_exponent']) < 3.0 * math.hypot(
        errors[0], dataset['saddle_exponent_error'])
    share = (dataset['cut'] / dataset['probes']).values[0]
    assert share[-2] > 2.0 * share[-1] > 0.0
    assert 'the boundary in a disc is not that' in describe(dataset)


@pytest.mark.long
def test_three_basins_share_one_boundary(tmp_path, capsys):
    """At 0.50 there are A, B and C, and a boundary with more than ln 2 in its boxes is fractal."""
    words = ('--alpha 0.5 --size 125 --distances 1e-5 1e-2 --per-decade 1 --error 0.1 --cap 4000 '
             '--initial-conditions 200 --hold 2000').split()
    picture = tmp_path / 'a.png'
    assert main([*words, '--output', str(tmp_path / 'a.zarr'), '--picture', str(picture)]) == 0
    said = capsys.readouterr().out
    assert picture.exists()
    assert 'S_bb exceeds ln 2' in said
    assert 'Wada by grid refinement: passed' in said
    assert 'Wada by unstable manifolds: passed' in said
    # C is born with the orbit that is accessible from it: three impacts as well.
    assert re.search('^C +orbit-3-1-U', said, re.MULTILINE)
    found = re.search(r'triplets: exponent (\S+) \+- (\S+),', said)
    assert 0.0 < float(found[1]) < 0.3 and float(found[2]) < 0.05


def test_the_coarse_measure_agrees_with_boxes_of_two_edges():
    """The slope between 1e-8 and 1e-2 at 0.48; and beyond the end of B there is no boundary."""
    plane, random = Plane(), np.random.default_rng(5)
    known = find_attractors(Parameters(alpha=0.48), plane.draw(Parameters(alpha=0.48), 60, 1),
                            hold=2000)
    exponent, error, entropy, _ = measure(known, plane, 1)
    label = functools.partial(labels_of, known, plane, 2000)
    (small, first), (large, second) = (
        count_cut(label, (plane.window, plane.velocity), 'box', size, 0.04, 50_000, random)
        for size in (1e-8, 1e-2))
    slope = math.log(large / second * first / small) / math.log(1e6)
    assert exponent == pytest.approx(slope, abs=3.0 * math.hypot(error, 0.06 / math.log(1e6)))
    assert 0.0 < entropy < math.log(2.0)
    alone = dataclasses.replace(known, orbits=known.orbits[:1])
    assert np.isnan(measure(alone, QUIET, 1)).all()


@pytest.mark.long
def test_a_continuation_carries_the_boundary_along(tmp_path, capsys):
    """At 0.56 there are A and B, at 0.59 A alone."""
    words = ('--boundary --alpha 0.56 0.59 --columns 2 --trajectories 32 --hold 2000 --tolerance '
             '1e-3').split()
    picture = tmp_path / 'a.png'
    assert follow([*words, '--output', str(tmp_path / 'a.zarr'), '--picture', str(picture)]) == 0
    said = capsys.readouterr().out
    assert picture.exists()
    assert 'uncertainty exponent of the boundary: at 1 of 2 alphas, 0.1' in said
    assert 'boundary basin entropy S_bb: at 1 of 2 alphas, 0.5' in said


def test_a_sweep_has_the_results_of_each_value(tmp_path, capsys):
    """To the last digit, along a path of two parameters; it goes on after a stop."""
    plane, options = Plane(phases=60, velocities=60), QUICK | {
        'distances': (1e-4, 1e-1), 'per_decade': 1, 'error': 0.3}
    words = ('--alpha 0.48 0.6 --gamma 0.1 0.11 --columns 2 --size 60 --distances 1e-4 1e-1 '
             '--per-decade 1 --error 0.3 --initial-conditions 60 --hold 2000 --cap 4000').split()
    path, picture = tmp_path / 'a.zarr', tmp_path / 'a.png'
    for _ in range(2):
        assert main([*words, '--output', str(path), '--picture', str(picture)]) == 0
        lines = capsys.readouterr().out.splitlines()
        Store(path).mark(0, False)
    assert picture.exists() and [line.split()[0] for line in lines[:3]] == ['path', '0', '1']
    one, rows = boundary(Parameters(0.48), plane, **options), Store(path)
    for name in ('exponent', 'exponent_error', 'saddle_exponent', 'saddle_kappa'):
        np.testing.assert_array_equal(rows.read_all(name)[0], one[name].values)
    assert rows.read_all('entropy_boundary')[0] == one['entropy_boundary'].values[-1]
    # B has ended at the other end.
    assert rows.read_all('basins').tolist() == [2.0, 1.0]
    assert np.isnan(rows.read_all('exponent')[1]).all()


def test_where_there_is_no_boundary():
    dataset = boundary(Parameters(alpha=0.48), QUIET, distances=(1e-6, 1e-3), per_decade=1,
                       **QUICK)
    assert 'no boundary: all cells have one label' in describe(dataset)
    assert not dataset['cut'].values.any()
    assert [law_of(dataset, probe) for probe in PROBES] == [None, None]
    assert np.isnan(dataset['exponent'].values).all()
    # Where no disc has several labels, nothing is said of them.
    dataset['label'][0, 0] = 1 - dataset['label'][0, 0]
    assert 'smooth' not in describe(dataset)


@pytest.mark.long
def test_probes_are_counted_where_that_was_stopped(tmp_path):
    """A count that is missing is made again, to the same number, and the others stay."""
    def counted():
        return boundary(Parameters(alpha=0.48), Plane(phases=10, velocities=10), per_decade=1,
                        distances=(1e-4, 1e-1), error=0.3, store=tmp_path / 'a.zarr',
                        resume=True, **QUICK).load()

    whole, store = counted(), Store(tmp_path / 'a.zarr')
    cut, probes = (store.read_all(name) for name in ('cut', 'probes'))
    cut[0, :2], probes[0, :2], cut[1, 0] = 0, 0, 7
    store.write_table({name: (('probe', 'distance'), values, {})
                       for name, values in (('cut', cut), ('probes', probes))})
    again = counted()
    assert np.array_equal(again['cut'][0], whole['cut'][0]) and again['cut'][1, 0] == 7
    assert np.array_equal(again['probes'], whole['probes'])


def test_where_areas_are_preserved_nothing_settles():
    dataset = boundary(Parameters(0.48, 0.0, 0.1, 1.0), QUIET, distances=(1e-6, 1e-3),
                       per_decade=1, **{**QUICK, 'cap': 50})
    assert 'no attractors' in describe(dataset)


@pytest.mark.parametrize('words, said', [
    ('--distances 1e-13 1e-1', '--distances 1e-13 0.1: give two between 1e-12'),
    ('--distances 1e-1 1e-9', '--distances 0.1 1e-09: give two'),
    ('--distances 1e-2 1e-1', '3 distances with --per-decade 2; a power law takes 4'),
    ('--error 0.5', '--error 0.5 is not between')])
def test_refusals(words, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(words.split()) == 2
    line, = capsys.readouterr().err.splitlines()
    assert line.startswith('boundary: ') and said in line
    assert list(tmp_path.iterdir()) == []
