"""
Basins and lifetimes from the start of a process to Zarr on disk, next to what else one would use.

The peers, heyoka (Taylor series with events) and scipy's solve_ivp, follow the starts of a coarse
grid and are compared label by label; where they disagree the difference is drawn. heyoka wants an
environment of its own: name its python in HEYOKA_PYTHON. What is not installed is skipped.
"""

import argparse
import os
from pathlib import Path
import subprocess
import sys
import tempfile
import time

import numpy as np

from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.offline.grid import Plane
from gear_rattle_ros.offline.search import find_attractors, settle
from gear_rattle_ros.offline.store import open_dataset

FOLLOW = Path(__file__).with_name('peers') / 'follow.py'
# Tool, options, target [s].
TARGETS = (
    ('basins', ['--alpha', '0.48'], 3.0),
    ('lifetimes', ['--alpha', '1.244', '--cap', '5000'], 25.0),
)
# Peer, cells along an edge of its grid, impacts of each start.
PEERS = (('heyoka', 40, 400), ('scipy', 8, 250))
NEAR = 0.02
TURNS = 2


def timed(tool: str, options: list[str], folder: Path) -> tuple[float, int]:
    """Run a tool in a process of its own; returns seconds and impacts of all lifetimes."""
    best = np.inf
    for turn in range(TURNS + 1):
        store = folder / f'{tool}-{turn}.zarr'
        begin = time.perf_counter()
        subprocess.run([sys.executable, '-m', 'gear_rattle_ros.start', tool, '--size', '400',
                        *options, '--output', str(store)], check=True, capture_output=True)
        seconds = time.perf_counter() - begin
        if turn:
            best = min(best, seconds)
        else:
            print(f'  first run, which may compile: {seconds:.1f} s')
    return best, int(open_dataset(store)['lifetime'].values.astype(np.int64).sum())


def compare(peer: str, size: int, count: int, folder: Path) -> None:
    """Follow a grid by a peer and by the lanes."""
    python = (os.environ.get('HEYOKA_PYTHON') if peer == 'heyoka' else None) or sys.executable
    if subprocess.run([python, '-c', f'import {peer}'], capture_output=True).returncode:
        print(f'  {peer}: not installed for {python}, skipped'
              + ('; see HEYOKA_PYTHON' if peer == 'heyoka' else ''))
        return
    parameters, plane = Parameters(alpha=0.48), Plane(phases=size, velocities=size)
    starts = plane.starts(parameters, slice(0, size), slice(0, size))
    np.save(folder / 'starts.npy', np.stack([starts['phase'], starts['velocity']], axis=1))
    done = subprocess.run(
        [python, str(FOLLOW), peer, str(folder / 'starts.npy'), str(folder / 'last.npy'),
         str(count)], check=True, capture_output=True, text=True)
    theirs_seconds = float(done.stdout)
    last = np.load(folder / 'last.npy')
    catalogue = find_attractors(parameters, plane.random_starts(parameters, 500, 1))
    table = catalogue.table()
    begin = time.perf_counter()
    ours = settle(starts, 20_000, table)['label']
    seconds = time.perf_counter() - begin
    theirs = np.full(len(starts), -1)
    for number, orbit in enumerate(catalogue.orbits):
        for phase, velocity in zip(orbit.phases, orbit.velocities, strict=True):
            near = (np.abs(np.sin(0.5 * (last[:, 0] - phase))) < 0.5 * NEAR) & (
                np.abs(last[:, 1] - velocity) < NEAR)
            theirs[near] = number
    agree = ours == theirs
    print(f'  {peer}: {size} x {size} starts, {np.mean(agree):.2%} of the labels agree '
          f'({np.mean(agree[theirs >= 0]):.2%} of those it gives, {np.mean(theirs < 0):.2%} '
          f'chatter and have none); {theirs_seconds:.2f} s, '
          f'{theirs_seconds / seconds:,.0f} times as long as here ({seconds:.4f} s); '
          f'at most {len(starts) * count / theirs_seconds:,.0f} impacts/s')
    draw(agree.reshape(size, size), plane, peer, Path(tempfile.gettempdir()))


def compute(alpha: float) -> None:
    """Time the computing alone."""
    parameters, plane = Parameters(alpha=alpha), Plane()
    best = np.inf
    for _ in range(TURNS):
        begin = time.perf_counter()
        catalogue = find_attractors(parameters, plane.random_starts(parameters, 1000, 1))
        settle(plane.starts(parameters, slice(0, 400), slice(0, 400)), 20_000, catalogue.table())
        best = min(best, time.perf_counter() - begin)
    print(f'  {best:.2f} s of computing (target 1.5 s), the search for attractors included')


def draw(agree: np.ndarray, plane: Plane, peer: str, folder: Path) -> None:
    """Draw where a peer disagrees."""
    from matplotlib.figure import Figure
    figure = Figure((7.0, 6.0), layout='constrained')
    axes = figure.subplots()
    axes.imshow(agree, origin='lower', aspect='auto', cmap='gray', vmin=0, vmax=1,
                extent=(plane.phase[0] / np.pi, plane.phase[1] / np.pi, *plane.velocity))
    axes.set(title=f'Black: {peer} gives another label (alpha 0.48)',
             xlabel='drive phase [π rad]', ylabel='velocity [1]')
    path = folder / f'disagreement-{peer}.png'
    figure.savefig(path, dpi=100)
    print(f'  picture: {path}')


def main() -> None:
    """Print all figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--peers-only', action='store_true')
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if not given.peers_only:
            for tool, options, target in TARGETS:
                print(f'{tool} 400 x 400, {" ".join(options)}:')
                seconds, impacts = timed(tool, options, folder)
                print(f'  {seconds:.2f} s from start to Zarr (target {target:g} s): '
                      f'{impacts / 1e6:,.1f} million impacts of transients')
                if tool == 'basins':
                    compute(0.48)
        print('the same labels by others:')
        for peer, size, count in PEERS:
            compare(peer, size, count, folder)


if __name__ == '__main__':
    main()
