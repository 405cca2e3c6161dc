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

"""All periodic orbits up to a number of impacts, stable or not, over the basins."""

import itertools
import json
import math
from typing import Final, Unpack

import numpy as np

from ..grids import basins
from ..work import Arrays, Study, Work, WorkOptions
from ...attractors.listing import impact_table, table
from ...attractors.plane import Plane
from ...attractors.skeleton.orbits import find_orbits, MOST
from ...core.defaults import BASINS_CAP, HOLD, INITIAL_CONDITIONS, SEED, TOLERANCE
from ...core.model import Parameters
from ...core.orbits.cycles import expand
from ...core.orbits.listing import OrbitList
from ...core.orbits.orbit import orbit_at
from ...core.words import counted, in_columns
from ...store.store import Store

NAME: Final = 'orbits'
TITLE: Final = 'Periodic orbits of the gear-rattling model'
# Orbits in the text: the least unstable ones.
SHOWN: Final = 40
# An order of the cycle expansion counts where orbits as long as the longest that is sought have at
# most this part of its weight: those that are longer are missing.
MISSING: Final = 0.02
# It has converged where the last order changes the rate by less [1].
CONVERGED: Final = 0.03


@Study
def orbits(parameters: Parameters, plane: Plane | None = None, *, impacts: int = 8,
           points: int = MOST, cap: int = BASINS_CAP, tolerance: float = TOLERANCE,
           initial_conditions: int = INITIAL_CONDITIONS, seed: int = SEED, hold: int = HOLD,
           tile: int | None = None, **options: Unpack[WorkOptions]) -> Store:
    """
    Find all periodic orbits up to a number of impacts, stable or not.

    The dataset is that of `basins`, with every orbit, its multipliers and its impacts. Orbits
    that stick are not among them: they attract at once, so they are attractors.

    Parameters
    ----------
    parameters, plane
        The model and the cells of the basins.
    impacts : int
        Impacts of the longest orbits.
    points : int
        Points of the section from which they are sought, at the most.
    cap, tolerance, initial_conditions, seed, hold, tile
        As `basins` takes them.

    """
    for name, value, high in (('impacts', impacts, 64), ('points', points, 10**7)):
        if not 1 <= value <= high:
            raise ValueError(f'{name} = {value} is not between 1 and {high:,}')
    work, plane = Work(**options), plane or Plane()
    store, _ = basins.compute_basins(
        parameters, plane, work, cap=cap, tolerance=tolerance, seed=seed, hold=hold,
        initial_conditions=initial_conditions, tile=tile, name=NAME, title=TITLE,
        impacts=impacts, points=points)
    known = read_orbits(store) if store.has_table('cycle_point_phase') else None
    with work.report('orbits, points of the section', points) as progress:
        progress.skip(known.points if known else 0)

        def reached(done: int, found: OrbitList | None) -> None:
            progress.add(done)
            if found:
                _write(store, found)

        find_orbits(parameters, impacts, most=points, known=known, threads=work.threads,
                    cluster=work.cluster, reached=reached)
    return store


def _write(store: Store, found: OrbitList) -> None:
    multipliers = np.array([orbit.multipliers for orbit in found.orbits]).reshape(-1, 2)
    store.write_table(table(
        'cycle', seeds=(np.array(found.seeds, np.int64), 'seeds that led to it'),
        multiplier_real=(multipliers.real, 'multipliers of a period, real part', '1', 'pair'),
        multiplier_imaginary=(multipliers.imag, 'multipliers of a period, imaginary part', '1',
                              'pair'),
        **{name: ([getattr(orbit, name) for orbit in found.orbits], words) for name, words in (
            ('key', 'name of the orbit'), ('impacts', 'impacts of a period'),
            ('drive_periods', 'drive periods of a period'),
            ('is_stable', 'whether it attracts its neighbourhood'))}) | impact_table(
        'cycle_point', [(orbit.walls, orbit.points) for orbit in found.orbits],
        'orbit of the impact'))
    store.set_attributes({'rounds': json.dumps(found.rounds), 'statement': found.statement(),
                          'escape_rates': escape_rates(found)})


def escape_rates(found: OrbitList) -> list[float]:
    """Return the rates of the cycle expansion, up to the order for which the orbits suffice."""
    for order in itertools.count():
        mine = [orbit for orbit in found.orbits
                if orbit.drive_periods == order + 1 and not orbit.is_stable]
        weights = np.array([1.0 / abs(np.prod(1.0 - orbit.multipliers)) for orbit in mine])
        longest = np.array([orbit.impacts == found.longest for orbit in mine], np.bool_)
        if not mine or weights[longest].sum() > MISSING * weights.sum():
            break
    return expand(found.orbits, order) if order else []


def read_orbits(dataset: Arrays) -> OrbitList:
    """
    Rebuild the list of periodic orbits from the dataset of `orbits`.

    Parameters
    ----------
    dataset : xarray.Dataset
        As `orbits` returns it.

    Returns
    -------
    OrbitList
        With the orbits as they were found.

    """
    parameters = Parameters.of(dataset.attrs)
    owner, wall, phase, velocity = (dataset[f'cycle_point_{name}'].values for name in (
        'number', 'wall', 'phase', 'velocity'))
    points = np.column_stack([phase, velocity])
    found = [orbit_at(wall[owner == number], points[owner == number], parameters)
             for number in range(len(dataset['cycle_key'].values))]
    return OrbitList(parameters, dataset.attrs['impacts'],
                     tuple(orbit for orbit in found if orbit),
                     tuple(dataset['cycle_seeds'].values.tolist()),
                     tuple((n, k) for n, k in json.loads(dataset.attrs['rounds'])))


def describe(dataset: Arrays) -> str:
    """Put the orbits in words: how many there are, the least unstable, the rate of escape."""
    a = dataset.attrs
    one = {name: dataset[f'cycle_{name}'].values for name in (
        'key', 'impacts', 'drive_periods', 'is_stable', 'seeds', 'multiplier_real',
        'multiplier_imaginary')}
    numbers, counts = np.unique(one['impacts'], return_counts=True)
    size = np.hypot(one['multiplier_real'], one['multiplier_imaginary'])[:, 0]
    order = np.argsort(np.log(size) / one['impacts'], kind='stable')[:SHOWN]
    lines = [in_columns(
        ['key', ' impacts', ' drive periods', ' multipliers', ' ', ' seeds'],
        [[str(one['key'][k]), str(one['impacts'][k]), str(one['drive_periods'][k]),
          *(f'{real:.6g}' + (f'{imaginary:+.6g}i' if imaginary else '') for real, imaginary in zip(
              one['multiplier_real'][k], one['multiplier_imaginary'][k], strict=True)),
          str(one['seeds'][k])] for k in order])]
    if len(size) > SHOWN:
        lines.append(f'and {len(size) - SHOWN:,} more that are less stable per impact')
    lines += [
        f'{counted(len(size), "orbit")} of {counted(a["impacts"], "impact")} at most, '
        f'{np.sum(one["is_stable"])} of them stable; by impacts: '
        + ', '.join(f'{n}: {count}' for n, count in zip(numbers, counts, strict=True)),
        a['statement']]
    rates = a['escape_rates']
    if rates:
        error = abs(rates[-1] - rates[-2]) if len(rates) > 1 else math.inf
        lines.append(
            'escape rate per impact from the unstable orbits, by a cycle expansion of order '
            f'1 to {len(rates)} in drive periods: {", ".join(f"{rate:.4f}" for rate in rates)}; '
            + (f'so {rates[-1]:.4f} +- {error:.4f}' if error < CONVERGED else
               'it has not converged: longer orbits are needed'))
    return '\n'.join([*lines, basins.describe(dataset)])
