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

"""The table of parameters: what it accepts, and that it agrees with the model."""

import math

from hypothesis import given, strategies as st
import pytest
from rclpy.parameter import Parameter

from gear_rattle_ros import parameters
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import Parameters, State
from gear_rattle_ros.parameters import SIMULATOR, Specification, TABLES

BY_NAME = {specification.name: specification for specification in SIMULATOR}
EVERY = [pytest.param(specification, id=f'{node}.{specification.name}')
         for node, table in TABLES.items() for specification in table]


@pytest.mark.parametrize('specification', EVERY)
def test_defaults_pass_and_have_their_unit(specification: Specification) -> None:
    """Every default lies in its own range; every description is there."""
    assert specification.check(specification.default) == specification.default
    descriptor = specification.descriptor()
    assert specification.description in descriptor.description
    assert descriptor.read_only == specification.read_only
    if isinstance(specification.default, float):
        assert f'[{specification.unit}]' in descriptor.description
        limits = descriptor.floating_point_range[0]
        assert limits.from_value <= specification.default <= limits.to_value


@pytest.mark.parametrize('specification', EVERY)
def test_wrong_types_are_refused_by_name(specification: Specification) -> None:
    """A string for a number, a truth value for either, a fraction for a whole number."""
    wrong: list[object] = [None, [1.0]]
    if not isinstance(specification.default, str):
        wrong.append('1')
    if not isinstance(specification.default, bool):
        wrong.append(True)
    if type(specification.default) is int:
        wrong += [1.5, 2.0]
    for value in wrong:
        with pytest.raises(ValueError, match=f'^{specification.name} = .*type'):
            specification.check(value)


@pytest.mark.parametrize('specification', [
    case for case in EVERY if case.values[0].low is not None])
def test_ranges_hold_and_nan_is_no_number(specification: Specification) -> None:
    """Both ends pass, a step beyond does not, nor does nan or infinity."""
    low, high = specification.low, specification.high
    assert low is not None and high is not None
    kind = type(specification.default)
    assert specification.check(kind(low)) == low
    assert specification.check(kind(high)) == high
    if kind is float:
        beyond: list[float] = [math.nextafter(low, -math.inf), math.nextafter(high, math.inf),
                               math.inf, -math.inf]
        with pytest.raises(ValueError, match=f'^{specification.name} = nan'):
            specification.check(math.nan)
    else:
        beyond = [int(low) - 1, int(high) + 1]
    for value in beyond:
        with pytest.raises(ValueError, match=f'^{specification.name} = .* is outside'):
            specification.check(value)


def test_an_integer_is_taken_for_a_double() -> None:
    """`ros2 param set /simulator alpha 1` is the commonest complaint about parameters."""
    value = BY_NAME['alpha'].check(1)
    assert value == 1.0 and isinstance(value, float)


def test_what_the_table_accepts_the_model_accepts() -> None:
    """At either end of every range of the simulator a simulation can be made and started."""
    for end in ('low', 'high'):
        value = {name: getattr(specification, end) for name, specification in BY_NAME.items()}
        simulation = Simulation(
            Parameters(value['alpha'], value['beta'], value['gamma'], value['restitution']),
            State(0, value['initial_phase'], value['initial_displacement'],
                  value['initial_velocity']),
            noise=value['noise'], seed=int(value['seed']))
        assert len(simulation.advance(1, 1.0, 10)) >= 1
        simulation.reset(value['initial_phase'], value['initial_displacement'],
                         value['initial_velocity'])


def test_defaults_of_the_table_are_those_of_the_model() -> None:
    """A simulator without any option runs the paper's parameters."""
    model = Parameters()
    for name in ('alpha', 'beta', 'gamma', 'restitution'):
        assert BY_NAME[name].default == getattr(model, name)
    assert BY_NAME['alpha_target'].default == BY_NAME['alpha'].default


def test_names_are_unique_in_each_table() -> None:
    """No parameter is declared twice."""
    for table in parameters.TABLES.values():
        names = [specification.name for specification in table]
        assert len(set(names)) == len(names)


VALUES = st.one_of(
    st.none(), st.booleans(), st.integers(-2**63, 2**63 - 1), st.integers(-2, 2),
    st.floats(), st.floats(-2.0, 2.0), st.text(max_size=20), st.lists(st.floats(), max_size=2),
    st.lists(st.integers(-5, 5), max_size=2), st.lists(st.booleans(), max_size=2))


@pytest.mark.parametrize('name', sorted(TABLES))
def test_the_guard_lets_in_what_the_table_allows_and_nothing_else(rclpy_node, name: str) -> None:
    """On a real node: all or none, the right type and range, or everything is as it was."""
    table = TABLES[name]
    applied: list[dict[str, object]] = []
    parameters.declare(rclpy_node, table)
    if any(not specification.read_only for specification in table):
        parameters.guard(rclpy_node, table, lambda values: None, applied.append)
    specifications = {specification.name: specification for specification in table}

    def fits(key: str, value: object) -> bool:
        specification = specifications[key]
        wanted = type(specification.default)
        if type(value) is not wanted and not (wanted is float and type(value) is int):
            return False
        if specification.read_only:
            return False
        return specification.low is None or specification.low <= value <= specification.high

    @given(values=st.dictionaries(st.sampled_from(sorted(specifications)), VALUES, min_size=1,
                                  max_size=3))
    def holds(values: dict[str, object]) -> None:
        before = {key: rclpy_node.get_parameter(key).value for key in specifications}
        result = rclpy_node.set_parameters_atomically(
            [Parameter(key, value=value) for key, value in values.items()])
        assert result.successful == all(fits(key, value) for key, value in values.items())
        # The services add the name where it is missing (test_hostile.py).
        assert result.successful or result.reason
        assert len(result.reason) < 300
        after = {key: rclpy_node.get_parameter(key).value for key in specifications}
        assert after == (before | values if result.successful else before)
        assert [type(value) for value in after.values()] == [
            type(specifications[key].default) for key in after]

    holds()
