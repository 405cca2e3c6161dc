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

"""Finite-time exponents against the product of the matrices, one by one, and exact statements."""

import math

import numpy as np
import pytest

from gear_rattle_ros.core.flight.lanes import INITIAL, new_tiles
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.many.growth import grow
from gear_rattle_ros.core.model import Parameters, State


def exponents(initial: np.ndarray, count: int) -> np.ndarray:
    """Follow initial conditions for `count` impacts."""
    result = np.full(len(initial), 7.0)
    grow(new_tiles(1)[0], initial, count, result)
    return result


def make(parameters: Parameters, states: list[tuple[float, float, float]]) -> np.ndarray:
    """Put states and parameters together."""
    values = (parameters.alpha, parameters.beta, parameters.gamma, parameters.restitution)
    return np.array([(*state, *values) for state in states], INITIAL)


@pytest.mark.parametrize('alpha, r, count', [
    (0.48, 0.9, 1), (0.48, 0.9, 7), (0.48, 0.9, 20), (1.244, 0.9, 1), (1.244, 0.9, 7),
    (1.244, 0.9, 20), (3.0, 0.0, 1)])
def test_exponent_is_that_of_the_perturbed_trajectory(alpha: float, r: float, count: int) -> None:
    """The events of `Simulation`, multiplied in extended precision and decomposed by LAPACK."""
    parameters = Parameters(alpha=alpha, restitution=r)
    rng = np.random.default_rng(3)
    compared = 0
    states = [(p, s, v) for p, s, v in zip(
        rng.uniform(0.0, 6.28, 120), rng.uniform(-1.0, 0.0, 120), rng.uniform(-2.0, 2.0, 120),
        strict=True)]
    found = exponents(make(parameters, states), count)
    for value, (phase, displacement, velocity) in zip(found, states, strict=True):
        events = Simulation(parameters, State(0, phase, displacement, velocity)).advance(
            10**6, 0.0, count + 1)
        if np.any(events['kind'][1:] != 0):
            continue
        product = np.eye(2, dtype=np.longdouble)
        beta = parameters.beta
        compared += 1
        for before, after in zip(events, events[1:], strict=False):
            d = (2.0 * math.pi * (int(after['cycle']) - int(before['cycle']))
                 + after['phase'] - before['phase'])
            flight = [[1.0, -math.expm1(-beta * d) / beta], [0.0, math.exp(-beta * d)]]
            force = (-alpha * math.sin(after['phase']) + alpha * beta * math.cos(after['phase'])
                     + parameters.gamma)
            v = float(after['velocity'])
            before_it, after_it = force - beta * v, force + beta * r * v
            impact = [[-r, 0.0], [(r * before_it + after_it) / v, -r]]
            product = np.array(flight, np.longdouble) @ product
            product = np.array(impact, np.longdouble) @ product
        expected = np.linalg.norm(product.astype(np.float64), 2)
        # Rounding of the trajectory grows as its tangent does.
        assert value == pytest.approx(math.log(expected) / count, abs=1e-9 + 1e-12 * expected)
    assert compared > 10


def test_on_the_orbit_it_is_that_of_its_multipliers() -> None:
    """Attractor A of the paper has complex multipliers: ln r - beta pi p/q from any point."""
    parameters = Parameters(alpha=0.48)
    found = exponents(make(parameters, [(4.0915, 0.0, -0.9 * 0.6273)]), 3000)
    assert found[0] == pytest.approx(math.log(0.9) - 0.1 * math.pi / 3.0, abs=2e-3)


def test_what_sticks_has_no_memory_and_what_floats_no_exponent() -> None:
    """A gear that is permanently pressed to a wall, and one that floats between the walls."""
    pressed, free = Parameters(alpha=0.0, gamma=0.5), Parameters(alpha=0.1, gamma=0.0)
    assert exponents(make(pressed, [(0.0, -0.5, 0.0)]), 100_000)[0] == -math.inf
    assert math.isnan(exponents(make(free, [(0.0, -0.5, 0.1)]), 10)[0])
