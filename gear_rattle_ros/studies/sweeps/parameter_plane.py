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

"""What the gear does over two parameters: periods, exponents, coexistence, rest, contact."""

import functools
from pathlib import Path as FilePath
from typing import Any, Final, Unpack

import numpy as np

from .diagram import KINDS
from .plane_curves import curves_table, find_loci
from ..attractors import identity_of
from ..work import Arrays, Study, Work, WorkOptions
from ...attractors.finding import CONSERVES
from ...attractors.listing import named
from ...attractors.plane import centres, Plane
from ...core.arrays import RecordArray
from ...core.defaults import SEED
from ...core.many.survey import FLOATING, LOOK, PERIODIC, RESTING, SLOTS, survey, UNSETTLED
from ...core.path import EMPTY, Path, WORDS
from ...core.words import counted
from ...store.layout import Axis, Layout, Variable
from ...store.store import Store

NAME: Final = 'parameter_plane'
# Cells along the edge of a tile, and those followed together.
EDGE: Final = 40
TOGETHER: Final = 160
Windows = dict[str, tuple[float, float]]


@Study
def parameter_plane(path: Path, plane: Plane | None = None, *, size: tuple[int, ...] = (400,),
                    initial_conditions: int = SLOTS, skip: int = 1000, keep: int = LOOK,
                    curves: int = 0, seed: int = SEED, **options: Unpack[WorkOptions]) -> Store:
    """
    Find what the gear settles on over a grid of two parameters.

    The dataset has for every cell and attractor, the most frequent first, its share, kind, period,
    contact and largest exponent with its error; and for every cell the number of attractors found
    and the share at rest. Tables have the curves on which orbits change and rest begins, and the
    points at which curves end or meet.

    Parameters
    ----------
    path : Path
        A diagonal of the plane: its ends are two corners, and two parameters change along it.
    plane, seed
        The window from which initial conditions are drawn, the same for all cells, and their seed.
    size : tuple of int
        Cells along both parameters.
    initial_conditions : int
        Initial conditions of every cell.
    skip, keep : int
        Impacts after which a trajectory that has settled on no orbit is measured, and over which.
    curves : int
        Orbits, those of most cells, whose changes are followed through the plane.

    """
    work, plane = Work(**options), plane or Plane()
    windows = windows_of(path)
    if not 1 <= len(size) <= 2 or not all(1 <= cells <= 20_000 for cells in size):
        raise ValueError(f'size {" ".join(map(str, size))} is not one or two numbers from 1 to '
                         '20000')
    if keep < LOOK:
        raise ValueError(f'keep = {keep} is less than {LOOK}')
    columns, rows = (centres(window, cells) for window, cells in zip(
        windows.values(), (size[0], size[-1]), strict=True))
    store = work.begin(_layout(path, windows, plane, (columns, rows), {
        'initial_conditions': initial_conditions, 'skip': skip, 'keep': keep, 'seed': seed,
        'curves': curves}))
    initial = plane.draw(path.first, initial_conditions, seed)

    def cells(tile: int) -> int:
        return int(np.prod([part.stop - part.start for part in store.tiles[tile].values()]))

    with work.pending(NAME, store, cells) as (pending, finished):
        work.run(functools.partial(fill_tile, store.path, tuple(windows), initial, skip, keep),
                 pending, lambda tile, done: finished(tile, 0))
    if not store.has_table('mark_kind'):
        loci = find_loci(store, windows, path.first, plane, seed, curves, work)
        store.write_table(curves_table(loci, windows, path.first))
    return store


def windows_of(path: Path) -> Windows:
    """Return the windows of the two parameters; ValueError where it is another number."""
    if len(path.varied) != 2:
        raise ValueError(f'a window of {" and ".join(path.varied)} makes no plane; give two '
                         'parameters a window, such as --alpha 0.2 1.8 --gamma 0 0.4')
    windows = {name: (float(getattr(path.first, name)), float(getattr(path.last, name)))
               for name in path.varied}
    for name, window in windows.items():
        if not window[0] < window[1]:
            raise ValueError(EMPTY.format(name, *window))
    return windows


def fill_tile(place: FilePath, names: tuple[str, ...], drawn: RecordArray, skip: int, keep: int,
              tile: int) -> None:
    """Compute and store a tile."""
    store = Store(place)
    part = store.tiles[tile]
    columns, rows = (store.read_all(name)[part[name]] for name in names)
    initial = np.tile(drawn, (len(rows) * len(columns), 1))
    for name, values in zip(names, np.meshgrid(columns, rows), strict=True):
        initial[name] = values.reshape(-1, 1)
    found, attractors = (np.concatenate(parts) for parts in zip(*(
        survey(initial[k:k + TOGETHER], skip, keep)
        for k in range(0, len(initial), TOGETHER)), strict=True))
    there = np.arange(SLOTS) < attractors[:, None]
    share = np.where(there, found['trajectories'] / len(drawn), 0.0)
    values = {
        'share': share, 'kind': np.where(there, found['kind'], -1),
        'period_impacts': found['impacts'], 'period_drive': found['drive'],
        'contact': found['walls'], 'exponent': np.where(there, found['exponent'], np.nan),
        'exponent_error': np.where(there, found['error'], np.nan), 'attractors': attractors,
        'rest': np.sum(share, axis=1, where=found['kind'] == RESTING)}
    store.write(tile, {name: value.reshape(len(rows), len(columns), *value.shape[1:])
                       for name, value in values.items()})


def _layout(path: Path, windows: Windows, plane: Plane, axes: tuple[Any, Any],
            others: dict[str, int]) -> Layout:
    x, y = windows
    kinds = ', '.join(f'{k} {name}' for k, name in enumerate(KINDS))
    identity = identity_of(
        NAME, path.first, plane, size=[len(values) for values in axes],
        horizontal=x, **{f'{name}_window': list(window) for name, window in windows.items()},
        **others)
    del identity[x], identity[y]
    return Layout(
        (*(Axis(name, values, named(WORDS[name]), EDGE)
           for name, values in zip((y, x), axes[::-1], strict=True)),
         Axis('slot', np.arange(SLOTS), named('attractors of a cell, most frequent first', None))),
        tuple(Variable(name, (y, x, *slot), dtype, named(words, units))
              for name, slot, dtype, words, units in (
            ('share', ('slot',), '<f4', 'share of the initial conditions', '1'),
            ('kind', ('slot',), '|i1', f'what it is: {kinds}, -1 nothing', None),
            ('period_impacts', ('slot',), '<i4', 'period, 0 off a periodic orbit', 'impacts'),
            ('period_drive', ('slot',), '<i4', 'period, 0 off a periodic orbit', 'drive periods'),
            ('contact', ('slot',), '|i1', 'walls in contact: 0 none, 1 upper, 2 lower, 3 both',
             None),
            ('exponent', ('slot',), '<f8', 'largest Lyapunov exponent per impact; -inf where the '
             'driven gear sticks or rests', '1'),
            ('exponent_error', ('slot',), '<f8', 'standard error; 0 from exact multipliers', '1'),
            ('attractors', (), '<i2', 'attractors found, each unsettled set among them', '1'),
            ('rest', (), '<f4', 'share of the initial conditions that come to rest', '1'))),
        identity, {'title': 'Parameter plane of the gear-rattling model'})


def describe(dataset: Arrays) -> str:
    """Put in words what fills the plane."""
    share, kinds, counts, rest, contact = (dataset[name].values for name in (
        'share', 'kind', 'attractors', 'rest', 'contact'))
    if dataset.attrs.get('restitution') == 1.0 and dataset.attrs.get('beta') == 0.0:
        return CONSERVES
    first = kinds[..., 0]
    words = {'periodic': PERIODIC, 'chaotic': 1, 'at rest': RESTING, 'between the walls': FLOATING,
             'unsettled': UNSETTLED}
    lines = [', '.join(f'{np.mean(first == kind):.2%} {name}' for name, kind in words.items()
                       if np.any(first == kind)) + f' of {counted(first.size, "cell")}',
             f'several attractors in {np.mean(counts > 1):.2%}, at most {np.max(counts)}; rest '
             f'beside rattle in {np.mean((rest > 0.0) & (rest < 1.0)):.2%}']
    orbits, numbers = np.unique(np.stack([
        dataset[f'period_{name}'].values[..., 0][first == PERIODIC]
        for name in ('impacts', 'drive')]), axis=1, return_counts=True)
    lines += [f'{numbers[k] / first.size:.2%} {counted(orbits[0, k], "impact")} in '
              f'{counted(orbits[1, k], "drive period")}' for k in np.argsort(-numbers)[:6]]
    for owner in ('curve', 'mark'):
        names, numbers = np.unique(dataset[f'{owner}_kind'].values, return_counts=True)
        lines += [f'{owner}s: ' + ', '.join(f'{number} {name}' for name, number in zip(
            names, numbers, strict=True))] * bool(len(names))
    return '\n'.join(lines)
