"""
Basins and lifetimes from the start of a process to Zarr on disk, next to what else one would use.

Told are: the first start ever, which compiles, and the second; both grids against their targets;
one thread and two beside a control that does nothing but arithmetic; and the labels that heyoka
(Taylor series with events) and scipy's solve_ivp give on a coarser grid, compared one by one, with
a sample of the starts on which they differ decided in 50 digits. heyoka wants an environment of
its own: name its python in HEYOKA_PYTHON. What is not installed is skipped.
"""

import argparse
import os
from pathlib import Path
import random
import resource
import subprocess
import sys
import tempfile
import threading
import time

import numba
import numpy as np
from peers.arbiter import label_of
from peers.picture import draw

from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.offline.grid import Plane
from gear_rattle_ros.offline.search import Catalogue, find_attractors, settle
from gear_rattle_ros.offline.store import open_dataset

FOLLOW = Path(__file__).with_name('peers') / 'follow.py'
# Tool, options, target [s].
TARGETS = (
    ('basins', ['--alpha', '0.48'], 3.0),
    ('lifetimes', ['--alpha', '1.244', '--cap', '5000'], 25.0),
)
# Peer, cells along an edge of its grid, impacts of each start.
PEERS = (('heyoka', 50, 400), ('scipy', 10, 250))
NEAR = 0.02
TURNS = 2
# Starts on which a peer differs that are decided in 50 digits.
SAMPLE = 8
ARITHMETIC = 150_000_000


def run(tool: str, store: Path, *options: str, cache: Path | None = None) -> float:
    """Run a tool in a process of its own; returns seconds."""
    environment = dict(os.environ)
    if cache is not None:
        environment['NUMBA_CACHE_DIR'] = str(cache)
    begin = time.perf_counter()
    subprocess.run([sys.executable, '-m', 'gear_rattle_ros.start', tool, *options, '--output',
                    str(store)], check=True, capture_output=True, env=environment)
    return time.perf_counter() - begin


def starts_of_processes(folder: Path) -> None:
    """Time the first start ever and the second."""
    first, second = (run('basins', folder / f'small-{turn}.zarr', '--size', '20',
                         cache=folder / 'cache') for turn in (1, 2))
    print(f'basins 20 x 20: {first:.1f} s at the first start ever, which compiles; then '
          f'{second:.2f} s (target 2 s)')


def whole(folder: Path) -> None:
    """Time both grids from start to disk."""
    for tool, options, target in TARGETS:
        stores = [folder / f'{tool}-{turn}.zarr' for turn in range(TURNS)]
        seconds = min(run(tool, store, '--size', '400', *options) for store in stores)
        dataset = open_dataset(stores[-1])
        impacts = int(dataset['lifetime'].values.astype(np.int64).sum())
        print(f'{tool} 400 x 400, {" ".join(options)}: {seconds:.2f} s from start to Zarr (target '
              f'{target:g} s): {impacts / 1e6:,.1f} million impacts of transients')


def search(alpha: float, plane: Plane, threads: int | None = None) -> Catalogue:
    """Find the attractors as the tool does."""
    parameters = Parameters(alpha=alpha)
    return find_attractors(parameters, plane.random_starts(parameters, 1000, 1), threads=threads)


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


def computing() -> None:
    """Time the computing alone, with one thread and with two, beside the control."""
    plane = Plane()
    starts = plane.starts(Parameters(alpha=0.48), slice(0, 400), slice(0, 400))
    arithmetic(1)
    best, plain = {1: np.inf, 2: np.inf}, {1: np.inf, 2: np.inf}
    for _ in range(TURNS + 1):
        for threads in (1, 2):
            begin = time.perf_counter()
            settle(starts, 20_000, search(0.48, plane, threads).table(), threads)
            best[threads] = min(best[threads], time.perf_counter() - begin)
            plain[threads] = min(plain[threads], control(threads))
    print(f'  of which computing, the search for attractors included: {best[2]:.2f} s (target '
          f'1.5 s) with two threads, {best[1]:.2f} s with one: {best[1] / best[2]:.2f} times as '
          f'fast; arithmetic alone in the same turns: {plain[1] / plain[2]:.2f} times')


def strip(folder: Path) -> None:
    """Compute a hundredth of a basin of 20,000 x 20,000; tell its memory and project its time."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    seconds = run('basins', folder / 'strip.zarr', '--size', '20000', '200', '--velocity', '-0.02',
                  '0.02', '--tile', '500')
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    print(f'basins 20,000 x 200, a hundredth of 20,000 x 20,000: {seconds:.1f} s, so about '
          f'{seconds / 36.0:.1f} h for all; peak memory {max(before, peak) / 1024:.0f} MiB')


def compare(peer: str, size: int, count: int, folder: Path) -> tuple[np.ndarray, ...] | None:
    """Follow a grid by a peer and by the lanes; returns both grids of labels."""
    python = (os.environ.get('HEYOKA_PYTHON') if peer == 'heyoka' else None) or sys.executable
    if subprocess.run([python, '-c', f'import {peer}'], capture_output=True).returncode:
        print(f'  {peer}: not installed for {python}, skipped'
              + ('; see HEYOKA_PYTHON' if peer == 'heyoka' else ''))
        return None
    parameters, plane = Parameters(alpha=0.48), Plane(phases=size, velocities=size)
    starts = plane.starts(parameters, slice(0, size), slice(0, size))
    np.save(folder / 'starts.npy', np.stack([starts['phase'], starts['velocity']], axis=1))
    done = subprocess.run(
        [python, str(FOLLOW), peer, str(folder / 'starts.npy'), str(folder / 'last.npy'),
         str(count)], check=True, capture_output=True, text=True)
    theirs_seconds = float(done.stdout)
    last = np.load(folder / 'last.npy')
    catalogue = search(0.48, plane)
    table = catalogue.table()
    begin = time.perf_counter()
    result = settle(starts, 20_000, table)
    seconds = time.perf_counter() - begin
    ours = result['label']
    theirs = np.full(len(starts), -1)
    for number, orbit in enumerate(catalogue.orbits):
        for phase, velocity in zip(orbit.phases, orbit.velocities, strict=True):
            near = (np.abs(np.sin(0.5 * (last[:, 0] - phase))) < 0.5 * NEAR) & (
                np.abs(last[:, 1] - velocity) < NEAR)
            theirs[near] = number
    agree = ours == theirs
    print(f'  {peer}: {size} x {size} starts, {np.mean(agree):.2%} of the labels agree; '
          f'{np.mean(~agree & (theirs >= 0)):.2%} are others, {np.mean(theirs < 0):.2%} have '
          f'none; {theirs_seconds:.2f} s, {theirs_seconds / seconds:,.0f} times as long as here '
          f'({seconds:.4f} s); at most {len(starts) * count / theirs_seconds:,.0f} impacts/s')
    decide(peer, starts, ours, theirs, result['lifetime'], catalogue)
    return ours.reshape(size, size), theirs.reshape(size, size)


def decide(peer: str, starts: np.ndarray, ours: np.ndarray, theirs: np.ndarray,
           lifetimes: np.ndarray, catalogue: Catalogue) -> None:
    """Follow a sample of the starts that differ in 50 digits."""
    orbits = [list(zip(orbit.phases.tolist(), orbit.velocities.tolist(), strict=True))
              for orbit in catalogue.orbits]
    for words, chosen in (('has another label', (ours != theirs) & (theirs >= 0)),
                          ('has none', theirs < 0), ('agrees', ours == theirs)):
        cells = np.flatnonzero(chosen).tolist()
        sample = random.Random(1).sample(cells, min(SAMPLE, len(cells)))
        if not sample:
            continue
        right = [label_of(starts['phase'][n], starts['velocity'][n], orbits) for n in sample]
        print(f'    where it {words}, {len(sample)} starts in 50 digits: as here '
              f'{sum(ours[n] == label for n, label in zip(sample, right, strict=True))}, as '
              f'{peer} {sum(theirs[n] == label for n, label in zip(sample, right, strict=True))} '
              f'(median lifetime {np.median(lifetimes[chosen]):.0f} impacts)')


def main() -> None:
    """Print all figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--peers-only', action='store_true')
    parser.add_argument('--picture', type=Path, default=Path(tempfile.gettempdir())
                        / 'disagreement.png', help='where the peers differ')
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if not given.peers_only:
            starts_of_processes(folder)
            whole(folder)
            computing()
            strip(folder)
        print('the same labels by others, at alpha 0.48:')
        grids = {peer: compare(peer, size, count, folder) for peer, size, count in PEERS}
        draw({peer: found for peer, found in grids.items() if found}, given.picture)


if __name__ == '__main__':
    main()
