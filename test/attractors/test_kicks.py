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


"""The smallest kick: against closed forms, and applied to the simulator."""

import math

import numpy as np
import pytest

from gear_rattle_ros import find_attractors, Parameters, Simulation, State
from gear_rattle_ros.attractors.skeleton.kicks import (
    DIRECTIONS,
    LOCATED,
    smallest_change,
    smallest_displacement,
    smallest_kick,
)
from gear_rattle_ros.core.many.settling import RESTS_UPPER, UNSETTLED
from gear_rattle_ros.core.orbits.section import distances


def star(count):
    angles = np.arange(count) * (math.tau / count)
    return np.column_stack([np.cos(angles), np.sin(angles)])


def test_squaring_map_has_its_basin_boundary_on_the_unit_circle():
    """From a point on a ray, the boundary of z -> z^2 is at 1 - |z|; other rays are longer."""
    def label(points):
        z = points[:, 0] + 1j * points[:, 1]
        with np.errstate(over='ignore', invalid='ignore'):
            for _ in range(40):
                z = z * z
        return np.where(np.abs(z) < 1.0, 0, 1)

    found = smallest_change(label, 0, 0.37 * np.repeat(star(8)[2:3], 8, axis=0), star(8),
                            np.full(8, 3.0))
    assert (found.ray, found.label, found.unsettled) == (2, 1, 0.0)
    assert found.distance == pytest.approx(0.63, rel=2.0 * LOCATED)
    assert found.resolution < 0.005


def test_a_dent_nearer_than_the_boundary_is_found_and_what_is_unsettled_passed_over():
    """The dent is 2 % wide; in front of it nothing settles, which leads nowhere."""
    def label(points):
        x, y = points.T
        found = np.where(np.hypot(x, y) > 1.0, 3, 7)
        found[(x > 0.6) & (x < 0.62) & (np.abs(y) < 1e-3)] = 4
        found[(x > 0.5) & (x < 0.55)] = UNSETTLED
        return found

    found = smallest_change(label, 7, np.zeros((8, 2)), star(8), np.full(8, 50.0))
    assert (found.ray, found.label) == (0, 4)
    assert found.distance == pytest.approx(0.6, rel=2.0 * LOCATED)
    assert 0.0 < found.unsettled < 0.1
    assert smallest_change(label, 7, np.zeros((8, 2)), star(8), np.full(8, 0.4)) is None


@pytest.fixture(scope='module')
def catalogue():
    """Return the paper's two attractors."""
    return find_attractors(Parameters(0.48), hold=20_000, threads=1)


def settles_on(simulation, orbit):
    """Whether a simulation is on a periodic orbit after a while."""
    cycle = simulation.moment[0]
    last = simulation.advance(cycle + 2000, 0.0, 100_000)[-20:]
    apart = [distances(orbit.velocities, orbit.phases, e['velocity'], e['phase']).min()
             for e in last]
    return bool(max(apart) < 1e-6)


@pytest.mark.parametrize('letter', ['A', 'B'])
def test_the_kick_does_to_the_simulator_what_it_says(letter, catalogue):
    """At the impact that is named, from the stream; 0.999 of it does not."""
    own = next(each for each in catalogue.attractors if each.letter == letter)
    for kick in (found := smallest_kick(catalogue, own, threads=1),
                 smallest_displacement(catalogue, own, found, threads=1)):
        target = next(each for each in catalogue.attractors if each.label == kick.target)
        assert target.letter == {'A': 'B', 'B': 'A'}[letter]
        for part, orbit in ((1.0, target.orbit), (0.999, own.orbit)):
            simulation = Simulation(catalogue.parameters, State(
                0, own.orbit.phases[0], -float(own.orbit.walls[0]), own.orbit.velocities[0]))
            # Some drive periods later it is still on its attractor.
            event = simulation.advance(50, kick.phase - 1e-6, 1000)[-1:]
            while (-event['displacement'][0], event['kind'][0]) != (kick.wall, 0) or abs(
                    event['phase'][0] - kick.phase) > 1e-9:
                event = simulation.advance(1000, 0.0, 1)
            e = event[0]
            if kick is found:
                assert e['velocity_after'] == pytest.approx(kick.velocity_after, abs=1e-9)
                simulation.reset(e['phase'], e['displacement'],
                                 e['velocity_after'] + part * kick.change)
            else:
                simulation.reset(e['phase'] + part * kick.phase_change, e['displacement'],
                                 e['velocity'] + part * kick.change)
            assert settles_on(simulation, orbit), (kick, part)


def test_the_disc_is_no_larger_than_the_kick_allows(catalogue):
    """A kick k displaces the velocity before the impact by -k/r; the disc has all directions."""
    for each in catalogue.attractors:
        kick = smallest_kick(catalogue, each, threads=1)
        disc = smallest_displacement(catalogue, each, kick, threads=1)
        assert disc.size <= kick.size / 0.9 * (1.0 + 1e-12)
        assert disc.size == pytest.approx(math.hypot(disc.phase_change, disc.change), rel=1e-12)
    assert DIRECTIONS % 4 == 0


def test_the_mirrored_gear_has_the_mirrored_kick(catalogue):
    """Trajectories go to trajectories by s -> -1 - s, tau -> tau + pi, gamma -> -gamma."""
    mirrored = find_attractors(Parameters(0.48, gamma=-0.1), hold=20_000, threads=1)
    for each in catalogue.attractors:
        other = next(one for one in mirrored.attractors if one.impacts == each.impacts)
        kick, twin = (smallest_kick(*pair, threads=1) for pair in (
            (catalogue, each), (mirrored, other)))
        assert twin.wall == 1 - kick.wall
        # Fingers of the other basin become ever finer towards the boundary.
        assert twin.change == pytest.approx(-kick.change, rel=1e-3)
        assert math.cos(twin.phase - kick.phase) == pytest.approx(-1.0, abs=1e-12)


@pytest.mark.long
def test_rest_is_left_by_a_kick_that_the_simulator_confirms():
    """At 0.09 the gear may rest on the upper wall for good, or rattle."""
    catalogue = find_attractors(Parameters(0.09), hold=20_000, threads=1)
    rest = next(each for each in catalogue.attractors if each.label == RESTS_UPPER)
    kick = smallest_kick(catalogue, rest, threads=1)
    assert (kick.wall, kick.velocity, kick.velocity_after) == (0, 0.0, 0.0)
    assert kick.change < 0.0
    assert smallest_displacement(catalogue, rest, kick, threads=1) is None
    for part, rests in ((1.0, False), (0.999, True)):
        simulation = Simulation(catalogue.parameters, State(velocity=0.0))
        simulation.advance(3, 0.0, 10)
        assert simulation.is_permanently_at_rest
        simulation.reset(kick.phase, 0.0, part * kick.change)
        simulation.advance(5000, 0.0, 1_000_000)
        assert simulation.is_permanently_at_rest is rests


def test_an_attractor_without_a_rival_has_no_kick():
    catalogue = find_attractors(Parameters(0.3), hold=20_000, threads=1)
    only, = (each for each in catalogue.attractors)
    assert smallest_kick(catalogue, only, reach=5.0, steps=64, threads=1) is None
    assert smallest_displacement(catalogue, only, None, steps=64, threads=1) is None
