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

"""The curves in a plane of two parameters on which its orbits change, and rest begins."""

from collections.abc import Iterator, Mapping
import dataclasses
from typing import Any, Final

import numpy as np

from ..work import Work
from ...attractors.listing import table
from ...attractors.plane import Plane
from ...core.arrays import FloatArray
from ...core.many.recognition import find_orbit
from ...core.many.recorded import record_impacts
from ...core.many.survey import LONGEST, PERIODIC, RECURS
from ...core.model import Parameters
from ...core.orbits.branches import follow, Turn
from ...core.orbits.loci import crossings, Locus, Mark, trace_locus
from ...core.orbits.orbit import Orbit
from ...core.path import Path
from ...store.store import Store

# Of the cells of an orbit, from which its branches begin: their places in order of the vertical
# parameter. Trajectories that look for it, impacts passed over and looked at, orbits of a branch.
PLACES: Final = (0.1, 0.5, 0.9)
TRAJECTORIES: Final = 32
PASSED, LOOKED_AT = 3000, 2 * LONGEST
MOST: Final = 600
# Points of the curve on which rest begins.
POINTS: Final = 400
REST: Final = 'rest'
Windows = Mapping[str, tuple[float, float]]


def find_loci(store: Store, windows: Windows, fixed: Parameters, plane: Plane, seed: int,
              count: int, work: Work) -> list[Locus]:
    """Find the curves of the orbits to which most cells belong."""
    kinds, exponents = (store.read_all(name) for name in ('kind', 'exponent'))
    types = np.stack([store.read_all(name) for name in (
        'period_impacts', 'period_drive', 'contact')], axis=-1)
    on_orbit = (kinds == PERIODIC) & np.isfinite(exponents)
    each, numbers = np.unique(types[on_orbit], axis=0, return_counts=True)
    each = each[np.argsort(-numbers, kind='stable')][:count]
    axes = {name: store.read_all(name) for name in windows}

    def search(kind: Any) -> list[Locus]:
        cells = (on_orbit & np.all(types == kind, axis=-1)).any(axis=2)
        loci: list[Locus] = []
        for turn in _turns(_orbits(cells, kind, axes, fixed, plane, seed), windows):
            locus = trace_locus(turn, windows, loci)
            loci += [locus] if locus else []
        return loci

    found: list[Locus] = []
    for loci in work.each('curves', [*each], search):
        found += [one for one in loci if not any(other.holds(one) for other in found)]
    return found


def _orbits(cells: Any, kind: Any, axes: Mapping[str, FloatArray], fixed: Parameters,
            plane: Plane, seed: int) -> Iterator[Orbit]:
    x, y = axes
    rows, columns = np.nonzero(cells)
    for place in PLACES:
        row = rows[int(place * (len(rows) - 1))]
        inside = columns[rows == row]
        here = dataclasses.replace(fixed, **{
            x: float(axes[x][inside[len(inside) // 2]]), y: float(axes[y][row])})
        impacts, made = record_impacts(plane.draw(here, TRAJECTORIES, seed), PASSED, LOOKED_AT)
        for some in impacts[made == LOOKED_AT]:
            orbit = find_orbit(here, some, LONGEST, RECURS)
            if orbit and (orbit.impacts, orbit.drive_periods) == tuple(kind[:2]):
                yield orbit
                break


def _turns(orbits: Iterator[Orbit], windows: Windows) -> Iterator[Turn]:
    for orbit in orbits:
        for name, window in windows.items():
            path = Path.over(orbit.parameters, **{name: window})
            for direction in (1.0, -1.0):
                yield from follow(orbit, path, direction, *window, most=MOST).turns


def rest_curves(windows: Windows, fixed: Parameters) -> Iterator[FloatArray]:
    """Give where a gear may begin to rest permanently: ``alpha sqrt(1 + beta^2) = |gamma|``."""
    solved = next(name for name in ('gamma', 'alpha', 'beta') if name in windows)
    other = next(name for name in windows if name != solved)
    values = vars(fixed) | {other: np.linspace(*windows[other], POINTS)}
    alpha, beta, gamma = values['alpha'], values['beta'], values['gamma']
    with np.errstate(all='ignore'):
        found = np.broadcast_to({
            'gamma': alpha * np.hypot(1.0, beta), 'alpha': np.abs(gamma) / np.hypot(1.0, beta),
            'beta': np.sqrt((gamma / alpha)**2 - 1.0)}[solved], POINTS)
    low, high = windows[solved]
    for sign in (1.0, -1.0)[:2 if solved == 'gamma' else 1]:
        inside = (sign * found >= low) & (sign * found <= high)
        points = np.stack([sign * found, values[other]], axis=1)[inside]
        if len(points):
            yield points if solved == next(iter(windows)) else points[:, ::-1]


def curves_table(loci: list[Locus], windows: Windows, fixed: Parameters) -> dict[str, Any]:
    """Return the arrays of all curves, the points at which they change, and rest."""
    curves = [(*one.ring.title, one.points[:, :2]) for one in loci] + [
        (REST, 0, 0, each) for each in rest_curves(windows, fixed)]
    points = np.concatenate([np.zeros((0, 2)), *(each[3] for each in curves)])
    marks = [(*mark, k, -1) for k, one in enumerate(loci) for mark in one.marks] + [
        (Mark.CROSSING, *place, k, n) for k, one in enumerate(loci)
        for n in range(k + 1, len(loci)) for place in crossings(one, loci[n])]
    return table(
        'curve', kind=(np.array([each[0] for each in curves], '<U16'),
                       'what happens to an orbit there; rest: the gear may begin to rest', None),
        impacts=([each[1] for each in curves], 'period of the orbit, 0 for rest', 'impacts'),
        drive=([each[2] for each in curves], 'period of the orbit, 0 for rest', 'drive periods'),
    ) | table(
        'vertex', curve=(np.repeat(np.arange(len(curves)), [len(each[3]) for each in curves]),
                         'number of its curve', None),
        **{name: (points[:, k], f'{name} there') for k, name in enumerate(windows)}
    ) | table(
        'mark', kind=(np.array([mark.value for mark, *_ in marks], '<U16'),
                      'cusp: two folds end; grazing: the curve ends, and the orbit grazes a wall; '
                      'doubling: a fold of the doubled orbit ends on the curve of the doubling; '
                      'sticking: a grazing ends, as the gear would stick; crossing: two curves '
                      'cross', None),
        curve=([mark[3] for mark in marks], 'number of its curve', None),
        other=([mark[4] for mark in marks], 'of a crossing, number of the other; -1', None),
        **{name: (np.array([mark[1 + k] for mark in marks], np.float64), f'{name} there')
           for k, name in enumerate(windows)})
