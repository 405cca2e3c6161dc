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


"""With which probability noise brings every initial condition of a plane to each attractor."""

import functools
from pathlib import Path
from typing import Final, Unpack

import numpy as np

from .hopping import noise_of
from .. import attractors
from ..grids.grid import axes_of
from ..work import Arrays, Study, Work, WorkOptions
from ...attractors.cores import cores_of
from ...attractors.finding import find_attractors
from ...attractors.listing import named
from ...attractors.plane import Plane
from ...core.defaults import HOLD, INITIAL_CONDITIONS, SEED, TOLERANCE
from ...core.flight.noise import Noise
from ...core.many.hopping import Cores, hop_from
from ...core.model import Parameters
from ...core.words import counted, in_columns
from ...store.layout import Axis, Layout, Variable
from ...store.store import Store

NAME: Final = 'probability_basins'
# Cells along the edge of a tile.
EDGE: Final = 25


@Study
def probability_basins(
        parameters: Parameters, plane: Plane | None = None, *, noise: float = 0.01,
        kind: str = 'gaussian', impacts: int = 100, trajectories: int = 20,
        tolerance: float = TOLERANCE, initial_conditions: int = INITIAL_CONDITIONS,
        seed: int = SEED, hold: int = HOLD, **options: Unpack[WorkOptions]) -> Store:
    """
    Find the shares of trajectories with noise that are on each attractor after some impacts.

    The dataset has `probability` of every cell and attractor: the share of trajectories whose last
    core was that of the attractor. What is missing to 1 has visited no core.

    Parameters
    ----------
    parameters, plane
        The model and the cells.
    noise, kind
        Standard deviation [1], and what is random, as in `hopping`.
    impacts : int
        Impacts of every trajectory.
    trajectories : int
        Trajectories of every cell; trajectory k has the noise of the simulator with `seed` + k.
    seed : int
        Of the noise and of the random initial conditions.
    tolerance, initial_conditions, hold
        As `find_attractors` takes them.

    """
    attractors.require_tolerance(tolerance)
    work, plane, number = Work(**options), plane or Plane(), noise_of(kind, [noise])
    identity = attractors.identity_of(
        NAME, parameters, plane, noise=noise, kind=kind, impacts=impacts,
        trajectories=trajectories, tolerance=tolerance, initial_conditions=initial_conditions,
        seed=seed, hold=hold, size=[plane.phases, plane.velocities])
    catalogue = find_attractors(
        parameters, plane.draw(parameters, initial_conditions, seed), tolerance=tolerance,
        hold=hold, threads=work.threads)
    known = [each for each in catalogue.attractors if each.label != -1]
    store = work.begin(Layout(
        (Axis('attractor', np.array([each.label for each in known]), named('attractor', None)),
         *axes_of(plane, EDGE)),
        (Variable('probability', ('attractor', 'velocity', 'phase'), '<f4', named(
            'share of trajectories that are on the attractor')),), identity,
        {'title': 'Basins of the gear-rattling model with noise'}))
    attractors.write_attractors(store, catalogue)
    fill = functools.partial(_fill, store.path, plane, number, cores_of(catalogue))
    with work.pending(NAME, store, lambda tile: 1) as (pending, finished):
        work.run(fill, pending, finished)
    return store


def _fill(path: Path, plane: Plane, kind: Noise, cores: Cores, tile: int) -> int:
    store = Store(path)
    a, part = store.attrs, store.tiles[tile]
    cells = plane.cells(Parameters.of(a), part['velocity'], part['phase'])
    known = store.read_all('attractor')
    shares = np.zeros((len(known), len(cells)))
    for k in range(a['trajectories']):
        seeds = np.full(len(cells), a['seed'] + k)
        _, visitors = hop_from(cells, a['noise'], kind, seeds, a['impacts'], cores, 0)
        shares += visitors['label'] == known[:, None]
    shape = [part[name].stop - part[name].start for name in ('velocity', 'phase')]
    store.write(tile, {'probability': shares.reshape(-1, *shape) / a['trajectories']})
    return a['trajectories'] * len(cells) * a['impacts']


def describe(dataset: Arrays) -> str:
    """Put the mean probabilities in words, and how many cells are certain."""
    a, shares = dataset.attrs, dataset['probability'].values
    names = dict(zip(dataset['attractor_label'].values.tolist(), (
        f'{letter} {key}'.lstrip() for letter, key in zip(
            dataset['attractor_letter'].values, dataset['attractor_key'].values, strict=True)),
        strict=True))
    return in_columns(['attractor', ' mean [%]', ' certain cells [%]', ' excluded cells [%]'], [
        [names[int(label)], *(f'{100.0 * np.mean(values):.2f}' for values in (
            share, share == 1.0, share == 0.0))]
        for label, share in zip(dataset['attractor'].values, shares, strict=True)]) + (
        f'\nfrom {counted(a["trajectories"], "trajectory")} of '
        f'{counted(a["impacts"], "impact")} each, sigma = {a["noise"]:g}')
