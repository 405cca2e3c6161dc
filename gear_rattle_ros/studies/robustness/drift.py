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


"""What a slow ramp of alpha shows: exponents along it, and how late orbits change."""

from collections.abc import Sequence
import dataclasses
import functools
import math
from pathlib import Path as FilePath
from typing import Final, Unpack

import numpy as np

from ..attractors import identity_of, require_tolerance
from ..trajectories.motion import choose, state_on
from ..work import Arrays, Study, Work, WorkOptions
from ...attractors.finding import find_attractors
from ...attractors.listing import named, table
from ...attractors.plane import Plane, STATE
from ...core.arrays import FloatArray
from ...core.defaults import HOLD, INITIAL_CONDITIONS, SEED, TOLERANCE
from ...core.flight.simulation import Simulation
from ...core.model import ALPHA_MAXIMUM, Parameters, require_finite, State
from ...core.orbits.branches import Branch, Change, follow, leaving
from ...core.orbits.orbit import Orbit
from ...core.path import Path
from ...core.stream.drift import departure, ramp_along
from ...core.stream.lyapunov import RunningLyapunov
from ...core.words import counted, in_columns
from ...store.layout import Axis, Layout, Variable
from ...store.store import Store

NAME: Final = 'drift'
# Points of the static curve, and windows of impacts passed over and measured at each.
STATIC: Final = 160
SKIPPED, MEASURED = 2, 8
# Exponents that are kept along a ramp, and changes of orbits that are followed.
KEPT: Final = 1000
CHANGES: Final = 4
# Longest step along a branch, so that what lies between its orbits is known far better than AWAY.
STEP: Final = 2e-3


@Study
def drift(parameters: Parameters, plane: Plane | None = None, *,
          to: float = 0.56, rates: Sequence[float] = (1e-4, 3e-5, 1e-5, 3e-6),
          attractor: str = '', window: int = 200, tolerance: float = TOLERANCE,
          initial_conditions: int = INITIAL_CONDITIONS, seed: int = SEED, hold: int = HOLD,
          **options: Unpack[WorkOptions]) -> Store:
    """
    Ramp alpha at some rates; find exponents along the ramps and how late orbits change.

    The dataset has finite-time exponents along every ramp, those at fixed alpha, and for each
    change of the orbit that is followed how far beyond it each ramp leaves the orbit.

    Parameters
    ----------
    parameters, plane
        The model where the ramp begins, and the window from which initial conditions are drawn
        that find the attractors there.
    to : float
        The alpha at which it ends [1], above or below.
    rates : sequence of float
        Changes of alpha in a drive period [1].
    attractor : str
        Key or letter of the attractor from which it begins; by default the one that most initial
        conditions reach.
    window : int
        Impacts of a finite-time exponent.
    tolerance, initial_conditions, seed, hold
        As `find_attractors` takes them.

    """
    require_tolerance(tolerance)
    begin, end = parameters.alpha, require_finite('to', to, 0.0, ALPHA_MAXIMUM)
    if begin == end:
        raise ValueError(f'the ramp ends at alpha = {end:g}, where it begins; give another end')
    rates = tuple(require_finite('rate', rate, 1e-9, 1e-2) for rate in rates)
    work, plane = Work(**options), plane or Plane()
    identity = identity_of(
        NAME, parameters, plane, to=end, rates=list(rates), attractor=attractor,
        window=window, tolerance=tolerance, initial_conditions=initial_conditions, seed=seed,
        hold=hold)
    store = work.begin(Layout(
        (Axis('rate', np.array([0.0, *rates]), named(
            'change of alpha in a drive period, 0 for the static exponents'), 1),
         Axis('sample', np.arange(KEPT), named('exponent in turn', None)),
         Axis('change', np.arange(CHANGES), named('change of the orbit in turn', None))),
        (Variable('alpha_of', ('rate', 'sample'), '<f8', named('alpha in the middle')),
         Variable('exponent', ('rate', 'sample'), '<f8', named(
             f'largest exponent per impact over {counted(window, "impact")}')),
         Variable('delay', ('rate', 'change'), '<f8', named(
             'how far beyond a change the ramp leaves the orbit; nan where it was not on it'))),
        identity, {'title': 'Ramps of alpha in the gear-rattling model'}))
    catalogue = find_attractors(
        parameters, plane.draw(parameters, initial_conditions, seed), tolerance=tolerance,
        hold=hold, threads=work.threads)
    chosen = choose(catalogue, attractor)
    there = state_on(chosen, catalogue)[0]
    first = State(0, *(float(there[name]) for name in STATE))
    path = Path.over(parameters, alpha=(min(begin, end), max(begin, end)))
    changes = _changes(chosen.orbit, path, math.copysign(1.0, end - begin)) if chosen.orbit else []
    store.write_table(table(
        'event', kind=([change.value for _, change, _ in changes], 'what happens', None),
        alpha=([at for _, _, at in changes], 'where, at fixed alpha'),
        orbit=([branch.orbits[0].key for branch, _, _ in changes], 'the orbit', None)))
    store.set_attributes({'attractor_key': chosen.key, 'attractor_letter': chosen.letter})
    fill = functools.partial(_fill, store.path, parameters, first, changes)
    with work.pending(NAME, store, lambda tile: 1) as (pending, finished):
        work.run(fill, pending, finished)
    return store


def _changes(orbit: Orbit, path: Path, direction: float) -> list[tuple[Branch, Change, float]]:
    """Follow an orbit, and what it becomes, to its changes along a ramp: branch, what, alpha."""
    found: list[tuple[Branch, Change, float]] = []
    low, high = path.ends
    while len(found) < CHANGES:
        branch = follow(orbit, path, direction, low, high, longest=STEP)
        ahead = [turn for turn in branch.turns if low < turn.value < high]
        if not ahead:
            break
        turn = ahead[0]
        found.append((branch, turn.change, turn.value))
        born = [each for each in leaving(path, turn) if each.is_stable] if turn.change in (
            Change.DOUBLING, Change.PITCHFORK) else []
        # What leaves on the side from which the ramp comes is not what it goes on with.
        born = [each for each in born if direction * (each.parameters.alpha - turn.value) > 0.0]
        if not born:
            break
        orbit = born[0]
    return found


def _fill(store_path: FilePath, parameters: Parameters, first: State,
          changes: list[tuple[Branch, Change, float]], tile: int) -> int:
    store = Store(store_path)
    a = store.attrs
    end, window = a['to'], a['window']
    rate = 0.0 if tile == 0 else a['rates'][tile - 1]
    delays = np.full(CHANGES, math.nan)
    if tile == 0:
        alphas, exponents = _static(parameters, first, end, window)
        impacts = len(alphas) * (SKIPPED + MEASURED) * window
    else:
        ramp = ramp_along(parameters, first, end, rate, window)
        every = -(-len(ramp.exponents) // KEPT) or 1
        alphas, exponents = ramp.exponent_alphas[::every], ramp.exponents[::every]
        for k, (branch, _, at) in enumerate(changes):
            delays[k] = departure(ramp, branch, at)
        impacts = len(ramp.alphas)
    room = KEPT - len(alphas)
    store.write(tile, {'alpha_of': np.pad(alphas, (0, room), constant_values=math.nan)[None],
                       'exponent': np.pad(exponents, (0, room), constant_values=math.nan)[None],
                       'delay': delays[None]})
    return impacts


def _static(parameters: Parameters, first: State, end: float, window: int
            ) -> tuple[FloatArray, FloatArray]:
    """Return exponents at fixed alphas, each from where the trajectory was at the one before."""
    alphas, exponents = np.linspace(parameters.alpha, end, STATIC), np.zeros(STATIC)
    simulation = Simulation(parameters, first)
    for k, alpha in enumerate(alphas):
        simulation.retune(dataclasses.replace(parameters, alpha=float(alpha)))
        running = RunningLyapunov(MEASURED * window)
        for count, keeps in ((SKIPPED, False), (MEASURED, True)):
            made = simulation.impacts + count * window
            while simulation.impacts < made and not simulation.is_permanently_at_rest:
                events = simulation.advance(
                    simulation.moment[0] + window, 0.0, made - simulation.impacts + 1)
                if keeps:
                    running.update(events)
        exponents[k] = running.report.lambda_1
    return alphas, exponents


def describe(dataset: Arrays) -> str:
    """List how late each change is seen at each rate, and the local exponents of the delay."""
    a, delays = dataset.attrs, dataset['delay'].values[1:]
    rates, rows = np.array(a['rates']), []
    for k, (kind, at, orbit) in enumerate(zip(*(dataset[f'event_{name}'].values for name in (
            'kind', 'alpha', 'orbit')), strict=True)):
        with np.errstate(invalid='ignore', divide='ignore'):
            local = np.diff(np.log(delays[:, k])) / np.diff(np.log(rates))
        for rate, delay, slope in zip(rates, delays[:, k], [math.nan, *local], strict=True):
            rows.append([f'{kind} at {at:.7f}', str(orbit), f'{rate:g}',
                         '-' if math.isnan(delay) else f'{delay:.6f}',
                         '-' if math.isnan(slope) else f'{slope:.3f}'])
    if not rows:
        return 'nothing happens to a periodic orbit along the ramp'
    return in_columns(['change', 'orbit', ' rate', ' delay [1]', ' local exponent'], rows)
