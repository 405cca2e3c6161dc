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

"""Edge states on boundaries of basins and chaotic saddles of transients, with their rates."""

import functools
import math
from pathlib import Path
from typing import Any, Final, Unpack

import numpy as np

from ..attractors import (
    describe as describe_attractors,
    identity_of,
    require_tolerance,
    write_attractors,
)
from ..work import Arrays, Study, Work, WorkOptions
from ...attractors.catalogue import Catalogue
from ...attractors.finding import find_attractors
from ...attractors.listing import impact_table, named, table
from ...attractors.plane import initial_condition, Plane
from ...attractors.skeleton.orbits import find_orbits
from ...attractors.skeleton.saddles import HEAD, Straddling
from ...core.arrays import FloatArray, RecordArray
from ...core.defaults import INITIAL_CONDITIONS, LIFETIMES_HOLD, SEED, TOLERANCE
from ...core.many.recorded import record_impacts
from ...core.many.settling import UNSETTLED
from ...core.many.sprinkler import QUANTITIES, SaddleRates
from ...core.model import Parameters
from ...core.orbits.section import distances
from ...core.words import counted, in_columns
from ...store.layout import Axis, Layout, Variable
from ...store.store import Store

NAME: Final = 'saddle'
# Independent batches, whose scatter gives the errors; impacts straddled, and initial conditions
# sprinkled about them.
PARTS: Final = 8
STRADDLED: Final = 2000
SPRINKLED: Final = 20_000
# Segments from each attractor to the boundary of its basin, impacts of each that is straddled, and
# orbits on the saddle that are listed, the shortest.
RAYS: Final = 4
REACHED: Final = 150
LISTED: Final = 12
# The orbits that are sought [impacts], from so many points of the section.
LONGEST: Final = 8
SOUGHT: Final = 2048
# How near a trajectory is to the saddle [rad, 1], and impacts of it that are compared at the most.
NEAR: Final = 0.05
COMPARED: Final = 4000

# Rates in the order in which they are kept, and their words.
RATES: Final = {
    'kappa': 'escape rate per impact', 'lambda_1': 'larger exponent per impact',
    'lambda_2': 'smaller exponent per impact', 'D_1': 'dimension along the unstable direction',
    'D_2': 'dimension along the stable direction', 'exponent': 'uncertainty exponent'}


@Study
def saddle(parameters: Parameters, plane: Plane | None = None, *, transient: bool = False,
           straddled: int = STRADDLED, sprinkled: int = SPRINKLED,
           initial: tuple[float, float, float] | None = None, tolerance: float = TOLERANCE,
           initial_conditions: int = INITIAL_CONDITIONS, hold: int = LIFETIMES_HOLD,
           seed: int = SEED, **options: Unpack[WorkOptions]) -> Store:
    """
    Follow the boundary of all basins, or the chaotic saddle of a transient, and find its rates.

    The dataset has the impacts of straddle trajectories, an `estimate` of each part, the unstable
    orbits near which they stay, those that are accessible from each attractor, and what `basins`
    has of the attractors.

    Parameters
    ----------
    parameters, plane
        The model, and the window from which initial conditions are drawn.
    transient : bool
        Straddle the longest lifetimes, where only an orbit or rest ends a transient; by default
        the labels of basins.
    straddled, sprinkled : int
        Impacts of the straddle trajectories, and initial conditions sprinkled about them.
    initial : tuple of float, optional
        Phase [rad], velocity and displacement [1] of a trajectory whose transient is compared
        with the saddle.
    tolerance, initial_conditions, hold, seed
        As `basins` takes them; after `hold` impacts any trajectory is given up.

    """
    require_tolerance(tolerance)
    work, plane = Work(**options), plane or Plane()
    store = work.begin(_layout(identity_of(
        NAME, parameters, plane, straddles='lifetimes' if transient else 'labels',
        straddled=straddled, sprinkled=sprinkled, tolerance=tolerance, seed=seed,
        initial_conditions=initial_conditions, hold=hold,
        **{'initial': list(initial)} if initial else {})))
    if not store.pending() and store.has_table('orbit_key') and (
            initial is None or 'transient' in store.attrs):
        return store
    drawn = plane.draw(parameters, initial_conditions, seed)
    straddling = Straddling(find_attractors(
        parameters, drawn, tolerance=tolerance, hold=hold, chaotic=not transient,
        threads=work.threads, cluster=work.cluster), not transient, hold)
    alone = initial_condition(parameters, *initial) if initial else drawn[:0]
    lifetime = _lifetime(straddling, alone) if initial else 0
    with work.pending(NAME, store, lambda tile: 1) as (tiles, finished):
        work.run(functools.partial(_fill, straddling, plane, seed, store.path), tiles, finished)
    write_attractors(store, straddling.catalogue)
    _write_results(store, straddling, work, seed)
    if initial:
        store.set_attributes(_compare(straddling, _straddled(store), alone, lifetime))
    return store


def _fill(straddling: Straddling, plane: Plane, seed: int, output: Path, tile: int) -> int:
    """Straddle and sprinkle one part into its tile; the impacts made are not counted."""
    store, random = Store(output), np.random.default_rng([seed, tile])
    count = store.attrs['straddled'] // PARTS
    points = straddling.follow(plane, count, random)
    phase, velocity = np.full((2, 1, count), np.nan)
    phase[0, :len(points)], velocity[0, :len(points)] = points.T
    store.write(tile, {'phase': phase, 'velocity': velocity, 'estimate': (
        np.full((1, 2, len(QUANTITIES)), np.nan) if straddling.orbit_of(points) else
        straddling.sprinkle(points, store.attrs['sprinkled'] // PARTS, random)[None])})
    return 0


def _straddled(store: Store) -> FloatArray:
    points = np.column_stack([store.read_all(name).ravel() for name in ('phase', 'velocity')])
    return points[np.isfinite(points[:, 0])]


def _write_results(store: Store, straddling: Straddling, work: Work, seed: int) -> None:
    """Write the rates, and the orbits, of a store whose parts are complete."""
    points, random = _straddled(store), np.random.default_rng([seed, PARTS])
    unstable = find_orbits(straddling.catalogue.parameters, LONGEST, most=SOUGHT,
                           threads=work.threads, cluster=work.cluster).unstable
    orbit = straddling.orbit_of(points)
    rates = straddling.rates(points, lambda: store.read_all('estimate'))
    found = [('', *near) for near in straddling.orbits_near(
        points, (orbit,) if orbit else unstable) if near[1]][:LISTED]
    for each in straddling.catalogue.attractors if straddling.is_edge else ():
        if met := straddling.accessible_orbit(each, unstable, RAYS, REACHED, random):
            found.append((each.key, *met))
    values, errors = zip(rates.kappa, rates.lambda_1, rates.lambda_2, rates.dimension_1,
                         rates.dimension_2, rates.exponent, strict=True)
    store.set_attributes({'is_orbit': orbit.key if orbit else '', 'escapes': rates.escapes,
                          'impacts': rates.impacts})
    store.write_table(table(
        'rate', name=([*RATES], 'name of the rate', ''), error=(errors, 'its standard error'),
        value=(values, 'rate per impact, or dimension')) | table(
        'orbit', key=([one.key for _, one, _ in found], 'name of the orbit', ''),
        side=([side for side, _, _ in found], 'attractor from which it is accessible, empty for '
              'an orbit on the saddle', ''),
        impacts=([one.impacts for _, one, _ in found], 'impacts of a period'),
        multiplier=(np.reshape([one.multipliers.real for _, one, _ in found], (-1, 2)),
                    'multipliers of a period', '1', 'pair'),
        near=([near for _, _, near in found], 'impacts straddled near it')) | impact_table(
        'orbit_point', [(one.walls, one.points) for _, one, _ in found], 'orbit of the point'))


def _lifetime(straddling: Straddling, initial: RecordArray) -> int:
    """Return how long one trajectory is transient; refuse what is too short to be compared."""
    (result,) = straddling.catalogue.label(initial)
    lifetime = int(result['impacts' if result['label'] == UNSETTLED else 'lifetime'])
    if lifetime < straddling.tail + 2 * HEAD:
        raise ValueError(f'the transient from --initial lasts {counted(lifetime, "impact")}, too '
                         'short to compare; take another initial condition')
    return lifetime


def _compare(straddling: Straddling, points: FloatArray, initial: RecordArray, lifetime: int
             ) -> dict[str, Any]:
    """Compare the transient of one trajectory with the saddle on which impacts lie."""
    count = min(lifetime - straddling.tail, COMPARED)
    grown = straddling.growths(initial, count)[0, HEAD:]
    batches = np.array([part.mean(axis=0) for part in np.array_split(grown, PARTS)])
    rows, _ = record_impacts(initial, HEAD, count - HEAD)
    apart = [np.min(distances(points[:, 1], points[:, 0], one['velocity'], one['phase']))
             for one in rows[0]]
    return {'transient': lifetime, 'transient_near': float(np.mean(np.less(apart, NEAR))),
            'transient_exponents': batches.mean(axis=0).tolist(),
            'transient_errors': (batches.std(axis=0, ddof=1) / math.sqrt(PARTS)).tolist()}


def describe(dataset: Arrays) -> str:
    """Put a saddle in words: what it is, its rates, the orbits on it."""
    a = dataset.attrs
    what = ('the chaotic saddle of the transient' if a['straddles'] == 'lifetimes' else
            'the boundary of the basins')
    keys, sides, *others = (dataset[f'orbit_{name}'].values.tolist() for name in (
        'key', 'side', 'impacts', 'multiplier', 'near'))
    if a['is_orbit']:
        lines = [f'{what} holds the orbit {a["is_orbit"]}' + ' alone' * (
            {*keys} == {a['is_orbit']})]
    else:
        lines = [f'{what}{" holds a chaotic saddle" * (a["straddles"] == "labels")}: '
                 f'{counted(a["escapes"], "escape")}, {counted(a["impacts"], "impact")} near it']
    lines.append(in_columns(['rate', '', 'value [1]'], [
        [words, name, with_error(value, error)] for (name, words), value, error in zip(
            RATES.items(), *(dataset[f'rate_{name}'].values for name in ('value', 'error')),
            strict=True)]))
    if 'transient' in a:
        one, two = zip(a['transient_exponents'], a['transient_errors'], strict=True)
        lines.append(f'transient of {counted(a["transient"], "impact")}: exponents '
                     f'{with_error(*one)} and {with_error(*two)}; '
                     f'{a["transient_near"]:.1%} of its impacts are within {NEAR} of the saddle')
    if keys:
        lines.append(in_columns(
            ['orbit', 'key', ' impacts', 'multipliers', ' straddled near it'],
            [[f'accessible from {side}' if side else 'on it', key, str(q),
              f'{pair[0]:+.5g} {pair[1]:+.5g}', str(near)]
             for key, side, q, pair, near in zip(keys, sides, *others, strict=True)]))
    return describe_attractors(dataset, beside='\n'.join(lines))


def with_error(value: float, error: float) -> str:
    """Write a value to the second digit of its error, or to ten digits where it is exact."""
    digits = 1 - math.floor(math.log10(error)) if error > 0.0 else 10
    return f'{value:.{digits}f} +- {error:.{digits}f}' if error > 0.0 else f'{value:.{digits}f}'


def _layout(identity: dict[str, Any]) -> Layout:
    impact = ('part', 'impact')
    return Layout(
        (Axis('part', np.arange(PARTS), named('independent part', None), 1),
         Axis('impact', np.arange(identity['straddled'] // PARTS), named('impact', None)),
         Axis('cut', np.array(['narrow', 'wide']), named('what is left out', None)),
         Axis('quantity', np.array(QUANTITIES), named('what is estimated', None))),
        (Variable('phase', impact, '<f8', named('phase of the impacts straddled', 'rad')),
         Variable('velocity', impact, '<f8', named('velocity just before them')),
         Variable('estimate', ('part', 'cut', 'quantity'), '<f8', named(
             'per impact, or how many; nan where too few stay'))),
        identity, {'title': 'A saddle of the gear-rattling model'})


def boundary_saddle(catalogue: Catalogue, plane: Plane | None = None, *, seed: int = SEED,
                    straddled: int = STRADDLED, sprinkled: int = 2 * SPRINKLED) -> SaddleRates:
    """Estimate the rates of the saddle on the boundary of all basins of a catalogue."""
    # ValueError where there is none; nan where too few trajectories stay long enough.
    straddling, random = Straddling(catalogue, True, catalogue.hold), np.random.default_rng(seed)
    points = straddling.follow(plane or Plane(), straddled, random)
    return straddling.rates(points, lambda: np.stack([
        straddling.sprinkle(points, sprinkled // PARTS, random) for _ in range(PARTS)]))
