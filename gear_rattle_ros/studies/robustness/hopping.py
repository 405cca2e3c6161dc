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


"""How often noise makes the driven gear hop from one attractor to another."""

from collections.abc import Sequence
import functools
import json
import math
from pathlib import Path
from typing import Any, Final, Unpack

import numpy as np

from .. import attractors
from ..work import Arrays, Study, Work, WorkOptions
from ...attractors.catalogue import Catalogue, OTHERS
from ...attractors.cores import cores_of, radii_of
from ...attractors.finding import find_attractors
from ...attractors.listing import named, table
from ...attractors.plane import Plane
from ...core.arrays import RecordArray
from ...core.defaults import HOLD, INITIAL_CONDITIONS, SEED, TOLERANCE
from ...core.flight.lanes import EMPTY
from ...core.flight.noise import Noise
from ...core.flight.simulation import NOISE_MAXIMUM
from ...core.many.hopping import Cores, hop_from, STAY
from ...core.many.residence import FEW, Residence, residence_on, slopes
from ...core.model import Parameters, require_finite
from ...core.words import counted, in_columns
from ...store.layout import Axis, Layout, Variable
from ...store.store import Store

NAME: Final = 'hopping'
# Trajectories of a tile.
BATCH: Final = 16
# The smallest strength that is tried, and how closely it is found.
FAINTEST: Final = 1e-12
CLOSE: Final = 1.02
# What ends a trajectory, by label.
ENDS: Final = {label: key for label, (key, _) in OTHERS.items() if label != EMPTY}
STAYS: Final = {'label': ('<i4', 'attractor of the stay, -1 for none'),
                'following': ('<i4', 'attractor that follows it, -1 where no end was seen'),
                'impacts': ('<i8', 'impacts of the stay'),
                'periods': ('<f8', 'drive periods of the stay')}


@Study
def hopping(parameters: Parameters, plane: Plane | None = None, *,
            noise: Sequence[float] = (0.01, 0.015, 0.02, 0.03), kind: str = 'gaussian',
            impacts: int = 200_000, trajectories: int = 64, stays: int = 200, smallest: int = 0,
            tolerance: float = TOLERANCE, initial_conditions: int = INITIAL_CONDITIONS,
            seed: int = SEED, hold: int = HOLD, **options: Unpack[WorkOptions]) -> Store:
    """
    Count the hops between the attractors at some strengths of the noise.

    A trajectory is on the attractor whose core it visited last; a stay lasts from its first impact
    in one core to its first in another. The dataset has every stay, what the attractors are
    without noise, and their cores.

    Parameters
    ----------
    parameters, plane
        The model, and the window from which initial conditions are drawn that find the attractors.
    noise : sequence of float
        Standard deviations [1].
    kind : str
        What is random: 'gaussian' or 'uniform' kicks added to the velocity after an impact, or
        'jitter' of alpha from one drive period to the next, Gaussian.
    impacts, trajectories : int
        Impacts of a trajectory at the most, and trajectories at each strength. They begin on the
        attractors in turn, and trajectory k has the noise of the simulator with `seed` + k.
    stays : int
        Stays with which a trajectory ends.
    smallest : int
        Impacts within which the smallest strength is to make a trajectory hop; 0 does without.
    seed : int
        Of the noise and of the random initial conditions.
    tolerance, initial_conditions, hold
        As `find_attractors` takes them.

    """
    attractors.require_tolerance(tolerance)
    work, plane = Work(**options), plane or Plane()
    number = noise_of(kind, noise)
    store = work.begin(_layout(attractors.identity_of(
        NAME, parameters, plane, noise=list(noise), kind=kind, impacts=impacts, stays=stays,
        trajectories=trajectories, smallest=smallest, tolerance=tolerance,
        initial_conditions=initial_conditions, seed=seed, hold=hold)))
    catalogue = find_attractors(
        parameters, plane.draw(parameters, initial_conditions, seed), tolerance=tolerance,
        hold=hold, threads=work.threads)
    cores, initial = cores_of(catalogue), _initial(catalogue, trajectories)
    attractors.write_attractors(store, catalogue)
    radii = radii_of(cores)
    store.write_table({**table('core', label=(list(radii), 'attractor of the core'), radius=(
        list(radii.values()), 'radius of the balls round the points of an orbit'))})
    follow = functools.partial(_follow, cores, number, seed)
    fill = functools.partial(_fill, store.path, follow, initial)
    with work.pending(NAME, store, lambda tile: 1) as (pending, finished):
        work.run(fill, pending, finished)
    if smallest and not store.has_table('smallest_high'):
        reached = _reached(catalogue)
        bounds = np.array([
            _smallest(follow, initial, range(k, trajectories, len(reached)), smallest)
            for k in range(len(reached))]).T
        store.write_table(table(
            'smallest', label=(reached, 'attractor that is left'),
            low=(bounds[0], 'largest strength tried at which none left it'),
            high=(bounds[1], 'smallest strength tried at which one left it')))
    return store


def noise_of(kind: str, strengths: Sequence[float]) -> Noise:
    """Return the kind of noise; ValueError where there is none of that name or strength."""
    for strength in strengths:
        require_finite('noise', strength, FAINTEST, NOISE_MAXIMUM)
    if kind.upper() not in Noise.__members__:
        raise ValueError(f'kind of noise {kind!r} is not one of '
                         f'{", ".join(each.name.lower() for each in Noise)}')
    return Noise[kind.upper()]


def _reached(catalogue: Catalogue) -> list[int]:
    reached = [each.label for each in catalogue.attractors if each.label >= 0 and each.settled]
    if not reached:
        raise ValueError('there is no attractor but rest at these parameters, and nothing hops')
    return reached


def _initial(catalogue: Catalogue, count: int) -> RecordArray:
    # On the attractors in turn.
    states = [catalogue.states[catalogue.labels == label] for label in _reached(catalogue)]
    owners = [states[k % len(states)] for k in range(count)]
    return np.array([own[k // len(states) % len(own)] for k, own in enumerate(owners)],
                    catalogue.states.dtype)


def _follow(cores: Cores, kind: Noise, seed: int, initial: RecordArray, sigma: float,
            first: int, impacts: int, stays: int) -> tuple[RecordArray, RecordArray]:
    seeds = np.arange(seed + first, seed + first + len(initial))
    return hop_from(initial, sigma, kind, seeds, impacts, cores, stays)


def _fill(path: Path, follow: functools.partial[tuple[RecordArray, RecordArray]],
          initial: RecordArray, tile: int) -> int:
    store = Store(path)
    a, part = store.attrs, store.tiles[tile]
    first = part['trajectory'].start
    rows, visitors = follow(initial[part['trajectory']], float(a['noise'][part['noise'].start]),
                            first, a['impacts'], a['stays'])
    rows['label'][np.arange(a['stays']) >= visitors['stays'][:, None]] = EMPTY
    store.write(tile, {
        'impacts': visitors['impacts'][None], 'outside': visitors['outside'][None],
        **{f'stay_{name}': rows[name][None] for name in STAYS}})
    return int(visitors['impacts'].sum())


def _smallest(follow: functools.partial[tuple[RecordArray, RecordArray]], initial: RecordArray,
              own: range, impacts: int) -> tuple[float, float]:
    """Bracket the smallest strength at which one of some trajectories hops in time."""
    def leaves(sigma: float) -> bool:
        # One after the other: each has the seed of its number.
        return any(
            rows['following'][0, 0] != EMPTY and visitors['stays'][0] > 0
            for rows, visitors in (follow(initial[k:k + 1], sigma, k, impacts, 1) for k in own))

    low, high = FAINTEST, 2.0 * FAINTEST
    while high < NOISE_MAXIMUM and not leaves(high):
        low, high = high, 2.0 * high
    if high >= NOISE_MAXIMUM:
        return low, math.inf
    while high / low > CLOSE:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if leaves(middle) else (middle, high)
    return low, high


def stays_of(dataset: Arrays, k: int) -> RecordArray:
    """Return the stays at the k-th strength, as STAY."""
    label = dataset['stay_label'].values[k]
    there = label != EMPTY
    stays = np.zeros(np.count_nonzero(there), STAY)
    for name in STAYS:
        stays[name] = dataset[f'stay_{name}'].values[k][there]
    return stays


def residences(dataset: Arrays) -> dict[int, list[Residence]]:
    """Return the stays on each attractor at each strength, by the label of the attractor."""
    labels = [int(label) for label in dataset['attractor_label'].values if label >= 0]
    stays = [stays_of(dataset, k) for k in range(len(dataset.attrs['noise']))]
    return {label: [residence_on(each, label, [*labels, *ENDS]) for each in stays]
            for label in labels}


def describe(dataset: Arrays) -> str:
    """Put residence times, rates and slopes in words."""
    a = dataset.attrs
    noise = np.array(a['noise'])
    names = ENDS | {int(label): str(letter or key) for label, letter, key in zip(
        *(dataset[f'attractor_{name}'].values for name in ('label', 'letter', 'key')),
        strict=True)}
    found = residences(dataset)
    rows, fits = [], []
    totals = dataset['impacts'].values.sum(axis=1)
    for k, sigma in enumerate(noise):
        for label, each in found.items():
            one = each[k]
            if not one.exposure:
                continue
            mean = (f'{one.mean:,.1f} +- {one.mean_error:.1f}' if one.ends else
                    f'> {one.mean:,.0f}')
            per = one.exposure / one.periods if one.periods else math.nan
            rows.append([
                f'{sigma:g}', names[label], mean, f'{one.mean / per:,.1f}',
                ', '.join(f'{names[to]} {count:,}' for to, count in zip(
                    [*found, *ENDS], one.jumps, strict=True) if count) or 'none',
                f'{one.exposure / totals[k]:.2%}',
                '-' if math.isnan(one.exponential) else f'{one.exponential:.2g}'])
    text = in_columns(
        [' sigma', 'attractor', ' mean stay [impacts]', ' [periods]', 'hops to', ' impacts on it',
         ' p(exponential)'], rows)
    outside = ', '.join(f'{share:.2%}' for share in
                        dataset['outside'].values.sum(axis=1) / totals)
    text += f'\nin no core: {outside} of the impacts, by strength'
    for label, each in found.items():
        local, errors = slopes(noise, each)
        fits += [f'{names[label]} {value:.3g} +- {error:.2g} ({low:g} to {high:g})'
                 for value, error, low, high in zip(local, errors, noise[:-1], noise[1:],
                                                    strict=True) if not math.isnan(value)]
    if fits:
        text += ('\nlocal slopes of ln T against 1/sigma^2, from at least '
                 f'{counted(FEW, "hop")} each: ' + '; '.join(fits))
    if a['smallest']:
        for label, low, high in zip(*(dataset[f'smallest_{name}'].values for name in (
                'label', 'low', 'high')), strict=True):
            text += (f'\n{names[int(label)]} is left within {counted(a["smallest"], "impact")} at '
                     f'sigma = {high:.4g}, not at {low:.4g}')
    return text


def _layout(identity: dict[str, Any]) -> Layout:
    noise, count, room = (identity[name] for name in ('noise', 'trajectories', 'stays'))
    whole = 'noise', 'trajectory', 'stay'
    return Layout(
        (Axis('noise', np.array(noise), named('standard deviation of the noise'), 1),
         Axis('trajectory', np.arange(count), named('trajectory', None), BATCH),
         Axis('stay', np.arange(room), named('stay in turn', None))),
        (Variable('impacts', whole[:2], '<i8', named('impacts made')),
         Variable('outside', whole[:2], '<i8', named('those outside every core')),
         *(Variable(f'stay_{name}', whole, dtype, named(words))
           for name, (dtype, words) in STAYS.items())),
        identity, {'title': 'Hops between attractors by noise', 'cores': json.dumps(
            'in phase and velocity just before the impact')})
