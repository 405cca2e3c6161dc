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

import json
import math
from typing import Any, Final, Unpack

import numpy as np
import numpy.typing as npt

from . import basins
from .work import Arrays, Study, Work, WorkOptions
from ..attractors.listing import named
from ..attractors.orbits import find_orbits, MOST
from ..attractors.plane import Plane
from ..core.defaults import BASINS_CAP, HOLD, INITIAL_CONDITIONS, SEED, TOLERANCE
from ..core.model import Parameters
from ..core.orbits.cycles import expand
from ..core.orbits.listing import OrbitList
from ..core.orbits.orbit import Orbit, orbit_at
from ..core.words import counted, in_columns
from ..store.store import Store

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
    rows = [(number, orbit) for number, orbit in enumerate(found.orbits)]
    multipliers = np.array([orbit.multipliers for orbit in found.orbits]).reshape(-1, 2)
    owners = np.repeat([number for number, _ in rows], [orbit.impacts for _, orbit in rows])
    points = np.concatenate([np.zeros((0, 2)), *(orbit.points for orbit in found.orbits)])
    none = np.zeros(0)
    store.write_table({name: (dimensions, values, named(words, units))
                       for name, dimensions, values, words, units in (
        *((f'cycle_{name}', ('cycle',), np.array([getattr(orbit, name) for orbit in found.orbits]),
           words, '1') for name, words in (
            ('key', 'name of the orbit'), ('impacts', 'impacts of a period'),
            ('drive_periods', 'drive periods of a period'),
            ('is_stable', 'whether it attracts its neighbourhood'))),
        ('cycle_seeds', ('cycle',), np.array(found.seeds, np.int64), 'seeds that led to it', '1'),
        ('cycle_multiplier_real', ('cycle', 'pair'), multipliers.real,
         'multipliers of a period, real part', '1'),
        ('cycle_multiplier_imaginary', ('cycle', 'pair'), multipliers.imag,
         'multipliers of a period, imaginary part', '1'),
        ('cycle_point_cycle', ('cycle_point',), owners.astype(np.int64), 'orbit of the impact',
         '1'),
        ('cycle_point_wall', ('cycle_point',), np.concatenate(
            [none, *(orbit.walls for orbit in found.orbits)]).astype(np.int64),
         'wall: 0 upper, 1 lower', '1'),
        ('cycle_point_flight_time', ('cycle_point',), np.concatenate(
            [none, *(orbit.flight_times for orbit in found.orbits)]),
         'time since the impact before', '1'),
        ('cycle_point_velocity', ('cycle_point',), points[:, 1], 'velocity before the impact',
         '1'),
        ('cycle_point_phase', ('cycle_point',), points[:, 0], 'drive phase of the impact',
         'rad'))})
    order, rates = escape_rates(found)
    store.set_attributes({'rounds': json.dumps(found.rounds), 'statement': found.statement(),
                          'unseen': found.unseen, 'escape_order': order, 'escape_rates': rates})


def escape_rates(found: OrbitList) -> tuple[int, list[float]]:
    """Return the order of the cycle expansion for which the orbits suffice, and its rates."""
    order = 0
    while True:
        mine = [orbit for orbit in found.unstable if orbit.drive_periods == order + 1]
        weights = np.array([_weight(orbit) for orbit in mine])
        longest = np.array([orbit.impacts == found.longest for orbit in mine], np.bool_)
        if not mine or weights[longest].sum() > MISSING * weights.sum():
            return order, list(expand(found.orbits, order).rates) if order else []
        order += 1


def _weight(orbit: Orbit) -> float:
    return 1.0 / float(np.abs(np.prod(1.0 - orbit.multipliers)))


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
    names = ('cycle', 'wall', 'phase', 'velocity')
    owner, wall, phase, velocity = (dataset[f'cycle_point_{name}'].values for name in names)
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
    columns: dict[str, npt.NDArray[Any]] = {
        name: dataset[f'cycle_{name}'].values for name in (
            'key', 'impacts', 'drive_periods', 'is_stable', 'seeds', 'multiplier_real',
            'multiplier_imaginary')}
    numbers, counts = np.unique(columns['impacts'], return_counts=True)
    stable = int(np.sum(columns['is_stable']))
    size = np.abs(columns['multiplier_real'][:, :1] + 1j * columns['multiplier_imaginary'][:, :1])
    order = np.argsort(np.log(size[:, 0]) / columns['impacts'], kind='stable')[:SHOWN]
    rows = [[str(columns['key'][k]), str(columns['impacts'][k]), str(columns['drive_periods'][k]),
             *(_complex(columns['multiplier_real'][k, n], columns['multiplier_imaginary'][k, n])
               for n in (0, 1)), str(columns['seeds'][k])] for k in order]
    lines = [
        in_columns(['key', ' impacts', ' drive periods', ' multipliers', ' ', ' seeds'], rows)]
    if len(size) > SHOWN:
        lines.append(f'and {len(size) - SHOWN:,} more that are less stable per impact')
    lines += [
        f'{counted(len(size), "orbit")} of {counted(a["impacts"], "impact")} at most, {stable} of '
        f'them stable; by impacts: '
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


def _complex(real: float, imaginary: float) -> str:
    return f'{real:.6g}' + (f'{imaginary:+.6g}i' if imaginary else '')

