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


"""The orbit to which a smallest kick leads, and kicks on its manifold: closed forms and labels."""

import math

import numpy as np
import pytest

from gear_rattle_ros import find_attractors, Parameters
from gear_rattle_ros.attractors.skeleton.accessible import accessible_orbit, least_changes
from gear_rattle_ros.attractors.skeleton.kicks import (
    impacts_of,
    smallest_displacement,
    smallest_kick,
)
from gear_rattle_ros.core.flight.lanes import make_initial_conditions

CAP = 20_000


def test_between_rattle_and_rest_it_is_the_other_orbit_of_one_impact():
    """In closed form v = 2 pi gamma/(1 + r) and alpha cos tau = c; the stable one has -tau."""
    catalogue = find_attractors(Parameters(0.06), hold=CAP, threads=1)
    rattle = next(each for each in catalogue.attractors if each.impacts == 1)
    speed = 0.2 * math.pi / 1.9
    c = -0.9 * speed - 1.0 + 0.2 * math.pi / (1.0 - math.exp(-0.2 * math.pi))
    saddle = accessible_orbit(catalogue, rattle, smallest_kick(catalogue, rattle, threads=1), CAP)
    assert saddle.points.ravel() == pytest.approx(
        [-rattle.orbit.phases[0] % math.tau, speed], abs=1e-10)
    assert 0.06 * math.cos(saddle.phases[0]) == pytest.approx(c, abs=1e-10)
    assert accessible_orbit(catalogue, rattle, None, CAP) is None


def test_labels_change_at_the_manifold_and_nowhere_nearer():
    """To eight digits, where bisection has six; both agree within the dents that it passes."""
    catalogue = find_attractors(Parameters(0.48), hold=CAP, threads=1)
    for each in catalogue.attractors:
        kick = smallest_kick(catalogue, each, threads=1)
        disc = smallest_displacement(catalogue, each, kick, threads=1)
        saddle = accessible_orbit(catalogue, each, kick, CAP)
        assert saddle.impacts == each.impacts
        kicked, displaced = least_changes(saddle, impacts_of(catalogue, each), 4.0)
        assert 0.9 * kicked == pytest.approx(kick.size, rel=1e-4)
        assert 0.9 * kicked < kick.size and displaced < disc.size < 1.01 * displaced

        def labels(parts, size=0.9 * kicked, kick=kick):
            return catalogue.label(make_initial_conditions(
                catalogue.parameters, kick.phase, -float(kick.wall),
                kick.velocity_after + math.copysign(size, kick.change) * np.array(parts)),
                CAP, threads=1)['label']

        beside = 1e-8 * np.arange(1.0, 51.0)
        assert np.all(labels(1.0 - beside) == each.label)
        assert np.any(labels(1.0 + beside) != each.label)
