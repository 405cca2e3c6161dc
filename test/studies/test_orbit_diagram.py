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

"""Orbit diagrams against orbits and exponents found in other ways."""

import math

import numpy as np
import pytest

from gear_rattle_ros.attractors.catalogue import Kind
from gear_rattle_ros.attractors.columns import find_branches, Window
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.cli.sweeps.orbit_diagram import main
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.many.velocity_counts import count_velocities
from gear_rattle_ros.core.model import Parameters, State
from gear_rattle_ros.core.path import Path
from gear_rattle_ros.core.stream.lyapunov import RunningLyapunov
from gear_rattle_ros.core.stream.transients import Regime, TransientDetector
from gear_rattle_ros.store.store import open_dataset, Store
from gear_rattle_ros.studies.sweeps.orbit_diagram import orbit_diagram

SMALL = ['--alpha', '0.48', '0.5', '--columns', '3', '--bins', '600', '--trajectories', '24',
         '--skip', '3000', '--keep', '512']


@pytest.fixture(scope='module')
def diagram(tmp_path_factory):
    """Three columns from 0.48 on, all sweeps."""
    path = tmp_path_factory.mktemp('diagram') / 'd.zarr'
    assert main([*SMALL, '--output', str(path), '--picture', str(path.with_name('d.png'))]) == 0
    return path


def orbits_by_events(alpha):
    """Find periodic orbits in the streams of events of a few trajectories."""
    found = {}
    for phase in np.linspace(0.3, 6.0, 8):
        detector = TransientDetector()
        simulation = Simulation(Parameters(alpha=alpha), State(phase=phase, velocity=-0.8))
        detector.update(simulation.advance(2000, 0.0, 20_000))
        report = detector.report
        assert report.regime is Regime.ORBIT
        found[report.period_impacts] = sorted(report.orbit.points[:, 1])
    return found


def test_only_the_points_of_a_and_b_at_048(diagram):
    store = Store(diagram)
    counts, kinds = store.read_all('count')[0, 0], store.read_all('kind')[0, 0]
    velocities = store.read_all('velocity')
    width = velocities[1] - velocities[0]
    expected = orbits_by_events(0.48)
    assert set(expected) == {2, 3}
    assert np.count_nonzero(kinds >= 0) == 2
    for slot in (0, 1):
        points = expected[int(store.read_all('period_impacts')[0, 0, slot])]
        occupied = velocities[counts[slot] > 0]
        distance = np.abs(occupied[:, None] - np.array(points))
        assert np.all(distance.min(axis=1) <= 0.51 * width + 1e-3)
        assert np.all(distance.min(axis=0) <= 0.51 * width + 1e-3)


def test_exponents_are_half_of_the_exact_sum(diagram):
    dataset = open_dataset(diagram).isel(sweep=0, alpha=0)
    for slot in (0, 1):
        impacts = int(dataset.period_impacts[slot])
        exact = 0.5 * (2.0 * math.log(0.9) - 0.1 * 2.0 * math.pi / impacts)
        assert float(dataset.exponent[slot]) == pytest.approx(exact, abs=1e-12)
        assert float(dataset.exact_sum[slot]) == pytest.approx(2.0 * exact, abs=1e-12)
        if impacts == 3:
            assert exact == pytest.approx(-0.2100802, abs=1e-7)


def test_the_kernel_measures_the_exponent_of_an_orbit():
    parameters = Parameters(alpha=0.48)
    _, found = find_branches(
        parameters, Plane().draw(parameters, 16, 3), Window(keep=4096, bins=200))
    for one in found:
        blocks = count_velocities(one.states, 4096, -3.0, 3.0, 200).growth
        error = np.std(blocks, ddof=1) / math.sqrt(blocks.size)
        assert abs(np.mean(blocks) - one.exponent) < 4.0 * error + 1e-4


def test_chaotic_exponent_agrees_with_the_stream_of_events():
    parameters = Parameters(alpha=1.1)
    _, found = find_branches(
        parameters, Plane().draw(parameters, 32, 3), Window(keep=8192, bins=200))
    assert [one.attractor.kind for one in found] == [Kind.CHAOTIC]
    running = RunningLyapunov()
    simulation = Simulation(parameters, State(velocity=-0.8))
    running.update(simulation.advance(100_000, 0.0, 200_000))
    report = running.report
    error = math.hypot(found[0].exponent_error, report.lambda_1_error)
    assert abs(found[0].exponent - report.lambda_1) < 4.0 * error
    assert error < 0.01


def test_following_agrees_with_random_initial_conditions(diagram):
    numbers = open_dataset(diagram).attractor.values
    names = [{int(n) for n in column[column >= 0]} for column in numbers[:, 1]]
    assert names[0] >= names[1] == names[2]
    assert len(names[1]) == 2


def test_what_is_followed_down_does_not_find_b_again(tmp_path):
    path = tmp_path / 'h.zarr'
    assert main(['--alpha', '0.56', '0.58', '--columns', '5', '--bins', '300', '--trajectories',
                 '16', '--skip', '6000', '--keep', '256', '--output', str(path)]) == 0
    dataset = open_dataset(path)
    seen = (dataset.attractor >= 0).sum('slot')
    assert int(seen.sel(sweep='random').isel(alpha=0)) == 2
    assert int(seen.sel(sweep='up').isel(alpha=0)) == 2
    assert [int(n) for n in seen.sel(sweep='down')] == [1] * 5


def test_an_orbit_just_before_its_doubling_is_not_taken_for_twice_itself():
    parameters = Parameters(alpha=0.529)
    _, found = find_branches(parameters, Plane().draw(parameters, 32, 1), Window())
    assert sorted(one.attractor.impacts for one in found) == [2, 3]
    assert sum(len(one.states) for one in found) == 32


@pytest.mark.parametrize('alpha', np.linspace(1.2436, 1.2445, 4))
def test_a_transient_is_not_called_chaotic(alpha):
    """Above the crisis the only attractor is one orbit; the rest is on its way there."""
    parameters = Parameters(alpha=float(alpha))
    _, found = find_branches(parameters, Plane().draw(parameters, 96, 1), Window())
    kinds = {one.attractor.kind for one in found}
    assert Kind.PERIODIC in kinds <= {Kind.PERIODIC, Kind.UNSETTLED}
    assert [one.attractor.impacts for one in found if one.attractor.orbit] == [4]


def test_the_dataset_describes_itself(diagram):
    dataset = open_dataset(diagram)
    assert dataset['count'].dims == ('sweep', 'alpha', 'slot', 'velocity')
    assert dataset.alpha.attrs['units'] == '1'
    assert dataset.attrs['beta'] == 0.1
    assert 'orbit_diagram --alpha 0.48' in dataset.attrs['command']
    total = dataset['count'].sel(sweep='random').sum(('slot', 'velocity'))
    assert set(total.values) == {24 * 512}


def test_going_on_changes_nothing(diagram, capsys):
    before = Store(diagram).read_all('count')
    assert main([*SMALL, '--output', str(diagram), '--resume']) == 0
    assert np.array_equal(Store(diagram).read_all('count'), before)
    assert main([*SMALL, '--seed', '7', '--output', str(diagram), '--resume']) == 2
    assert 'seed' in capsys.readouterr().err


@pytest.mark.parametrize('sweeps', [(), ('up', 'starts')])
def test_sweeps_that_do_not_exist_are_refused(sweeps):
    with pytest.raises(ValueError, match='^sweeps = .* must name some of random, up, down$'):
        orbit_diagram(Path.over(alpha=(0.4, 0.5)), sweeps=sweeps)


@pytest.mark.parametrize(('words', 'named'), [
    (['--alpha', '0.6', '0.5'], 'alpha window 0.6 to 0.5'),
    (['--alpha', 'nan', '0.5'], 'nan'),
    (['--columns', '1'], '1'),
    (['--bin-window', '1', '-1'], 'velocity window'),
])
def test_bad_input_is_refused_in_one_line(words, named, capsys, tmp_path):
    try:
        status = main([*words, '--output', str(tmp_path / 'x.zarr')])
    except SystemExit as stop:
        status = stop.code
    assert status == 2
    error = capsys.readouterr().err
    assert named in error and error.count('\n') == 1
