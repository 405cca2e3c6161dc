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

"""Impacts counted on the section (phase, velocity): attractors and chaotic transients."""

import math
from pathlib import Path
from typing import Any, Final, Unpack

import numpy as np

from .densities import compare_densities
from ..attractors import identity_of, write_attractors
from ..work import Arrays, Study, Work, WorkOptions
from ...attractors.cores import find_jumps
from ...attractors.finding import find_attractors
from ...attractors.listing import named
from ...attractors.plane import initial_condition, Plane, STATE
from ...core.arrays import FloatArray
from ...core.defaults import INITIAL_CONDITIONS, SEED
from ...core.flight.lanes import IMPACT
from ...core.flight.simulation import Simulation
from ...core.many.recorded import record_impacts
from ...core.many.settling import RecordArray
from ...core.model import EventArray, EventKind, Parameters, State
from ...core.words import counted
from ...store.layout import Axis, Layout, Variable
from ...store.store import open_dataset, Store

NAME: Final = 'section'
# Trajectories followed at once.
BATCH: Final = 64
# Events of a trajectory with noise that are asked for at once.
EVENTS: Final = 20_000
SETTLED, WANDERING = 0, 1
TABLES: Final = ('orbit_phase', 'orbit_velocity', 'impact_phase', 'impact_velocity')


@Study
def section(parameters: Parameters, plane: Plane | None = None, *, trajectories: int = 64,
            skip: int = 1000, keep: int = 20_000, bins: tuple[int, int] = (720, 540),
            bin_window: tuple[float, float] = (-2.0, 2.0),
            initial: tuple[float, float, float] | None = None, noise: float = 0.0,
            seed: int = SEED, compare: Path | str | None = None,
            **options: Unpack[WorkOptions]) -> Store:
    """
    Count impacts on the section.

    The dataset has `count` over phase and velocity, of what settled on a periodic orbit and of
    what did not, and the periodic orbits. Of one trajectory it has the impacts in turn, too, and
    those before it settles count as not settled. With noise all of them do, and
    `impact_attractor` is the label of the attractor whose core was visited last.

    Parameters
    ----------
    parameters, plane, seed
        The model, the window from which initial conditions are drawn, and their seed, which is
        that of the noise, too.
    trajectories, skip, keep : int
        Trajectories, and the impacts of each that are passed over and then counted.
    bins : tuple of int
        Along phase and velocity.
    bin_window : tuple of float
        Velocities that are counted [1].
    initial : tuple of float, optional
        Phase [rad], velocity and displacement [1] of the only initial condition.
    noise : float
        Standard deviation of the kick that an impact adds to the velocity of one trajectory [1].
    compare : Path or str, optional
        The store of another section, whose density is compared with that of this one.

    """
    if not bin_window[0] < bin_window[1]:
        raise ValueError(f'velocity window {bin_window[0]:g} to {bin_window[1]:g} is empty or '
                         'reversed; give the lower end first')
    if noise and initial is None:
        raise ValueError(f'noise = {noise:g} is for one trajectory; give its --initial')
    work, plane = Work(**options), plane or Plane()
    single = {} if initial is None else {'initial': list(initial)}
    trajectories = 1 if single else trajectories
    store = work.begin(_layout(identity_of(
        NAME, parameters, plane, trajectories=trajectories, seed=seed, **single,
        **({'noise': noise} if noise else {}),
        initial_velocity_window=list(plane.velocity), impacts_skipped=skip, impacts_counted=keep,
        velocity_window=list(bin_window), bins=list(bins))))
    if store.pending() or not all(store.has_table(name) for name in TABLES):
        drawn = (plane.draw(parameters, trajectories, seed) if initial is None else
                 initial_condition(parameters, *initial))
        if noise:
            _follow_noisy(store, plane, _noisy(parameters, drawn, noise, seed, skip + keep)[skip:])
        else:
            _follow(store, parameters, drawn, work)
        # Last, as nothing of this is computed again once both are done.
        store.mark([SETTLED, WANDERING])
    store.set_attributes({'comparison': '' if compare is None else compare_densities(
        store, open_dataset(compare))})
    return store


def _follow(store: Store, parameters: Parameters, drawn: RecordArray, work: Work) -> None:
    """Follow initial conditions, count their impacts and write them."""
    skip, keep = store.attrs['impacts_skipped'], store.attrs['impacts_counted']
    catalogue = find_attractors(parameters, drawn, hold=skip + keep, threads=work.threads)
    counts = [_counted(store, np.zeros(0), np.zeros(0)) for _ in (SETTLED, WANDERING)]
    points = [np.zeros((0, 2))]
    for each in catalogue.attractors:
        if each.orbit and each.settled:
            counts[SETTLED] += each.settled * _counted(
                store, each.orbit.phases, each.orbit.velocities)
            points.append(each.orbit.points)
    # Of one trajectory the impacts before it settles.
    lifetime, impacts = -1, np.zeros(0, IMPACT)
    on_orbit = np.isin(catalogue.labels, [each.label for each in catalogue.attractors
                                          if each.orbit])
    if 'initial' in store.attrs:
        (impacts,), (made,) = record_impacts(drawn, skip, keep)
        impacts = impacts[:made]
        if on_orbit.any():
            lifetime = int(catalogue.label(drawn, threads=work.threads)['lifetime'][0])
            transient = impacts[:max(lifetime - skip, 0)]
            counts[WANDERING] += _counted(store, transient['phase'], transient['velocity'])
    wandering = drawn[~on_orbit]
    with work.report(NAME, len(drawn)) as progress:
        progress.add(int(np.count_nonzero(on_orbit)))
        for first in range(0, len(wandering), BATCH):
            rows, made = record_impacts(wandering[first:first + BATCH], skip, keep)
            for row, length in zip(rows, made, strict=True):
                counts[WANDERING] += _counted(
                    store, row['phase'][:length], row['velocity'][:length])
            progress.add(len(rows), int(made.sum()) + len(rows) * skip)
    _write(store, counts, np.concatenate(points), impacts)
    store.set_attributes({'attractors': repr(catalogue), 'lifetime': lifetime})


def _noisy(parameters: Parameters, drawn: RecordArray, noise: float, seed: int, most: int
           ) -> EventArray:
    """Return the first impacts of a trajectory with noise, as the simulator makes them."""
    simulation = Simulation(parameters, State(0, *(float(drawn[name][0]) for name in STATE)),
                            noise=noise, seed=seed)
    parts = [simulation.advance(0, simulation.moment[1], 1)]
    # Nothing happens at rest for good, nor where a motion ends between the walls.
    while simulation.impacts < most and len(parts[-1]):
        cycle, phase = simulation.moment
        parts.append(simulation.advance(cycle + EVENTS, phase, EVENTS))
    events = np.concatenate(parts)
    return events[events['kind'] <= EventKind.STICK][:most]


def _follow_noisy(store: Store, plane: Plane, impacts: EventArray) -> None:
    """Count the impacts of a trajectory with noise, and its jumps between all attractors."""
    parameters = Parameters.of(store.attrs)
    catalogue = find_attractors(parameters, plane.draw(parameters, INITIAL_CONDITIONS, SEED))
    jumps = find_jumps(catalogue, impacts['phase'], impacts['velocity'])
    _write(store, [_counted(store, np.zeros(0), np.zeros(0)),
                   _counted(store, impacts['phase'], impacts['velocity'])],
           np.concatenate([np.zeros((0, 2)), *(each.points for each in catalogue.orbits)]),
           impacts)
    write_attractors(store, catalogue)
    store.write_table({'impact_attractor': (('impact',), jumps.last, named(
        'label of the attractor whose core was visited last, -1 before the first'))})
    names = {a.label: a.letter or a.key for a in catalogue.attractors if a.label >= 0}
    periods = int(impacts['cycle'][-1] - impacts['cycle'][0]) if len(impacts) else 0
    store.set_attributes({
        'attractors': repr(catalogue), 'lifetime': -1, 'jumps': sum(jumps.counts.values()),
        'noisy': f'{counted(len(impacts), "impact")} with kicks of {store.attrs["noise"]:g}, in '
        f'{counted(periods, "drive period")}\n{jumps.describe(names)}'})


def _counted(store: Store, phases: FloatArray, velocities: FloatArray) -> FloatArray:
    a = store.attrs
    return np.histogram2d(velocities, phases, a['bins'][::-1], (
        a['velocity_window'], (0.0, math.tau)))[0]


def _write(store: Store, counts: list[FloatArray], points: FloatArray,
           impacts: RecordArray | EventArray) -> None:
    for kind in (SETTLED, WANDERING):
        store.write(kind, {'count': counts[kind][None].astype(np.uint32)})
    store.write_table({
        TABLES[0]: (('point',), points[:, 0],
                    named('phase of the impacts of periodic orbits', 'rad')),
        TABLES[1]: (('point',), points[:, 1], named('velocity just before them')),
        TABLES[2]: (('impact',), impacts['phase'],
                    named('phase of the impacts of one trajectory in turn', 'rad')),
        TABLES[3]: (('impact',), impacts['velocity'], named('velocity just before them'))})


def describe(dataset: Arrays) -> str:
    """List the attractors that were reached, and of one trajectory its transient or jumps."""
    a = dataset.attrs
    transient = f'transient of {counted(a["lifetime"], "impact")}' if a['lifetime'] >= 0 else ''
    return '\n'.join(filter(None, (a['attractors'], transient, a.get('noisy'), a['comparison'])))


def _layout(identity: dict[str, Any]) -> Layout:
    phases, velocities = identity['bins']
    low, high = identity['velocity_window']
    edges = np.linspace(low, high, velocities + 1)
    return Layout(
        (Axis('kind', np.array(['settled', 'wandering']),
              named('on a periodic orbit at the end, or not', None), 1),
         Axis('velocity', 0.5 * (edges[1:] + edges[:-1]), named('velocity before the impact')),
         Axis('phase', (np.arange(phases) + 0.5) * math.tau / phases,
              named('drive phase', 'rad'))),
        (Variable('count', ('kind', 'velocity', 'phase'), '<u4', named('impacts counted')),),
        identity)
