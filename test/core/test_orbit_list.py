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


"""The list of all periodic orbits, and the escape rate that follows from them."""

import itertools
import math

import numpy as np
import pytest

from gear_rattle_ros.attractors.finding import find_attractors
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.attractors.skeleton.orbits import find_orbits
from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.core.orbits.cycles import expand
from gear_rattle_ros.core.orbits.listing import OrbitList
from gear_rattle_ros.core.orbits.orbit import fire, Orbit, same_orbit


@pytest.fixture(scope='module')
def at_48() -> OrbitList:
    return find_orbits(Parameters(alpha=0.48), 6, first=256)


def test_orbits_of_one_impact_are_those_of_the_closed_form() -> None:
    """Both orbits of one impact a period on the upper wall, of which one is unstable."""
    p = Parameters(alpha=0.06)
    decay = math.exp(-math.tau * p.beta)
    velocity = math.tau * p.gamma / (1.0 + p.restitution)
    cosine = (-p.restitution * velocity - p.gamma / p.beta
              + math.tau * p.gamma / (1.0 - decay)) / p.alpha
    found = find_orbits(p, 2, first=64)
    single = [orbit for orbit in found.orbits if orbit.impacts == orbit.drive_periods == 1]
    assert found.is_complete
    assert sorted(orbit.phases[0] for orbit in single) == pytest.approx(
        sorted([math.acos(cosine), math.tau - math.acos(cosine)]), abs=1e-12)
    assert all(orbit.velocities[0] == pytest.approx(velocity, abs=1e-12) for orbit in single)
    assert sorted(orbit.is_stable for orbit in single) == [False, True]


def test_every_orbit_closes_and_has_the_determinant_that_it_must(at_48: OrbitList) -> None:
    """The matrix of flights and impacts knows nothing of r^(2 q) exp(-2 pi beta p)."""
    assert at_48.is_complete and len(at_48.orbits) >= 15
    for orbit in at_48.orbits:
        shot = fire(orbit.walls, orbit.points, orbit.parameters)
        matrix = shot.derivative()
        assert np.max(np.abs(shot.defects)) < 1e-11
        assert orbit.multipliers.sum().real == pytest.approx(np.trace(matrix), rel=1e-9)
        assert orbit.multipliers.prod().real == pytest.approx(
            0.9**(2 * orbit.impacts) * math.exp(-0.2 * math.pi * orbit.drive_periods), rel=1e-12)
        if abs(orbit.multipliers[0]) < 100.0:
            assert np.linalg.det(matrix) == pytest.approx(orbit.multipliers.prod().real, rel=1e-9)
    for one, other in itertools.combinations(at_48.orbits, 2):
        assert not same_orbit(one, other, 1e-6)


def test_the_stable_orbits_are_the_attractors(at_48: OrbitList) -> None:
    """A search that follows random initial conditions knows nothing of Newton's method."""
    catalogue = find_attractors(at_48.parameters, Plane().draw(at_48.parameters, 500, 1))
    attracting = {orbit.key for orbit in at_48.orbits if orbit.is_stable}
    assert attracting == {orbit.key for orbit in catalogue.orbits if orbit.impacts <= 6}


def test_the_mirrored_model_has_the_mirrored_orbits(at_48: OrbitList) -> None:
    """Under s -> -1 - s and gamma -> -gamma walls and phases change, multipliers do not."""
    mirrored = find_orbits(Parameters(alpha=0.48, gamma=-0.1), 6, first=256)

    def sizes(found: OrbitList) -> list[tuple[int, int, float]]:
        return sorted((orbit.impacts, orbit.drive_periods, float(abs(orbit.multipliers[0])))
                      for orbit in found.orbits)
    assert np.allclose(sizes(mirrored), sizes(at_48), rtol=1e-6)


def test_a_search_goes_on_where_it_was_and_does_not_depend_on_threads(at_48: OrbitList) -> None:
    half = find_orbits(at_48.parameters, 6, first=256, most=256, threads=1)
    assert not half.is_complete and 'one round alone, of 256 points' in half.statement()
    whole = find_orbits(at_48.parameters, 6, first=256, known=half, threads=2)
    assert whole.rounds == at_48.rounds
    assert all(np.array_equal(one.points, other.points)
               for one, other in zip(whole.orbits, at_48.orbits, strict=True))


def cycle(word: tuple[int, ...], slopes: tuple[float, float], contraction: float) -> Orbit:
    q = len(word)
    return Orbit(Parameters(), np.zeros(q, np.int64), np.zeros((q, 2)), np.zeros(q), q, np.array(
        [math.prod(slopes[letter] for letter in word), contraction**q], np.complex128))


@pytest.mark.parametrize('slopes', [(3.0, -4.0), (2.0, -2.0)])
def test_the_rate_of_a_horseshoe_is_exact(slopes: tuple[float, float]) -> None:
    """Of a map with two straight branches the share 1/|a| + 1/|b| stays at each step."""
    words = [word for q in range(1, 7) for word in itertools.product((0, 1), repeat=q)
             if word == min(word[k:] + word[:k] for k in range(q))
             and all(word != word[k:] + word[:k] for k in range(1, q))]
    found = expand([cycle(word, slopes, 0.1) for word in words], 6)
    exact = -math.log(sum(1.0 / abs(slope) for slope in slopes))
    assert found[-1] == pytest.approx(exact, abs=1e-6)
    assert abs(found[-1] - found[-2]) < 1e-4
