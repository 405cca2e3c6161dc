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

"""The motion against an integrator of scipy, and against the orbits that are found."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
import xarray

from gear_rattle_ros import find_attractors, motion, Parameters
from gear_rattle_ros.cli.trajectories.motion import main

P = Parameters(alpha=0.48)
FEW = {'initial_conditions': 60, 'hold': 2000}


def flights(dataset: xarray.Dataset) -> list[slice]:
    """List the samples of each flight: an impact stands twice."""
    ends = [*(1 + np.flatnonzero(np.diff(dataset['tau']) == 0.0)), len(dataset['tau'])]
    return [slice(a, b) for a, b in zip([0, *ends[:-1]], ends, strict=True)]


@pytest.mark.parametrize(('options', 'impacts'), [
    ({'attractor': 'A', 'periods': 3}, 9), ({'attractor': 'B', 'periods': 3}, 6),
    ({'initial': (1.0, 0.4, -0.3), 'periods': 2}, None)])
def test_every_flight_obeys_the_equation_of_motion(options: dict, impacts: int | None) -> None:
    """Equation (3), integrated from the first sample of each flight to its last."""
    dataset = motion(P, **options, **FEW)
    tau, s, v = (dataset[name].values for name in ('tau', 'displacement', 'velocity'))
    for part in flights(dataset):
        if tau[part][-1] == tau[part][0]:
            continue
        found = solve_ivp(
            lambda t, y: (y[1], P.gamma - P.beta * y[1] - P.alpha * math.sin(t)
                          + P.alpha * P.beta * math.cos(t)),
            (tau[part][0], tau[part][-1]), (s[part][0], v[part][0]), 'DOP853',
            np.unique(tau[part]), rtol=1e-12, atol=1e-12)
        _, first = np.unique(tau[part], return_index=True)
        assert np.abs(found.y - [s[part][first], v[part][first]]).max() < 1e-9
    assert tau[-1] - tau[0] == pytest.approx(2.0 * math.pi * options['periods'], abs=1e-12)
    assert -1.0 <= s.min() and s.max() <= 0.0
    before, after = (dataset[f'impact_{name}'].values for name in ('velocity', 'velocity_after'))
    assert np.allclose(after, -P.restitution * before, rtol=1e-15)
    assert impacts in (None, len(before))
    assert np.array_equal(dataset['impact_wall'], before < 0.0)


def test_the_impacts_are_those_of_the_orbit() -> None:
    """Found by letter and by key; phase and velocity as Newton's method closes the orbit."""
    catalogue = find_attractors(P)
    for letter, each in zip('BA', catalogue.attractors, strict=True):
        assert each.letter == letter
        by_letter, by_key = (motion(P, attractor=name, periods=1, **FEW)
                             for name in (letter, each.key))
        assert by_letter.drop_attrs().identical(by_key.drop_attrs())
        assert by_letter.attrs['attractor_key'] == each.key
        points = np.column_stack([by_letter['impact_tau'], by_letter['impact_velocity']])
        expected = each.orbit.points[np.argsort(each.orbit.phases)]
        assert np.abs(points - expected).max() < 1e-9


def test_an_initial_condition_is_where_it_begins() -> None:
    """Upwards from the upper wall the impact comes at once; passed over, it is not listed."""
    dataset = motion(P, initial=(1.0, 0.4, 0.0), periods=1)
    assert dataset['tau'].values[0] == 1.0 and dataset['displacement'].values[0] == 0.0
    assert dataset['velocity'].values[:2].tolist() == [0.4, 0.4]
    assert dataset['impact_velocity_after'].values[0] == pytest.approx(-0.36, rel=1e-15)
    later = motion(P, initial=(1.0, 0.4, 0.0), periods=1, skip=3)
    assert later['tau'].values[0] == dataset['impact_tau'].values[2]


def test_a_gear_at_rest_does_not_move() -> None:
    """A weak drive presses it against the upper wall for good: neither motion nor impacts."""
    dataset = motion(Parameters(alpha=0.05), attractor='rest-upper', periods=2, **FEW)
    assert not np.any(dataset['displacement']) and not np.any(dataset['velocity'])
    assert dataset['impact_tau'].size == 0


@pytest.mark.parametrize(('words', 'named'), [
    ('--attractor C', 'no attractor C at these parameters; there are B orbit-2-1-'),
    ('--restitution 1 --beta 0', 'no attractor was reached at these parameters; there are none'),
    ('--attractor A --initial 0 0 0', 'exclude each other'),
    ('--initial 0 0 0.5', 'displacement = 0.5 is outside')])
def test_bad_input_is_refused_in_one_line(words: str, named: str, tmp_path, capsys) -> None:
    """It names what there is."""
    options = ['--initial-conditions', '60', '--hold', '2000', *words.split()]
    assert main([*options, '--output', str(tmp_path / 'a.zarr')]) == 2
    error = capsys.readouterr().err
    assert named in error and error.count('\n') == 1
