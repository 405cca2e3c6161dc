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


"""The study of stability: against scipy, the simulator, and the fold known in closed form."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from gear_rattle_ros import find_attractors, Parameters, Plane, Simulation, stability, State
from gear_rattle_ros.attractors.catalogue import Catalogue
from gear_rattle_ros.attractors.skeleton.kicks import smallest_kick
from gear_rattle_ros.core.many.recognition import with_neighbourhood
from gear_rattle_ros.core.orbits.orbit import close_orbit
from gear_rattle_ros.core.orbits.section import distances
from gear_rattle_ros.studies.robustness import stability as study

P = Parameters(0.48)
# Where the orbit of one impact a period ends at the paper's beta, gamma and r.
FOLD = 0.0492189296698


@pytest.mark.parametrize(('phase', 'turns'), [((0.0, math.tau), True), ((1.0, 4.0), False)])
def test_the_largest_disc_is_that_of_the_distance_transform(phase, turns):
    """Of scipy, on each side of the wall and around the circle of phases."""
    plane = Plane(phase=phase, velocity=(-1.0, 1.5), phases=61, velocities=50, kind='impact')
    inside = np.random.default_rng(3).random((50, 61)) < 0.97
    steps = 2.5 / 50, (phase[1] - phase[0]) / 61
    found = study.largest_disc(inside, plane)
    best = 0.0
    for half in (inside[:20], inside[20:]):
        cells = np.tile(half, 3) if turns else np.pad(half, ((0, 0), (1, 1)))
        apart = distance_transform_edt(np.pad(cells, ((1, 1), (0, 0))), sampling=steps)[1:-1]
        best = max(best, apart[:, 61:122].max() if turns else apart.max())
    assert found[0] == pytest.approx(best, rel=1e-12)
    assert inside[np.argmin(abs(plane.velocity_values() - found[2])),
                  np.argmin(abs(plane.across_values() - found[1]))]
    assert study.largest_disc(inside & False, plane)[0] == 0.0


def test_settling_times_are_those_of_the_simulator():
    """The drive periods until an impact of given number, whatever the order of the numbers."""
    initial = Plane().draw(P, 40, 5)
    numbers = np.random.default_rng(2).integers(0, 60, 40)
    times = study.settling_times(initial, numbers)
    for row, number, time in zip(initial, numbers, times, strict=True):
        simulation = Simulation(P, State(0, row['phase'], row['displacement'], row['velocity']))
        events = simulation.advance(1000, 0.0, 200)
        impacts = events[events['kind'] <= 1]
        last = impacts[number - 1]
        expected = last['cycle'] + (last['phase'] - row['phase']) / math.tau if number else 0.0
        assert time == pytest.approx(expected, abs=1e-12)


@pytest.fixture(scope='module')
def dataset():
    return stability(P, Plane(phases=50, velocities=40, kind='impact'),
                     initial_conditions=500, hold=20_000, to=Parameters(0.52), threads=1)


def test_random_initial_conditions_are_of_the_plane_of_the_grid(dataset):
    """Their shares are those of the cells, within four errors of both."""
    for label, share in zip(dataset['attractor_label'].values, dataset['attractor_share'].values,
                            strict=True):
        cells = np.mean(dataset['label'].values == label)
        error = math.sqrt(cells * (1.0 - cells) * (1.0 / 500 + 1.0 / 2000))
        assert share == pytest.approx(cells, abs=4.0 * error)


def test_a_jump_of_alpha_leads_the_simulator_where_it_says(dataset):
    """From B at 0.48 to 0.52 at 40 of the moments: the retuned simulator is on what is named."""
    letters = dataset['attractor_letter'].values.tolist()
    after = find_attractors(dataclasses.replace(P, alpha=0.52), hold=20_000, threads=1)
    before = next(one for one in find_attractors(P, hold=20_000, threads=1).attractors
                  if one.letter == 'B')
    states = study._states_of(P, before)
    labels = np.zeros(len(states), int)
    for number, (phase, displacement, velocity) in enumerate(states):
        if number % 25 == 0:
            simulation = Simulation(P, State(0, phase, displacement, velocity))
            simulation.retune(after.parameters)
            events = simulation.advance(3000, 0.0, 100_000)[-12:]
            apart = {one.label: max(distances(one.orbit.velocities, one.orbit.phases, e[
                'velocity'], e['phase']).min() for e in events)
                for one in after.attractors if one.orbit}
            labels[number] = min(apart, key=apart.get)
            assert apart[labels[number]] < 1e-6
    tipped = dataset['attractor_tipped'].values[letters.index('B')]
    assert tipped.sum() == pytest.approx(1.0)
    for share, letter in zip(tipped, dataset['target_letter'].values, strict=True):
        label = next(one.label for one in after.attractors if one.letter == letter)
        found = np.mean(labels[::25] == label)
        assert share == pytest.approx(found, abs=4.0 * math.sqrt(0.25 / 40))
    # Evenly over one drive period, which begins at an impact of B.
    assert np.ptp(np.diff(np.unwrap(states[:, 0]))) < 1e-12


def test_shares_settling_and_kicks_agree_with_each_other(dataset):
    """The table is the catalogue's; the disc round an impact is one of those in the basin."""
    assert dataset['attractor_share'].values.sum() == pytest.approx(1.0)
    for k in range(2):
        mean, median, largest = dataset['attractor_settling_impacts'].values[k]
        assert 0.0 < median <= largest and mean <= largest
        kick, disc = (dataset[f'attractor_{name}_size'].values[k] for name in (
            'kick', 'displacement'))
        assert 0.0 < disc <= kick / 0.9 * (1.0 + 1e-12)
        # To the size of a cell.
        assert dataset['attractor_disc_radius'].values[k] > disc - 0.13
    words = study.describe(dataset)
    assert 'after a jump to alpha 0.52' in words and 'smallest kick' in words


def test_the_smallest_kick_vanishes_with_the_square_root_at_a_fold():
    """The orbit of one impact a period and its saddle are that far apart; rest is the rival."""
    kicks = []
    for beyond in (1e-6, 4e-6):
        parameters = Parameters(FOLD + beyond)
        speed = 0.2 * math.pi / 1.9
        e = math.exp(-0.2 * math.pi)
        c = -0.9 * speed - 1.0 + 0.2 * math.pi / (1.0 - e)
        phase = math.acos(c / parameters.alpha)
        orbits = [close_orbit([0], [[place, speed]], parameters)
                  for place in (phase, math.tau - phase)]
        orbit = with_neighbourhood(next(one for one in orbits if one and one.is_stable), 1e-4)
        catalogue = Catalogue(parameters, tolerance=1e-4).with_orbits((orbit,))
        kick = smallest_kick(catalogue, catalogue.attractors[0], threads=1)
        assert kick.target == -2
        kicks.append(kick.size)
    assert kicks[1] / kicks[0] == pytest.approx(2.0, rel=0.05)


def test_parts_are_left_where_a_line_says():
    """Values that fall as 1 - x; with an error of the shares, or a quarter of a step."""
    x = np.linspace(0.0, 1.0, 11)
    assert study.where_left(x, 1.0 - x, 0.75, 0) == pytest.approx((0.25, 0.025))
    place, error = study.where_left(-x, 0.5 * (1.0 - x), 0.5, 100)
    assert place == pytest.approx(-0.5)
    # The share at 0.6 is 0.2 and at 0 is 0.5; the line falls by 0.5 in 1.
    assert error == pytest.approx(2.0 * math.sqrt(0.25 * 0.0025 + 0.0016))
    assert np.isnan(study.where_left(x, 1.0 + x, 0.9, 0)).all()
