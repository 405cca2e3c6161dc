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

"""Attractors: exact statements, the scalar core, other seeds and threads."""

import math
import re

import numpy as np
import pytest

from gear_rattle_ros.attractors.catalogue import Kind
from gear_rattle_ros.attractors.finding import find_attractors
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.cli.attractors import main
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.many.settling import UNSETTLED
from gear_rattle_ros.core.model import EventKind, Parameters, State
from gear_rattle_ros.store.store import open_dataset


def search(parameters: Parameters, count: int = 200, seed: int = 1, **settings):
    """Search from random initial conditions of the default window."""
    settings = {'hold': 4000, **settings}
    initial = Plane().draw(parameters, count, seed)
    return find_attractors(parameters, initial, **settings)


@pytest.fixture(scope='module')
def chaotic():
    """Search where an orbit and chaos coexist."""
    return search(Parameters(alpha=0.57), hold=20_000).attractors


@pytest.mark.parametrize('alpha', [0.48, 0.51, 0.53, 1.244])
def test_exponents_of_every_orbit_have_the_exact_sum(alpha):
    """The multipliers of flights and impacts know nothing of 2 ln r - beta 2 pi p/q."""
    found = search(Parameters(alpha=alpha), 60, hold=10_000, chaotic=False).attractors
    assert found
    for each in found:
        if each.kind is Kind.UNSETTLED:
            continue
        assert each.kind is Kind.PERIODIC
        exact = 2.0 * math.log(0.9) - 0.1 * 2.0 * math.pi * each.drive_periods / each.impacts
        assert sum(each.exponents) == pytest.approx(exact, abs=1e-6)
        assert each.exact_sum == pytest.approx(exact, abs=1e-12)


@pytest.mark.parametrize(('alpha', 'impacts', 'exponent'),
                         [(0.48, 3, -0.2100802), (1.244, 4, -0.1839003)])
def test_exponents_of_the_orbits_of_the_paper(alpha, impacts, exponent):
    """Attractor A, and the orbit after the crisis: complex multipliers, equal exponents."""
    found = {each.impacts: each for each in search(
        Parameters(alpha=alpha), 60, hold=10_000, chaotic=False).attractors}
    assert found[impacts].exponents == pytest.approx((exponent, exponent), abs=5e-7)


def test_chaotic_exponents_have_the_exact_sum(chaotic):
    """The exponents of the chaotic attractor add up too; the largest is positive by its error."""
    orbit, chaos = chaotic
    assert (orbit.kind, chaos.kind) == (Kind.PERIODIC, Kind.CHAOTIC)
    assert sum(chaos.exponents) == pytest.approx(chaos.exact_sum, abs=1e-10)
    assert chaos.exponents[0] > 20.0 * chaos.errors[0] > 0.0
    assert chaos.pieces == 1
    assert orbit.share + chaos.share == pytest.approx(1.0)


@pytest.mark.parametrize('alpha', [0.48, 0.515])
def test_orbits_are_orbits_of_the_scalar_core(alpha):
    """From every point the simulation comes back to it, again and again."""
    parameters = Parameters(alpha=alpha)
    for orbit in search(parameters).orbits:
        q = orbit.impacts
        simulation = Simulation(parameters, State(
            0, float(orbit.phases[0]), -float(orbit.walls[0]),
            -parameters.restitution * float(orbit.velocities[0])))
        events = simulation.advance(40 * orbit.drive_periods, 0.0, 40 * q)[1:]
        events = events[:len(events) // q * q]
        expected = (1 + np.arange(len(events))) % q
        assert len(events) >= 30 * q
        assert np.max(np.abs(events['velocity'] - orbit.velocities[expected])) < 1e-8
        assert np.max(np.abs(np.sin(events['phase'] - orbit.phases[expected]))) < 1e-8
        assert events['cycle'][q - 1 + q] - events['cycle'][q - 1] == orbit.drive_periods


def test_keys_do_not_depend_on_the_seed_and_shares_agree():
    """Another seed finds the same attractors, with shares within their errors."""
    first, second = (search(Parameters(alpha=0.51), 400, seed).attractors for seed in (1, 2))
    assert [each.key for each in first] == [each.key for each in second]
    assert len(first) == 3
    for a, b in zip(first, second, strict=True):
        assert abs(a.share - b.share) < 4.0 * math.hypot(a.share_error, b.share_error)
        assert a.points() == pytest.approx(b.points(), abs=1e-9)


def test_threads_change_nothing():
    """The labels of random initial conditions are the same with one thread and with three."""
    one, three = (search(Parameters(alpha=0.51), 600, threads=threads) for threads in (1, 3))
    assert np.array_equal(one.labels, three.labels)
    assert [orbit.key for orbit in one.orbits] == [orbit.key for orbit in three.orbits]


def test_an_orbit_is_given_with_its_smallest_period():
    """Before B doubles its multiplier is negative: twice the period recurs long before."""
    found = {each.impacts: each for each in search(Parameters(alpha=0.52)).attractors}
    assert sorted(found) == [2, 3]
    assert min(value.real for value in found[2].multipliers) < -0.7


def test_a_long_transient_is_not_called_an_attractor():
    """Just above the crisis no positive exponent lasts: what has not settled is counted."""
    catalogue = search(Parameters(alpha=1.244), 40, hold=3000)
    left = int(np.sum(catalogue.labels == UNSETTLED))
    assert not catalogue.chaotic
    assert left > 10
    assert [orbit.impacts for orbit in catalogue.orbits] == [4]


def test_an_orbit_that_sticks_is_recognised():
    """A soft wall: the gear chatters to rest, leaves at a certain phase, and comes back."""
    catalogue = search(Parameters(alpha=0.15, restitution=0.3))
    orbit, = catalogue.orbits
    assert orbit.sticks == 0
    assert np.all(orbit.multipliers == 0)
    # Released where a(tau, 0) = 0, the gear is at the other end of the orbit a flight later.
    assert abs(orbit.velocities).min() < 1e-9
    assert np.all(catalogue.labels != UNSETTLED)


def test_an_orbit_that_sticks_has_whole_drive_periods():
    """
    What is seen of it may begin with a stick that is not on it, but the release after it is.

    Between two releases of such an orbit the simulation counts the drive periods.
    """
    parameters = Parameters(0.68, 0.12180224, 0.51925843, 0.8)
    for orbit in search(parameters, 100, hold=20_000).orbits:
        assert np.sum(orbit.flight_times) == pytest.approx(2.0 * np.pi * orbit.drive_periods)
        simulation = Simulation(parameters, State())
        events = simulation.advance(200, 0.0, 100_000)
        releases = events[events['kind'] == EventKind.RELEASE]
        assert set(np.diff(releases['cycle'].astype(int))[5:]) == {orbit.drive_periods}


def test_the_tool_writes_what_it_prints(tmp_path, capsys):
    """Keys, shares and points are in the store; the picture is drawn."""
    path, picture = tmp_path / 'a.zarr', tmp_path / 'a.png'
    assert main(['--initial-conditions', '100', '--output', str(path),
                 '--picture', str(picture)]) == 0
    printed = capsys.readouterr().out
    dataset = open_dataset(path)
    for key in dataset['attractor_key'].values:
        assert str(key) in printed
    assert float(dataset['attractor_share'].sum()) == 1.0
    assert dataset.sizes['point'] == int(dataset['attractor_impacts'].sum())
    assert picture.stat().st_size > 5000


@pytest.mark.parametrize('alpha', [0.51, 0.53])
def test_keys_of_orbits_do_not_depend_on_the_plane(alpha):
    """Other planes and seeds reach the same orbits, to the last digit of their names."""
    keys = set()
    for seed, displacement in ((3, 0.0), (4, -0.5), (5, -1.0)):
        plane = Plane(displacement=displacement)
        catalogue = find_attractors(Parameters(alpha=alpha), plane.draw(
            Parameters(alpha=alpha), 300, seed), hold=4000, chaotic=False)
        keys.add(tuple(orbit.key for orbit in catalogue.orbits))
    assert len(keys) == 1


@pytest.mark.long
@pytest.mark.parametrize(('alpha', 'impacts'), [(0.57, 2), (1.0, 2), (1.22, 2)])
def test_keys_of_chaotic_attractors_do_not_depend_on_the_seed(alpha, impacts):
    """The shortest orbit on the attractor is the same from any seed and plane, and repels."""
    keys = set()
    for seed, displacement in ((1, 0.0), (2, 0.0), (3, -0.5)):
        plane, parameters = Plane(displacement=displacement), Parameters(alpha=alpha)
        found = find_attractors(
            parameters, plane.draw(parameters, 150, seed), hold=6000).attractors
        keys.add(tuple(each.key for each in found))
        chaos, = (each for each in found if each.kind is Kind.CHAOTIC)
        # From the point that the key names the scalar core comes back to it after a period.
        q, periods = (int(number) for number in chaos.key.split('-')[1:3])
        wall, phase, velocity = re.fullmatch(
            r'.*-([UL])(\d+\.\d{4})([+-]\d+\.\d{4})', chaos.key).groups()
        assert (q, wall) == (impacts, 'U')
        simulation = Simulation(parameters, State(0, float(phase), 0.0, -0.9 * float(velocity)))
        back = simulation.advance(periods + 1, 0.0, q + 2)[q]
        assert back['cycle'] == periods
        assert back['phase'] == pytest.approx(float(phase), abs=5e-3)
        assert back['velocity'] == pytest.approx(float(velocity), abs=5e-3)
        assert 1e-5 < abs(back['phase'] - float(phase)) + abs(back['velocity'] - float(velocity))
    assert len(keys) == 1


def test_a_search_can_be_given_up_all_along() -> None:
    """Checks come all along, and the one that raises is the last."""
    initial = Plane().draw(Parameters(1.0), 60, 1)
    calls = []

    class GivenUp(Exception):
        """As whoever asked may raise."""

    def check() -> None:
        calls.append(None)

    find_attractors(Parameters(1.0), initial, hold=60_000, threads=1, check=check)
    assert len(calls) > 10
    most = len(calls) // 2
    calls.clear()

    def check_and_give_up() -> None:
        calls.append(None)
        if len(calls) == most:
            raise GivenUp

    with pytest.raises(GivenUp):
        find_attractors(Parameters(1.0), initial, hold=60_000, threads=1, check=check_and_give_up)
    assert len(calls) == most
