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

"""Rattle of a gear pair: whether, how often and how hard, at one speed or in a run-up."""

import functools
import json
import math
from typing import Any, Final, NamedTuple, Unpack

import numpy as np

from .motion import follow, state_on
from ..attractors import identity_of, require_tolerance
from ..work import Arrays, Study, Work, WorkOptions
from ...attractors.catalogue import Attractor, Catalogue, Kind
from ...attractors.finding import find_attractors
from ...attractors.listing import named, table
from ...attractors.plane import Plane
from ...attractors.skeleton.kicks import CAP, REACH, smallest_kick
from ...core.arrays import FloatArray
from ...core.defaults import SEED, TOLERANCE
from ...core.flight.elementary import TWO_PI
from ...core.gears import Gears, Scales
from ...core.many.chaotic_sets import SWEEP, THOROUGH
from ...core.model import EventKind, require_finite
from ...core.stream.rattle import order_spectrum, rattle_of
from ...core.stream.reconstruction import drive_phases
from ...core.words import in_columns
from ...store.layout import Axis, Layout, Variable
from ...store.store import Store, StoreError

NAME: Final = 'rattle'
# Bands of the spectrum in an order.
BANDS: Final = 8
QUIET: Final = (Kind.RESTING.value, Kind.FLOATING.value)
# Speeds of a run-up that are measured one after another, and then kept.
BLOCK: Final = 4
# Columns of the table of motions: words, and unit.
COLUMNS: Final = {
    'point': ('point of the run-up', '1'), 'key': ('name of the motion', ''),
    'kind': ('periodic, chaotic, resting or the like', ''),
    'share': ('share of the random initial conditions', '1'),
    'share_error': ('standard error of the share', '1'), 'mode': ('flanks that are hit', ''),
    'force': ('contact force, rms in a band of orders', 'N', 'order')}
# Words of the others by how their names begin, and units by how they end.
WORDS: Final = {
    'rate': 'impacts per second on the flank', 'speed': 'approach speed of impacts',
    'impulse': 'impulse of an impact', 'loss': 'energy that an impact loses',
    'contact': 'share of the time in contact with the flank', 'force': 'force on the flank',
    'power': 'power', 'rattle': 'share of the contact impulse that comes in impacts',
    'duration': 'length of the stretch that was measured'}
UNITS: Final = {'_per_s': '1/s', '_m_per_s': 'm/s', '_n_s': 'N s', '_j': 'J', '_n': 'N',
                '_w': 'W', '_s': 's'}


class _Motion(NamedTuple):
    """A motion of a gear pair."""

    row: dict[str, Any]  # of the table of motions, by column
    times: FloatArray  # of its impacts [s], and their impulses, on the upper flank positive [N s]
    impulses: FloatArray


@Study
def rattle(pair: Gears, plane: Plane | None = None, *,
           run_up: tuple[float, float] | None = None, points: int = 61, above: float = 0.0,
           orders: int = 20, periods: int = 200, initial_conditions: int = 300,
           seed: int = SEED, hold: int = 20_000, tolerance: float = TOLERANCE,
           **options: Unpack[WorkOptions]) -> Store:
    """
    Find whether a gear pair rattles, how often and how hard, at one speed or in a run-up.

    The dataset has, for every `point` of the run-up, the share of random initial conditions that
    rattle and the smallest kick that starts rattle of a gear at rest; for every `state`, a motion
    that initial conditions settle on, what `Rattle` has, in SI units, and the spectrum of the
    contact force over the order; and every `impact`.

    Parameters
    ----------
    pair : Gears
        The gear pair.
    plane, initial_conditions, seed
        The window from which initial conditions are drawn, how many, and their seed.
    run_up : tuple of float, optional
        First and last `speed_rpm`, or `frequency_hz` if the gear pair gives that.
    points : int
        Speeds of the run-up.
    above : float
        Approach speed from which impacts count for rates and speeds [m/s].
    orders : int
        Highest order of the spectrum, in units of the frequency of the drive.
    periods : int
        Drive periods over which a motion that is not periodic is measured.
    hold, tolerance
        As `find_attractors` takes them.

    """
    require_tolerance(tolerance)
    require_finite('above', above, 0.0, math.inf)
    name = 'frequency_hz' if pair.speed_rpm is None else 'speed_rpm'
    pairs, asked = [pair], {}
    if run_up is not None:
        if not 0.0 < run_up[0] < run_up[1] < math.inf:
            raise ValueError(f'run-up {run_up[0]:g} to {run_up[1]:g} is not from a positive '
                             f'{name} to a higher one')
        pairs = [pair.at(**{name: float(value)}) for value in np.linspace(*run_up, points)]
        asked = {'run_up': list(run_up), 'points': points}
    work, plane = Work(**options), plane or Plane()
    store = work.begin(Layout(
        (Axis('point', np.arange(len(pairs)), named('point of the run-up', None), BLOCK),),
        (Variable('point_share', ('point',), '<f8', named(
            'share of the random initial conditions that rattle')),
         Variable('point_kick_m_per_s', ('point',), '<f8', named(
             'smallest kick that starts rattle of a gear at rest: 0 where none rests, inf where '
             'none was found', 'm/s'))),
        identity_of(
            NAME, pair.parameters, plane, gears=json.dumps(pair.given), above=above,
            orders=orders, periods=periods, initial_conditions=initial_conditions, seed=seed,
            hold=hold, tolerance=tolerance, **asked),
        {'title': 'Rattle of a gear pair', 'onset_hz': pair.onset_hz}))
    try:
        motions = _read(store)
    except StoreError:
        motions = []
        store.mark(list(range(len(store.tiles))), False)
        _write_points(store, pairs, orders)
    points_of = [range(len(pairs))[tile['point']] for tile in store.tiles]
    # Those of a block that is not marked were its last.
    open_points = {number for tile in store.pending() for number in points_of[tile]}
    motions = [one for one in motions if one.row['point'] not in open_points]
    with work.pending(NAME, store, lambda tile: len(points_of[tile])) as (pending, finished):
        def measured(tile: int, found: list[tuple[list[_Motion], float]]) -> None:
            motions.extend(one for some, _ in found for one in some)
            if motions:
                _write(store, sorted(motions, key=lambda one: int(one.row['point'])))
            store.write(tile, {'point_share': [
                sum(one.row['share'] for one in some if one.row['kind'] not in QUIET)
                for some, _ in found], 'point_kick_m_per_s': [kick for _, kick in found]})
            finished(tile, 0)

        work.run(functools.partial(
            _measure, pairs, points_of, plane, above, orders, periods, initial_conditions, seed,
            hold, tolerance), pending, measured)
    if not motions:
        raise ValueError(f'no motion settles within {hold} impacts; give a larger --hold')
    return store


def _measure(pairs: list[Gears], points_of: list[range], plane: Plane, above: float, orders: int,
             periods: int, initial_conditions: int, seed: int, hold: int, tolerance: float,
             tile: int) -> list[tuple[list[_Motion], float]]:
    """Measure the motions of some gear pairs, and the smallest kick that starts rattle."""
    found = []
    for number in points_of[tile]:
        parameters, scales = pairs[number].parameters, pairs[number].scales
        catalogue = find_attractors(
            parameters, plane.draw(parameters, initial_conditions, seed), tolerance=tolerance,
            hold=hold, effort=THOROUGH if len(pairs) == 1 else SWEEP, threads=1)
        motions = [_motion(number, each, catalogue, scales, above, orders, periods)
                   for each in catalogue.attractors if each.settled]
        found.append((motions, _kick(catalogue) * scales.velocity_m_per_s))
    return found


def _motion(number: int, each: Attractor, catalogue: Catalogue, scales: Scales, above: float,
            orders: int, periods: int) -> _Motion:
    # A periodic motion is known from one period.
    total = each.drive_periods or periods
    events = follow(catalogue.parameters, state_on(each, catalogue)[0], each.impacts, total, True)
    lines = np.arange(total * orders + 1)
    power = np.abs(order_spectrum(events, lines / total))**2 * np.where(lines, 2.0, 1.0)
    bands = np.bincount(np.rint(lines * BANDS / total).astype(np.int64), power)
    is_hit = events['kind'] <= EventKind.STICK
    hits, taus = events[is_hit], drive_phases(events)[is_hit] + TWO_PI * total
    measured = rattle_of(events, above / scales.velocity_m_per_s)
    return _Motion({
        'point': number, 'key': each.key, 'kind': each.kind.value, 'share': each.share,
        'share_error': each.share_error, 'mode': measured.mode,
        'force': np.sqrt(bands) * scales.force_n, **measured.in_si(scales)},
        taus * scales.time_s, (hits['velocity'] - hits['velocity_after']) * scales.impulse_n_s)


def _kick(catalogue: Catalogue) -> float:
    """Return the smallest kick that starts rattle of a gear at rest: 0 where none rests."""
    resting = [each for each in catalogue.attractors if each.kind is Kind.RESTING]
    if not resting:
        return 0.0
    kicks = [smallest_kick(catalogue, each, reach=REACH, cap=CAP, threads=1) for each in resting]
    return min((kick.size for kick in kicks if kick), default=math.inf)


def _write_points(store: Store, pairs: list[Gears], orders: int) -> None:
    models = [pair.parameters for pair in pairs]
    store.write_table(table(
        'point',
        frequency_hz=([pair.omega / TWO_PI for pair in pairs], 'frequency of the drive', 'Hz'),
        speed_rpm=([pair.speed_rpm or math.nan for pair in pairs], 'speed of the shaft', '1/min'),
        alpha=([p.alpha for p in models], 'amplitude of the drive'),
        beta=([p.beta for p in models], 'damping'), gamma=([p.gamma for p in models], 'load'),
        lift=([p.alpha * math.hypot(1.0, p.beta) / abs(p.gamma) if p.gamma else math.inf
               for p in models], 'force of the drive over that of the load: above 1 a gear at '
              'rest is lifted'),
    ) | {'order': (('order',), np.arange(orders * BANDS + 1) / BANDS, named(
        'order: frequency over that of the drive'))})


def _write(store: Store, motions: list[_Motion]) -> None:
    def column(name: str) -> tuple[Any, ...]:
        words = COLUMNS.get(name) or (
            f'{WORDS[name.split("_")[0]]}, {name.split("_")[1]}',
            next((unit for suffix, unit in UNITS.items() if name.endswith(suffix)), '1'))
        return (np.array([one.row[name] for one in motions]), *words)

    store.write_table(table('state', **{name: column(name) for name in motions[0].row}) | table(
        'impact', state=(np.repeat(np.arange(len(motions)), [len(one.times) for one in motions]),
                         'motion it belongs to'),
        time_s=(np.concatenate([one.times for one in motions]), 'time', 's'),
        impulse_n_s=(np.concatenate([one.impulses for one in motions]),
                     'impulse, positive on the upper flank', 'N s')))


def _read(store: Store) -> list[_Motion]:
    """Read the motions that are there; StoreError where there are none."""
    owners, times, impulses = (store.read_all(f'impact_{name}')
                               for name in ('state', 'time_s', 'impulse_n_s'))
    columns = {name.removeprefix('state_'): store.read_all(name)
               for name in store.tables() if name.startswith('state_')}
    return [_Motion({name: values[k] for name, values in columns.items()},
                    times[owners == k], impulses[owners == k])
            for k in range(len(columns['point']))]


def describe(dataset: Arrays) -> str:
    """Answer whether it rattles, and list every motion."""
    def column(name: str, form: str, scale: float = 1.0) -> list[str]:
        return [format(value * scale, form) if math.isfinite(value) else
                'none' if math.isinf(value) else '' for value in dataset[name].values.tolist()]

    a = dataset.attrs
    gears = Gears.of(json.loads(a['gears']))
    frequency, speed, lift, share, kick = (dataset[f'point_{name}'].values for name in (
        'frequency_hz', 'speed_rpm', 'lift', 'share', 'kick_m_per_s'))
    axis = speed if gears.speed_rpm else frequency
    unit = 'rpm' if gears.speed_rpm else 'Hz'
    answers = ['rattles' if not k else 'rests' if not s else 'rattles or rests'
               for s, k in zip(share, kick, strict=True)]
    words = [f'a gear at rest is lifted above {a["onset_hz"]:.6g} Hz'
             + (f', {gears.speed_rpm * a["onset_hz"] / (gears.omega / TWO_PI):.6g} rpm'
                if gears.speed_rpm else '')]
    rests = np.flatnonzero(kick > 0.0)
    if len(rests):
        some = rests[np.argmax(share[rests])]
        words.append(f'where it rests, at most {share[some]:.1%} of the random initial conditions '
                     f'rattle, at {axis[some]:.6g} {unit}' if share[some] else
                     'where it rests, none of the random initial conditions rattles')
        least = rests[np.argmin(kick[rests])]
        words.append('no kick was found that starts rattle' if math.isinf(kick[least]) else
                     f'the smallest kick that starts rattle is {1e3 * kick[least]:.4g} mm/s, at '
                     f'{axis[least]:.6g} {unit}')
    above = f' from {1e3 * a["above"]:g} mm/s' if a['above'] else ''
    points = dataset['state_point'].values
    columns = [
        (f' {unit}', [f'{axis[k]:.6g}' for k in points]),
        (' lift [1]', [f'{lift[k]:.3f}' for k in points]),
        ('answer', [answers[k] for k in points]),
        ('motion', dataset['state_key'].values.tolist()),
        (' share [%]', column('state_share', '.1f', 100.0)),
        ('flanks', dataset['state_mode'].values.tolist()),
        (' in contact [%]', [f'{100.0 * value:.1f}' for value in (
            dataset['state_contact_upper'].values + dataset['state_contact_lower'].values)]),
        (f' impacts/s{above}: upper', column('state_rate_upper_per_s', '.4g')),
        (' lower', column('state_rate_lower_per_s', '.4g')),
        (' rms [mm/s]', column('state_speed_rms_m_per_s', '.4g', 1e3)),
        (' mean', column('state_speed_mean_m_per_s', '.4g', 1e3)),
        (' peak', column('state_speed_peak_m_per_s', '.4g', 1e3)),
        (' impulse, peak [N s]', column('state_impulse_peak_n_s', '.3g')),
        (' force, upper [N]', column('state_force_upper_n', '.3g')),
        (' lower', column('state_force_lower_n', '.3g')),
        (' lost [mW]', column('state_power_lost_w', '.3g', 1e3)),
        (' index [1]', column('state_rattle_index', '.3f'))]
    headings, cells = zip(*columns, strict=True)
    return '\n'.join(['; '.join(words), in_columns(headings, [
        [*row] for row in zip(*cells, strict=True)])])
