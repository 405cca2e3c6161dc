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

"""Views: the command that reproduces one, the limit of float64, coarse to fine."""

import math
from pathlib import Path

import numpy as np
import pytest

from gear_rattle_ros.attractors.plane import PLANES
from gear_rattle_ros.cli.grids import basins, exponents, lifetimes
from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.explorer.view import EXPONENTS, FINE, following, KINDS, NARROWEST, View
from gear_rattle_ros.store.store import open_dataset

TOOLS = {'basins': basins, 'lifetimes': lifetimes, 'exponents': exponents}


@pytest.mark.parametrize(('kind', 'on'), [*((kind, 'displacement') for kind in KINDS), (
    EXPONENTS, 'section'), (EXPONENTS, 'strobe')])
def test_command_computes_the_very_window(
        kind: str, on: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The tool takes the words, and its cells are those of the view to the bit."""
    narrow = -1.2345678901234567, -1.2345670000000001
    displacement, phase = {'displacement': (-0.25, narrow), 'section': (None, narrow),
                           'strobe': ((-0.1234567890123456, -0.12345670000000001), -4.5)}[on]
    view = View(Parameters(0.4812345678901234, 0.11, -0.1, 0.85), displacement, phase,
                (-0.1, 0.30000000000000004), kind, on)
    words = view.command(str(tmp_path / 'a.zarr'), str(tmp_path / 'a.png'))
    words[words.index('--size') + 1] = '8'
    assert TOOLS[words[0]].main(words[1:]) == 0
    dataset = open_dataset(tmp_path / 'a.zarr')
    plane = view.plane(8)
    assert np.array_equal(dataset[plane.across].values, plane.across_values())
    assert np.array_equal(dataset['velocity'].values, plane.velocity_values())
    for name in ('alpha', 'beta', 'gamma', 'restitution'):
        assert dataset.attrs[name] == getattr(view.parameters, name)
    for name, value in plane.attributes().items():
        assert np.array_equal(dataset.attrs[name], value)
    assert (tmp_path / 'a.png').stat().st_size > 1000


def test_cells_stay_different_numbers_to_the_very_depth() -> None:
    """In the narrowest window all centres differ; the view reports that float64 ends there."""
    for phase in (4.0, 6.283, 100.0):
        view = View(phase=(phase - NARROWEST / 2, phase + NARROWEST / 2),
                    velocity=(1.5, 1.5 + NARROWEST))
        cells = min(FINE, view.finest())
        plane = view.plane(cells)
        for values in (plane.across_values(), plane.velocity_values()):
            steps = np.diff(values) / np.array([math.ulp(value) for value in values[1:]])
            assert np.all(steps >= 4.0)
        assert 'float64 ends here' in view.limit()
    assert View().limit() == ''
    assert View(phase=(4.0, 4.0 + 100 * NARROWEST), velocity=(1.0, 2.0)).limit() == ''


@pytest.mark.parametrize('on', PLANES)
def test_another_plane_shows_the_same_state(on: str) -> None:
    """The state of the point stays; where all are impacts it is put on the wall of one."""
    for view, point in ((View(displacement=-0.25), (2.0, -0.5)),
                        (View(phase=3.0, on='strobe'), (-0.75, 1.5)),
                        (View(on='section'), (4.0, -1.0))):
        before = view.state(*point)
        other, there = view.turned(on, before)
        after = other.state(*there)
        assert (other.on, after.phase, after.velocity) == (on, before.phase, before.velocity)
        upper = after.velocity < 0.0 if on == 'section' else after.velocity >= 0.0
        assert after.displacement == (before.displacement if on not in ('section', 'impact') else
                                      0.0 if upper else -1.0)
        assert other == other.whole(other.kind)


def test_levels_become_finer_and_end() -> None:
    """Quick views jump to fine levels, slow ones double, hopeless ones stop at 400."""
    for per_cell, expected in ((1e-9, [400, 800]), (5e-6, [200, 400, 800]),
                               (2e-5, [100, 200, 400]), (1e-3, [100, 200, 400])):
        levels, cells = [], 50
        while cells := following(cells, per_cell * cells**2, View()):
            levels.append(cells)
        assert levels == expected


def test_what_cannot_be_is_refused() -> None:
    """Every field is validated, with one line."""
    with pytest.raises(ValueError, match='is not one of basins'):
        View(kind='colours')
    with pytest.raises(ValueError, match='empty or reversed'):
        View(velocity=(1.0, 1.0))
    with pytest.raises(ValueError, match='displacement'):
        View(displacement=0.5, kind=EXPONENTS)
