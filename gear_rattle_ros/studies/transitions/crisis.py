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

"""
The critical place of a crisis, by two methods that share nothing but the flight.

The tangency of manifolds gives it to many digits, and the orbit with which the attractor collides.
The rates at which trajectories escape beyond it, fitted by a law in which it is free, check that
and give the exponent of the lifetimes.
"""

import contextlib
import dataclasses
import math
from typing import Any, Final, Unpack

import numpy as np

from .endings import Captor, End, find_end, Herd, spread_out, watch
from .escape_rates import fit_exponent, fit_law, LifetimeLaw
from .escapes import compute, Escapes, rates_of
from ..attractors import swept
from ..skeleton.tangency import birth_of, carry, SEARCHES, Tangency, touch
from ..work import Arrays, Study, Work, WorkOptions
from ...attractors.finding import find_attractors
from ...attractors.listing import named
from ...attractors.plane import Plane, STATE
from ...core.arrays import FloatArray
from ...core.defaults import SEED
from ...core.orbits.orbit import Orbit
from ...core.orbits.section import distances
from ...core.path import Path
from ...core.words import counted, in_columns
from ...store.store import Store

# What the paper prints, and the amplitudes of its figures on either side.
PAPER: Final = 1.2347058
PAPER_BRACKET: Final = (1.230, 1.244)
# Impacts for which an attractor is watched, initial conditions that are followed to find it, and
# the step, in parts of the window, with which it is followed to its end, whose place is then
# known to the tolerance, in the parameters [1].
HOLD: Final = 20_000
SOUGHT: Final = 256
STEPS: Final = 16
TOLERANCE: Final = 1e-6
# Before the crisis nothing escapes; trajectories are watched over this number of impacts.
BEFORE: Final = 100_000
# A trajectory is captured this near to an orbit, or a tenth of the way to the saddle [rad, 1].
CAPTURED: Final = 0.02


@Study
def crisis(path: Path, plane: Plane | None = None, *, attractor: str = '',
           beyond: tuple[float, float] = (4e-6, 4e-4), rates: int = 20, escapes: int = 80,
           skip: int = 300, limit: int = 50_000_000, seed: int = SEED,
           **options: Unpack[WorkOptions]) -> Store:
    """
    Locate the crisis of a chaotic attractor, by the tangency of manifolds and by escape rates.

    The dataset has lifetimes and escape rates along the path; the crisis, the orbit with which the
    attractor collides and the law as attributes.

    Parameters
    ----------
    path : Path
        A window of one parameter, or the straight path between two models, across the crisis.
    plane, seed
        The window from which initial conditions are drawn, and their seed; by default it lies at
        s = -0.5, because off the walls hardly any sticks: those that do go on as one trajectory.
    attractor : str
        Its key at one of the ends; by default the first that ends between them.
    beyond : tuple of float
        Distances along the path from the crisis at which escapes are timed [1].
    rates, escapes : int
        Places at which they are, and how many at each.
    skip, limit : int
        Escapes before this do not count, and after this a trajectory is given up [impacts].

    """
    work, plane = Work(**options), plane or Plane(displacement=-0.5)
    if not 0.0 < beyond[0] < beyond[1]:
        raise ValueError(f'--beyond {beyond[0]:g} {beyond[1]:g} must be positive and rising')
    key, end, captors = find_ending(path, plane, attractor, seed)
    # The search begins with many saddles, of which it is not known how many there are.
    with work.report('crisis, searches of the manifold', SEARCHES, uneven=True) as progress:
        tangency = touch(end, progress.add)
    places = places_beyond(tangency.value, end.direction, *beyond, rates)
    store = compute(Escapes(
        places, path, plane, escapes, seed, skip, limit, min(limit, BEFORE),
        tuple(points_at(captors, path, value) for value in places),
        min(radius_of(one, tangency) for one in captors)),
        {'attractor': key, 'captor': captors[0].key, 'direction': end.direction,
         **attributes_of(tangency)}, work)
    write_law(store, path.name)
    return store


def find_ending(path: Path, plane: Plane, key: str, seed: int
                ) -> tuple[str, End, list[Orbit]]:
    """Find the first that ends in a crisis: its key, end, captor and other stable orbits."""
    seen: list[str] = []  # the chaotic attractors, and what becomes of them
    for inside, outside in (path.ends, path.ends[::-1]):
        here = path.at(inside)
        found = find_attractors(here, plane.draw(here, SOUGHT, seed), hold=HOLD)
        for one in found.attractors:
            if one.chaos is None or key not in ('', one.key):
                if one.chaos is not None:
                    seen.append(f'{one.key} at {inside:g}')
                continue
            herd: Herd | Captor = watch(here, spread_out(here, np.array(
                [one.chaos.states[0][name] for name in STATE])), HOLD)
            if not isinstance(herd, Herd):
                continue
            end = find_end(herd, path, math.copysign(1.0, outside - inside),
                           abs(outside - inside) / STEPS, outside, TOLERANCE * path.unit, HOLD)
            if end and end.kind == 'crisis' and isinstance(end.captor, Orbit):
                # What escapes may settle on another one, too.
                return one.key, end, [end.captor, *found.orbits]
            seen.append(f'{one.key} at {inside:g} ' + (
                f'ends at {end.value:.6f}: {end.kind}' if end else 'lasts all along'))
    raise ValueError(
        f'no crisis of {key or "a chaotic attractor"} between {path.name} = {path.ends[0]:g} and '
        f'{path.ends[1]:g}; chaotic there: {", ".join(seen) or "nothing"}; give another --'
        + ' and --'.join(path.varied))


def attributes_of(tangency: Tangency) -> dict[str, Any]:
    """Describe a tangency by attributes of a dataset."""
    contact, saddle = tangency.contact, tangency.contact.target
    axis, birth = contact.path.name, birth_of(saddle.orbit, contact.path)
    return {
        'saddle': saddle.orbit.canonical().name, 'saddle_impacts': saddle.orbit.impacts,
        'saddle_drive_periods': saddle.orbit.drive_periods,
        'saddle_expansion': saddle.expansion, 'saddle_contraction': saddle.contraction,
        'saddle_born': birth.change.value if birth else '',
        f'saddle_born_{axis}': birth.value if birth else math.nan,
        'tangency': 'homoclinic' if contact.is_homoclinic else 'heteroclinic',
        f'tangency_{axis}': tangency.value, 'tangency_uncertainty': tangency.uncertainty,
        'tangency_exponent': contact.lifetime_exponent}


def points_at(captors: list[Orbit], path: Path, value: float) -> tuple[FloatArray, ...]:
    """Return the points at a place of the captor and of what else is stable there, once each."""
    first, *others = captors
    carried = [carry(first, path, value)]
    for orbit in others:
        # One that does not last to there captures nothing.
        with contextlib.suppress(ValueError):
            carried.append(carry(orbit, path, value))
    known = {one.key: one.points for one in carried if one is carried[0] or one.is_stable}
    return tuple(known.values())


def radius_of(captor: Orbit, tangency: Tangency) -> float:
    """Choose how near to an orbit a trajectory is captured; rounded, the same on every machine."""
    saddle = tangency.contact.target.orbit
    apart = distances(captor.velocities[:, None], captor.phases[:, None], saddle.velocities,
                      saddle.phases)
    return round(min(CAPTURED, 0.1 * float(np.min(apart))), 6)


def places_beyond(value: float, direction: float, nearest: float, farthest: float, count: int
                  ) -> tuple[float, ...]:
    """
    Choose where escapes are timed: once before the crisis, then in equal steps of the logarithm.

    The tangency only gives where to look; the law is fitted without it.
    """
    beyond = np.geomspace(nearest, farthest, count)
    return tuple(float(round(value + direction * d, 9)) for d in (-2.0 * nearest, *beyond))


def write_law(store: Store, axis: str) -> None:
    """Fit the law of the lifetimes to a complete store, the place of the crisis free; write it."""
    timed = rates_of(store.read_all('lifetime'), store.read_all('fate'),
                     store.attrs['impacts_skipped'])
    store.write_table({name: ((axis,), np.array([getattr(rate, field) for rate in timed]),
                              named(words, units)) for name, field, words, units in (
        ('escape_rate', 'rate', 'escape rate, from escapes over impacts at risk', '1/impact'),
        ('escape_rate_error', 'error', 'its standard error', '1/impact'),
        ('escapes', 'escapes', 'trajectories that escaped', '1'),
        ('at_risk', 'at_risk', 'impacts at risk', 'impacts'))})
    places, rates, escapes = (store.read_all(name)
                              for name in (axis, 'escape_rate', 'escapes'))
    direction = store.attrs['direction']
    some = [k for k in range(1, len(places)) if escapes[k] >= 10]
    # Weighed by their counts: the errors of few escapes scatter themselves.
    data = direction * places[some], rates[some], rates[some] / np.sqrt(escapes[some])
    law = fit_law(*data)
    exponent, exponent_error = fit_exponent(*data, direction * store.attrs[f'tangency_{axis}'])
    law = dataclasses.replace(law, critical=direction * law.critical)
    store.set_attributes({_of_law(name, axis): float(value)
                          for name, value in dataclasses.asdict(law).items()})
    store.set_attributes({'exponent_at_tangency': exponent,
                          'exponent_at_tangency_error': exponent_error, 'paper_alpha': PAPER})


def _of_law(name: str, axis: str) -> str:
    return f'law_{name.replace("critical", f"{axis}_c")}'


def describe(dataset: Arrays) -> str:
    """Put a crisis in words."""
    a, axis = dataset.attrs, swept(dataset.attrs)
    law = LifetimeLaw(**{field.name: a[_of_law(field.name, axis)]
                         for field in dataclasses.fields(LifetimeLaw)})
    value = a[f'tangency_{axis}']
    apart = law.critical - value
    born = (f', born in a {a["saddle_born"]} at {axis} = {a[f"saddle_born_{axis}"]:.9f}'
            if a['saddle_born'] else '')
    lines = [
        f'boundary crisis of {a["attractor"]}; {a["captor"]} captures what escapes',
        f'it collides with the saddle {a["saddle"]} of '
        f'{counted(a["saddle_impacts"], "impact")} in '
        f'{counted(a["saddle_drive_periods"], "drive period")}{born}',
        in_columns(['found from', f'{axis}_c [1]', 'exponent of the lifetime [1]'], [
            [f'{a["tangency"]} tangency',
             f'{value:.10f} +- {a["tangency_uncertainty"]:.1g}',
             f'{a["tangency_exponent"]:.4f} in the limit'],
            ['escape rates', f'{law.critical:.7f} +- {law.critical_error:.1g}',
             f'{law.exponent:.3f} +- {law.exponent_error:.3f}, chi^2 per degree of freedom '
             f'{law.chi_square:.1f}'],
            [f'escape rates, {axis}_c given', f'{value:.10f}',
             f'{a["exponent_at_tangency"]:.3f} +- {a["exponent_at_tangency_error"]:.3f}']]),
        f'both places differ by {apart:.1g}, '
        f'{abs(apart) / law.critical_error:.1f} standard errors',
        f'before it, at {axis} = {dataset[axis].values[0]:.7f}: '
        f'{counted(dataset["escapes"].values[0], "escape")} in '
        f'{dataset["at_risk"].values[0]:.3g} impacts']
    if axis == 'alpha' and PAPER_BRACKET[0] < value < PAPER_BRACKET[1]:
        lines.append(f'the paper prints alpha_c = {PAPER}; the difference is '
                     f'{value - PAPER:+.7f}, and its bracket {PAPER_BRACKET[0]:.3f} to '
                     f'{PAPER_BRACKET[1]:.3f} holds what is found here')
    return '\n'.join(lines)
