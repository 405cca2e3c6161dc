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

"""Manifolds over basins: which saddle, where its manifolds lead, what bad input says."""

import shlex

import numpy as np
import pytest

from gear_rattle_ros import manifolds, Parameters, Path, Plane
from gear_rattle_ros.cli.skeleton.manifolds import main
from gear_rattle_ros.core.orbits.cells import first_crossing
from gear_rattle_ros.core.orbits.curves import grow, impact_map, segments_of
from gear_rattle_ros.core.orbits.manifolds import saddle_of
from gear_rattle_ros.figures.draw import draw
from gear_rattle_ros.studies.skeleton.manifolds import describe, find_saddle
from gear_rattle_ros.studies.skeleton.tangency import carry, first_touch

P = Parameters(0.48)
B_AND_PARTNER = 'orbit-2-1-U5.4554+0.8585', 'orbit-2-1-U5.1744+0.8226'


@pytest.mark.parametrize('how', [
    {'key': B_AND_PARTNER[0]}, {'key': B_AND_PARTNER[1]}, {'key': B_AND_PARTNER[1][6:]},
    {'point': (0, 5.17, 0.82), 'period': 2}, {'point': (1, 1.5616, -0.4919)}])
def test_a_saddle_is_found_by_key_or_point(how):
    """The orbit closes in the paper's map, and has a multiplier on either side of the circle."""
    orbit = find_saddle(P, **how)
    assert orbit.key == B_AND_PARTNER[1]
    first, second = orbit.multipliers.real
    assert first > 1.0 > second > 0.0
    # det of two impacts in one drive period: r^4 exp(-2 pi beta).
    assert first * second == pytest.approx(0.9**4 * np.exp(-0.2 * np.pi), rel=1e-9)


@pytest.fixture(scope='module')
def beside_b():
    return manifolds(P, Plane(phases=40, velocities=40), orbit=B_AND_PARTNER[0], length=20.0,
                     initial_conditions=40, hold=2000, progress=False)


def test_dataset_of_manifolds(beside_b):
    """One side leads to B alone, the other to both attractors, and crosses the stable one."""
    said = describe(beside_b)
    assert f'saddle {B_AND_PARTNER[1]}: multipliers 2.88109 and 0.121489' in said
    assert f'leads to B {B_AND_PARTNER[0]} alone: the saddle is accessible from its basin' in said
    assert 'unstable - crosses stable' in said
    numbers = beside_b['curve_number'].values
    assert np.all(np.diff(numbers) >= 0) and set(numbers.tolist()) == {0, 1, 2, 3}
    walls, velocities = beside_b['curve_wall'].values, beside_b['curve_velocity'].values
    assert np.array_equal(walls, np.signbit(velocities))
    # Each branch begins beside a point of the saddle.
    begins = np.flatnonzero(beside_b['curve_begins'].values * (
        beside_b['curve_impacts'].values < 2))
    apart = np.hypot(*(beside_b[f'curve_{axis}'].values[begins, None]
                       - beside_b[f'saddle_{axis}'].values for axis in ('phase', 'velocity')))
    assert len(begins) == 8 and np.max(np.min(apart, axis=1)) < 1e-5


def test_a_basin_cell_is_drawn_at_both_ends_of_the_phase(beside_b):
    """The outline of a disc about a point close to 2 pi, on the upper wall."""
    angles = np.linspace(0.0, 2.0 * np.pi, 50)
    dataset = beside_b.drop_vars([f'cell_{name}' for name in (
        'number', 'wall', 'phase', 'velocity')]).assign({
            f'cell_{name}': ('cell', values) for name, values in (
                ('number', np.zeros(50, np.int64)), ('wall', np.zeros(50, np.int64)),
                ('phase', np.mod(6.2 + 0.4 * np.cos(angles), 2.0 * np.pi)),
                ('velocity', 0.8 + 0.3 * np.sin(angles)))})
    paths = [patch.get_path() for patch in draw(dataset).axes[0].patches]
    assert [any(path.contains_point((phase, 0.8)) for path in paths)
            for phase in (0.2, 0.4, 3.0, 5.7, 5.9)] == [True, False, False, False, True]


@pytest.mark.long
def test_first_touch_is_where_the_curves_begin_to_cross():
    """The signed gap and the curves themselves, which know nothing of it, agree to 1e-5."""
    orbit = find_saddle(Parameters(0.445), point=(0, 0.3603, 0.3718))
    path = Path.over(alpha=(0.447, 0.455))
    touch = first_touch(orbit, path)
    assert touch.value == pytest.approx(0.454425205, abs=2e-9)
    for aside in (-1e-5, 1e-5):
        saddle = saddle_of(carry(orbit, path, touch.value + aside))
        unstable, stable = (grow(segment, impact_map(
            saddle.orbit.parameters.model, backwards=backwards, fastest=6.0), impacts=impacts)
            for name, segment, backwards, impacts in (
                (*each, 33 if each[2] else 30) for each in segments_of(saddle))
            if name in ('unstable +', 'stable -'))
        assert (first_crossing(unstable, stable) is not None) == (aside > 0.0)


@pytest.mark.long
def test_a_window_without_a_first_touch_is_refused():
    """Fractal at both ends."""
    orbit = find_saddle(P, key=B_AND_PARTNER[1])
    with pytest.raises(ValueError, match='do not begin to cross between alpha = 0.479 and 0.48'):
        first_touch(orbit, Path.over(alpha=(0.479, 0.48)))


@pytest.mark.parametrize(('options', 'words'), [
    ('', 'give either --orbit KEY or --point WALL PHASE VELOCITY'),
    ('--orbit B', '--orbit B is no key of an orbit'),
    ('--orbit orbit-2-1-U5.1+0.8', 'there is no such orbit at alpha = 0.48'),
    ('--point 0 1 -1', 'the wall is 0 (upper) with a positive velocity'),
    ('--point 2 1 1', 'the wall is 0 (upper) with a positive velocity'),
    ('--point 0 3 1.9 --period 1', 'no saddle is near the point 3 1.9'),
    ('--orbit orbit-2-1-U5.1744+0.8226 --displacement -0.5', 'no impact lies on'),
    ('--orbit orbit-2-1-U5.1744+0.8226 --plane strobe', 'no impact lies on'),
    ('--orbit orbit-2-1-U5.1744+0.8226 --restitution 0', 'give a --restitution above 0'),
    ('--orbit orbit-2-1-U5.1744+0.8226 --length 0', 'length = 0 is not between'),
    ('--orbit orbit-2-1-U5.1744+0.8226 --precision 1', 'precision = 1 is not between')])
def test_bad_input_is_refused_in_one_line(options, words, capsys, tmp_path, monkeypatch):
    """The line names the value, the status is 2, and nothing is written."""
    monkeypatch.chdir(tmp_path)
    assert main(shlex.split(options)) == 2
    said = capsys.readouterr()
    assert said.out == '' and len(said.err.splitlines()) == 1
    assert said.err.startswith('manifolds: ') and words in said.err
    assert list(tmp_path.iterdir()) == []
