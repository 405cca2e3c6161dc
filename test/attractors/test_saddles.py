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

"""Edge states and saddles of the gear, against closed forms and exact identities."""

import math

import numpy as np
import pytest

from gear_rattle_ros.attractors.finding import find_attractors
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.attractors.skeleton.saddles import Straddling
from gear_rattle_ros.core.many.recorded import record_impacts
from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.core.orbits.impact_map import map_points
from gear_rattle_ros.core.orbits.section import distances
from gear_rattle_ros.studies.skeleton.saddle import boundary_saddle


def straddling(alpha: float, is_edge: bool, cap: int) -> Straddling:
    """Find the attractors that few initial conditions reach."""
    parameters = Parameters(alpha, 0.1, 0.1, 0.9)
    return Straddling(find_attractors(parameters, Plane().draw(parameters, 128, 1), hold=20_000,
                                      chaotic=False, threads=1), is_edge, cap)


def test_between_rest_and_rattle_lies_the_orbit_in_closed_form() -> None:
    """One impact a period: v = 2 pi gamma/(1 + r), and alpha cos(tau) = c."""
    alpha, beta, gamma, r = 0.06, 0.1, 0.1, 0.9
    v = 2.0 * math.pi * gamma / (1.0 + r)
    c = -r * v - gamma / beta + 2.0 * math.pi * gamma / -math.expm1(-2.0 * math.pi * beta)
    found = straddling(alpha, True, 20_000)
    points = found.follow(Plane(), 60, np.random.default_rng(1))
    orbit = found.orbit_of(points)
    assert orbit is not None
    assert orbit.points[0, 1] == pytest.approx(v, abs=1e-12)
    assert orbit.points[0, 0] == pytest.approx(2.0 * math.pi - math.acos(c / alpha), abs=1e-10)
    # It is accessible from both sides.
    rates = boundary_saddle(found.catalogue, straddled=60)
    assert rates.exponent == (1.0, 0.0)
    assert rates.lambda_1[0] + rates.lambda_2[0] == pytest.approx(
        2.0 * math.log(r) - 2.0 * math.pi * beta, abs=1e-12)


def test_a_straddle_trajectory_is_one_and_lies_on_the_boundary() -> None:
    """Each impact follows from the one before; of points beside it, some go to each attractor."""
    found = straddling(0.48, True, 20_000)
    points = found.follow(Plane(), 200, np.random.default_rng(1))
    images = map_points(points, found.catalogue.parameters.model)[0]
    apart = distances(images[:-1, 1], images[:-1, 0], points[1:, 1], points[1:, 0])
    assert len(points) == 200
    assert np.median(apart) < 1e-6
    assert np.mean(apart < 1e-3) > 0.95
    beside = points[:40, None] + 1e-5 * np.random.default_rng(2).standard_normal((40, 24, 2))
    labels = found.values(beside.reshape(-1, 2)).reshape(40, 24)
    assert np.mean(np.ptp(labels, axis=1) > 0) > 0.95


def test_growths_add_up_to_what_each_flight_and_impact_loses() -> None:
    """Exact, by eq. (9): the determinant is r^2 exp(-beta d) v/v', whatever the trajectory."""
    found = straddling(1.244, False, 20_000)
    initial = Plane().draw(found.catalogue.parameters, 8, 3)
    rows, made = record_impacts(initial, 0, 31)
    assert np.all(made == 31)
    times = 2.0 * math.pi * np.diff(rows['cycle'], axis=1) + np.diff(rows['phase'], axis=1)
    speeds = np.abs(rows['velocity'])
    assert found.growths(initial, 31)[:, :30].sum(axis=2) == pytest.approx(
        2.0 * math.log(0.9) - 0.1 * times + np.log(speeds[:, :-1] / speeds[:, 1:]), abs=1e-9)
