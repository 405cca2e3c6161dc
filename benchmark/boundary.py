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
The boundary of the basins at 0.48, from the start of a process to its store, and beside it others.

Prints rows of a Markdown table: the command with two threads and with one; pynamicalsys' estimator
of the uncertainty exponent, which asks our labels one at a time; and the time of a label by heyoka
(Taylor series with events) and by ours. Run it as: python benchmark/boundary.py
pynamicalsys is taken where it is installed; heyoka needs a separate environment: name its python
in HEYOKA_PYTHON. What is not installed is skipped.
"""

from collections.abc import Iterator
import os
from pathlib import Path
import subprocess
import sys
import tempfile
import time

import numpy as np
from peers.comparison import CAP, Grid, INSIDE, PARAMETERS, python_of

from gear_rattle_ros.attractors.catalogue import follow_here
from gear_rattle_ros.core.boundaries.uncertainty import fit_power_law
from gear_rattle_ros.core.flight.lanes import make_initial_conditions
from gear_rattle_ros.core.many.settling import RESULT
from gear_rattle_ros.store.store import open_dataset

# Cells along an edge of the grid from which pynamicalsys draws its points, the points at each
# distance, and the distances, to one over the number of cells.
CELLS, POINTS, DISTANCES = 400, 1000, 5
# Probes of the largest distances are no power law.
LARGEST = 1e-2
SIZE = 30
Row = tuple[str, str, str]


def tool(folder: Path, threads: int) -> Row:
    """Time the command in a process of its own."""
    store = folder / f'{threads}.zarr'
    begin, before = time.perf_counter(), os.times()
    subprocess.run([sys.executable, '-m', 'gear_rattle_ros.start', 'boundary', '--threads',
                    str(threads), '--output', str(store)], check=True, capture_output=True)
    seconds, after = time.perf_counter() - begin, os.times()
    used = sum(after[2:4]) - sum(before[2:4])
    found = open_dataset(store)
    exponents = ', '.join(f'{value:.4f} ± {error:.4f} by {probe}' for probe, value, error in zip(
        found['probe'].values, found['exponent'].values, found['exponent_error'].values,
        strict=True))
    labels = int(found['probes'].values.sum(axis=1) @ [3, 4])
    return (f'boundary at 0.48, threads: {threads}; {labels + found["label"].size:,} labels',
            f'{seconds:.1f} s, {used:.1f} s of processors', exponents)


class OneAtATime:
    """What pynamicalsys asks for the fate of a point: ours."""

    def __init__(self, grid: Grid) -> None:
        self.table, self.calls = grid.catalogue.table, 0

    def escape_analysis(self, u, **options):  # type: ignore[no-untyped-def]
        """Return the label of a point, and its lifetime."""
        self.calls += 1
        result = np.zeros(1, RESULT)
        follow_here(make_initial_conditions(PARAMETERS, u[:1], 0.0, u[1]), CAP, self.table, result)
        return int(result['label'][0]), int(result['lifetime'][0])


def pynamicalsys() -> Iterator[Row]:
    """Let pynamicalsys estimate the exponent from our labels."""
    try:
        from pynamicalsys import BasinMetrics
    except ImportError:
        yield 'pynamicalsys: not installed, skipped', '-', '-'
        return
    grid = Grid(CELLS)
    labels = grid.ours().labels.reshape(CELLS, CELLS)
    x, y = np.meshgrid(grid.plane.across_values(), grid.plane.velocity_values())
    ours = OneAtATime(grid)
    begin = time.process_time()
    sizes, shares = BasinMetrics(labels.astype(np.float64)).uncertainty_fraction_mapping(
        x, y, ours, [], [], n_samples=POINTS, n_eps=DISTANCES, n_jobs=1)
    seconds = time.process_time() - begin
    small = np.asarray(sizes) <= LARGEST
    cut = np.round(np.asarray(shares)[small] * POINTS).astype(np.int64)
    law = fit_power_law(np.asarray(sizes)[small], cut, np.full(len(cut), POINTS))
    assert law is not None
    yield (f"pynamicalsys' estimator, {ours.calls:,} labels of ours one at a time",
           f'{seconds:.1f} s of one core', f'{law.exponent:.4f} ± {law.error:.4f} from '
           f'{law.low:.0e} to {law.high:.0e}')


def label(folder: Path) -> Iterator[Row]:
    """Time a label by heyoka and by ours."""
    grid = Grid(SIZE)
    ours = min(grid.ours().seconds for _ in range(3)) / SIZE**2
    python = python_of('heyoka')
    if not python:
        yield 'heyoka: not installed, skipped', '-', '-'
        return
    theirs = grid.theirs('heyoka', python, folder, INSIDE).seconds / SIZE**2
    yield ('a label', f'{1e6 * ours:.1f} us of one core',
           f'heyoka {1e6 * theirs:,.0f} us, {theirs / ours:.0f} times as long')


def main() -> None:
    """Print the rows."""
    print('| what | measured | beside it |\n|---|---|---|', flush=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for threads in (2, 1):
            print(f'| {" | ".join(tool(folder, threads))} |', flush=True)
        for rows in (pynamicalsys(), label(folder)):
            for row in rows:
                print(f'| {" | ".join(row)} |', flush=True)


if __name__ == '__main__':
    main()
