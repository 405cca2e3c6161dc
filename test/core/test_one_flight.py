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

"""The scalar kernels and the lanes are one flight: the same bits, impact by impact."""

from typing import Any, Final

import numba
import numpy as np
import pytest

from gear_rattle_ros.core.arrays import RecordArray
from gear_rattle_ros.core.flight.elementary import TWO_PI
from gear_rattle_ros.core.flight.lanes import (
    advance,
    EMPTY,
    INITIAL,
    is_busy,
    new_impacts,
    new_tiles,
    refill,
    release,
)
from gear_rattle_ros.core.flight.lanes_step import LANES
from gear_rattle_ros.core.flight.simulation import IMPACT, run, settle, STICK, TRAJECTORY
from gear_rattle_ros.core.model import EVENT

STEPS: Final = 40
IMPACTS: Final = 8
# Drive periods after which a trajectory without impacts is left alone.
LONGEST: Final = 1000
Array = np.ndarray[Any, Any]


def everywhere(random: np.random.Generator, count: int) -> RecordArray:
    """Return initial conditions of all kinds, with parameters drawn and with special values."""
    initial = np.zeros(count, INITIAL)
    initial['phase'] = random.uniform(0.0, TWO_PI, count)
    initial['displacement'] = random.choice([0.0, -1.0, -0.5], count)
    between = initial['displacement'] == -0.5
    initial['displacement'][between] = -random.random(between.sum())
    initial['velocity'] = random.normal(0.0, 1.0, count) * 10.0**random.uniform(-3.0, 0.7, count)
    initial['alpha'] = np.where(
        random.random(count) < 0.1, 0.0, 10.0**random.uniform(-2.0, 1.0, count))
    initial['beta'] = np.where(
        random.random(count) < 0.2, 0.0, 10.0**random.uniform(-3.0, 0.5, count))
    initial['gamma'] = np.where(random.random(count) < 0.2, 0.0, random.normal(0.0, 0.3, count))
    initial['restitution'] = random.choice([0.0, 0.3, 0.5, 0.9, 0.99, 1.0], count)
    return initial


def near_walls(random: np.random.Generator, count: int) -> RecordArray:
    """Return initial conditions a hair off a wall."""
    initial = everywhere(random, count)
    hair = 10.0**random.uniform(-17.0, -3.0, count)
    initial['displacement'] = np.where(random.random(count) < 0.5, -hair, hair - 1.0)
    return initial


def from_rest(random: np.random.Generator, count: int) -> RecordArray:
    """Return initial conditions at rest, on walls and between them."""
    initial = everywhere(random, count)
    initial['velocity'] = 0.0
    return initial


def grazing(random: np.random.Generator, count: int) -> RecordArray:
    """Return initial conditions almost at rest: impacts on a wall just left, turns beside it."""
    initial = near_walls(random, count)
    initial['velocity'] *= 1e-6
    return initial


def long_flights(random: np.random.Generator, count: int) -> RecordArray:
    """Return initial conditions with hardly any force, or hardly any motion left."""
    initial = everywhere(random, count)
    initial['alpha'] = 10.0**random.uniform(-6.0, -1.0, count)
    initial['gamma'] = random.normal(0.0, 1e-3, count)
    return initial


def damped(random: np.random.Generator, count: int) -> RecordArray:
    """Return initial conditions whose flights outlast the decay of the free motion."""
    initial = everywhere(random, count)
    initial['beta'] = 10.0**random.uniform(0.0, 2.0, count)
    return initial


def slow_launches(random: np.random.Generator, count: int) -> RecordArray:
    """Return initial conditions that leave a wall slowly where the force vanishes: soon back."""
    initial = everywhere(random, count)
    on_upper = random.random(count) < 0.5
    initial['displacement'] = np.where(on_upper, 0.0, -1.0)
    initial['velocity'] = np.where(on_upper, -1.0, 1.0) * 10.0**random.uniform(-40.0, -6.0, count)
    initial['alpha'] = 10.0**random.uniform(-1.0, 3.0, count)
    initial['phase'] = np.where(on_upper, np.pi, 0.0) + random.choice([0.0, 1e-12], count)
    initial['beta'] = initial['gamma'] = 0.0
    initial['restitution'] = 1.0
    return initial


def tangent(random: np.random.Generator, count: int) -> RecordArray:
    """Return initial conditions on a wall that nearly meet it again without velocity or force."""
    initial = everywhere(random, count)
    on_upper = random.random(count) < 0.5
    initial['displacement'] = np.where(on_upper, 0.0, -1.0)
    initial['beta'] = 0.0
    initial['alpha'] = 10.0**random.uniform(-3.0, 3.0, count)
    duration = 10.0**random.uniform(-6.0, -1.0, count)
    sign = np.where(on_upper, -1.0, 1.0)
    nearly = 1.0 + random.normal(0.0, 1.0, count) * 10.0**random.uniform(-16.0, -4.0, count)
    initial['velocity'] = sign * initial['alpha'] * duration**3 / 24.0 * nearly
    initial['phase'] = np.where(on_upper, 0.5, 1.5) * np.pi - 0.75 * duration
    initial['gamma'] = -sign * initial['alpha'] * np.cos(0.25 * duration)
    return initial


def mixed(random: np.random.Generator, count: int) -> RecordArray:
    """Return some of all kinds in any order: lanes change between the short way and the search."""
    kinds = (everywhere, near_walls, from_rest, grazing, long_flights, damped, slow_launches,
             tangent)
    return random.permutation(np.concatenate(
        [kind(random, count // len(kinds)) for kind in kinds]))


def tails(random: np.random.Generator, count: int) -> RecordArray:
    """Return strong damping after the rest: tiles in which all lanes come to be searched."""
    initial = np.tile(mixed(random, 240), count // 240)
    initial['beta'][count - 200:] = 10.0**random.uniform(0.0, 1.0, 200)
    return initial


@numba.njit
def by_lanes(tile, impacts, initial, found, counts):  # type: ignore[no-untyped-def]
    """Write the first impacts from every initial condition, through one tile."""
    following = refill(tile, initial, 0, float(IMPACTS))
    while following < len(initial) or is_busy(tile):
        advance(tile, impacts, STEPS)
        for i in range(LANES):
            number = tile.number[i]
            if number == EMPTY:
                continue
            for j in range(tile.count[i]):
                impact = found[number, counts[number]]
                impact.cycle = impacts[i, j].cycle
                impact.phase = impacts[i, j].phase
                impact.velocity = impacts[i, j].velocity
                counts[number] += 1
            if tile.left[i] == 0.0 or tile.cycle[i] > LONGEST:
                release(tile, i)
        following = refill(tile, initial, following, float(IMPACTS))


@numba.njit
def by_events(trajectories, events, found, counts):  # type: ignore[no-untyped-def]
    """Write the first impacts of every trajectory, from its stream of events."""
    for i in range(len(trajectories)):
        settle(trajectories[i])
        while counts[i] < IMPACTS:
            # One by one: the stream does not depend on the cuts.
            if run(trajectories[i], events, LONGEST, 0.0) == 0:
                break
            if events[0].kind == IMPACT or events[0].kind == STICK:
                impact = found[i, counts[i]]
                impact.cycle = events[0].cycle
                impact.phase = events[0].phase
                impact.velocity = events[0].velocity
                counts[i] += 1


def compare(initial: RecordArray) -> int:
    """Compare the first eight impacts, to the bit, and return how many there are."""
    rows = new_impacts(STEPS)
    lanes = np.zeros((len(initial), IMPACTS), rows.dtype)
    scalar = np.zeros_like(lanes)
    lane_counts, counts = np.zeros((2, len(initial)), int)
    by_lanes(new_tiles(1)[0], rows, initial, lanes, lane_counts)
    trajectories = np.zeros(len(initial), TRAJECTORY)
    for name in INITIAL.names or ():
        trajectories[name] = initial[name]
    by_events(trajectories, np.zeros(1, EVENT), scalar, counts)
    late = lanes['cycle'] >= LONGEST
    lanes[late] = 0
    assert np.array_equal(lane_counts - late.sum(1), counts)
    assert lanes.tobytes() == scalar.tobytes()
    return int(counts.sum())


@pytest.mark.parametrize(
    'kind',
    [everywhere, near_walls, from_rest, grazing, long_flights, damped, slow_launches, tangent,
     mixed, tails])
def test_scalar_and_lanes_give_the_same_bits(kind: Any) -> None:
    """The first eight impacts from 6,000 of each kind, through sticking and release."""
    initial = kind(np.random.default_rng(1), 6_000)
    assert compare(initial) > 3 * len(initial)


def test_an_impact_just_beyond_a_leg_that_is_clear_is_the_same() -> None:
    """The search in steps of the leg before would find it, 0.05 after the leg's end."""
    initial = np.zeros(1, INITIAL)
    initial[0] = (4.360771404479224, -1.0, -3.166138438922711e-05, 1.6536772837328974e-06,
                  0.9339501302098417, 0.0011627447843888844, 0.0)
    assert compare(initial) > 1
