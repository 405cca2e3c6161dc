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

"""The flight backwards against the flight forwards and against 50 digits."""

import math

import mpmath as mp
import numpy as np
import pytest
from reference import DIGITS, Flight, roots

from gear_rattle_ros.core.flight.closed_form import is_pressed, LEG, NO_WALL
from gear_rattle_ros.core.flight.elementary import TWO_PI
from gear_rattle_ros.core.flight.inverse import previous_impact, require_inverse
from gear_rattle_ros.core.model import Model, Parameters
from gear_rattle_ros.core.orbits.impact_map import next_impact

MODELS = [Model(0.48, 0.1, 0.1, 0.9), Model(1.244, 0.1, 0.1, 0.9), Model(0.3, 0.0, 0.0, 0.5),
          Model(0.0, 0.0, 0.2, 1.0), Model(2.0, 1.5, -0.7, 0.3), Model(0.05, 0.02, 0.06, 0.8)]


def impacts(seed: int, count: int) -> list[tuple[int, float, float]]:
    """Return random impacts: wall, phase, velocity, some of them very slow."""
    rng = np.random.default_rng(seed)
    return [(wall := int(rng.integers(2)), float(rng.uniform(0.0, TWO_PI)),
             float((1 - 2 * wall) * rng.uniform(0.05, 2.0) * 10.0**-rng.integers(0, 3)))
            for _ in range(count)]


def apart(phase: float, other: float) -> float:
    """Return the distance of two phases."""
    return abs((phase - other + math.pi) % TWO_PI - math.pi)


@pytest.mark.parametrize('model', MODELS)
def test_forward_after_backward_and_backward_after_forward(model: Model) -> None:
    """Both return to the impact they begin with, to 1e-9."""
    there = back = 0
    for wall, phase, velocity in impacts(1, 4000):
        hit, _, p, v, d = next_impact(wall, phase, velocity, model)
        # A slow impact forgets digits.
        if hit != NO_WALL and abs(v) > 1e-4:
            again, p, v, duration = previous_impact(hit, p, v, model)
            assert again == wall
            assert max(apart(p, phase), abs(v - velocity), abs(d - duration)) < 1e-9
            there += 1
        hit, p, v, d = previous_impact(wall, phase, velocity, model)
        if hit != NO_WALL and 1e-4 < abs(v) < 1e3:
            again, _, p, v, duration = next_impact(hit, p, v, model)
            assert again == wall
            assert max(apart(p, phase), abs(v - velocity), abs(d - duration)) < 1e-9
            back += 1
    assert min(there, back) > 2000


def impact_in_50_digits(flight: Flight, until: float) -> tuple[mp.mpf, int] | None:
    """Return the time back to the impact before, and its wall, from the turns of the flight."""
    grid = [until * k / 400 for k in range(401)]
    turns = roots(lambda d: flight.velocity_at(-d), grid)
    # Between these times the way is monotone.
    times = [mp.mpf(0), *sorted([*turns, mp.mpf(until)])]
    for t0, t1 in zip(times[:-1], times[1:], strict=True):
        s = flight.displacement_at(-t1)
        if -1 < s < 0 or (t0 == 0 and abs(s - flight.displacement) < mp.mpf(10)**-40):
            continue
        level = mp.mpf(0 if s >= 0 else -1)
        if t0 == 0 and level == flight.displacement:
            return None
        exact = mp.findroot(lambda d, level=level: flight.displacement_at(-d) - level, (t0, t1),
                            solver='anderson', tol=mp.mpf(10)**-60, verify=False)
        return exact, int(-level)
    return None


def grazes(seed: int, count: int, model: Model) -> list[tuple[int, float, float]]:
    """Return impacts whose flight before nearly touched a wall."""
    rng = np.random.default_rng(seed)
    found = []
    while len(found) < count:
        wall, phase = int(rng.integers(2)), float(rng.uniform(0.0, TWO_PI))
        if is_pressed(-float(wall), phase, model):
            continue
        # At rest so near to the wall, it is left without an impact.
        near = Flight(phase, (1 - 2 * wall) * -(10.0**rng.uniform(-10.0, -2.0)) - wall, 0.0,
                      model.alpha, model.beta, model.gamma)
        grid = [LEG / 64 * k / 400 for k in range(401)]
        for level in (0, -1):
            for d in roots(lambda t, f=near, s=level: f.displacement_at(t) - s, grid):
                if all(-1 <= near.displacement_at(d * k / 50) <= 0 for k in range(1, 50)):
                    found.append((-level, float((phase + d) % TWO_PI),
                                  float(near.velocity_at(d))))
    return found[:count]


@pytest.mark.parametrize('model', [
    *MODELS[:1], *(pytest.param(model, marks=pytest.mark.long) for model in MODELS[1:3])])
@pytest.mark.parametrize('grazing', [False, True])
def test_impact_before_in_50_digits(model: Model, grazing: bool) -> None:
    """No wall is met in between, also where the flight nearly touches one."""
    compared = 0
    with mp.workdps(DIGITS):
        cases = grazes(2, 12, model) if grazing else impacts(2, 25)
        for wall, phase, velocity in cases:
            flight = Flight(phase, -float(wall), velocity, model.alpha, model.beta, model.gamma)
            hit, p, v, d = previous_impact(wall, phase, velocity, model)
            expected = impact_in_50_digits(flight, 1.0 + d)
            assert expected is not None
            exact, level = expected
            assert hit == level
            before = -flight.velocity_at(-exact) / mp.mpf(model.restitution)
            # Rounding of the way, by the speed at which it passes the wall.
            bound = 1e-14 * (1.0 + d) * (1.0 + 1.0 / abs(float(before)))
            assert abs(d - exact) < bound
            assert abs(v - before) < 10.0 * bound
            assert apart(p, float((phase - exact) % TWO_PI)) < bound + 1e-14
            compared += 1
    assert compared == len(cases)


def test_where_there_is_no_impact_before() -> None:
    """A gear that is pressed had stuck; one that nothing drives has flown for ever."""
    assert previous_impact(0, 0.1, 0.0, Model(0.0, 0.0, 0.2, 0.9))[0] == NO_WALL
    assert previous_impact(0, 0.1, 1e-6, Model(0.0, 0.0, 0.0, 0.9))[0] == NO_WALL
    # Damped, it has come from the other wall: (1 - exp(-beta d))/beta = 1/v there.
    hit, _, v, d = previous_impact(0, 0.1, 0.2, Model(0.0, 0.1, 0.0, 0.5))
    assert hit == 1
    assert v == pytest.approx(-(0.2 + 0.1) / 0.5, rel=1e-13)
    assert d == pytest.approx(10.0 * math.log(1.5), rel=1e-13)


def test_without_restitution_there_is_no_way_back() -> None:
    """One line names the value and the remedy."""
    with pytest.raises(ValueError, match='restitution = 0 .* give a --restitution above 0'):
        require_inverse(Parameters(restitution=0.0))
