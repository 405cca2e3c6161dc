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

"""Parameters, states and EVENT: what is accepted, what is refused and by what name."""

import math
import os
from pathlib import Path
import subprocess
import sys

import pytest

from gear_rattle_ros.core.model import EVENT, EventKind, Parameters, State


@pytest.mark.parametrize('name', ['alpha', 'beta', 'gamma', 'restitution'])
@pytest.mark.parametrize(
    'value', [math.nan, math.inf, -math.inf, 1e9, -1e9, 10**400, None, 'much', 1j, []])
def test_parameters_refuse_and_name_the_value(name: str, value: object) -> None:
    """No number, not finite or out of range: ValueError begins with the name."""
    with pytest.raises(ValueError, match=f'^{name} = '):
        Parameters(**{name: value})


@pytest.mark.parametrize('name, value', [
    ('alpha', -1e-9), ('beta', -0.1), ('restitution', 1.0000001), ('restitution', -0.1)])
def test_parameters_refuse_what_is_unphysical(name: str, value: float) -> None:
    """A negative amplitude or damping, and a restitution beyond 1, are refused."""
    with pytest.raises(ValueError, match=f'^{name} = {value}'):
        Parameters(**{name: value})


@pytest.mark.parametrize('name, value', [
    ('displacement', 1e-9), ('displacement', -1.0000001), ('displacement', math.nan),
    ('phase', -1e-9), ('phase', 2 * math.pi), ('phase', math.nan),
    ('velocity', math.nan), ('velocity', math.inf),
    ('cycle', -1), ('cycle', 1.5), ('cycle', math.nan), ('cycle', '3')])
def test_states_refuse_and_name_the_value(name: str, value: object) -> None:
    """A displacement outside the walls is an error and never clipped."""
    with pytest.raises(ValueError, match=f'^{name} = '):
        State(**{name: value})


def test_integers_become_floats_and_nothing_changes_later() -> None:
    """Whole numbers are accepted for floats; both classes are frozen."""
    parameters, state = Parameters(1, 0, 0, 1), State(0, 1, -1, 2)
    assert isinstance(parameters.alpha, float) and isinstance(state.displacement, float)
    with pytest.raises(AttributeError):
        parameters.alpha = 2.0  # type: ignore[misc]
    with pytest.raises(AttributeError):
        state.velocity = 2.0  # type: ignore[misc]


def test_layout_of_an_event() -> None:
    """80 bytes: four unsigned words and eight doubles, in the published order."""
    assert EVENT.itemsize == 80
    assert EVENT.names == (
        'kind', 'index', 'epoch', 'cycle', 'phase', 'displacement', 'velocity', 'velocity_after',
        'alpha', 'beta', 'gamma', 'restitution')
    assert [EVENT.fields[name][1] for name in EVENT.names] == [
        0, 4, 8, 12, 16, 24, 32, 40, 48, 56, 64, 72]
    assert [kind.name for kind in EventKind] == ['IMPACT', 'STICK', 'RELEASE', 'RETUNE', 'RESET']


@pytest.mark.parametrize('writable', [True, False])
def test_compiled_kernels_are_kept_where_one_can_write(tmp_path: Path, writable: bool) -> None:
    """The cache is below NUMBA_CACHE_DIR, else in a folder of its own; numba's is left alone."""
    (tmp_path / 'file').write_text('')
    wanted = tmp_path / 'cache' if writable else tmp_path / 'file' / 'cache'
    answer = subprocess.run(
        [sys.executable, '-c',
         'import numba; before = numba.config.CACHE_DIR\n'
         'from gear_rattle_ros.core.compiled import cache_directory\n'
         'from gear_rattle_ros.core.flight.elementary import exp_minus\n'
         'assert numba.config.CACHE_DIR == before\n'
         'assert exp_minus(0.0) == 1.0; print(cache_directory())'],
        env={**os.environ, 'NUMBA_CACHE_DIR': str(wanted), 'TMPDIR': str(tmp_path)},
        check=True, capture_output=True, text=True)
    folder = Path(answer.stdout.strip())
    assert folder.is_relative_to(wanted if writable else tmp_path)
    assert any(folder.rglob('*.nbi'))
