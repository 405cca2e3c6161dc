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

"""Paths through the parameters."""

import numpy as np
import pytest

from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.core.path import Path

FIRST, LAST = Parameters(0.3, 0.0, -0.2, 0.6), Parameters(0.7, 0.2, 0.1, 1.0)


def test_a_window_of_one_parameter_has_its_name():
    path = Path.over(FIRST, beta=(0.0, 0.3))
    assert (path.name, path.ends, path.unit) == ('beta', (0.0, 0.3), 1.0)
    assert path.at(0.1) == Parameters(0.3, 0.1, -0.2, 0.6)
    assert path.of(path.at(0.7)) == 0.7
    assert path.values(4).tolist() == np.linspace(0.0, 0.3, 4).tolist()


def test_several_parameters_go_straight_from_one_point_to_the_other():
    path = Path(FIRST, LAST)
    assert (path.name, path.ends) == ('path', (0.0, 1.0))
    assert path.at(0.0) == FIRST
    assert path.at(1.0).model == pytest.approx(LAST.model, abs=1e-15)
    for value in (0.25, 0.7):
        assert path.at(value).model == pytest.approx(
            [(1.0 - value) * a + value * b for a, b in zip(
                FIRST.model, LAST.model, strict=True)], abs=1e-15)
        assert path.of(path.at(value)) == pytest.approx(value, abs=1e-15)
        assert path.meets(path.at(value)) and not path.meets(Parameters(0.5, 0.1, 0.0, 0.8))
    h = 1e-3
    assert path.direction == pytest.approx(
        np.subtract(path.at(0.5 + h).model, path.at(0.5 - h).model) / (2.0 * h), abs=1e-12)
    # How far one goes in the parameters.
    assert np.linalg.norm(np.subtract(path.at(0.3 + h * path.unit).model, path.at(0.3).model)
                          ) == pytest.approx(h, rel=1e-10)


def test_a_path_goes_on_as_far_as_there_are_parameters():
    path = Path.over(alpha=(0.1, 0.3), restitution=(0.8, 1.0))
    with pytest.raises(ValueError, match=r'restitution = 1.* is outside \[0, 1\]'):
        path.at(1.5)
    assert path.at(1.5, nearest=True).restitution == 1.0
    assert path.at(-0.5).alpha == pytest.approx(0.0, abs=1e-15)
