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

"""What organises the basins, against the impact map and the labels on both sides of a manifold."""

import math

import numpy as np
import pytest

from gear_rattle_ros.attractors.finding import find_attractors
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.attractors.skeleton.kicks import smallest_kick
from gear_rattle_ros.attractors.skeleton.skeleton import KICK, LAYERS, skeletons
from gear_rattle_ros.attractors.watching import Dropped
from gear_rattle_ros.core.many.recorded import initial_after
from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.core.orbits.impact_map import map_points
from gear_rattle_ros.core.orbits.section import distances
from gear_rattle_ros.palette import LAYERS as COLOURED

PLANE = Plane(velocity=(-1.5, 1.5))


def test_layers_at_two_attractors() -> None:
    """Orbits are a set that is mapped into itself, a stable manifold bounds, the kick changes."""
    parameters = Parameters(0.48)
    catalogue = find_attractors(parameters, PLANE.draw(parameters, 64, 1), threads=1)
    kicks = {each.label: smallest_kick(catalogue, each, steps=64, threads=1)
             for each in catalogue.attractors}
    checked: list[int] = []
    *_, found = skeletons(catalogue, kicks, PLANE, lambda: checked.append(1))
    assert LAYERS == tuple(COLOURED) and len(checked) > 20
    for label, layers in found.items():
        assert set(layers) == set(LAYERS) and all(map(len, layers.values()))
        orbits = layers['unstable_orbits']
        images = map_points(orbits, parameters.model)[0]
        apart = distances(images[:, None, 1], images[:, None, 0], orbits[:, 1], orbits[:, 0])
        assert np.max(np.min(apart, axis=1)) < 1e-6
        lines = layers['stable_manifold'].reshape(-1, 2)
        assert (0.0 <= lines[:, 0]).all() and (lines[:, 0] <= math.tau).all()
        # Any neighbourhood of a point on the boundary has parts of two basins, few others do.
        near = 1e-7 * np.random.default_rng(2).normal(size=(60, 2))
        elsewhere = PLANE.draw(parameters, 40, 3)
        for centres, least, most in (
                (lines[::101], 0.9, 1.0),
                (np.column_stack([elsewhere['phase'], elsewhere['velocity']]), 0.0, 0.5)):
            labels = catalogue.label(initial_after(
                parameters, *(centres[:, None] + near).reshape(-1, 2).T), threads=1)['label']
            assert least <= np.mean(np.ptp(labels.reshape(-1, 60), axis=1) > 0) <= most
        (begin, end), = layers[KICK]
        kick = kicks[label]
        assert kick is not None
        after = catalogue.label(initial_after(parameters, *np.array([begin, end]).T),
                                threads=1)['label']
        assert list(after) == [label, kick.target]


def test_work_is_given_up() -> None:
    """What `check` raises ends it at once."""
    parameters = Parameters(0.48)
    catalogue = find_attractors(parameters, PLANE.draw(parameters, 64, 1), threads=1)

    def check() -> None:
        raise Dropped

    with pytest.raises(Dropped):
        next(skeletons(catalogue, {}, PLANE, check))
