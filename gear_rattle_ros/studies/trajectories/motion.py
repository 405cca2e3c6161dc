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

"""The motion between the walls, of an attractor or from an initial condition."""

from typing import Any, Final, Unpack

import numpy as np

from ..attractors import identity_of, require_tolerance
from ..work import Arrays, Study, Work, WorkOptions
from ...attractors.catalogue import Attractor, Catalogue, Kind
from ...attractors.finding import find_attractors
from ...attractors.listing import named
from ...attractors.plane import initial_condition, Plane, STATE
from ...core.defaults import HOLD, INITIAL_CONDITIONS, SEED, TOLERANCE
from ...core.flight.elementary import TWO_PI
from ...core.flight.simulation import Simulation
from ...core.many.recorded import initial_after
from ...core.many.settling import RecordArray
from ...core.model import EventArray, EventKind, Parameters, State, Wall
from ...core.stream.reconstruction import drive_phases, rebuild
from ...core.words import counted, in_columns
from ...store.layout import Layout
from ...store.store import Store

NAME: Final = 'motion'
# Samples in a drive period, at least; events asked for at once; impacts that are listed.
SAMPLES: Final = 400
EVENTS: Final = 10_000
LISTED: Final = 12


@Study
def motion(parameters: Parameters, plane: Plane | None = None, *, attractor: str = '',
           initial: tuple[float, float, float] | None = None, skip: int = 0, periods: int = 8,
           tolerance: float = TOLERANCE, hold: int = HOLD,
           initial_conditions: int = INITIAL_CONDITIONS, seed: int = SEED,
           **options: Unpack[WorkOptions]) -> Store:
    """
    Sample the motion over some drive periods, exactly.

    The dataset has `tau`, `displacement` and `velocity` of the samples, twice at an impact, before
    it and after it; and `impact_tau`, `impact_wall`, `impact_velocity` and
    `impact_velocity_after`.

    Parameters
    ----------
    parameters : Parameters
        The model.
    plane, initial_conditions, seed
        The window from which initial conditions are drawn that find the attractors, how many, and
        their seed.
    attractor : str
        Key or letter of the attractor; by default the one that most initial conditions reach.
    initial : tuple of float, optional
        Instead of an attractor, an initial condition: phase [rad], velocity and displacement [1].
    skip, periods : int
        Impacts that are passed over, and the drive periods that follow.
    tolerance, hold
        As `find_attractors` takes them.
    **options
        As `Work` explains them.

    """
    if attractor and initial is not None:
        raise ValueError(f'attractor {attractor} and an initial condition exclude each other; '
                         'give one of them')
    require_tolerance(tolerance)
    work, plane = Work(**options), plane or Plane()
    store = work.begin(Layout((), (), identity_of(
        NAME, parameters, plane, attractor=attractor, skip=skip, periods=periods,
        tolerance=tolerance, hold=hold, initial_conditions=initial_conditions, seed=seed,
        **({} if initial is None else {'initial': list(initial)})), {
            'title': 'Motion of the gear-rattling model'}))
    if not store.pending():
        return store
    chosen = None
    if initial is None:
        catalogue = find_attractors(
            parameters, plane.draw(parameters, initial_conditions, seed), tolerance=tolerance,
            hold=hold, threads=work.threads, cluster=work.cluster)
        chosen = choose(catalogue, attractor)
        start = state_on(chosen, catalogue)
    else:
        start = initial_condition(parameters, *initial)
    events = follow(parameters, start[0], skip, periods, chosen is not None)
    _write(store, events, chosen)
    store.mark(0)
    return store


def describe(dataset: Arrays) -> str:
    """List the impacts."""
    a = dataset.attrs
    columns = [dataset[f'impact_{name}'].values for name in (
        'tau', 'wall', 'velocity', 'velocity_after')]
    velocity, time = (a.get(f'scale_{name}', 0.0) for name in ('velocity_m_per_s', 'time_s'))
    rows = [[f'{tau / TWO_PI:.6f}', Wall(wall).label, f'{before:+.6f}', f'{after:+.6f}',
             *([f'{1e3 * tau * time:.4f}', f'{1e3 * before * velocity:+.4g}',
                f'{1e3 * after * velocity:+.4g}'] if time else [])]
            for tau, wall, before, after in list(zip(*columns, strict=True))[:LISTED]]
    name = ' '.join(filter(None, (a['attractor_letter'], a['attractor_key']))) or 'one trajectory'
    left = len(columns[0]) - len(rows)
    return '\n'.join([
        f'{name}: {counted(len(columns[0]), "impact")} in {counted(a["periods"], "drive period")}',
        in_columns([' tau/2pi', 'wall', ' velocity before', ' after',
                    *([' time [ms]', ' before [mm/s]', ' after [mm/s]'] if time else [])], rows),
        *([f'and {left:,} more'] if left else [])])


def choose(catalogue: Catalogue, name: str) -> Attractor:
    """Return the attractor with a key or letter, by default the one that is reached most often."""
    known = [each for each in catalogue.attractors if each.kind is not Kind.UNSETTLED]
    found = [each for each in known if not name or name in (each.key, each.letter)]
    if not found:
        there = ', '.join(each.title for each in known)
        raise ValueError(f'no attractor {name or "was reached"} at these parameters; there are '
                         f'{there or "none"}')
    return max(found, key=lambda each: each.settled)


def state_on(chosen: Attractor, catalogue: Catalogue) -> RecordArray:
    """Return a state on an attractor, as START, one."""
    if chosen.orbit and chosen.orbit.sticks < 0:
        return initial_after(catalogue.parameters, chosen.orbit.phases[:1],
                             chosen.orbit.velocities[:1])
    return catalogue.states[catalogue.labels == chosen.label][:1]


def follow(parameters: Parameters, start: Any, skip: int, periods: int, whole: bool
           ) -> EventArray:
    """Return the events of some drive periods, with records at both ends, `whole` from phase 0."""
    simulation = Simulation(parameters, State(0, *(float(start[name]) for name in STATE)))
    while simulation.impacts < skip and not simulation.is_permanently_at_rest:
        cycle, phase = simulation.moment
        simulation.advance(cycle + skip, phase, min(skip - simulation.impacts, EVENTS))
    cycle, phase = simulation.moment
    if whole:
        cycle, phase = cycle + 1, 0.0
        while simulation.moment != (cycle, phase):
            simulation.advance(cycle, phase, EVENTS)
    # A change to the same parameters changes nothing, and leaves a record.
    events = [simulation.retune(parameters)[-1:]]
    while simulation.moment != (cycle + periods, phase):
        events.append(simulation.advance(cycle + periods, phase, EVENTS))
    return np.concatenate([*events, simulation.retune(parameters)])


def _write(store: Store, events: EventArray, chosen: Attractor | None) -> None:
    sampled = rebuild(events, TWO_PI / SAMPLES)
    # From the beginning of the first drive period.
    begin = TWO_PI * float(events['cycle'][-1] - events['cycle'][0])
    is_impact = np.isin(events['kind'], [EventKind.IMPACT, EventKind.STICK])
    impacts, taus = events[is_impact], (drive_phases(events) + begin)[is_impact]
    store.write_table({name: ((name.split('_')[0] if name[:6] == 'impact' else 'sample',), values,
                              named(words, units)) for name, values, words, units in (
        ('tau', sampled.tau + begin, 'time from the beginning of the first drive period', 'rad'),
        # At a wall rounding may lie beyond it.
        ('displacement', np.clip(sampled.displacement, -1.0, 0.0), 'displacement in the backlash',
         '1'),
        ('velocity', sampled.velocity, 'velocity', '1'),
        ('impact_tau', taus, 'time of the impact', 'rad'),
        ('impact_wall', -impacts['displacement'].astype(np.int64), 'wall: 0 upper, 1 lower', '1'),
        ('impact_velocity', impacts['velocity'], 'velocity before the impact', '1'),
        ('impact_velocity_after', impacts['velocity_after'], 'velocity after it', '1'))})
    store.set_attributes({'attractor_key': chosen.key if chosen else '',
                          'attractor_letter': chosen.letter if chosen else ''})
