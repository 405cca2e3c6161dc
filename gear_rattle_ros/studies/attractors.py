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

"""Every attractor at given parameters, and its share of random initial conditions."""

from collections.abc import Mapping, Sequence
import dataclasses
import json
import math
from typing import Any, Final, Unpack

import numpy as np

from .work import Arrays, Study, Work, WorkOptions
from ..attractors.catalogue import Catalogue, others_where, table_of
from ..attractors.finding import CONSERVES, conserves_areas, find_attractors
from ..attractors.listing import COLUMNS, listed
from ..attractors.plane import Plane
from ..core.defaults import HOLD, INITIAL_CONDITIONS, SEED, TOLERANCE
from ..core.model import Model, Parameters
from ..core.path import Path, SEVERAL
from ..store.layout import Layout
from ..store.store import Store

NAME: Final = 'attractors'
TITLE: Final = 'Attractors of the gear-rattling model'


@Study
def attractors(parameters: Parameters, plane: Plane | None = None, *,
               tolerance: float = TOLERANCE, hold: int = HOLD,
               initial_conditions: int = INITIAL_CONDITIONS, seed: int = SEED,
               **options: Unpack[WorkOptions]) -> Store:
    """
    Find every attractor that random initial conditions reach, as a dataset.

    The dataset has the arrays of `table_of`.

    Parameters
    ----------
    parameters, plane
        The model, and the window from which initial conditions are drawn.
    tolerance, hold, initial_conditions, seed
        As `basins` takes them.

    """
    require_tolerance(tolerance)
    work, plane = Work(**options), plane or Plane()
    identity = identity_of(NAME, parameters, plane, tolerance=tolerance, hold=hold,
                           initial_conditions=initial_conditions, seed=seed)
    store = work.begin(Layout((), (), identity, {'title': TITLE}))
    catalogue = find_attractors(
        parameters, plane.draw(parameters, initial_conditions, seed),
        tolerance=tolerance, hold=hold, threads=work.threads, cluster=work.cluster)
    write_attractors(store, catalogue)
    store.mark(0)
    return store


def describe(dataset: Arrays, cells: dict[int, int] | None = None, beside: str = '') -> str:
    """Put the attractors of a dataset in words, with the cells of a grid by label."""
    # What is known `beside` them follows; where areas are preserved, one line is all.
    if conserves_areas(Parameters.of(dataset.attrs)):
        return CONSERVES
    # A grid may reach rest that no random initial condition did.
    known = dataset['attractor_label'].values
    others = table_of(tuple(
        each.with_share(0, dataset.attrs['random_initial_conditions'])
        for each in others_where(lambda label: label in (cells or {}) and label not in known)))
    columns = {name: [*dataset[name].values, *np.asarray(others[name][1])] for name in COLUMNS}
    return listed(columns, dataset.attrs['hold'], cells, _in_si(dataset, columns)) + (
        f'\n{beside}' if beside else '')


def _in_si(dataset: Arrays, columns: dict[str, Any]) -> dict[str, list[str]]:
    """Return columns in the units of the gear pair, if there is one."""
    a = dataset.attrs
    if 'gears' not in a:
        return {}
    labels, velocities = (np.concatenate([dataset[f'{what}_{name}'].values for what in (
        'point', 'box')]) for name in ('label', 'velocity'))
    fastest = [np.max(np.abs(velocities[labels == label]), initial=0.0)
               for label in columns['attractor_label']]
    return {
        ' period [ms]': [f'{2e3 * math.pi * periods / a["omega"]:.6g}' if periods > 0 else ''
                         for periods in columns['attractor_drive_periods']],
        ' fastest impact [mm/s]': [
            f'{1e3 * speed * a["scale_velocity_m_per_s"]:.4g}' if speed else ''
            for speed in fastest]}


def identity_of(name: str, parameters: Parameters, plane: Plane, **others: Any) -> dict[str, Any]:
    """List what makes a result what it is: plain values for `Layout`."""
    return {
        'tool': name,
        **dataclasses.asdict(parameters),
        **plane.attributes(),
        **others,
    }


def identity_along(name: str, paths: Sequence[Path], plane: Plane, end: str = '_window', /,
                   **others: Any) -> dict[str, Any]:
    """List what makes a sweep what it is: `identity_of`, with windows of what varies."""
    first = paths[0]
    identity = identity_of(name, first.first, plane, **others)
    for each in first.varied:
        del identity[each]
        identity[f'{each}{end}'] = [getattr(point, each) for path in paths for point in (
            path.first, path.last)]
    return identity


def path_attributes(name: str, path: Path | None) -> dict[str, Any]:
    """Say where a path goes that leads through the model; in alpha its ends are enough."""
    if path is None or path.varied == ('alpha',):
        return {name: list(path.ends if path else ())}
    return {name: list(path.ends), f'{name}_along': path.name,
            f'{name}_from': list(path.first.model), f'{name}_to': list(path.last.model)}


def swept(attributes: Mapping[str, Any]) -> str:
    """Return the coordinate of a sweep, from the attributes of its dataset."""
    varied = [name for name in Model._fields if name not in attributes]
    return varied[0] if len(varied) == 1 else SEVERAL


def write_attractors(store: Store, catalogue: Catalogue) -> None:
    store.write_table(table_of(catalogue.attractors), {
        'labels': json.dumps({each.key: each.label for each in catalogue.attractors}),
        'random_initial_conditions': len(catalogue.labels),
        'stay': catalogue.stay,
    })


def require_tolerance(tolerance: float) -> None:
    """Refuse a tolerance outside 1e-7 to 0.1 with a ValueError."""
    if not 1e-7 <= tolerance <= 0.1:
        raise ValueError(f'tolerance = {tolerance:g} is not between 1e-7 and 0.1')
