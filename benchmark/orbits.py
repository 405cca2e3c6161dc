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
Seconds for all periodic orbits of at most 8 impacts at 0.57, on all processors.

Beside them scipy's root finder closes a hundred of the same seeds by the same equations: seconds
for each, and how many it closes. Fails above 20 s, or where scipy finds an orbit that is not in
the list. Run: python benchmark/orbits.py
"""

import sys
import time

import numpy as np
from scipy.optimize import root

from gear_rattle_ros.attractors.skeleton.orbits import find_orbits
from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.core.orbits.orbit import close_orbit, fire, Orbit, same_orbit

ALPHA, LONGEST = 0.57, 8
LIMIT = 20.0
SEEDS, AWAY = 100, 0.01


def by_scipy(walls: np.ndarray, points: np.ndarray, parameters: Parameters) -> np.ndarray | None:
    """Close a sequence of impacts by scipy's Newton-like method, as one system of equations."""
    def defects(x: np.ndarray) -> np.ndarray:
        shot = fire(walls, x.reshape(-1, 2), parameters)
        return np.full(x.size, 1.0) if shot is None else shot.defects.ravel()

    found = root(defects, points.ravel(), tol=1e-12)
    return found.x.reshape(-1, 2) if np.max(np.abs(found.fun)) < 1e-9 else None


def main() -> int:
    """Print the orbits, the seconds, and those of scipy; return 1 where something fails."""
    parameters = Parameters(ALPHA)
    find_orbits(parameters, 2, first=2, most=2)
    begin = time.perf_counter()
    found = find_orbits(parameters, LONGEST)
    seconds = time.perf_counter() - begin
    print(f'{len(found.orbits)} orbits of at most {LONGEST} impacts at {ALPHA} in '
          f'{seconds:.1f} s, from {sum(found.seeds):,} seeds that led to one; {found.statement()}')
    noise = np.random.default_rng(1)
    spent, closed, unknown = np.zeros(2), np.zeros(2, int), 0
    for n in range(SEEDS):
        orbit: Orbit = found.orbits[n % len(found.orbits)]
        seed = orbit.points + noise.uniform(-AWAY, AWAY, orbit.points.shape)
        begin = time.perf_counter()
        ours = close_orbit(orbit.walls, seed, parameters)
        middle = time.perf_counter()
        theirs = by_scipy(orbit.walls, seed, parameters)
        spent += middle - begin, time.perf_counter() - middle
        closed += ours is not None, theirs is not None
        if theirs is not None:
            again = close_orbit(orbit.walls, theirs, parameters)
            unknown += again is not None and not any(
                same_orbit(again, each, 1e-6) for each in found.orbits)
    print(f'a seed within {AWAY} of an orbit: {1e6 * spent[0] / SEEDS:.0f} us, {closed[0]} of '
          f'{SEEDS} closed; scipy {1e6 * spent[1] / SEEDS:.0f} us, {closed[1]} closed, {unknown} '
          'of them at orbits that are not in the list')
    return int(seconds > LIMIT or unknown > 0)


if __name__ == '__main__':
    sys.exit(main())
