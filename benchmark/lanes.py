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
shared; seconds are of CPU time. C takes the short way; flights for which that fails are searched
by numba in both. The scalar kernel is timed beside them, then numba again without AVX-512 and
without AVX2, and two threads. With --against COMMIT the kernel and that of another commit take
turns from the same states in many regimes instead, and totals count; the exit status is 1 where
the ratio of the rates is too low. Run: make bench, or python benchmark/lanes.py
"""

import argparse
from collections.abc import Callable, Iterator
import concurrent.futures
import contextlib
import ctypes
import itertools
import math
import os
from pathlib import Path
import shutil
import subprocess
import sys
import tempfile
import time
import types
from typing import Any

import numba
import numpy as np

from gear_rattle_ros.core.arrays import RecordArray
from gear_rattle_ros.core.flight import lanes, lanes_step, lanes_stride, stretches
from gear_rattle_ros.core.flight.lanes import INITIAL, new_impacts, new_tiles, NO_IMPACTS, refill
from gear_rattle_ros.core.flight.lanes_step import LANES
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import Parameters, State

Regime = tuple[float, float, float, float]
# alpha, beta, gamma, r: first those of the paper.
REGIMES: tuple[Regime, ...] = (
    (0.48, 0.1, 0.1, 0.9), (1.244, 0.1, 0.1, 0.9), (0.57, 0.1, 0.1, 0.9), (1.5, 0.1, 0.1, 0.9),
    (0.2, 0.1, 0.1, 0.9), (0.09, 0.1, 0.1, 0.9), (0.12, 0.1, 0.1, 0.9), (0.3, 0.1, 0.1, 0.9),
    (0.48, 0.0, 0.0, 0.5), (0.48, 0.3, 0.1, 0.9), (2.0, 0.3, 0.3, 0.8), (5.0, 0.1, 0.1, 0.9),
    (100.0, 0.1, 0.1, 0.9), (100.0, 0.01, 1.0, 0.7), (1.0, 0.0, 0.5, 0.95),
    (0.48, 0.1, 0.45, 0.9), (0.48, 0.1, 0.1, 0.5), (0.48, 1.0, 0.1, 0.9), (10.0, 5.0, 1.0, 0.9),
    (0.48, 0.0, 0.1, 1.0))
PAPER = REGIMES[:2]
# Least ratios of the rate to that of another commit.
LEAST = dict.fromkeys(REGIMES, 0.95) | dict.fromkeys(PAPER, 2.0)
TURNS = 400
STEPS = 60
# More impacts than a lane makes in a turn.
MANY = 1e6
# With --against: pairs of processes, for where memory lies makes some percent; turns of each,
# after one that compiles; and tiles of states.
PAIRS, RACES, TILES = 4, 10, 4
ROOT = Path(__file__).parents[1]
RACE = ROOT / 'benchmark' / 'peers' / 'lanes_race.py'
# What the C kernel shares with the Python files.
SHARED = {
    lanes_stride: ('LANES', 'VECTOR', 'ROUNDS', 'WAITS', 'SEARCHED', 'STICKING_SPEED'),
    stretches: ('BLUR', 'REMAINDER', 'REMAINDER_1', 'STRIKES', 'ASIDE', 'LAST_ERROR', 'NEAREST',
                'SERIES_MAXIMUM', 'OPEN', 'BRACKETED', 'TURNS', 'FURTHER'),
}
# Threaded jumps would keep gcc from vectorising some of the loops.
FLAGS = ('-O3', '-march=native', '-mprefer-vector-width=512', '-fno-math-errno',
         '-fno-trapping-math', '-fno-thread-jumps', '-shared', '-fPIC')
# The C kernel without contraction.
SAME = 'C, the same bits'
# Features of processors that numba is to leave aside.
NO_AVX512 = '+avx2,+avx,+fma,+sse4.2'
NO_AVX2 = '+sse4.2'
# A numba kernel.
Kernel = Any
Turn = Callable[[], None]


def filled_tiles(regime: Regime, count: int = 1) -> RecordArray:
    """Return tiles whose trajectories have been going for a while, or begin anew if they end."""
    random = np.random.default_rng(1)
    tiles = new_tiles(count)
    for tile in tiles:
        initial = np.zeros(LANES, INITIAL)
        initial['phase'] = random.uniform(0.0, 2.0 * math.pi, LANES)
        initial['velocity'] = random.uniform(-1.0, 0.0, LANES)
        for name, value in zip(('alpha', 'beta', 'gamma', 'restitution'), regime, strict=True):
            initial[name] = value
        refill(tile, initial, 0, math.inf)
        lanes.advance(tile, NO_IMPACTS, 5000)
        for i in range(LANES):
            if tile['end'][i] != lanes.RUNS:
                lanes.release(tile, i)
                refill(tile, initial[i:i + 1], 0, math.inf)
    return tiles


def best_rates(turns: dict[str, tuple[Turn, RecordArray]]) -> dict[str, float]:
    """Let all take turns and return the best impacts per second of each."""
    best = dict.fromkeys(turns, 0.0)
    for _ in range(TURNS):
        for name, (turn, tiles) in turns.items():
            left = tiles['left'][:, :LANES]
            left[:] = MANY
            start = time.thread_time()
            turn()
            elapsed = time.thread_time() - start
            best[name] = max(best[name], (MANY - left).sum() / elapsed)
    return best


def header() -> str:
    """Return what the C kernel shares with the Python files: constants and the tile."""
    constants = ''.join(f'#define {name} {getattr(module, name)!r}\n'
                        for module, names in SHARED.items() for name in names)
    tile = lanes_step.TILE
    rows = ''.join(f'    {"int64_t" if name in lanes_step.WHOLE else "double"} '
                   f'{name}[{tile[name].shape[0]}];\n' for name in tile.names or ())
    return f'#include <stdint.h>\n{constants}typedef struct {{\n{rows}}} tile;\n'


def built_peer(compiler: str, folder: str, contraction: str) -> Kernel:
    """Return `advance` with the C kernel in it, compiled."""
    shared, library = Path(folder, 'lanes.h'), Path(folder, f'lanes_{contraction}.so')
    shared.write_text(header())
    subprocess.run([compiler, *FLAGS, f'-ffp-contract={contraction}', '-include', shared,
                    Path(__file__).with_suffix('.c'), '-o', library, '-lm'], check=True)
    peer = ctypes.CDLL(str(library)).stride
    peer.argtypes, peer.restype = [ctypes.c_void_p, ctypes.c_int64], ctypes.c_int64
    waits = lanes_step.WAITS

    @numba.njit(nogil=True)
    def stride(tile, turns):  # type: ignore[no-untyped-def]
        # The first row is where the tile is.
        found = peer(tile.cycle.ctypes, turns)
        return found % waits, found // waits

    def with_other(kernel: Kernel, **names: Kernel) -> Kernel:
        function = kernel.py_func
        return numba.njit(nogil=True, error_model='numpy')(
            types.FunctionType(function.__code__, function.__globals__ | names))

    return with_other(lanes.advance, move=with_other(lanes.move, stride=stride))


def turns_of(advance: Kernel, alpha: float, impacts: RecordArray) -> tuple[Turn, RecordArray]:
    """Return a turn of a kernel, and its tile."""
    tiles = filled_tiles((alpha, *PAPER[0][1:]))
    tile = tiles[0]
    advance(tile, impacts, STEPS)
    return lambda: advance(tile, impacts, STEPS), tiles


def agreeing(peer: Kernel) -> int:
    """Return in how many regimes a kernel leaves the same bits in all of a tile."""
    count = 0
    for regime in REGIMES:
        ours, theirs = filled_tiles(regime), filled_tiles(regime)
        lanes.advance(ours[0], NO_IMPACTS, 10 * STEPS)
        peer(theirs[0], NO_IMPACTS, 10 * STEPS)
        count += all(np.array_equal(ours[name], theirs[name], equal_nan=True)
                     for name in lanes_step.TILE.names or ())
    return count


def scalar_rate(alpha: float) -> float:
    """Return the best impacts per second of the scalar kernel, events written."""
    simulation = Simulation(Parameters(alpha=alpha), State(0, 0.3, 0.0, -0.5))
    best = 0.0
    for _ in range(TURNS):
        start = time.thread_time()
        simulation.advance(10**9, 0.0, 1000)
        best = max(best, 1000 / (time.thread_time() - start))
    return best


def plainer(features: str, folder: str) -> dict[str, str]:
    """Return the environment of a process that has a plainer processor, or this if none."""
    return dict(os.environ) | ({} if not features else {
        'NUMBA_CPU_NAME': 'generic', 'NUMBA_CPU_FEATURES': features, 'NUMBA_CACHE_DIR': folder})


def rate_with(features: str, alpha: float) -> float:
    """Return the rate in a process that has a plainer processor."""
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, __file__, 'rate', str(alpha)], check=True, text=True,
            stdout=subprocess.PIPE, env=plainer(features, folder))
    return float(done.stdout)


def two_threads(alpha: float) -> float:
    """Return how much faster two threads are than one, in impacts per second."""
    turns = [turns_of(lanes.advance, alpha, NO_IMPACTS)[0] for _ in range(2)]

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


def race_against(folder: Path, features: str) -> Iterator[tuple[float, float]]:
    """Return impacts per second of both kernels in each regime."""
    totals = np.zeros((2, len(REGIMES), 2))
    for _ in range(PAIRS):
        with contextlib.ExitStack() as stack:
            runners = [stack.enter_context(subprocess.Popen(
                [sys.executable, RACE, folder / 'states.npy'], stdin=subprocess.PIPE,
                stdout=subprocess.PIPE, text=True, bufsize=1,
                env=plainer(features, str(folder)) | {'PYTHONPATH': str(package)}))
                for package in (ROOT, folder)]
            for turn, k in itertools.product(range(RACES + 1), range(len(REGIMES))):
                for runner, total in zip(runners, totals, strict=True):
                    assert runner.stdin is not None and runner.stdout is not None
                    print(k, file=runner.stdin)
                    result = [float(word) for word in runner.stdout.readline().split()]
                    if turn > 0:
                        total[k] += result
    rates = totals[:, :, 0] / totals[:, :, 1]
    return zip(*rates.tolist(), strict=True)


def against(commit: str) -> bool:
    """Print a table of the rates of this kernel and another; return whether all are good."""
    good = True
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        packed = subprocess.run(
            ['git', 'archive', commit, 'gear_rattle_ros'], cwd=ROOT, check=True,
            stdout=subprocess.PIPE).stdout
        subprocess.run(['tar', '-x', '-C', folder], input=packed, check=True)
        states = np.zeros((len(REGIMES), TILES * LANES), INITIAL)
        for row, regime in zip(states, REGIMES, strict=True):
            tiles = filled_tiles(regime, TILES)
            for field in INITIAL.names or ():
                row[field] = tiles[field][:, :LANES].ravel()
        np.save(folder / 'states.npy', states)
        print(f'million impacts per second, one core: here, at {commit}, ratio')
        for words, features in (('all features', ''), ('without AVX-512', NO_AVX512)):
            print(words)
            rates = race_against(folder, features)
            for regime, (ours, theirs) in zip(REGIMES, rates, strict=True):
                ratio = ours / theirs
                enough = ratio >= LEAST[regime]
                good &= enough
                print(f'  alpha {regime[0]:<6} beta {regime[1]:<5} gamma {regime[2]:<5} '
                      f'r {regime[3]:<5} {ours / 1e6:6.2f} {theirs / 1e6:6.2f} {ratio:6.2f}'
                      f'{"" if enough else f"   below {LEAST[regime]}"}', flush=True)
    return good


def main() -> None:
    """Print the tables."""
    compiler = shutil.which('cc')
    if compiler is None:
        print('no C compiler (cc) here: the C kernel is left out')
    print(f'million impacts per second, one core, {LANES} lanes')
    with tempfile.TemporaryDirectory() as folder:
        peers = {} if compiler is None else {
            name: built_peer(compiler, folder, contraction) for name, contraction in (
                (SAME, 'off'), ('C, fused multiply-add', 'fast'))}
        for alpha, *_ in PAPER:
            turns = {
                'lanes, impacts counted': turns_of(lanes.advance, alpha, NO_IMPACTS),
                'lanes, impacts written': turns_of(lanes.advance, alpha, new_impacts(STEPS)),
            }
            for name, peer in peers.items():
                turns[name] = turns_of(peer, alpha, NO_IMPACTS)
            rates = best_rates(turns)
            rates['lanes without AVX-512'] = rate_with(NO_AVX512, alpha)
            rates['lanes without AVX2'] = rate_with(NO_AVX2, alpha)
            rates['scalar, events written'] = scalar_rate(alpha)
            counted = rates['lanes, impacts counted']
            for name, rate in rates.items():
                print(f'  alpha {alpha:<6} {name:24} {rate / 1e6:6.2f}   {rate / counted:5.2f}')
        if peers:
            print('  C and numba give the same bits in '
                  f'{agreeing(peers[SAME])} of {len(REGIMES)} regimes')
    print(f'  two threads against one: {two_threads(PAPER[0][0]):.2f} '
          '(less than 2 where they share a core)')


if __name__ == '__main__':
    if sys.argv[1:2] == ['rate']:
        plain = turns_of(lanes.advance, float(sys.argv[2]), NO_IMPACTS)
        print(best_rates({'': plain})[''])
    else:
        parser = argparse.ArgumentParser(
            description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
        parser.add_argument('--against', metavar='COMMIT', help='a commit to compare with')
        commit = parser.parse_args().against
        if commit is None:
            main()
        else:
            sys.exit(not against(commit))
