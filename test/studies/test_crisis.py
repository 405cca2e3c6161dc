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

"""Escape rates from known laws, and the crisis between what escapes and what does not."""

import math

import numpy as np
import pytest

from gear_rattle_ros.attractors.finding import find_attractors
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.cli.transitions.crisis import main
from gear_rattle_ros.core.flight.lanes import new_tiles
from gear_rattle_ros.core.many.escape import (
    CAPTURED,
    escape_rate,
    last_until_captured,
    UNUSED,
)
from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.core.orbits.branches import Change, follow
from gear_rattle_ros.core.orbits.manifolds import saddle_of
from gear_rattle_ros.core.path import Path
from gear_rattle_ros.store.store import open_dataset
from gear_rattle_ros.studies.skeleton.tangency import birth_of, carry, Contact, find_tangency
from gear_rattle_ros.studies.transitions.crisis import PAPER, PAPER_BRACKET
from gear_rattle_ros.studies.transitions.escape_rates import fit_exponent, fit_law

# Of the captor at which a trajectory is captured [rad, 1].
RADIUS = 0.02
ALPHA = Path.over(alpha=(1.0, 1.3))


@pytest.fixture(scope='module')
def captor():
    """Find the orbit of four impacts that captures what escapes beyond the crisis."""
    parameters = Parameters(alpha=1.25)
    found = find_attractors(parameters, Plane().draw(parameters, 64, 1), hold=20_000,
                            chaotic=False)
    return next(orbit for orbit in found.orbits if orbit.impacts == 4)


@pytest.fixture(scope='module')
def saddle(captor):
    """Follow that orbit through the fold in which it was born, to the saddle beside it."""
    orbits = follow(captor, ALPHA, -1.0, 1.0, 1.3).orbits
    return carry(min((one for one in orbits if one.multipliers[0].real > 1.0),
                     key=lambda one: abs(one.parameters.alpha - 1.25)), ALPHA, 1.25)


def contact_of(saddle):
    """Return the contact of a saddle with itself, from the side that stays in the attractor."""
    side = saddle_of(saddle)
    sides = [Contact(one, side, ALPHA) for one in (side, side.other_side)]
    return next(one for one in sides if one.begins(1.2430, 1.2436))


def escapes_at(captor, alpha, trajectories, limit):
    """Time escapes at an alpha."""
    parameters = Parameters(alpha=alpha)
    initial = Plane().draw(parameters, trajectories, 5)
    return last_until_captured(new_tiles(1)[0], initial, carry(captor, ALPHA, alpha).points,
                               np.array([captor.impacts]), RADIUS, 300, trajectories, limit)[:2]


@pytest.mark.parametrize('limit', [math.inf, 700.0])
def test_a_known_rate_is_found_within_its_error(limit):
    rng = np.random.default_rng(2)
    off = []
    for _ in range(60):
        life = 100.0 + rng.exponential(500.0, 2000)
        rate = escape_rate(np.minimum(life, limit), life > limit, 100.0)
        off.append((rate.rate - 1.0 / 500.0) / rate.error)
        assert rate.mean == pytest.approx(500.0, abs=6.0 * rate.mean_error)
    # The stated error is the scatter.
    assert np.std(off) == pytest.approx(1.0, abs=0.3)
    assert abs(np.mean(off)) < 4.0 / math.sqrt(60)


def test_what_escapes_at_once_does_not_count():
    life = np.concatenate([np.full(1000, 5.0), 50.0 + np.full(10, 100.0)])
    rate = escape_rate(life, np.zeros(1010, bool), 50.0)
    assert rate.escapes == 10 and rate.rate == pytest.approx(0.01)


def test_a_known_law_is_found_within_its_errors():
    rng = np.random.default_rng(3)
    alphas = 1.2 + np.geomspace(1e-5, 1e-3, 16)
    exact = 0.07 * (alphas - 1.2)**0.93
    counts = rng.poisson(400, len(alphas))
    rates = exact * counts / 400
    law = fit_law(alphas, rates, rates / np.sqrt(counts))
    assert abs(law.critical - 1.2) < 4.0 * law.critical_error < 6e-5
    assert abs(law.exponent - 0.93) < 4.0 * law.exponent_error < 0.5
    exponent, error = fit_exponent(alphas, rates, rates / np.sqrt(counts), 1.2)
    assert abs(exponent - 0.93) < 4.0 * error < 0.2
    clean = fit_law(alphas, exact, 0.01 * exact)
    assert clean.critical == pytest.approx(1.2, abs=1e-10)
    assert clean.exponent == pytest.approx(0.93, abs=1e-6)


def test_too_few_rates_are_refused():
    with pytest.raises(ValueError, match='not enough'):
        fit_law([1.0, 1.1, 1.2], [1.0, 2.0, 3.0], [0.1, 0.1, 0.1])


def test_captor_and_saddle_are_born_in_a_fold(captor, saddle):
    for orbit in (captor, saddle):
        assert (orbit.impacts, orbit.drive_periods) == (4, 1)
        product = complex(orbit.multipliers[0] * orbit.multipliers[1])
        assert product.real == pytest.approx(0.9**8 * math.exp(-0.1 * 2.0 * math.pi), rel=1e-10)
    assert captor.is_stable and not saddle.is_stable
    birth = birth_of(saddle, ALPHA)
    assert birth.change is Change.FOLD and 1.20 < birth.value < 1.21
    assert abs(carry(captor, ALPHA, birth.value + 1e-6).multipliers[0] - 1.0) < 0.05


@pytest.mark.long
def test_manifolds_cross_where_trajectories_escape_and_not_where_they_stay(captor, saddle):
    contact = contact_of(saddle)
    # scipy's integrator finds the same place: python benchmark/crisis.py.
    touch = find_tangency(contact, 1.2430, 1.2436)
    assert touch.value == pytest.approx(1.2432027802, abs=5e-10) and contact.is_homoclinic
    assert touch.contact.lifetime_exponent == pytest.approx(0.9462, abs=1e-3)
    # None of those that last escapes below the tangency, nearly all do above.
    life, fates = escapes_at(captor, 1.2430, 128, 40_000)
    assert not np.any((fates == CAPTURED) & (life > 300))
    life, fates = escapes_at(captor, 1.2500, 128, 40_000)
    assert np.all(fates == CAPTURED)


@pytest.mark.long
def test_nothing_escapes_just_above_the_figure_of_the_paper(captor):
    life, fates = escapes_at(captor, PAPER + 1e-3, 128, 40_000)
    assert not np.any((fates == CAPTURED) & (life > 300))


def test_enough_escapes_stop_all_and_give_the_same_rate(captor):
    parameters = Parameters(alpha=1.25)
    initial = Plane(displacement=-0.5).draw(parameters, 2000, 6)
    rates = []
    for wanted in (300, 2000):
        lifetimes, fates, _ = last_until_captured(
            new_tiles(1)[0], initial, captor.points, np.array([captor.impacts]), RADIUS, 300,
            wanted, 10**7)
        begun = fates != UNUSED
        assert begun.all() == (wanted == 2000) and np.all(lifetimes[~begun] == 0)
        rates.append(escape_rate(lifetimes[begun], fates[begun] != CAPTURED, 300))
    assert 300 <= rates[0].escapes < 400
    assert abs(rates[0].rate - rates[1].rate) < 4.0 * math.hypot(rates[0].error, rates[1].error)


@pytest.mark.long
def test_both_methods_agree_inside_the_bracket_of_the_paper(tmp_path, capsys):
    path, picture = tmp_path / 'c.zarr', tmp_path / 'c.png'
    assert main(['--output', str(path), '--picture', str(picture), '--beyond', '2e-5', '4e-4',
                 '--rates', '12']) == 0
    a = open_dataset(path).attrs
    assert PAPER_BRACKET[0] < a['tangency_alpha'] < PAPER_BRACKET[1]
    assert a['tangency_uncertainty'] < 1e-5
    assert abs(a['law_alpha_c'] - a['tangency_alpha']) < 4.0 * a['law_alpha_c_error']
    assert str(PAPER) in capsys.readouterr().out


# Where attractors of figure 2 end, as escapes alone show it to `continuation`, the saddles there,
# and where that of B was born: in the fold of a stable orbit of as many impacts.
ENDS = {
    'B': (('0.5715', '0.5735'), 0.572286, (6, 3), 0.5208323),
    'C': (('0.5155', '0.5165'), 0.51601, (9, 3), None),
}


@pytest.mark.long
@pytest.mark.parametrize('name', ENDS)
def test_the_end_of_any_chaotic_attractor_names_what_it_collides_with(name, tmp_path):
    window, alpha, saddle, born = ENDS[name]
    path = tmp_path / 'c.zarr'
    assert main(['--alpha', *window, '--rates', '8', '--escapes', '24', '--beyond', '3e-5', '6e-4',
                 '--output', str(path)]) == 0
    a = open_dataset(path).attrs
    assert a['tangency_alpha'] == pytest.approx(alpha, abs=2e-6)
    assert a['tangency_uncertainty'] < 1e-7
    assert (a['saddle_impacts'], a['saddle_drive_periods']) == saddle
    # The escape rates know nothing of the manifolds.
    assert abs(a['law_alpha_c'] - a['tangency_alpha']) < 3.0 * a['law_alpha_c_error']
    assert born is None or a['saddle_born_alpha'] == pytest.approx(born, abs=1e-6)


@pytest.mark.parametrize(('words', 'named'), [
    (['--alpha', '1.25', '1.23'], 'alpha window'),
    (['--beyond', '1e-3', '1e-4'], '--beyond'),
    (['--alpha', '0.48', '0.49'], 'give another --alpha'),
    pytest.param(['--alpha', '0.57', '0.571', '--attractor', 'chaotic-9'], 'chaotic-9',
                 marks=pytest.mark.long),
])
def test_bad_input_is_refused_in_one_line(words, named, capsys, tmp_path):
    # The first time on a machine a line says that kernels are compiled.
    main([*words, '--output', str(tmp_path / 'c.zarr')])
    capsys.readouterr()
    assert main([*words, '--output', str(tmp_path / 'c.zarr')]) == 2
    error = capsys.readouterr().err
    assert named in error and error.count('\n') == 1
