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


"""Erosion: what is left of basins and of the smallest kicks as a parameter moves away."""

import math
from typing import Any, Final

import numpy as np

from .continuation import BINS
from .diagram import Diagram
from .orbit_diagram import compute
from .work import Arrays, Work
from ..attractors.catalogue import Catalogue, Kind
from ..attractors.columns import Window
from ..attractors.listing import named, table
from ..attractors.plane import Plane
from ..core.arrays import FloatArray
from ..core.flight.lanes import make_initial_conditions
from ..core.path import Path
from ..core.words import in_columns

# Parts of what there is at the model, and quantities, of which the places are sought.
LEVELS: Final = (0.9, 0.5)
QUANTITIES: Final = ('share', 'kick')


def erosion_of(catalogue: Catalogue, plane: Plane, path: Path, columns: int, trajectories: int,
               seed: int, work: Work) -> dict[str, Any]:
    """Follow the attractors of a catalogue along a path both ways; return tables of a dataset."""
    here, count, axis = path.of(catalogue.parameters), len(catalogue.attractors), path.name
    left = np.full((count, len(QUANTITIES), len(LEVELS), 2, 2), math.nan)
    lines = []
    for side, end in enumerate(path.ends):
        if end == here:
            continue
        ends = min(here, end), max(here, end)
        diagram = Diagram(
            Path(path.at(ends[0]), path.at(ends[1])), max(2, 1 + round(
                (columns - 1) * (ends[1] - ends[0]) / (path.ends[1] - path.ends[0]))),
            plane, trajectories, seed, Window(bins=BINS, kicks=True), ('random',))
        store = compute(diagram, Work(threads=work.threads, progress=work.progress),
                        f'erosion in {ends[0]:g} to {ends[1]:g}')
        # Away from the model.
        numbers, share, kick, states = (store.read_all(name)[0][::1 if side else -1] for name in (
            'attractor', 'share', 'kick', 'member_state'))
        places = np.linspace(*ends, diagram.columns)[::1 if side else -1]
        # Which is which there: where the state of each leads.
        some = np.flatnonzero(numbers[0] >= 0)
        labels = catalogue.label(make_initial_conditions(
            catalogue.parameters, *states[0, some].T), threads=work.threads)['label']
        values = np.full((count, len(QUANTITIES), len(places)), math.nan)
        for k, each in enumerate(catalogue.attractors):
            if each.kind is Kind.UNSETTLED or each.label not in labels:
                continue
            mine = numbers == numbers[0, some[np.argmax(labels == each.label)]]
            values[k] = np.sum(share, axis=1, where=mine), np.where(mine.any(axis=1), np.max(
                kick, axis=1, where=mine, initial=-math.inf), 0.0)
            for q, noise in enumerate((trajectories, 0)):
                for n, level in enumerate(LEVELS):
                    left[k, q, n, side] = where_left(places, values[k, q], level, noise)
        lines.append(np.vstack([places, values.reshape(-1, len(places))]))
    line = np.concatenate(lines[::-1], axis=1)
    places, first = np.unique(line[0], return_index=True)
    share, kick = line[1:, first].reshape(count, len(QUANTITIES), -1).transpose(1, 0, 2)
    over = '1', 'quantity', 'level', 'side'
    return table('attractor', left=(
        left[..., 0], f'{axis} at which 90 and 50 % of share and kick are left, below and above '
        'the model', *over), left_error=(left[..., 1], 'how well it is known', *over)) | {
            f'erosion_{name}': (dimensions, values, named(words))
            for name, dimensions, values, words in (
                (axis, ('erosion',), places, path.words),
                ('share', ('attractor', 'erosion'), share, 'share of the random initial '
                 'conditions'),
                ('kick', ('attractor', 'erosion'), kick, 'smallest kick that changes the '
                 'attractor; 0 where it is not there, nan for none'))}


def where_left(places: FloatArray, values: FloatArray, level: float, trajectories: int
               ) -> tuple[float, float]:
    """Return where a part of the first value is left for the first time, and the error; or nan."""
    # The error is that of the shares of `trajectories`, and a quarter of the last step at least.
    below = np.flatnonzero(values < level * values[0])
    if not len(below):
        return math.nan, math.nan
    k = int(below[0])
    step, fall = places[k] - places[k - 1], values[k - 1] - values[k]
    errors = [value * (1.0 - value) / trajectories if trajectories else 0.0
              for value in values[[0, k]]]
    error = math.sqrt(level**2 * errors[0] + errors[1]) * abs(step) / fall
    return (float(places[k - 1] + step * (values[k - 1] - level * values[0]) / fall),
            max(error, 0.25 * abs(step)))


def describe_erosion(dataset: Arrays, names: dict[int, str]) -> str:
    """List the places at which parts of the shares and the kicks are left."""
    axis = dataset.attrs.get('erosion_window_along', 'alpha')
    left, errors = (dataset[f'attractor_{name}'].values for name in ('left', 'left_error'))
    return in_columns(
        ['erosion', 'of', *(f' {level:.0%} left {side} {axis}' for level in LEVELS
                            for side in ('below', 'above'))],
        [[name, quantity, *(
            f'{place:.5f} +- {error:.5f}' if math.isfinite(place) else 'not in the window'
            for place, error in zip(left[k, q].flat, errors[k, q].flat, strict=True))]
         for k, name in names.items() for q, quantity in enumerate(QUANTITIES)])
