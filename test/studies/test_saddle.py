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

"""The study of saddles: its routes agree with each other and with other studies."""

import math

import numpy as np
import pytest

from gear_rattle_ros import find_attractors, lifetimes, Parameters, Path, Plane, saddle
from gear_rattle_ros.cli.skeleton.saddle import main
from gear_rattle_ros.core.orbits.branches import follow
from gear_rattle_ros.core.orbits.orbit import close_orbit
from gear_rattle_ros.studies.skeleton.saddle import describe

BETA, GAMMA, R = 0.1, 0.1, 0.9


def rates(dataset):
    return {name: (value, error) for name, value, error in zip(
        dataset['rate_name'].values.tolist(), dataset['rate_value'].values.tolist(),
        dataset['rate_error'].values.tolist(), strict=True)}


@pytest.fixture(scope='module')
def edge():
    return saddle(Parameters(0.48), straddled=400, sprinkled=4000, initial_conditions=64,
                  threads=1)


def test_dimensions_follow_from_the_rates(edge):
    """As Kantz and Grassberger have them."""
    found = rates(edge)
    kappa, one, two = (found[name][0] for name in ('kappa', 'lambda_1', 'lambda_2'))
    assert found['D_1'][0] == pytest.approx(1.0 - kappa / one, abs=1e-12)
    assert found['D_2'][0] == pytest.approx((one - kappa) / -two, abs=1e-12)
    # The box dimension is not less than that of the natural measure.
    assert 0.0 < found['exponent'][0] < kappa / one


def test_words_state_rates_with_two_digits_of_their_errors(edge):
    said = describe(edge)
    value, error = rates(edge)['kappa']
    assert 0.001 < error < 0.01
    assert f'kappa     {value:.4f} +- {error:.4f}' in said
    assert 'the boundary of the basins holds a chaotic saddle' in said


@pytest.mark.long
def test_between_rest_and_rattle_the_boundary_holds_one_orbit_alone():
    found = saddle(Parameters(0.06), straddled=160, sprinkled=800, initial_conditions=64,
                   threads=1)
    assert f'the boundary of the basins holds the orbit {found.attrs["is_orbit"]} alone' in (
        describe(found))
    assert rates(found)['exponent'] == (1.0, 0.0)


def test_orbits_on_the_edge_satisfy_what_is_exact(edge):
    """Saddles whose multipliers have the product r^(2q) exp(-2 pi beta p)."""
    turns = [int(key.split('-')[2]) for key in edge['orbit_key'].values.tolist()]
    product = np.prod(edge['orbit_multiplier'].values, axis=1)
    assert len(turns) > 4
    assert product == pytest.approx(R**(2.0 * edge['orbit_impacts'].values)
                                    * np.exp(-2.0 * math.pi * BETA * np.array(turns)), rel=1e-6)
    assert np.all(np.abs(edge['orbit_multiplier'].values[:, 0]) > 1.0)


def test_accessible_orbits_are_born_with_the_attractors(edge):
    """Round its fold, each attractor becomes the saddle that bounds its basin."""
    parameters = Parameters(0.48)
    catalogue = find_attractors(parameters, Plane().draw(parameters, 64, 1), hold=2000, threads=1)
    accessible = dict(zip(edge['orbit_side'].values.tolist(), edge['orbit_key'].values.tolist(),
                          strict=True))
    for orbit in catalogue.orbits:
        branch = follow(orbit, Path.over(alpha=(0.40, 0.481)), -1.0, 0.40, 0.481)
        # The place on the other side of the fold that is nearest to 0.48.
        fold = min(range(len(branch.orbits)), key=lambda k: branch.orbits[k].parameters.alpha)
        partner = min(branch.orbits[fold:], key=lambda one: abs(one.parameters.alpha - 0.48))
        partner = close_orbit(partner.walls, partner.points, parameters)
        assert partner is not None and not partner.is_stable
        assert accessible[orbit.key] == partner.canonical().key


@pytest.mark.long
def test_escape_rate_is_that_of_lifetimes():
    """A grid of the plane decays at the rate of the saddle; its transients stretch as it does."""
    grid = lifetimes(Parameters(1.26), Plane(phases=150, velocities=150), threads=1)
    longest = grid['lifetime'].where(grid['label'] >= 0).stack(cell=('velocity', 'phase'))
    velocity, phase = longest['cell'].values[int(np.nanargmax(longest.values))]
    found = saddle(Parameters(1.26), transient=True, initial=(phase, velocity, 0.0),
                   straddled=800, sprinkled=16_000, initial_conditions=128, threads=1)
    kappa, error = rates(found)['kappa']
    # A chance per impact, and the rate that it stands for.
    decay = -math.log1p(-grid.attrs['escape_rate'])
    assert abs(kappa - decay) < 3.0 * math.hypot(error, grid.attrs['escape_rate_error'])
    assert error < 0.02 * kappa
    one = rates(found)['lambda_1']
    assert abs(found.attrs['transient_exponents'][0] - one[0]) < 4.0 * math.hypot(
        one[1], found.attrs['transient_errors'][0])
    assert found.attrs['transient_near'] > 0.8


@pytest.mark.long
def test_a_chaotic_attractor_ends_at_the_orbit_that_is_accessible_from_it():
    """Shortly before B's crisis: the orbit that the tangency of manifolds names there."""
    found = saddle(Parameters(0.57), straddled=160, sprinkled=800, initial_conditions=128,
                   threads=1)
    accessible = dict(zip(found['orbit_side'].values, found['orbit_key'].values, strict=True))
    (chaotic,) = (side for side in accessible if side.startswith('chaotic'))
    assert accessible[chaotic].startswith('orbit-6-3-U5.32')


@pytest.mark.parametrize(('options', 'words'), [
    ('--alpha 1.26', '--transient'),
    ('--alpha 1.20 --transient', 'another alpha'),
    ('--alpha 1.26 --transient --initial 0 0.1 0', 'too short'),
])
def test_what_has_no_saddle_is_refused_in_one_line(options, words, tmp_path, monkeypatch, capsys):
    """Where one attractor is all, where nothing escapes, and where nothing is transient."""
    monkeypatch.chdir(tmp_path)
    assert main([*options.split(), '--initial-conditions', '40', '--hold', '2000']) == 2
    said = capsys.readouterr().err.splitlines()
    assert words in said[-1]
