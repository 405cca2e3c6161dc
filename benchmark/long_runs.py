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
Statistics of long runs against independent integrators, at parameters far beyond the paper's.

At each setting random states are followed here and, other ones, by a peer: scipy's DOP853 and
heyoka's Taylor series, neither with a closed form of a flight or a rest. Every trajectory is
sampled once, after a fixed number of impacts, and a permutation test decides whether both samples
are of one distribution. The p-values of all settings are judged together. The peer's states are
followed here too, and impacts compared one by one as long as errors cannot have grown much.

That the tests see wrong physics is tried on this package itself; --wrong tries it on the peers,
and then ends with status 1. heyoka needs a separate environment: name its python in HEYOKA_PYTHON.
What is not installed is skipped with a message. Status 1 too where a peer disagrees.
"""

import argparse
from collections.abc import Callable
import dataclasses
import math
from pathlib import Path
import subprocess
import sys
import tempfile
import time

import numpy as np
from peers.comparison import python_of
from peers.samples import compare, own_rows, path_errors, random_states, samples

CHAINS = Path(__file__).with_name('peers') / 'chains.py'
Array = np.ndarray
# alpha, beta, gamma, restitution: every special value once; the others are drawn.
SPECIAL = [(1.5, 0.0, 0.1, 1.0), (2.0, 0.0, 0.0, 1.0), (10.0, 0.0, 0.0, 0.5),
           (0.6, 0.1, 0.1, 0.0), (10.0, 0.0, -0.4, 0.0), (0.0, 0.0, -0.3, 0.8),
           (0.3, 0.5, 0.0, 0.6), (10.0, 10.0, -2.0, 0.4)]
# What is wrong there, and how it changes the parameters.
WRONG: dict[str, tuple[str, Callable[[Array], Array]]] = {
    'restitution': ('restitution 0.02 lower (higher at 0)',
                    lambda p: p + np.outer(np.where(p[:, 3] > 0.02, -0.02, 0.02), [0, 0, 0, 1])),
    'gamma': ('sign of gamma', lambda p: p * [1, 1, -1, 1]),
    'drive': ('drive 2 % stronger', lambda p: p * [1.02, 1, 1, 1]),
    'damping': ('beta 0.02 larger', lambda p: p + [0, 0.02, 0, 0])}
# Share of trials that is rejected although all physics is right.
LEVEL = 0.01
# Largest difference of compared impacts [rad, 1].
PATHS = 1e-9


@dataclasses.dataclass(frozen=True)
class Size:
    """What a peer has the time for."""

    trajectories: int
    impacts: int
    periods: int


SIZES = {'heyoka': Size(800, 50, 100), 'scipy': Size(100, 14, 28)}
QUICK = {'heyoka': Size(400, 40, 80), 'scipy': Size(40, 10, 20)}


def drawn_settings(count: int, seed: int) -> Array:
    """Return the special settings and as many others as are wanted, all at random."""
    random = np.random.default_rng(seed)
    rows = list(SPECIAL)
    while len(rows) < count:
        alpha = math.exp(random.uniform(math.log(0.3), math.log(10.0)))
        beta = random.choice([0.0, 10.0**random.uniform(-3.0, 0.3)], p=[0.2, 0.8])
        gamma = random.choice([0.0, alpha * 10.0**random.uniform(-2.0, -0.2)], p=[0.15, 0.85])
        restitution = random.choice([0.0, 1.0, random.uniform()], p=[0.1, 0.1, 0.8])
        rows.append((alpha, beta, gamma * random.choice([-1.0, 1.0]), restitution))
    # As they are printed.
    return np.array([[float(f'{value:.4g}') for value in row] for row in rows[:count]])


def holm(ps: list[float]) -> Array:
    """Return which are rejected at LEVEL for all of them together."""
    order = np.argsort(ps)
    passed = np.sort(ps) <= LEVEL / (len(ps) - np.arange(len(ps)))
    rejected = np.zeros(len(ps), bool)
    rejected[order[:int(np.logical_and.accumulate(passed).sum())]] = True
    return rejected


def fisher(ps: list[float]) -> float:
    """Return the p-value of all p-values together: too many that are small."""
    half = -float(np.sum(np.log(ps)))
    terms = np.cumsum([0.0, *(math.log(half / k) for k in range(1, len(ps)))])
    return float(np.exp(terms - half).sum())


def uniformity(ps: list[float]) -> float:
    """Return the p-value of a Kolmogorov-Smirnov test of p-values for uniformity."""
    placed, n = np.sort(ps), len(ps)
    steps = np.arange(n + 1) / n
    d = max(np.max(placed - steps[:-1]), np.max(steps[1:] - placed))
    x = d * (math.sqrt(n) + 0.12 + 0.11 / math.sqrt(n))
    return float(np.clip(2.0 * sum((-1)**(k - 1) * math.exp(-2.0 * k * k * x * x)
                                   for k in range(1, 101)), 0.0, 1.0))


def verdict(ps: list[float]) -> tuple[bool, str]:
    """Judge the p-values of all settings together."""
    rejected, together, uniform = holm(ps), fisher(ps), uniformity(ps)
    bad = bool(rejected.any()) or min(together, uniform) < 0.1 * LEVEL
    return bad, (f'{rejected.sum()} of {len(ps)} settings rejected (Holm, {LEVEL:.0%}), smallest '
                 f'p = {min(ps):.2g}, all together p = {together:.2g} (Fisher), uniformity '
                 f'p = {uniform:.2g}')


def sample_here(settings: Array, size: Size, seed: int) -> list[Array]:
    """Return samples of this package at all settings, from states drawn here."""
    return [samples(own_rows(random_states(size.trajectories, seed + k), setting, size.impacts,
                             size.periods), size.trajectories, setting[3])
            for k, setting in enumerate(settings)]


def judge(ours: list[Array], theirs: list[Array], seed: int) -> tuple[list[float], list[str]]:
    """Return p and the statistic that differs most, for all settings."""
    random = np.random.default_rng(seed)
    pairs = [compare(one, two, random) for one, two in zip(ours, theirs, strict=True)]
    return [p for p, _ in pairs], [worst for _, worst in pairs]


def run_peer(peer: str, python: str, states: Array, settings: Array, size: Size,
             folder: Path) -> tuple[list[Array], float]:
    """Let a peer follow states at all settings; its rows, and seconds of its processor time."""
    job, out = folder / 'job.npz', folder / 'out.npz'
    np.savez(job, states=states, settings=settings, most=size.impacts,
             until=2.0 * math.pi * size.periods)
    done = subprocess.run([python, str(CHAINS), peer, str(job), str(out)], check=True,
                          stdout=subprocess.PIPE, text=True)
    with np.load(out) as found:
        return [found[str(k)] for k in range(len(settings))], float(done.stdout)


def against(peer: str, python: str, settings: Array, size: Size, wrong: str, seed: int,
            folder: Path) -> bool:
    """Compare with a peer; print a table, and return whether it disagrees."""
    states = random_states(size.trajectories, seed)
    theirs = WRONG[wrong][1](settings) if wrong else settings
    begin = time.process_time()
    ours = sample_here(settings, size, seed + 1000)
    seconds = time.process_time() - begin
    rows, their_seconds = run_peer(peer, python, states, theirs, size, folder)
    other = [samples(found, size.trajectories, setting[3])
             for found, setting in zip(rows, theirs, strict=True)]
    ps, worst = judge(ours, other, seed)
    print(f'\n{peer}: {len(settings)} settings, {size.trajectories} trajectories each here and '
          f'there, {size.impacts} impacts each, {sum(map(len, rows)):,} by {peer} in '
          f'{their_seconds:.0f} s, here in {seconds:.0f} s'
          + (f'; wrong there: {WRONG[wrong][0]}' if wrong else ''))
    print('| alpha | beta | gamma | r | p | most different | rest | impacts one by one | '
          'largest difference |\n|---|---|---|---|---|---|---|---|---|')
    compared, largest = 0, 0.0
    for k, setting in enumerate(settings):
        count, error = path_errors(states, setting, rows[k], size.impacts, size.periods)
        compared, largest = compared + count, max(largest, error)
        rest = ours[k][:, 6].clip(0.0).mean() * 1e-4
        print(f'| {" | ".join(f"{value:g}" for value in setting)} | {ps[k]:.4f} | {worst[k]} | '
              f'{rest:.1%} | {count} | {error:.1e} |', flush=True)
    bad, words = verdict(ps)
    far = largest > PATHS
    print(f'{peer}: {words}: {"REJECTED" if bad else "agrees"}')
    print(f'{peer}: {compared:,} impacts one by one, largest difference {largest:.1e}, bound '
          f'{PATHS:g}: {"EXCEEDED" if far else "kept"}')
    return bad or far


def power(settings: Array, size: Size, seed: int) -> bool:
    """Try the tests on this package with wrong physics; return whether they fail to see it."""
    right = sample_here(settings, size, seed + 2000)
    blind, text = verdict(judge(right, sample_here(settings, size, seed + 3000), seed)[0])
    print(f'\nwrong physics here, {size.trajectories} trajectories, {size.impacts} impacts each\n'
          f'nothing wrong: {text}: {"REJECTED" if blind else "passes"}')
    for what, change in WRONG.values():
        wrong = sample_here(change(settings), size, seed + 3000)
        bad, text = verdict(judge(right, wrong, seed)[0])
        blind = blind or not bad
        print(f'{what}: {text}: {"seen" if bad else "NOT SEEN"}', flush=True)
    return blind


def main() -> int:
    """Compare with every peer that is installed."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--settings', type=int, default=24, metavar='N',
                        help='how many values of the parameters; 24 by default')
    parser.add_argument('--seed', type=int, default=1, help='seed of parameters and states')
    parser.add_argument('--quick', action='store_true', help='fewer and shorter trajectories')
    parser.add_argument('--wrong', choices=WRONG, default='', help='let the peers be wrong in it')
    parser.add_argument('--only', choices=(*SIZES, 'power'), nargs='+',
                        default=(*SIZES, 'power'), help='which parts')
    given = parser.parse_args()
    sizes = QUICK if given.quick else SIZES
    settings = drawn_settings(given.settings, given.seed)
    bad, compared = False, 0
    with tempfile.TemporaryDirectory() as name:
        for number, (peer, size) in enumerate(sizes.items(), 1):
            if peer not in given.only:
                continue
            python = python_of(peer)
            if not python:
                print(f'\n{peer}: not installed, SKIPPED'
                      + ('; name a Python that has it in HEYOKA_PYTHON' if peer == 'heyoka'
                         else ''))
                continue
            compared += 1
            bad |= against(peer, python, settings, size, given.wrong,
                           10_000 * given.seed + 100_000 * number, Path(name))
    if not compared and (given.wrong or given.only == (*SIZES, 'power')):
        parser.error('nothing was compared: no peer is installed or asked for')
    if 'power' in given.only and not given.wrong:
        # What the fewest trajectories see, more see as well.
        bad |= power(settings, sizes['scipy'], 10_000 * given.seed + 500_000)
    return int(bad)


if __name__ == '__main__':
    sys.exit(main())
