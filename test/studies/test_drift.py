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


"""Ramps: the laws by which a fold and a doubling are seen late, and static exponents."""

import numpy as np
import pytest

from gear_rattle_ros import drift, Parameters
from gear_rattle_ros.studies.robustness.drift import describe


@pytest.mark.long
def test_a_fold_is_seen_late_by_the_power_two_thirds():
    """The time to pass a fold at rate e goes as e^(-1/3) (Haberman 1979)."""
    dataset = drift(Parameters(alpha=0.45), to=0.435, attractor='A', rates=(1e-5, 2e-6),
                    initial_conditions=200)
    assert dataset['event_kind'].values.tolist() == ['fold']
    assert float(dataset['event_alpha'][0]) == pytest.approx(0.4422772, abs=1e-7)
    slow, slower = dataset['delay'].values[1:, 0]
    assert np.log(slow / slower) / np.log(5.0) == pytest.approx(2 / 3, abs=0.04)
    assert 'fold at 0.4422772' in describe(dataset)


def test_a_doubling_is_seen_late_by_the_square_root():
    """What grows from rounding needs the area under the exponent, the square of the delay."""
    dataset = drift(Parameters(alpha=0.505), to=0.55, attractor='B', rates=(1e-4, 1e-5),
                    initial_conditions=200)
    assert dataset['event_kind'].values[0] == 'doubling'
    fast, slow = dataset['delay'].values[1:, 0]
    assert np.log(fast / slow) / np.log(10.0) == pytest.approx(0.5, abs=0.06)


def test_exponents_of_a_slow_ramp_are_the_static_ones():
    """On an orbit far from its changes, those of its multipliers."""
    dataset = drift(Parameters(alpha=0.49), to=0.50, attractor='A', rates=(2e-6,), window=600,
                    initial_conditions=200)
    static, ramp = ((row[np.isfinite(row)], at[np.isfinite(row)]) for row, at in zip(
        dataset['exponent'].values, dataset['alpha_of'].values, strict=True))
    assert len(ramp[0]) > 15
    assert np.max(np.abs(ramp[0] - np.interp(ramp[1], static[1], static[0]))) < 0.01
    assert dataset['event_kind'].size == 0
    assert describe(dataset).startswith('nothing happens')
