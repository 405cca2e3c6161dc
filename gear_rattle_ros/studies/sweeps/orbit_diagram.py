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

"""Orbit diagrams: impact velocities along a path, attractor by attractor, with the exponent."""

import dataclasses
import functools
import itertools
import math
import pathlib
from typing import Final, Unpack

import numpy as np
import numpy.typing as npt

from .diagram import BOUNDARY, describe as laid_out, Diagram, in_order, KINDS, layout_of, SWEEPS
from ..attractors import swept
from ..skeleton.boundary import measure
from ..work import Arrays, Study, Work, WorkOptions
from ...attractors.catalogue import Kind
from ...attractors.columns import Branch, find_branches, Window
from ...attractors.listing import named
from ...attractors.plane import at_parameters, Plane, STATE
from ...attractors.tracks import track
from ...core.defaults import SEED
from ...core.flight.lanes import make_initial_conditions
from ...core.flight.lanes_step import LANES
from ...core.orbits.orbit import Orbit
from ...core.path import Path
from ...core.words import counted, in_columns
from ...store.store import Store

NAME = 'orbit_diagram'
MOST: Final = 0.9  # of the trajectories


@Study
def orbit_diagram(path: Path, plane: Plane | None = None, *, columns: int = 780,
                  trajectories: int = 32, keep: int = 2048, hold: int = Window.hold,
                  bins: int = 900, bin_window: tuple[float, float] = (-1.5, 1.5),
                  seed: int = SEED, sweeps: tuple[str, ...] = SWEEPS,
                  **options: Unpack[WorkOptions]) -> Store:
    """
    Count impact velocities along a path, attractor by attractor, with the largest exponent.

    The dataset has counts, key, share, kind, period and exponent over sweep, attractor and the
    parameter that varies, or `path` from 0 to 1 where several do.

    Parameters
    ----------
    path : Path
        A window of one parameter, or the straight path between two models.
    plane, seed
        The window from which initial conditions are drawn, and their seed.
    columns, trajectories : int
        Places on the path, and trajectories at each.
    keep : int
        Impacts counted of each trajectory.
    hold : int
        Impacts after which a trajectory is unsettled; in 32 times as many nothing may leave a
        chaotic attractor.
    bins, bin_window
        Bins of the velocity, and their window [1].
    sweeps : tuple of str
        Of 'random' (initial conditions drawn in each column), 'up' and 'down' (followed).

    """
    return compute(Diagram(
        path, columns, plane or Plane(), trajectories, seed,
        Window(keep, *bin_window, bins, hold), in_order(sweeps)), Work(**options))


def compute(diagram: Diagram, work: Work, name: str = NAME) -> Store:
    store = work.begin(layout_of(diagram))
    fill = functools.partial(fill_tile, diagram, store.path)

    def columns(tile: int) -> int:
        region = store.tiles[tile][diagram.path.name]
        return int(region.stop - region.start)

    with work.pending(name, store, columns) as (pending, finished):
        many, up, down = ([t for t in pending if _sweep(diagram, store, t) == sweep]
                          for sweep in SWEEPS)
        work.run(fill, many, finished)
        # A tile that is followed begins where its neighbour ends: one of each sweep at a time.
        for tiles in itertools.zip_longest(up, reversed(down)):
            work.run(fill, [tile for tile in tiles if tile is not None], finished)
    write_attractors(store, diagram.path.name)
    return store


def fill_tile(diagram: Diagram, output: pathlib.Path, tile: int) -> int:
    """Compute a tile of the store at `output`; return the impacts made."""
    store = Store(output)
    region = store.tiles[tile]
    part = region[diagram.path.name]
    columns = range(part.start, part.stop)
    sweep = _sweep(diagram, store, tile)
    ends = np.full((len(columns), LANES, len(STATE)), math.nan)
    found: dict[int, list[Branch]] = {}
    measured = np.full((len(columns), len(BOUNDARY)), math.nan)
    order = list(columns) if sweep != 'down' else list(reversed(columns))
    is_followed = sweep != 'random'
    states = _states_before(diagram, store, tile, order[0]) if is_followed else None
    known: tuple[Orbit, ...] = ()
    for c in order:
        catalogue, found[c] = find_branches(
            diagram.at(c), diagram.draw(c) if states is None else at_parameters(
                diagram.at(c), states), diagram.window, known)
        if is_followed:
            states = catalogue.states
            ends[c - columns.start, :len(states)] = np.stack(
                [states[name] for name in STATE], axis=1)
        else:
            # What is followed knows nothing of what it has left.
            known = catalogue.orbits
            if diagram.boundary:
                measured[c - columns.start] = measure(catalogue, diagram.plane, diagram.seed)
    values = laid_out([found[c] for c in columns], diagram)
    if diagram.boundary:
        values |= dict(zip(BOUNDARY, measured.T, strict=True))
    store.write(tile, {name: value[None] for name, value in {**values, 'end_state': ends}.items()})
    return sum(len(one.states) for c in columns for one in found[c]) * diagram.window.keep


def write_attractors(store: Store, axis: str) -> None:
    """Match attractors from one column to the next, and write which is which."""
    kinds = store.read_all('kind')
    numbers = track(store.read_all('key'), store.read_all('point'),
                    kinds == KINDS.index(Kind.CHAOTIC.value),
                    (kinds >= 0) & (kinds != KINDS.index(Kind.UNSETTLED.value)),
                    store.read_all('letter'))
    store.write_table({
        'attractor': (('sweep', axis, 'slot'), numbers.astype(np.int32), named(
            f'number of the attractor, matched from {axis} to {axis}; -1 none', None))})


def describe(dataset: Arrays) -> str:
    """List the attractors of a diagram, numbered as in the dataset and in the picture."""
    axis = swept(dataset.attrs)
    numbers, places_on, keys, letters = (
        dataset[name].values for name in ('attractor', axis, 'key', 'letter'))
    rows = []
    for label in np.unique(numbers[numbers >= 0]):
        _, places, _ = np.nonzero(numbers == label)
        seen = places_on[np.unique(places)]
        rows.append([f'{max(letters[numbers == label])} {label}', f'{len(seen):,}',
                     f'{seen[0]:.6f}', f'{seen[-1]:.6f}',
                     str(keys[numbers == label][np.argmin(places)])])
    largest = np.where(numbers >= 0, dataset['share'].values, 0.0)[0].max(axis=1)
    lines = [in_columns(
        [' attractor', f' {axis}s', ' from [1]', ' to [1]', 'key at the first'], rows),
        f'one attractor has {MOST:.0%} of the trajectories or more at '
        f'{np.count_nonzero(largest >= MOST):,} of {counted(len(places_on), axis)}']
    unsettled = np.where(dataset['kind'].values == KINDS.index(Kind.UNSETTLED.value),
                         dataset['share'].values, 0.0).sum(axis=2).max(axis=0)
    if np.any(unsettled):
        lines.append(f'unsettled after {counted(dataset.attrs["hold"], "impact")}: at '
                     f'{np.count_nonzero(unsettled):,} of {counted(len(places_on), axis)}, '
                     f'at most {np.max(unsettled):.1%} of the trajectories')
    return '\n'.join(lines)


def _states_before(diagram: Diagram, store: Store, tile: int, column: int) -> npt.NDArray[np.void]:
    # The ends of the neighbouring column, or fresh initial conditions at the end of the window.
    backwards = -1 if _sweep(diagram, store, tile) == 'up' else 1
    if not 0 <= column + backwards < diagram.columns:
        few = dataclasses.replace(diagram, trajectories=min(diagram.trajectories, LANES))
        return few.draw(column)
    sweep = store.tiles[tile]['sweep'].start
    states = store.read_all('end_state')[sweep, column + backwards]
    return make_initial_conditions(diagram.at(column), *states[np.isfinite(states[:, 0])].T)


def _sweep(diagram: Diagram, store: Store, tile: int) -> str:
    return diagram.sweeps[store.tiles[tile]['sweep'].start]
