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
Impacts per second of the lanes kernel on one core, and of the same kernel written by hand in C.

C and numba take turns in the same run, and the best of many short turns counts, since machines are
shared. The scalar kernel is timed beside them, then numba again without AVX-512 and without AVX2,
and two threads. Run: make bench, or python benchmark/lanes.py
"""

from collections.abc import Callable
import concurrent.futures
import ctypes
import math
import os
from pathlib import Path
import shutil
import subprocess
import sys
import tempfile
import time

import numpy as np

from gear_rattle_ros.core.arrays import RecordArray
from gear_rattle_ros.core.flight.lanes import (
    advance,
    INITIAL,
    new_impacts,
    new_tiles,
    NO_IMPACTS,
    refill,
)
from gear_rattle_ros.core.flight.lanes_step import LANES
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import Parameters, State

ALPHAS = (0.48, 1.244)
TURNS = 400
STEPS = 60
# More impacts than a lane makes in a turn.
ROUNDS = 1e6
FLAGS = ('-O3', '-march=native', '-mprefer-vector-width=512', '-fno-math-errno',
         '-fno-trapping-math', '-shared', '-fPIC', f'-DLANES={LANES}')
# Features of processors that numba is to leave aside.
NO_AVX512 = '+avx2,+avx,+fma,+sse4.2'
NO_AVX2 = '+sse4.2'
Turn = Callable[[], None]


def filled_tiles(alpha: float) -> RecordArray:
    """Return a tile with the paper's parameters whose trajectories have been going for a while."""
    random = np.random.default_rng(1)
    initial = np.zeros(LANES, INITIAL)
    initial['phase'] = random.uniform(0.0, 2.0 * math.pi, LANES)
    initial['velocity'] = random.uniform(-1.0, 0.0, LANES)
    for name, value in (('alpha', alpha), ('beta', 0.1), ('gamma', 0.1), ('restitution', 0.9)):
        initial[name] = value
    tiles = new_tiles(1)
    refill(tiles[0], initial, 0, math.inf)
    advance(tiles[0], NO_IMPACTS, 5000)
    return tiles


def best_rates(turns: dict[str, tuple[Turn, RecordArray]]) -> dict[str, float]:
    """Let all take turns and return the best impacts per second of each."""
    best = dict.fromkeys(turns, 0.0)
    for _ in range(TURNS):
        for name, (turn, tiles) in turns.items():
            tiles['left'] = ROUNDS
            start = time.perf_counter()
            turn()
            elapsed = time.perf_counter() - start
            best[name] = max(best[name], (ROUNDS - tiles['left']).sum() / elapsed)
    return best


def built_peer(compiler: str, folder: str, *flags: str) -> ctypes.CDLL:
    """Return the C kernel, compiled."""
    library = Path(folder, 'lanes' + ''.join(flags) + '.so')
    source = Path(__file__).with_suffix('.c')
    subprocess.run([compiler, *FLAGS, *flags, source, '-o', library, '-lm'], check=True)
    peer = ctypes.CDLL(str(library))
    peer.take_steps.argtypes = [ctypes.c_void_p, ctypes.c_int64]
    return peer


def kernel_turns(tiles: RecordArray, impacts: RecordArray) -> tuple[Turn, RecordArray]:
    """Return a turn of the numba kernel."""
    tile = tiles[0]
    advance(tile, impacts, STEPS)
    return lambda: advance(tile, impacts, STEPS), tiles


def peer_turns(tiles: RecordArray, peer: ctypes.CDLL) -> tuple[Turn, RecordArray]:
    """Return a turn of the C kernel."""
    address = tiles.ctypes.data
    return lambda: peer.take_steps(address, STEPS), tiles


def scalar_rate(alpha: float) -> float:
    """Return the best impacts per second of the scalar kernel, events written."""
    simulation = Simulation(Parameters(alpha=alpha), State(0, 0.3, 0.0, -0.5))
    best = 0.0
    for _ in range(TURNS):
        start = time.perf_counter()
        simulation.advance(10**9, 0.0, 1000)
        best = max(best, 1000 / (time.perf_counter() - start))
    return best


def rate_with(features: str, alpha: float) -> float:
    """Return the rate in a process that has a plainer processor."""
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, __file__, 'rate', str(alpha)], check=True, text=True,
            stdout=subprocess.PIPE, env=os.environ | {
                'NUMBA_CPU_NAME': 'generic', 'NUMBA_CPU_FEATURES': features,
                'NUMBA_CACHE_DIR': folder})
    return float(done.stdout)


def two_threads(alpha: float) -> float:
    """Return how much faster two threads are than one, in impacts per second."""
    turns = [kernel_turns(filled_tiles(alpha), NO_IMPACTS)[0] for _ in range(2)]

    def work(turn: Turn) -> None:
        for _ in range(TURNS):
            turn()

    ratios = []
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        for _ in range(5):
            start = time.perf_counter()
            work(turns[0])
            one = time.perf_counter() - start
            start = time.perf_counter()
            list(pool.map(work, turns))
            ratios.append(2.0 * one / (time.perf_counter() - start))
    return max(ratios)


def main() -> None:
    """Print the tables."""
    compiler = shutil.which('cc')
    if compiler is None:
        print('no C compiler (cc) here: the C kernel is left out')
    print(f'million impacts per second, one core, {LANES} lanes')
    with tempfile.TemporaryDirectory() as folder:
        for alpha in ALPHAS:
            turns = {
                'lanes, impacts counted': kernel_turns(filled_tiles(alpha), NO_IMPACTS),
                'lanes, impacts written': kernel_turns(filled_tiles(alpha), new_impacts(STEPS)),
            }
            if compiler is not None:
                # Without contraction the C kernel makes the same bits.
                turns['C, the same bits'] = peer_turns(
                    filled_tiles(alpha), built_peer(compiler, folder, '-ffp-contract=off'))
                turns['C, fused multiply-add'] = peer_turns(
                    filled_tiles(alpha), built_peer(compiler, folder, '-ffp-contract=fast'))
            rates = best_rates(turns)
            rates['lanes without AVX-512'] = rate_with(NO_AVX512, alpha)
            rates['lanes without AVX2'] = rate_with(NO_AVX2, alpha)
            rates['scalar, events written'] = scalar_rate(alpha)
            lanes = rates['lanes, impacts counted']
            for name, rate in rates.items():
                print(f'  alpha {alpha:<6} {name:24} {rate / 1e6:6.2f}   {rate / lanes:5.2f}')
            if compiler is not None:
                same = [filled_tiles(alpha), filled_tiles(alpha)]
                kernel_turns(same[0], NO_IMPACTS)
                peer_turns(same[1], built_peer(compiler, folder, '-ffp-contract=off'))[0]()
                equal = all(
                    np.array_equal(same[0][name], same[1][name], equal_nan=True)
                    for name in ('cycle', 'phase', 'velocity', 'duration', 'moved'))
                print(f'  alpha {alpha:<6} C and numba give the same bits: {equal}')
    print(f'  two threads against one: {two_threads(ALPHAS[0]):.2f} '
          '(less than 2 where they share a core)')


if __name__ == '__main__':
    if sys.argv[1:2] == ['rate']:
        print(best_rates({'': kernel_turns(filled_tiles(float(sys.argv[2])), NO_IMPACTS)})[''])
    else:
        main()
