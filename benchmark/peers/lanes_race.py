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
The lanes kernel of a package, of this commit or another, for benchmark/lanes.py.

Takes a file with the states of each regime; for each number of a regime on standard input, prints
the impacts of a turn and its seconds of CPU time.
"""

import math
import sys
import time

import numba
import numpy as np

from gear_rattle_ros.core.flight.lanes import (
    advance,
    INITIAL,
    new_tiles,
    NO_IMPACTS,
    refill,
    release,
    RUNS,
)
from gear_rattle_ros.core.flight.lanes_step import LANES

IMPACTS = 100_000
STEPS = 60


@numba.njit(nogil=True)
def run_on(tile, states, following, impacts):  # type: ignore[no-untyped-def]
    """Make so many impacts; trajectories that end are replaced."""
    made = 0
    while made < IMPACTS:
        following = refill(tile, states, following % len(states), math.inf)
        advance(tile, impacts, STEPS)
        for i in range(LANES):
            made += tile.count[i]
            if tile.end[i] != RUNS:
                release(tile, i)
    return made, following


def main() -> None:
    """Take turns."""
    states = np.load(sys.argv[1]).view(INITIAL)
    tiles, following = new_tiles(len(states)), [0] * len(states)
    for line in sys.stdin:
        k = int(line)
        start = time.thread_time()
        made, following[k] = run_on(tiles[k], states[k], following[k], NO_IMPACTS)
        print(made, time.thread_time() - start, flush=True)


if __name__ == '__main__':
    main()
