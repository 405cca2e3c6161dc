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

"""Parameter planes against closed forms, symmetry and published numbers."""

import math
from pathlib import Path as FilePath

import numpy as np
import pytest

from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.cli.sweeps.parameter_plane import main
from gear_rattle_ros.core.many.survey import CHAOTIC, OUTCOME, PERIODIC, RESTING, survey
from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.core.path import Path
from gear_rattle_ros.store.store import open_dataset, Store
from gear_rattle_ros.studies.sweeps.parameter_plane import parameter_plane

KEEP = 4096


def surveyed(*places: Parameters, count: int = 8, keep: int = KEEP) -> np.recarray:
    """Return the outcomes of initial conditions at some places, a row each."""
    initial = np.stack([Plane().draw(each, count, 1) for each in places])
    return survey(initial, 1000, keep)


def test_orbits_have_their_known_periods_and_exact_exponents() -> None:
    """A and B at 0.48, and the orbit after the crisis; multipliers are known in closed form."""
    found, count = surveyed(Parameters(0.48), Parameters(1.26))
    assert count.tolist() == [2, 1]
    b, a = sorted(found[0][:2].tolist(), key=lambda one: one[1])
    exact = [math.log(0.9) - 0.1 * math.pi * p / q for q, p in ((3, 1), (4, 1))]
    names = OUTCOME.names
    assert names is not None
    for one, period, exponent in ((a, (3, 1), exact[0]), (b, (2, 1), None),
                                  (found[1][0].tolist(), (4, 1), exact[1])):
        values = dict(zip(names, one, strict=True))
        assert values['kind'] == PERIODIC and (values['impacts'], values['drive']) == period
        assert values['walls'] == 3 and values['error'] == 0.0
        assert exponent is None or abs(values['exponent'] - exponent) < 1e-10
    assert b[1:3] == (2, 1)


def test_chaos_has_the_exponent_of_a_long_run() -> None:
    """At 0.57 a long run of 2e5 impacts gives 0.16121 +- 0.00037 for B."""
    found, count = surveyed(Parameters(0.57), keep=8 * KEEP)
    assert count == [2]
    chaos, = found[0][found[0]['kind'] == CHAOTIC]
    assert abs(chaos['exponent'] - 0.16121) < 4.0 * math.hypot(chaos['error'], 0.00037)
    assert chaos['error'] < 0.004


def test_orbits_that_stick_and_rest() -> None:
    """Below the threshold something rests; above it, at a small r, the gear sticks each period."""
    beta, gamma = 0.1, 0.3
    threshold = gamma / math.hypot(1.0, beta)
    found, _ = surveyed(*(Parameters(alpha, beta, gamma, 0.3)
                          for alpha in (threshold - 1e-6, threshold + 1e-6)), count=32)
    assert np.any(found[0]['kind'] == RESTING)
    assert np.all(found[0]['walls'][found[0]['kind'] == RESTING] == 1)
    assert not np.any(found[1]['kind'] == RESTING)
    sticking = found[1][0]
    assert (sticking['kind'], sticking['exponent'], sticking['drive']) == (PERIODIC, -math.inf, 1)


def test_the_plane_is_symmetric(tmp_path: FilePath) -> None:
    """The map s -> -1 - s, gamma -> -gamma turns walls round and keeps the rest."""
    path, picture = tmp_path / 'a.zarr', tmp_path / 'a.png'
    assert main(['--alpha', '0.3', '1.3', '--gamma', '-0.3', '0.3', '--size', '9', '12',
                 '--initial-conditions', '8', '--threads', '1', '--output', str(path),
                 '--picture', str(picture)]) == 0
    assert picture.read_bytes()[:8] == b'\x89PNG\r\n\x1a\n'
    plane = open_dataset(path)
    assert plane['exponent'].dims == ('gamma', 'alpha', 'slot')
    alone = plane['attractors'].values == 1
    alone &= alone[::-1]
    assert np.count_nonzero(alone) > 60
    first = plane.isel(slot=0)
    for name in ('kind', 'period_impacts', 'period_drive'):
        values = first[name].values
        assert np.mean(values[alone] == values[::-1][alone]) > 0.97, name
    contact = first['contact'].values
    assert np.all(contact[alone] == np.array([0, 2, 1, 3])[contact[::-1]][alone])
    exponent, error = first['exponent'].values, first['exponent_error'].values
    both = alone & (first['kind'].values == PERIODIC) & (first['kind'].values[::-1] == PERIODIC)
    same = both & np.isfinite(exponent)
    np.testing.assert_allclose(exponent[same], exponent[::-1][same], atol=1e-9)
    both = alone & (first['kind'].values == CHAOTIC) & (first['kind'].values[::-1] == CHAOTIC)
    apart = abs(exponent[both] - exponent[::-1][both]) / np.hypot(error, error[::-1])[both]
    assert np.mean(apart < 3.0) > 0.9
    np.testing.assert_allclose(first['share'].values[alone], 1.0)


def test_the_stable_orbit_of_one_impact_fills_its_closed_region() -> None:
    """Over (alpha, gamma) at beta = 0 it is stable between its fold and its doubling."""
    r = 0.6
    plane = parameter_plane(
        Path.over(Parameters(beta=0.0, restitution=r), alpha=(0.02, 0.3), gamma=(0.02, 0.2)),
        size=(16, 10), initial_conditions=24, threads=1)
    alpha, gamma = np.meshgrid(plane['alpha'], plane['gamma'])
    fold = gamma * math.pi * (1.0 - r) / (1.0 + r)
    doubling = gamma * math.hypot(math.pi * (1.0 - r) / (1.0 + r),
                                  2.0 * (1.0 + r * r) / (1.0 + r)**2)
    one = ((plane['period_impacts'] == 1) & (plane['period_drive'] == 1)
           & (plane['contact'] == 1)).values
    seen = one.any(axis=2)
    assert not np.any(seen[(alpha < fold) | (alpha > doubling)])
    np.testing.assert_allclose(plane['exponent'].values[one], math.log(r), atol=1e-10)
    # Near its ends its basin is small, and close to the walls it meets the other one.
    inside = (alpha > 1.2 * fold) & (alpha < 0.9 * doubling) & (gamma < 0.15)
    assert np.count_nonzero(inside) > 5 and np.mean(seen[inside]) > 0.8


def test_the_tiles_do_not_matter_and_go_on(tmp_path: FilePath) -> None:
    """A store that is cut short is finished to the same bits."""
    options = {'path': Path.over(alpha=(0.4, 0.9), restitution=(0.5, 0.9)), 'size': (90, 3),
               'skip': 64}
    path = tmp_path / 'a.zarr'
    whole = parameter_plane(store=path, threads=1, **options)
    before = whole['exponent'].values.copy()
    store = Store(path)
    assert len(store.tiles) == 3
    store.write(1, {'exponent': np.zeros((3, 40, 4))})
    store.mark(1, False)
    again = parameter_plane(store=path, resume=True, threads=1, **options)
    np.testing.assert_array_equal(again['exponent'].values, before)


@pytest.mark.parametrize(('words', 'said'), [
    ('--alpha 0.4 --gamma 0.1', 'no parameter has a window'),
    ('--beta 0 0.1', 'a window of beta makes no plane'),
    ('--alpha 0.5 0.4 --gamma 0 1', 'alpha window 0.5 to 0.4 is empty or reversed'),
    ('--alpha 0.1 0.2 0.3', '--alpha takes a value or a window of two, not 3'),
    ('--gamma 0 5000', 'gamma = 5000.0 is outside'), ('--keep 10', 'whole number from 1024 on')])
def test_refusals_are_one_line(words: str, said: str, capsys: pytest.CaptureFixture[str],
                               tmp_path: FilePath) -> None:
    """They name the value; nothing is written."""
    try:
        status = main([*words.split(), '--output', str(tmp_path / 'a.zarr')])
    except SystemExit as end:
        status = end.code
    assert status == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert said in lines[-1]
    assert not (tmp_path / 'a.zarr').exists()
