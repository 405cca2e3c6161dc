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
An adversarial search for impacts that the short way misses.

Flights drawn over the whole range of the parameters, and flights next to grazes: between two
initial conditions whose first impacts differ, bisection finds where they jump, and flights are
drawn from 1e-16 to 0.1 on either side. Each is taken the short way and by the search in certified
steps; a flight on which they disagree by more than rounding is printed, and the exit status is 1.
Run: python benchmark/short_way.py [--flights 1e8] [--seed 1]
"""

import argparse
import math
import sys
import time
from typing import Final

import numba
import numpy as np

from gear_rattle_ros.core.flight.closed_form import NO_WALL, strikes_at_once
from gear_rattle_ros.core.flight.elementary import sine_cosine, TWO_PI
from gear_rattle_ros.core.flight.first_impact import search_along
from gear_rattle_ros.core.flight.stretches import short_way, Stretches, stretches_of
from gear_rattle_ros.core.model import Model

# With these the search makes steps only.
STEPS: Final = Stretches(*[0.0] * len(Stretches._fields))
LONGEST: Final = 400.0
# Rounding of a time by the velocity, by the size of the motion.
ROUNDING: Final = 1e-13
ROWS: Final = 20


@numba.njit
def draw():  # type: ignore[no-untyped-def]
    """Draw the initial condition and the parameters of a flight."""
    alpha = 10.0**np.random.uniform(-2.0, 3.0)
    beta = 0.0 if np.random.random() < 0.15 else 10.0**np.random.uniform(-4.0, 2.0)
    if np.random.random() < 0.7:
        beta = min(beta, 10.0**np.random.uniform(-4.0, -0.2))
    kind = np.random.random()
    if kind < 0.1:
        gamma = 0.0
    elif kind < 0.3:
        # Next to the largest load that leaves the force zeros.
        gamma = alpha * (1.0 + np.random.normal() * 10.0**np.random.uniform(-12.0, -1.0))
    elif kind < 0.6:
        gamma = 0.3 * np.random.normal()
    else:
        gamma = alpha * np.random.uniform(-1.2, 1.2)
    place = np.random.random()
    s = 0.0 if place < 0.4 else -1.0 if place < 0.8 else -np.random.random()
    v = np.random.normal() * 10.0**np.random.uniform(-6.0, 0.5)
    if np.random.random() < 0.5:
        v *= alpha
    if strikes_at_once(s, v):
        v = -v
    return np.array((np.random.random() * TWO_PI, s, v, alpha, beta, gamma))


@numba.njit
def in_steps(f):  # type: ignore[no-untyped-def]
    """Return the first impact by certified steps: time, velocity, wall."""
    d, _, velocity, wall = search_along(
        0.0, 0, LONGEST, f[0], f[1], f[2], Model(f[3], f[4], f[5], 1.0), STEPS)
    return d, velocity, wall


@numba.njit
def compare(f, counts, bad):  # type: ignore[no-untyped-def]
    """Compare the two ways; count flights, short ones and differences, and keep these."""
    model = Model(f[3], f[4], f[5], 1.0)
    stretches = stretches_of(model)
    if stretches.use == 0.0 or strikes_at_once(f[1], f[2]):
        return
    sine, cosine = sine_cosine(f[0])
    hits, d, velocity = short_way(f[0], sine, cosine, f[1], f[2], model, stretches)
    exact, speed, wall = in_steps(f)
    size = ROUNDING * (1.0 + f[3] + abs(f[5]) * (1.0 + exact) + abs(f[2])) * (1.0 + exact)
    if hits:
        wrong = (wall == NO_WALL or (speed > 0.0) != (velocity > 0.0)
                 or abs(exact - d) * abs(velocity) > size)
    else:
        # No impact before the time that is said to be free.
        wrong = wall != NO_WALL and exact < d and (d - exact) * abs(speed) > size
    counts[0] += 1
    counts[1] += hits
    if wrong:
        if counts[2] < len(bad):
            bad[counts[2]] = f
        counts[2] += 1


@numba.njit
def anywhere(count, seed, counts, bad):  # type: ignore[no-untyped-def]
    """Compare flights from anywhere."""
    np.random.seed(seed)
    for _ in range(count):
        compare(draw(), counts, bad)


@numba.njit
def next_to_grazes(count, seed, counts, bad):  # type: ignore[no-untyped-def]
    """Compare flights next to initial conditions at which the first impact jumps."""
    np.random.seed(seed)
    for _ in range(count):
        one, other = draw(), np.zeros(6)
        other[:] = one
        if np.random.random() < 0.5:
            other[2] *= 1.0 + 0.5 * np.random.normal()
        else:
            other[0] = (other[0] + np.random.normal()) % TWO_PI
        first, last = in_steps(one), in_steps(other)
        if abs(first[0] - last[0]) < 0.3 and first[2] == last[2]:
            continue
        way = other - one
        a, b = 0.0, 1.0
        while True:
            middle = 0.5 * (a + b)
            if not a < middle < b:
                break
            there = in_steps(one + middle * way)
            if there[2] == first[2] and abs(there[0] - first[0]) < abs(there[0] - last[0]):
                a, first = middle, there
            else:
                b, last = middle, there
        for k in range(40):
            x = a + (1.0 - 2.0 * (k % 2)) * 10.0**np.random.uniform(-16.0, -1.0)
            flight = one + x * way
            if 0.0 <= flight[0] < TWO_PI:
                compare(flight, counts, bad)


def main() -> None:
    """Search, and print what was found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--flights', type=float, default=1e6)
    parser.add_argument('--seed', type=int, default=1)
    options = parser.parse_args()
    wrong = 0
    for name, run, share, size in (('from anywhere', anywhere, 0.6, 100_000),
                                   ('next to grazes', next_to_grazes, 0.4, 4_000)):
        counts, bad = np.zeros(3, np.int64), np.zeros((ROWS, 6))
        start = time.process_time()
        seed = options.seed * 100_000
        while counts[0] < share * options.flights:
            run(size, seed, counts, bad)
            seed += 1
        print(f'{name}: {counts[0]:,} flights, {100 * counts[1] / counts[0]:.1f} % the short way, '
              f'{counts[2]} differences, {math.ceil(time.process_time() - start)} s of CPU time')
        for flight in bad[:counts[2]]:
            print('  phase, s, v, alpha, beta, gamma =', [float(x) for x in flight])
        wrong += int(counts[2])
    sys.exit(1 if wrong else 0)


if __name__ == '__main__':
    main()
