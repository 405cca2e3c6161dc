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
Basins and lifetimes from the start of a process to Zarr on disk, next to what else one would use.

Prints rows of a Markdown table. The parts, each also alone by --only: the first start ever, which
compiles, and the second (`start`); both grids (`basin`, `lifetimes`); the basin again, in turns
with the package of another commit (`against`, where --against names one); one thread and two
beside a control that does nothing but arithmetic (`threads`); a hundredth of a very large basin,
with its memory (`strip`); and the labels of one coarser grid (`peers`) by heyoka (Taylor series
with events), by scipy's solve_ivp, by this package from where the last digit of the phase or the
velocity is another, and in 50 digits, which takes minutes. heyoka needs a separate environment:
name its python in HEYOKA_PYTHON. What is not installed is skipped.
"""

import argparse
from collections.abc import Iterator
import os
from pathlib import Path
import subprocess
import sys
import tempfile
import threading
import time

import numba
import numpy as np
from peers.comparison import Grid, INSIDE, MOVED, PARAMETERS, python_of
from peers.picture import draw

from gear_rattle_ros.attractors.finding import find_attractors
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.store.store import open_dataset

PARTS = ('start', 'basin', 'against', 'lifetimes', 'threads', 'strip', 'peers')
# Options of a tool.
GRIDS = {'basins': ['--alpha', '0.48'], 'lifetimes': ['--alpha', '1.244', '--cap', '5000']}
# Displacements at which peers begin.
BEGINS = {'heyoka': INSIDE, 'heyoka, from s = 0': 0.0, 'scipy': 0.0}
# An error like those that scipy's tolerance leaves [1].
COARSE = 1e-13
TURNS = 2
# Of programs that take turns: the quickest of each counts, the first compiles.
MANY_TURNS = 8
ARITHMETIC = 150_000_000
# A process counts the memory of the one that started it as its own, so a small one starts it.
WATCH = """
import os, sys, time
begin = time.perf_counter()
pid = os.posix_spawn(sys.argv[1], sys.argv[1:], os.environ)
_, status, usage = os.wait4(pid, 0)
print(time.perf_counter() - begin, usage.ru_maxrss / 1024)
sys.exit(os.waitstatus_to_exitcode(status) != 0)
"""
Row = tuple[str, str, str, str]


def run(tool: str, store: Path, *options: str, cache: Path | None = None,
        package: Path | None = None) -> tuple[float, float]:
    """Run a tool in a process of its own; returns seconds and the peak of its memory [MiB]."""
    environment = dict(os.environ)
    if cache is not None:
        environment['NUMBA_CACHE_DIR'] = str(cache)
    if package is not None:
        environment['PYTHONPATH'] = str(package)
        # Both keep their compiled sources.
        environment.pop('PYTHONDONTWRITEBYTECODE', None)
    done = subprocess.run(
        [sys.executable, '-S', '-c', WATCH, sys.executable, '-m', 'gear_rattle_ros.start', tool,
         *options, '--output', str(store)], capture_output=True, env=environment, text=True,
        cwd=package)
    if done.returncode:
        sys.exit(done.stderr)
    seconds, peak = done.stdout.splitlines()[-1].split()
    return float(seconds), float(peak)


def first_and_second(folder: Path) -> Iterator[Row]:
    """Time the first start ever and the second."""
    for words in ('first start ever, which compiles', 'second start'):
        seconds, _ = run('basins', folder / f'{words[:5]}.zarr', '--size', '20',
                         cache=folder / 'cache')
        yield f'basins 20 x 20, {words}', f'{seconds:.2f} s', '-', 'start'


def whole(tool: str, folder: Path, size: int) -> Iterator[Row]:
    """Time a grid from start to disk."""
    options = GRIDS[tool]
    stores = [folder / f'{tool}-{turn}.zarr' for turn in range(TURNS)]
    seconds = min(run(tool, store, '--size', str(size), *options)[0] for store in stores)
    impacts = int(open_dataset(stores[-1])['lifetime'].values.astype(np.int64).sum())
    yield (f'{tool} {size} x {size}, {" ".join(options)}: {impacts / 1e6:,.1f} million impacts of '
           'transients', f'{seconds:.2f} s from start to Zarr', '-',
           tool if tool == 'lifetimes' else 'basin')


def against(folder: Path, size: int, commit: str) -> Iterator[Row]:
    """Time the basin from start to disk, in turns with the package of another commit."""
    here, there = Path(__file__).parents[1], folder / 'there'
    there.mkdir()
    packed = subprocess.run(['git', 'archive', commit, 'gear_rattle_ros'], cwd=here, check=True,
                            stdout=subprocess.PIPE).stdout
    subprocess.run(['tar', '-x', '-C', there], input=packed, check=True)
    turns = [[run('basins', folder / f'against-{turn}-{number}.zarr', '--size', str(size),
                  *GRIDS['basins'], package=package)[0]
              for number, package in enumerate((here, there))] for turn in range(MANY_TURNS)]
    ours, theirs = (min(times) for times in zip(*turns[1:], strict=True))
    yield (f'basins {size} x {size}, {" ".join(GRIDS["basins"])}, {MANY_TURNS - 1} turns',
           f'{ours:.2f} s from start to Zarr', f'{commit}: {theirs:.2f} s, ratio '
           f'{ours / theirs:.2f}', 'against')


@numba.njit(nogil=True)
def arithmetic(count):  # type: ignore[no-untyped-def]
    """Iterate a map in registers: what a processor does without memory."""
    x = 0.3
    for _ in range(count):
        x = 3.9 * x * (1.0 - x)
    return x


def control(threads: int) -> float:
    """Time the same arithmetic, shared out."""
    workers = [threading.Thread(target=arithmetic, args=(ARITHMETIC // threads,))
               for _ in range(threads)]
    begin = time.perf_counter()
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    return time.perf_counter() - begin


def computing(size: int) -> Iterator[Row]:
    """Time the computing alone, with one thread and with two, beside the control."""
    plane = Plane(phases=size, velocities=size)
    initial = plane.cells(PARAMETERS, slice(0, size), slice(0, size))
    draws = plane.draw(PARAMETERS, 1000, 1)
    arithmetic(1)
    best, plain = {1: np.inf, 2: np.inf}, {1: np.inf, 2: np.inf}
    for _ in range(TURNS + 1):
        for threads in (1, 2):
            begin = time.perf_counter()
            catalogue = find_attractors(PARAMETERS, draws, threads=threads)
            catalogue.label(initial, 20_000, threads=threads)
            best[threads] = min(best[threads], time.perf_counter() - begin)
            plain[threads] = min(plain[threads], control(threads))
    what = f'basins {size} x {size}, search and grid computed'
    yield f'{what}, two threads', f'{best[2]:.2f} s', '-', 'threads'
    yield (f'{what}, one thread',
           f'{best[1]:.2f} s: two are {best[1] / best[2]:.2f} times as fast',
           f'plain arithmetic in the same turns: {plain[1] / plain[2]:.2f} times', 'threads')


def strip(folder: Path, size: int) -> Iterator[Row]:
    """Compute a hundredth of a very large basin; report its memory and project its time."""
    rows = max(size // 100, 1)
    seconds, peak = run('basins', folder / 'strip.zarr', '--size', str(size), str(rows),
                        '--velocity', '-0.02', '0.02', '--tile', '500')
    yield (f'basins {size:,} x {rows:,}, a piece of {size:,} x {size:,}',
           f'{seconds:.1f} s, peak memory {peak:.0f} MiB',
           f'all of it: about {seconds * size / rows / 3600.0:.1f} h', 'strip')


def share(chosen: np.ndarray) -> str:
    """Return the share of true ones, with its error."""
    mean = np.mean(chosen)
    return f'{100.0 * mean:.2f} ± {100.0 * np.sqrt(mean * (1.0 - mean) / len(chosen)):.2f} %'


def peers(folder: Path, size: int, fine: int, picture: Path) -> Iterator[Row]:
    """Compare the labels of all programs with ours and with those in 50 digits."""
    grid = Grid(size)
    ours = min((grid.ours() for _ in range(TURNS + 1)), key=lambda found: found.seconds)
    moved = {what: grid.ours(what) for what in MOVED}
    programs = {'basins': ours} | {f'basins, {what} one unit in the last place larger': found
                                   for what, found in moved.items()}
    for name, displacement in BEGINS.items():
        peer = name.split(',')[0]
        if python := python_of(peer):
            programs[name] = grid.theirs(peer, python, folder, displacement)
        else:
            yield f'{name}: not installed, skipped', '-', '-', 'peers'
    # Of ours both the labels and where they change with the last digit of the velocity.
    draw({'basins, and with the velocity moved': (ours.labels, moved['velocity'].labels)}
         | {name: (programs[name].labels, programs[name].labels)
            for name in ('heyoka', 'scipy') if name in programs},
         ours.labels, grid.catalogue, picture)
    print(f'picture: {picture}', file=sys.stderr)
    exact = grid.exact()
    for name, found in (programs | {'50 digits': exact}).items():
        none = found.labels < 0
        yield (f'labels of {size} x {size} initial conditions at 0.48: {name}',
               f'none {share(none)}; other than by `basins` '
               f'{share((found.labels != ours.labels) & ~none)}',
               f'other than in 50 digits {share((found.labels != exact.labels) & ~none)}; '
               f'{found.seconds:.3g} s of one core, {found.seconds / ours.seconds:,.0f} times as '
               'long', 'peers')
    grid = Grid(fine)
    ours = grid.ours()
    for by, words in ((0.0, 'one unit in the last place'), (COARSE, f'{COARSE:g}')):
        for what in MOVED:
            other = grid.ours(what, by).labels != ours.labels
            yield (f'labels of {fine} x {fine} initial conditions at 0.48: basins, {what} {words} '
                   'larger', f'other {share(other)}',
                   f'median lifetime there {np.median(ours.lifetimes[other]):.0f} impacts, '
                   f'elsewhere {np.median(ours.lifetimes[~other]):.0f}', 'peers')


def main() -> None:
    """Print the rows of the parts."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--only', nargs='+', choices=PARTS, default=PARTS, metavar='PART',
                        help=f'which parts: {", ".join(PARTS)}; all by default')
    for name, size, words in (('size', 400, 'cells along an edge of both grids'),
                              ('strip', 20_000, 'cells along an edge of the very large basin'),
                              ('peers', 30, 'cells along an edge of the grid for peers')):
        parser.add_argument(f'--{name}', type=int, default=size, metavar='N',
                            help=f'{words}; {size} by default')
    parser.add_argument('--against', metavar='COMMIT', help='a commit to compare the basin with')
    parser.add_argument('--picture', type=Path, default=Path(tempfile.gettempdir())
                        / 'disagreement.png', help='where the peers differ')
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        parts = {'start': first_and_second(folder),
                 'basin': whole('basins', folder, given.size),
                 'against': against(folder, given.size, given.against) if given.against else (),
                 'lifetimes': whole('lifetimes', folder, given.size),
                 'threads': computing(given.size),
                 'strip': strip(folder, given.strip),
                 'peers': peers(folder, given.peers, given.size, given.picture)}
        print('| what | measured | beside it | `python benchmark/basins.py --only` |')
        print('|---|---|---|---|', flush=True)
        for part in PARTS:
            if part in given.only:
                for row in parts[part]:
                    print(f'| {" | ".join(row)} |', flush=True)


if __name__ == '__main__':
    main()
