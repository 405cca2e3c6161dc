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

"""
The worst case of the search for one impact: random states, then hill climbing from each.

What is counted are evaluations of the flight. Over states and parameters up to the largest that
the model takes; then from tangencies: states on a wall, or between the walls, whose flights meet a
wall with no velocity and no force, where steps shrink without end. Four worst cases are printed
beside the bound that doc/steps.md proves. The exit status is 1 where that bound, or `EMPIRICAL`,
does not hold.
Run: python benchmark/flight_steps.py [--climbs 40] [--seed 1]
"""

import argparse
import math
import sys
from typing import Final

import numba
import numpy as np

from gear_rattle_ros.core.flight.advancement import PATIENCE, PATIENCE_RATE
from gear_rattle_ros.core.flight.closed_form import displace, LEG
from gear_rattle_ros.core.flight.elementary import TWO_PI
from gear_rattle_ros.core.flight.first_impact import HALVINGS, search_impact
from gear_rattle_ros.core.model import Model

# Evaluations in excess of 4 d that no hunt has found.
EMPIRICAL: Final = 250
NAMES: Final = ('phase', 'displacement', 'velocity', 'alpha', 'beta', 'gamma')


def proved_bound(d: float) -> int:
    """Return how many evaluations a search up to a time takes at the most: doc/steps.md."""
    slow = math.floor(d / math.pi) + 3
    return math.floor(PATIENCE + PATIENCE_RATE * d) + 1 + slow * (HALVINGS + 3) + HALVINGS


@numba.njit
def steps_of(state, longest):  # type: ignore[no-untyped-def]
    """Return the evaluations of a search, and how far it has come."""
    d, effort, _, _ = search_impact(
        0.0, 0, longest, state[0], state[1], state[2], Model(state[3], state[4], state[5], 1.0))
    return effort, d


@numba.njit
def cost(state, longest, steps_a_time):  # type: ignore[no-untyped-def]
    """Return what is to be made as large as possible."""
    steps, d = steps_of(state, longest)
    return steps - steps_a_time * d


@numba.njit
def random_state():  # type: ignore[no-untyped-def]
    """Return an initial condition of any size, on a wall or between them."""
    state = np.zeros(6)
    state[0] = np.random.uniform(0.0, TWO_PI)
    place = np.random.randint(4)
    state[1] = -np.random.random() if place < 2 else 2.0 - place
    state[2] = np.random.normal() * 10.0**np.random.uniform(-12.0, 4.0)
    state[3] = 10.0**np.random.uniform(-3.0, 3.0) if np.random.random() < 0.9 else 0.0
    state[4] = 10.0**np.random.uniform(-3.0, 2.0) if np.random.random() < 0.8 else 0.0
    if np.random.random() < 0.8:
        state[5] = np.random.normal() * 10.0**np.random.uniform(-3.0, 2.0)
    return state


@numba.njit
def tangent_state():  # type: ignore[no-untyped-def]
    """Return an initial condition whose flight nearly meets the upper wall with v = a = 0."""
    state = np.zeros(6)
    state[3] = 10.0**np.random.uniform(-3.0, 3.0)
    if np.random.random() < 0.5:
        # On the wall: without damping the displacement is about -alpha/24 t (T - t)^3.
        duration = 10.0**np.random.uniform(-8.0, -0.5)
        state[0] = 0.5 * np.pi - 0.75 * duration
        state[2] = -state[3] * duration**3 / 24.0
        state[5] = state[3] * np.cos(0.25 * duration)
        return state
    # Between the walls: back from the tangency by the closed form, which also holds for d < 0.
    state[4] = 10.0**np.random.uniform(-3.0, 0.0) if np.random.random() < 0.5 else 0.0
    amplitude = state[3] * np.sqrt(1.0 + state[4]**2)
    state[5] = amplitude * np.random.uniform(-1.0, 1.0)
    # Where a(tau, 0) goes through zero upwards.
    phase = np.pi - np.arcsin(state[5] / amplitude) + np.arctan(state[4])
    back = 10.0**np.random.uniform(-3.0, 0.3)
    moved, state[2], _, _ = displace(
        -back, np.sin(phase), np.cos(phase), 0.0, Model(state[3], state[4], state[5], 1.0))
    state[0] = (phase - back) % TWO_PI
    state[1] = min(max(moved, -1.0), 0.0)
    return state


@numba.njit
def neighbour(state):  # type: ignore[no-untyped-def]
    """Return an initial condition beside another, at a random distance of any size."""
    other = state.copy()
    size = 10.0**np.random.uniform(-15.0, 0.0)
    for j in range(6):
        if np.random.random() < 0.5:
            scale = abs(state[j]) if j > 1 and np.random.random() < 0.8 else 1.0
            other[j] += np.random.normal() * size * scale
    other[0] %= TWO_PI
    other[1] = min(max(other[1], -1.0), 0.0)
    other[2] = min(max(other[2], -1e4), 1e4)
    other[3] = min(abs(other[3]), 1000.0)
    other[4] = min(abs(other[4]), 100.0)
    other[5] = min(max(other[5], -1000.0), 1000.0)
    return other


@numba.njit
def climb(seed, moves, longest, steps_a_time, is_tangent):  # type: ignore[no-untyped-def]
    """Return the worst initial condition that is found from the worst of fifty random ones."""
    np.random.seed(seed)
    best = tangent_state() if is_tangent else random_state()
    worst = cost(best, longest, steps_a_time)
    for k in range(50 + moves):
        if k >= 50:
            other = neighbour(best)
        else:
            other = tangent_state() if is_tangent else random_state()
        found = cost(other, longest, steps_a_time)
        if found >= worst:
            best, worst = other, found
    return worst, best


def worst_state(climbs: int, seed: int, longest: float, steps_a_time: float,
                is_tangent: bool) -> tuple[int, float, np.ndarray]:
    """Return evaluations, time and initial condition of the worst case of many climbs."""
    found = [climb(seed * 1_000_003 + k, 3000, longest, steps_a_time, is_tangent)
             for k in range(climbs)]
    state = max(found, key=lambda pair: pair[0])[1]
    return *steps_of(state, longest), state


def main(arguments: list[str] | None = None) -> int:
    """Search, print the worst cases, and return 1 where the bounds do not hold."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n\n')[0])
    parser.add_argument('--climbs', type=int, default=40)
    parser.add_argument('--seed', type=int, default=1)
    options = parser.parse_args(arguments)
    holds = True
    for title, longest, rate in (
            ('most evaluations in a flight of one period', TWO_PI, 0.0),
            ('most evaluations beyond 4 d, d up to 64 periods', LEG, PATIENCE_RATE)):
        for is_tangent in (False, True):
            steps, d, state = worst_state(
                options.climbs, options.seed, longest, rate, is_tangent)
            proved = proved_bound(d)
            seen = math.floor(EMPIRICAL + PATIENCE_RATE * d)
            holds = holds and steps <= min(proved, seen)
            print(f'{title}{", from tangencies" if is_tangent else ""}: {steps}, d = {d:.6g} '
                  f'(proved {proved}, empirical {seen})')
            print('  ' + ', '.join(
                f'{name} {value!r}' for name, value in zip(NAMES, state.tolist(), strict=True)))
    return 0 if holds else 1


if __name__ == '__main__':
    sys.exit(main())
