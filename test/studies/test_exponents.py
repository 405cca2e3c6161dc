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

"""Grids of finite-time exponents against exponents that are known exactly."""

import math
from pathlib import Path

import numpy as np

from gear_rattle_ros.cli.grids.exponents import main
from gear_rattle_ros.store.store import open_dataset


def test_exponents_at_two_attractors_are_those_of_their_multipliers(tmp_path: Path) -> None:
    """At alpha = 0.48 every trajectory ends on A, whose multipliers are complex, or on B."""
    store, picture = tmp_path / 'exponents.zarr', tmp_path / 'exponents.png'
    assert main(['--size', '12', '10', '--impacts', '4000', '--displacement', '-0.5',
                 '--output', str(store), '--picture', str(picture)]) == 0
    values = open_dataset(store)['exponent'].values
    assert values.shape == (10, 12)
    assert picture.read_bytes()[:8] == b'\x89PNG\r\n\x1a\n'
    on_a = (2.0 * math.log(0.9) - 0.1 * 2.0 * math.pi / 3.0) / 2.0
    on_b = math.log(0.591626) / 2.0
    near = np.stack([abs(values - on_a), abs(values - on_b)])
    # Transients of some hundred impacts among 4000.
    assert np.all(near.min(axis=0) < 0.04)
    assert set(near.argmin(axis=0).ravel()) == {0, 1}
