"""
The worst case of steps in the search for one impact: random starts, then hill climbing on each.

Over states and parameters up to the largest that the model takes. Two tables are printed: short
flights, in which the steps themselves count, and legs of 64 periods, in which steps in excess of
four for each unit of time do. The exit status is 1 where `BOUND` does not hold.
Run: python benchmark/flight_steps.py [--climbs 40] [--seed 1]
"""

import argparse
import math
import sys
from typing import Final

import numba
import numpy as np

from gear_rattle_ros.core.elementary import TWO_PI
from gear_rattle_ros.core.flight import LEG, search_impact

# Steps up to an impact at time d, or to that time: no more than BOUND + STEPS_A_TIME d.
BOUND: Final = 100
STEPS_A_TIME: Final = 4.0
HANGS: Final = 1_000_000
NAMES: Final = ('phase', 'displacement', 'velocity', 'alpha', 'beta', 'gamma')


@numba.njit
def steps_of(start, longest):  # type: ignore[no-untyped-def]
    """Return the steps of a search, and how far it has come."""
    d = 0.0
    steps = 0
    wall = 0
    while wall == 0 and d < longest and steps < HANGS:
        # A stop that is passed already makes one step.
        d, _, wall = search_impact(
            d, 0.0, start[0], start[1], start[2], start[3], start[4], start[5])
        steps += 1
    return steps, d


@numba.njit
def cost(start, longest, steps_a_time):  # type: ignore[no-untyped-def]
    """Return what is to be made as large as can be."""
    steps, d = steps_of(start, longest)
    return steps - steps_a_time * d


@numba.njit
def random_start():  # type: ignore[no-untyped-def]
    """Return a start of any size, on a wall or between them."""
    start = np.zeros(6)
    start[0] = np.random.uniform(0.0, TWO_PI)
    place = np.random.randint(4)
    start[1] = -np.random.random() if place < 2 else 2.0 - place
    start[2] = np.random.normal() * 10.0**np.random.uniform(-12.0, 4.0)
    start[3] = 10.0**np.random.uniform(-3.0, 3.0) if np.random.random() < 0.9 else 0.0
    start[4] = 10.0**np.random.uniform(-3.0, 2.0) if np.random.random() < 0.8 else 0.0
    if np.random.random() < 0.8:
        start[5] = np.random.normal() * 10.0**np.random.uniform(-3.0, 2.0)
    return start


@numba.njit
def neighbour(start):  # type: ignore[no-untyped-def]
    """Return a start beside another, at a random distance of any size."""
    other = start.copy()
    size = 10.0**np.random.uniform(-15.0, 0.0)
    for j in range(6):
        if np.random.random() < 0.5:
            scale = abs(start[j]) if j > 1 and np.random.random() < 0.8 else 1.0
            other[j] += np.random.normal() * size * scale
    other[0] %= TWO_PI
    other[1] = min(max(other[1], -1.0), 0.0)
    other[2] = min(max(other[2], -1e4), 1e4)
    other[3] = min(abs(other[3]), 1000.0)
    other[4] = min(abs(other[4]), 100.0)
    other[5] = min(max(other[5], -1000.0), 1000.0)
    return other


@numba.njit
def climb(seed, moves, longest, steps_a_time):  # type: ignore[no-untyped-def]
    """Return the worst start that is found from the worst of fifty random ones."""
    np.random.seed(seed)
    best = random_start()
    worst = cost(best, longest, steps_a_time)
    for k in range(50 + moves):
        other = random_start() if k < 50 else neighbour(best)
        found = cost(other, longest, steps_a_time)
        if found >= worst:
            best, worst = other, found
    return worst, best


def worst_start(climbs: int, seed: int, longest: float,
                steps_a_time: float) -> tuple[int, float, np.ndarray]:
    """Return steps, time and start of the worst case of many climbs."""
    found = [climb(seed * 1_000_003 + k, 3000, longest, steps_a_time) for k in range(climbs)]
    start = max(found, key=lambda pair: pair[0])[1]
    return *steps_of(start, longest), start


def main(arguments: list[str] | None = None) -> int:
    """Search, print the worst cases, and tell whether the bound holds."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n\n')[0])
    parser.add_argument('--climbs', type=int, default=40)
    parser.add_argument('--seed', type=int, default=1)
    options = parser.parse_args(arguments)
    holds = True
    for title, longest, rate in (
            ('most steps in a flight of one period', TWO_PI, 0.0),
            ('most steps beyond 4 d, d up to 64 periods', LEG, STEPS_A_TIME)):
        steps, d, start = worst_start(options.climbs, options.seed, longest, rate)
        limit = BOUND + STEPS_A_TIME * d
        holds = holds and steps <= limit
        print(f'{title}: {steps} steps, d = {d:.6g} (bound {math.floor(limit)})')
        print('  ' + ', '.join(
            f'{name} {value!r}' for name, value in zip(NAMES, start.tolist(), strict=True)))
    return 0 if holds else 1


if __name__ == '__main__':
    sys.exit(main())
