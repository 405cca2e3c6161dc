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

"""How far attractors are from being left: what to know before choosing an operating point."""

from collections.abc import Callable
import dataclasses
import functools
import math
from typing import Any, Final, Unpack

import numpy as np
import numpy.typing as npt

from .. import attractors
from ..grids import basins
from ..sweeps.diagram import Diagram
from ..sweeps.orbit_diagram import compute
from ..transitions.continuation import BINS
from ..work import Arrays, Study, Work, WorkOptions
from ...attractors.catalogue import Attractor, Catalogue, Kind, OTHERS, others_where
from ...attractors.columns import Window
from ...attractors.finding import find_attractors
from ...attractors.listing import named, table
from ...attractors.plane import IMPACT, ON_WALLS, Plane
from ...attractors.skeleton.accessible import accessible_orbit, least_changes
from ...attractors.skeleton.kicks import (
    impacts_of,
    Kick,
    REACH,
    smallest_displacement,
    smallest_kick,
)
from ...core.arrays import FloatArray, IntArray
from ...core.defaults import BASINS_CAP, HOLD, SEED, TOLERANCE
from ...core.flight.elementary import TWO_PI
from ...core.flight.lanes import make_initial_conditions
from ...core.flight.simulation import Simulation
from ...core.many.recorded import record_impacts
from ...core.many.settling import RecordArray, UNSETTLED
from ...core.model import Parameters, require_finite, State, Wall
from ...core.path import Path
from ...core.words import in_columns
from ...store.store import Store

NAME: Final = 'stability'
TITLE: Final = 'Stability of the attractors of the gear-rattling model'
# Impacts that are kept at once, to find when trajectories settle.
ROOM: Final = 1_000_000
# Moments at which parameters jump, and between two of them on a chaotic attractor the drive
# periods, whose fractions are spread evenly.
MOMENTS: Final = 1000
BETWEEN: Final = 10.0 + 0.5 * (math.sqrt(5.0) - 1.0)
# Parts of what there is at the model, and quantities, of which the places are sought.
LEVELS: Final = (0.9, 0.5)
QUANTITIES: Final = ('share', 'kick')
# What is listed of a kick.
KICK: Final = ('size', 'change', 'phase_change', 'wall', 'phase', 'velocity', 'target',
               'resolution', 'unsettled', 'manifold')


@Study
def stability(parameters: Parameters, plane: Plane | None = None, *, cap: int = BASINS_CAP,
              tolerance: float = TOLERANCE, initial_conditions: int = 10_000, seed: int = SEED,
              hold: int = HOLD, reach: float = REACH, to: Parameters | None = None,
              erosion: Path | None = None, columns: int = 41,
              trajectories: int = 2000, omega: float | None = None, tile: int | None = None,
              **options: Unpack[WorkOptions]) -> Store:
    """
    Find how far the attractors are from being left.

    The dataset has the basins, by default just before impacts, and of every attractor its share,
    how soon trajectories settle on it, the smallest kick at an impact and the smallest
    displacement of an impact that change the attractor, and the largest disc in its basin.

    Parameters
    ----------
    parameters, plane, cap, tolerance, initial_conditions, seed, hold, tile
        As `basins` takes them; `cap` is for kicks, too.
    reach : float
        The largest kick that is tried [1].
    to : Parameters, optional
        The model after a jump at a random moment: where trajectories go then.
    erosion : Path, optional
        Path through the model, on which shares and smallest kicks are followed.
    columns, trajectories : int
        Places on that path, and random initial conditions at each.
    omega : float, optional
        Angular frequency of the drive [rad/s]: times are given in seconds, too.

    """
    require_finite('reach', reach, 1e-9, 100.0)
    if omega is not None:
        require_finite('omega', omega, 1e-9, 1e9)
    asked: dict[str, Any] = {'reach': reach}
    if to is not None:
        asked['to'] = jumps(parameters, to)
    if erosion is not None:
        (low, high), value = erosion.ends, erosion.of(parameters)
        if not (low <= value <= high and erosion.meets(parameters)):
            raise ValueError(f'{erosion.name} {value:g} is not in the window of erosion {low:g} '
                             f'to {high:g}; widen it')
        asked |= {**attractors.path_attributes('erosion_window', erosion), 'columns': columns,
                  'trajectories': trajectories}
    work, plane = Work(**options), plane or Plane(phases=200, velocities=200, kind=IMPACT)
    store, catalogue = basins.compute_basins(
        parameters, plane, work, cap=cap, tolerance=tolerance, seed=seed, hold=hold,
        initial_conditions=initial_conditions, tile=tile, name=NAME, title=TITLE, **asked)
    if not store.has_table('attractor_disc_radius'):
        store.write_table(_settling(
            catalogue, plane.draw(parameters, initial_conditions, seed), work) | _kicks(
            catalogue, reach, cap, work) | _discs(store.read_all('label'), catalogue, plane))
    if to is not None and not store.has_table('attractor_tipped'):
        store.write_table(_tipped(catalogue, find_attractors(
            to, plane.draw(to, initial_conditions, seed), tolerance=tolerance, hold=hold,
            threads=work.threads), work))
    if erosion and not store.has_table('attractor_left'):
        store.write_table(_erosion(catalogue, Diagram(
            erosion, columns, plane, trajectories, seed, Window(bins=BINS, kicks=True),
            ('random',)), work))
    store.set_attributes({'omega': omega or 0.0})
    return store


def jumps(parameters: Parameters, to: Parameters) -> str:
    """Put in words where parameters jump; ValueError where none does."""
    changed = [f'{name} {value:.10g}' for name, value in vars(to).items()
               if value != getattr(parameters, name)]
    if not changed:
        raise ValueError('a jump to the same parameters changes nothing; give others')
    return ', '.join(changed)


def _settling(catalogue: Catalogue, initial: RecordArray, work: Work) -> dict[str, Any]:
    """Find how soon the random initial conditions settle: mean, median, largest."""
    results = catalogue.label(initial, threads=work.threads)
    times = np.stack([results['lifetime'], settling_times(initial, results['lifetime'])])
    lifetimes = np.full((2, len(catalogue.attractors), 3), math.nan)
    for k, each in enumerate(catalogue.attractors):
        mine = times[:, results['label'] == each.label]
        if mine.size and each.kind is not Kind.UNSETTLED:
            lifetimes[:, k] = np.stack([f(mine, axis=1) for f in (np.mean, np.median, np.max)], 1)
    words = 'until a trajectory is within the tolerance of the attractor: mean, median, largest'
    return table('attractor', **{f'settling_{unit.split()[-1]}': (
        values, f'{unit} {words}', '1', 'moment')
        for unit, values in zip(('impacts', 'drive periods'), lifetimes, strict=True)})


def settling_times(initial: RecordArray, lifetimes: IntArray) -> FloatArray:
    """Return when trajectories make their impact of these numbers [drive periods]."""
    times = np.zeros(len(initial))
    order = np.argsort(-lifetimes, kind='stable')
    order = order[lifetimes[order] > 0]
    while len(order):
        longest = int(lifetimes[order[0]])
        some, order = np.split(order, [max(ROOM // longest, 1)])
        rows, _ = record_impacts(initial[some], 0, longest)
        last = rows[np.arange(len(some)), lifetimes[some] - 1]
        times[some] = last['cycle'] + (last['phase'] - initial['phase'][some]) / TWO_PI
    return times


def _kicks(catalogue: Catalogue, reach: float, cap: int, work: Work) -> dict[str, Any]:
    """Find the smallest kick and displacement of each attractor, by labels and on a manifold."""
    found: list[tuple[Kick | None, Kick | None]] = []
    saddles, least = [], np.full((len(catalogue.attractors), 2), math.nan)
    with work.report(f'{NAME}, kicks', len(catalogue.attractors)) as progress:
        for k, each in enumerate(catalogue.attractors):
            kick = smallest_kick(catalogue, each, reach=reach, cap=cap, threads=work.threads)
            found.append((kick, smallest_displacement(
                catalogue, each, kick, reach=reach, cap=cap, threads=work.threads)))
            saddle = accessible_orbit(catalogue, each, kick, cap)
            if kick and saddle:
                impacts = impacts_of(catalogue, each)
                kicked, displaced = least_changes(
                    saddle, impacts, reach + float(np.max(np.abs(impacts[:, 2]))))
                least[k] = (kicked * catalogue.parameters.restitution,
                            displaced if found[k][1] else math.nan)
            saddles.append(saddle.key if saddle else '')
            progress.add(1)
    columns: dict[str, tuple[Any, ...]] = {'saddle': (
        saddles, 'orbit on the boundary that the smallest kick leads to, empty for none', '')}
    for name, kicks, places in zip(('kick', 'displacement'), zip(*found, strict=True), least.T,
                                   strict=True):
        words = f'smallest {name} of an impact that changes the attractor'
        columns[f'{name}_manifold'] = places, f'{words}: size on the manifold of the orbit'
        for field in dataclasses.fields(Kick):
            columns[f'{name}_{field.name}'] = (
                [getattr(kick, field.name) if kick else UNSETTLED if field.type is int else
                 math.nan for kick in kicks],
                f'{words}: {field.name.replace("_", " ")}',
                'rad' if 'phase' in field.name else '1')
    return table('attractor', **columns)


def _discs(labels: IntArray, catalogue: Catalogue, plane: Plane) -> dict[str, Any]:
    discs = np.array([largest_disc(labels == each.label, plane) for each in catalogue.attractors])
    return table('attractor', **{f'disc_{name}': (
        discs[:, k], f'largest disc in the basin: {name}', 'rad' if name == 'phase' else '1')
        for k, name in enumerate(('radius', plane.across, 'velocity'))})


def largest_disc(inside: npt.NDArray[np.bool_], plane: Plane) -> tuple[float, float, float]:
    """Return radius and centre of the largest disc of cells; it leaves neither window nor wall."""
    # Of a cell, the distance to the centre of the nearest one that is not inside.
    turns = math.isclose(plane.window[1] - plane.window[0], TWO_PI)
    width, height = ((high - low) / count for (low, high), count in (
        (plane.window, plane.phases), (plane.velocity, plane.velocities)))
    velocities, best = plane.velocity_values(), (0.0, math.nan, math.nan)
    for half in (velocities >= 0.0, velocities < 0.0) if plane.kind in ON_WALLS else (
            np.isfinite(velocities),):
        rows = np.flatnonzero(half)
        if not len(rows):
            continue
        cells = np.pad(inside[rows], ((1, 1), (0, 0) if turns else (1, 1)))
        places = np.arange(len(cells))[:, None]
        below = np.maximum.accumulate(np.where(cells, 0, places))
        above = np.minimum.accumulate(np.where(cells, len(cells) - 1, places)[::-1])[::-1]
        apart = (np.minimum(places - below, above - places) * height)**2
        nearest = apart.copy()
        for shift in range(1, cells.shape[1]):
            away = (min(shift, cells.shape[1] - shift) * width)**2
            np.minimum(nearest, np.roll(apart, shift, axis=1) + away, out=nearest)
        nearest = nearest[1:-1] if turns else nearest[1:-1, 1:-1]
        row, column = np.unravel_index(np.argmax(nearest), nearest.shape)
        radius = math.sqrt(nearest[row, column])
        if radius > best[0]:
            best = radius, float(plane.across_values()[column]), float(velocities[rows[row]])
    return best


def _tipped(catalogue: Catalogue, target: Catalogue, work: Work) -> dict[str, Any]:
    """Let parameters jump at many moments of each attractor; find where trajectories settle."""
    labels = [target.label(make_initial_conditions(target.parameters, *_states_of(
        catalogue.parameters, each).T), threads=work.threads)['label']
        for each in catalogue.attractors]
    # Rest may be reached that no random initial condition did.
    known = {one.label for one in target.attractors}
    reached = [*target.attractors, *others_where(lambda label: label not in known and any(
        label in found for found in labels))]
    shares = [[np.mean(found == one.label) if len(found) else math.nan for one in reached]
              for found in labels]
    return table('attractor', tipped=(
        shares, 'share of the moments from which the trajectory settles there after the jump',
        '1', 'target')) | table(
            'target', key=([one.key for one in reached], 'attractor after the jump', None),
            letter=([one.letter for one in reached], 'its letter in the paper, empty for none',
                    None))


def _states_of(parameters: Parameters, attractor: Attractor) -> FloatArray:
    """List where an attractor is at many moments, evenly in time: phase, displacement, s'."""
    if attractor.orbit:
        orbit = attractor.orbit
        begin = State(0, orbit.phases[0], -float(orbit.walls[0]), orbit.velocities[0])
        step = orbit.drive_periods / MOMENTS
    elif attractor.chaos:
        one = attractor.chaos.states[0]
        begin = State(0, *(float(one[name]) for name in ('phase', 'displacement', 'velocity')))
        step = BETWEEN
    elif attractor.kind is Kind.RESTING:
        begin, step = State(displacement=0.0 if 'upper' in attractor.key else -1.0), 1.0 / MOMENTS
    else:
        return np.zeros((0, 3))
    simulation, states = Simulation(parameters, begin), []
    for number in range(MOMENTS):
        turns, part = divmod(begin.phase / TWO_PI + number * step, 1.0)
        phase = min(part * TWO_PI, math.nextafter(TWO_PI, 0.0))
        # The first phase may lie an ulp before the beginning.
        simulation.advance(*max((int(turns), phase), simulation.moment), 1_000_000)
        state = simulation.state
        states.append((state.phase, state.displacement, state.velocity))
    return np.array(states)


def _erosion(catalogue: Catalogue, diagram: Diagram, work: Work) -> dict[str, Any]:
    """Follow shares and smallest kicks along a path, and find where parts of them are left."""
    path, count = diagram.path, len(catalogue.attractors)
    value, places = path.of(catalogue.parameters), diagram.values
    store = compute(diagram, Work(threads=work.threads, progress=work.progress), 'erosion')
    numbers, share, kick, states = (store.read_all(name)[0] for name in (
        'attractor', 'share', 'kick', 'member_state'))
    # Which is which there: where the state of each leads.
    here = int(np.argmin(np.abs(places - value)))
    some = np.flatnonzero(numbers[here] >= 0)
    labels = catalogue.label(make_initial_conditions(
        catalogue.parameters, *states[here, some].T), threads=work.threads)['label']
    values = np.full((len(QUANTITIES), count, len(places)), math.nan)
    left = np.full((count, len(QUANTITIES), len(LEVELS), 2, 2), math.nan)
    for k, each in enumerate(catalogue.attractors):
        if each.kind is Kind.UNSETTLED or each.label not in labels:
            continue
        mine = numbers == numbers[here, some[np.argmax(labels == each.label)]]
        values[:, k] = np.sum(share, axis=1, where=mine), np.where(mine.any(axis=1), np.max(
            kick, axis=1, where=mine, initial=-math.inf), 0.0)
        for q, noise in enumerate((diagram.trajectories, 0)):
            for side, away in enumerate((-1, 1)):
                # From the model on, where the line between two columns has its value.
                beyond = np.flatnonzero(away * (places - value) > 1e-12)[::away]
                line = (np.append(value, places[beyond]), np.append(
                    np.interp(value, places, values[q, k]), values[q, k, beyond]))
                for n, level in enumerate(LEVELS):
                    left[k, q, n, side] = where_left(*line, level, noise)
    over = '1', 'quantity', 'level', 'side'
    return table('attractor', left=(
        left[..., 0], f'{path.name} at which 90 and 50 % of share and kick are left, below and '
        'above the model', *over), left_error=(left[..., 1], 'how well it is known', *over)) | {
            f'erosion_{name}': (dimensions, column, named(words))
            for name, dimensions, column, words in (
                (path.name, ('erosion',), places, path.words),
                ('share', ('attractor', 'erosion'), values[0], 'share of the random initial '
                 'conditions'),
                ('kick', ('attractor', 'erosion'), values[1], 'smallest kick that changes the '
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


def describe(dataset: Arrays) -> str:
    """Put the stability of every attractor in words."""
    a, omega = dataset.attrs, dataset.attrs['omega']
    scale = a.get('scale_velocity_m_per_s', 0.0)
    across = Plane.of(a).across
    one = {name: dataset[f'attractor_{name}'].values for name in (
        'label', 'letter', 'key', 'kind', 'settling_impacts', 'settling_periods', 'disc_radius',
        f'disc_{across}', 'disc_velocity', 'saddle', *(f'{what}_{name}' for what in (
            'kick', 'displacement') for name in KICK))}
    names = {label: key for label, (key, _) in OTHERS.items()} | {
        int(label): str(letter or key) for label, letter, key in zip(
            one['label'], one['letter'], one['key'], strict=True)}
    some = np.flatnonzero(one['kind'] != Kind.UNSETTLED.value).tolist()
    parts = [attractors.describe(dataset)]

    def add(headings: list[str], row: Callable[[int], list[str]]) -> None:
        parts.append(in_columns(headings, [[names[int(one['label'][k])], *row(k)] for k in some]))

    def kick(what: str, k: int) -> list[str]:
        size, change, turned, wall, phase, velocity, target, resolution, unsettled, manifold = (
            one[f'{what}_{name}'][k] for name in KICK)
        in_si = [f'{1e3 * size * scale:.4g}'] if scale and what == 'kick' else []
        if not math.isfinite(size):
            return [f'none to {a["reach"]:g}', *[''] * (7 + len(in_si))]
        return [f'{size:.6f}', *in_si, f'{manifold:.9f}' if math.isfinite(manifold) else '-',
                str(one['saddle'][k] or '-'), f'{change:+.6f}' if what == 'kick' else
                f'({turned:+.6f}, {change:+.6f})',
                f'{Wall(int(wall)).label}, {phase:.4f}, {velocity:+.4f}', names[int(target)],
                f'{resolution:.1e}', f'{100.0 * unsettled:.2f}']

    add(['settling', ' mean [impacts]', ' median', ' largest', ' mean [drive periods]', ' largest',
         *[' mean [s]', ' largest [s]'] * bool(omega)], lambda k: [
        *(f'{value:,.0f}' for value in one['settling_impacts'][k]),
        *(f'{value:,.1f}' for value in one['settling_periods'][k, ::2]),
        *(f'{value * TWO_PI / omega:.4g}' for value in one['settling_periods'][k, ::2] if omega)])
    for what in ('kick', 'displacement'):
        add([f'smallest {what}', ' size [1]', *[' [mm/s]'] * bool(scale and what == 'kick'),
             ' on the manifold', 'of', ' change', 'impact: wall, phase, velocity', 'leads to',
             ' dents under', ' unsettled [%]'], functools.partial(kick, what))
    add(['largest disc', ' radius [1]', f' {across}', ' velocity'], lambda k: [
        f'{one["disc_radius"][k]:.3f}', f'{one[f"disc_{across}"][k]:.3f}',
        f'{one["disc_velocity"][k]:+.3f}'])
    if 'to' in a:
        letters, keys = (dataset[f'target_{name}'].values for name in ('letter', 'key'))
        add([f'after a jump to {a["to"]} [%]',
             *(f' {letter or key}' for letter, key in zip(letters, keys, strict=True))],
            lambda k: [f'{100.0 * share:.1f}' for share in dataset['attractor_tipped'].values[k]])
    if 'erosion_window' in a:
        axis = a.get('erosion_window_along', 'alpha')
        left, errors = (dataset[f'attractor_{name}'].values for name in ('left', 'left_error'))
        parts.append(in_columns(
            ['erosion', 'of', *(f' {level:.0%} left {side} {axis}' for level in LEVELS
                                for side in ('below', 'above'))],
            [[names[int(one['label'][k])], quantity, *(
                f'{place:.5f} +- {error:.5f}' if math.isfinite(place) else 'not in the window'
                for place, error in zip(left[k, q].flat, errors[k, q].flat, strict=True))]
             for k in some for q, quantity in enumerate(QUANTITIES)]))
    return '\n\n'.join(parts[:len(parts) if some else 1])
