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

"""Core sets: what begins in one stays, and jumps are counted as by hand."""

import numpy as np
import pytest

from gear_rattle_ros.attractors.cores import find_jumps
from gear_rattle_ros.attractors.finding import find_attractors
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.core.many.recorded import initial_after, record_impacts
from gear_rattle_ros.core.model import Parameters


@pytest.fixture(scope='module')
def known():
    """Find the attractors B, label 0, and A, label 1, of the paper."""
    return find_attractors(Parameters(alpha=0.48))


def test_without_noise_what_is_in_a_core_settles_there(known):
    """Random points of the balls, and hardly less than these: twice as wide ones do not."""
    random = np.random.default_rng(3)
    for each in known.attractors:
        near = np.repeat(each.orbit.points, 1000, axis=0)
        shift = find_jumps(known, *near.T).radius[each.label] * random.uniform(-1, 1, near.shape)
        shares = []
        for points in (near + shift, near + 2.0 * shift):
            points[:, 0] %= 2.0 * np.pi
            labels = known.label(initial_after(known.parameters, *points.T))['label']
            shares.append(np.mean(labels == each.label))
        assert find_jumps(known, *(near + shift).T).inside == 1.0
        assert shares[0] > 0.985 > shares[1] > 0.7


def test_jumps_are_counted_as_by_hand(known):
    """Far from both, B, far, B, A, far, A, B: one jump each way, and the state is carried on."""
    b, a = (each.orbit.points[0] for each in known.attractors)
    path = np.array([(1.0, 3.0), b, (1.0, 3.0), b, a, (1.0, 3.0), a, b])
    jumps = find_jumps(known, *path.T)
    assert jumps.last.tolist() == [-1, 0, 0, 0, 1, 1, 1, 0]
    assert jumps.counts == {(0, 1): 1, (1, 0): 1} and jumps.inside == 5 / 8
    lines = jumps.describe({0: 'B', 1: 'A'}).splitlines()
    assert lines[1].split() == ['B', '0.05', '50.0%', '-', '1', '+-', '1.0']


def test_a_chaotic_attractor_is_its_own_core():
    """A trajectory on the chaotic B stays in its boxes, and so does none on A."""
    parameters = Parameters(alpha=0.57)
    known = find_attractors(parameters, Plane().draw(parameters, 60, 1), hold=5000)
    for each in known.attractors:
        first = known.states[known.labels == each.label][:1]
        (row,), _ = record_impacts(first, 0, 3000)
        jumps = find_jumps(known, row['phase'], row['velocity'])
        assert jumps.inside > 0.99 and not jumps.counts
        assert np.all(jumps.last == each.label)
