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

"""The stable and unstable manifolds of a saddle, over the basins that they bound."""

from collections.abc import Sequence
import functools
import itertools
import math
import re
from typing import Final, Unpack

import numpy as np

from .tangency import first_touch
from ..attractors import path_attributes
from ..grids import basins
from ..work import Arrays, Study, Work, WorkOptions
from ...attractors.catalogue import Catalogue
from ...attractors.listing import impact_table
from ...attractors.plane import Plane
from ...core.defaults import BASINS_CAP, HOLD, INITIAL_CONDITIONS, SEED, TOLERANCE
from ...core.flight.inverse import require_inverse
from ...core.flight.lanes import make_initial_conditions
from ...core.many.recorded import initial_after, record_impacts
from ...core.many.settling import UNSETTLED
from ...core.model import ALPHA_MAXIMUM, Parameters, Wall
from ...core.orbits.branches import follow
from ...core.orbits.cells import find_cells, first_crossing
from ...core.orbits.curves import Curve, impact_map, joined, Segment, segments_of, sides_of
from ...core.orbits.manifolds import Saddle, saddle_of
from ...core.orbits.orbit import close_near, close_orbit, Orbit
from ...core.orbits.section import distances
from ...core.path import Path
from ...core.words import counted
from ...store.store import Store

NAME: Final = 'manifolds'
TITLE: Final = 'Manifolds of a saddle of the gear-rattling model'
# Impacts of a period at most, where none is given.
LONGEST: Final = 24
# An orbit is sought this far from a point [rad, 1], and from one that a key names.
REACH: Final = 0.3
NAMED: Final = 2e-4
# How far in alpha an orbit is followed to the saddle that was born with it [1].
BEYOND: Final = 0.3
# Points of the unstable manifold whose attractors are found.
LABELLED: Final = 200
# Curves are followed to this many times the largest speed of the plane.
FASTER: Final = 3.0
KEY: Final = re.compile(r'(?:orbit-)?(\d+)-\d+-(?:U(?=.*[+])|L)([\d.]+)([-+][\d.]+)')


@Study
def manifolds(parameters: Parameters, plane: Plane | None = None, *, orbit: str | None = None,
              point: tuple[float, float, float] | None = None, period: int | None = None,
              length: float = 200.0, precision: float = 1e-3,
              touch: Path | None = None, cap: int = BASINS_CAP,
              tolerance: float = TOLERANCE, initial_conditions: int = INITIAL_CONDITIONS,
              seed: int = SEED, hold: int = HOLD, tile: int | None = None,
              **options: Unpack[WorkOptions]) -> Store:
    """
    Draw the manifolds of a saddle as curves, over the basins.

    The dataset is that of `basins`, with the points of the curves, the saddle, and where the
    manifolds cross.

    Parameters
    ----------
    parameters, plane
        The model and the cells of the basins; their displacement is that of a wall.
    orbit : str, optional
        The key of the saddle; of a stable orbit that of the saddle that was born with it.
    point : tuple of float, optional
        Wall (0 upper, 1 lower), phase [rad] and velocity before the impact [1] near the saddle.
    period : int, optional
        Impacts of a period of the orbit near the point; the nearest one by default.
    length : float
        Length of each side of a manifold [1], nearly.
    precision : float
        Bound of the distance between neighbours times the angle between them [1].
    touch : Path, optional
        Path through the model, on which it is sought where the manifolds first touch.
    cap, tolerance, initial_conditions, seed, hold, tile
        As `basins` takes them.

    """
    plane = plane or Plane()
    require_inverse(parameters)
    if not plane.holds(np.arange(2)).any():
        raise ValueError(f'{plane.words}: no impact lies on this plane; take the section, or the '
                         'displacement 0 or -1')
    for name, value, low, high in (('length', length, 1e-3, 1e5),
                                   ('precision', precision, 1e-6, 0.1)):
        if not low <= value <= high:
            raise ValueError(f'{name} = {value:g} is not between {low:g} and {high:g}')
    if touch is not None and not touch.meets(parameters):
        raise ValueError('the path of the first touch does not lead through the model')
    saddle = saddle_of(find_saddle(parameters, orbit, point, period))
    work = Work(**options)
    store, catalogue = basins.compute_basins(
        parameters, plane, work, cap=cap, tolerance=tolerance, seed=seed, hold=hold,
        initial_conditions=initial_conditions, tile=tile, name=NAME, title=TITLE,
        saddle=saddle.orbit.name, length=length, precision=precision,
        **path_attributes('touch', touch))
    if not store.has_table('curve_wall'):
        curves: dict[str, Curve] = {}
        with work.report('curves', len(segments_of(saddle))) as progress:
            for name, curve in sides_of(
                    saddle.orbit, fastest=FASTER * max(map(abs, plane.velocity)), length=length,
                    tolerance=precision):
                curves[name] = curve
                progress.add(1, len(curve.walls))
        _write(store, saddle, catalogue, curves, work)
    if touch is not None and 'touch_error' not in store.attrs:
        with work.report('first touch', 70, uneven=True) as progress:
            found = first_touch(saddle.orbit, touch, searched=progress.add)
        store.set_attributes({f'touch_{touch.name}': found.value,
                              'touch_error': found.uncertainty})
    return store


def find_saddle(parameters: Parameters, key: str | None = None,
                point: tuple[float, float, float] | None = None, period: int | None = None
                ) -> Orbit:
    """Find the saddle that a key names, or one near a point; ValueError where there is none."""
    if (key is None) == (point is None):
        raise ValueError('give either --orbit KEY or --point WALL PHASE VELOCITY')
    if key is not None:
        read = KEY.fullmatch(key)
        if not read:
            raise ValueError(f'--orbit {key} is no key of an orbit, such as '
                             'orbit-2-1-U5.1744+0.8226; attractors lists those of stable ones')
        found = _close(parameters, (float(read[2]), float(read[3])), int(read[1]), NAMED)
        if found is None:
            raise ValueError(f'--orbit {key}: there is no such orbit at alpha = '
                             f'{parameters.alpha:g}; its key has four digits of its first point')
        return partner_of(found) if found.is_stable else found
    assert point is not None
    wall, *place = point
    if wall not in tuple(Wall) or math.copysign(1.0, point[2]) != 1.0 - 2.0 * wall:
        raise ValueError(f'--point {wall:g} {point[1]:g} {point[2]:g}: the wall is 0 (upper) '
                         'with a positive velocity or 1 (lower) with a negative one')
    orbits = [each for q in ([period] if period else range(1, LONGEST + 1))
              if (each := _close(parameters, place, q, REACH))
              and not each.is_stable and each.multipliers[0].imag == 0.0]
    if not orbits:
        raise ValueError(f'no saddle is near the point {point[1]:g} {point[2]:g}, of '
                         f'{counted(period or LONGEST, "impact")}{"" if period else " at most"}; '
                         'give a nearer point or --period')
    return min(orbits, key=functools.partial(_distance, point=place))


def _distance(orbit: Orbit, point: Sequence[float]) -> float:
    return float(np.min(distances(orbit.velocities, orbit.phases, point[1], point[0])))


def _close(parameters: Parameters, point: Sequence[float], period: int, reach: float
           ) -> Orbit | None:
    # The orbit of that many impacts through a point; its other points are found on the way, and
    # those of a saddle are off by more.
    rows, made = record_impacts(
        initial_after(parameters, *np.reshape(point, (2, 1))), 0, period)
    rows['phase'][0, -1], rows['velocity'][0, -1] = point
    found = close_near(parameters, rows[0], REACH) if made[0] == period else None
    if found is None or found.impacts != period or _distance(found, point) > reach:
        return None
    return found.canonical()


def partner_of(orbit: Orbit) -> Orbit:
    """Find the saddle that was born with a stable orbit, where its branch has turned round."""
    alpha = orbit.parameters.alpha
    path = Path.over(orbit.parameters, alpha=(0.0, ALPHA_MAXIMUM))
    for direction in (-1.0, 1.0):
        branch = follow(orbit, path, direction, alpha - BEYOND, alpha + BEYOND).orbits
        offsets = np.array([each.parameters.alpha - alpha for each in branch])
        for k in np.flatnonzero(offsets[1:] * offsets[:-1] < 0.0):
            found = close_orbit(branch[k].walls, branch[k].points, orbit.parameters)
            if found is not None and not found.is_stable:
                return found.canonical()
    raise ValueError(f'the orbit {orbit.name} is stable, and its branch within {BEYOND:g} of '
                     f'alpha = {alpha:g} shows no saddle born with it; give the --point of one')


def _write(store: Store, saddle: Saddle, catalogue: Catalogue, curves: dict[str, Curve],
           work: Work) -> None:
    orbit, lines, cells = saddle.orbit, [], []
    for name, segment, backwards in segments_of(saddle):
        curve = curves[name]
        leads = '' if backwards else f'; {leads_to(segment, catalogue, work.threads)}'
        lines.append(
            f'{name}: length {curve.length:.1f}, {counted(len(curve.walls), "point")} in '
            f'{counted(int(curve.begins.sum()), "piece")}, after at most '
            f'{counted(int(curve.impacts.max()), "impact")}{leads}')
    crossings = []
    for one, other in itertools.product(curves, curves):
        if one.startswith('unstable') and other.startswith('stable') and (
                met := first_crossing(curves[one], curves[other])):
            i, _, (phase, velocity) = met
            crossings.append((curves[one].walls[i:i + 1], met[2][None]))
            lines.append(f'{one} crosses {other} at phase {phase % math.tau:.4f}, velocity '
                         f'{velocity:.4f}')
            if saddle.turns == 1:
                cells += find_cells(orbit.points, curves[one], curves[other],
                                    impact_map(orbit.parameters.model))
    if not crossings:
        lines.append('the manifolds do not cross each other at these lengths')
    lines.append(f'basin cells: {", ".join(f"{cell.sides} sides" for cell in cells) or "none"}')
    store.set_attributes({
        'orbit': orbit.key, 'curves': '\n'.join(lines), 'sides': ', '.join(curves),
        'multipliers': orbit.multipliers.real.tolist()})
    whole = joined(list(curves.values()))
    store.write_table(impact_table(
        'curve', [(curve.walls, curve.points) for curve in curves.values()],
        'side: number in `sides`', impacts=(whole.impacts, 'impacts from the saddle'),
        begins=(whole.begins.astype(np.int8), '1 where a piece begins'),
        grazes=(whole.grazes.astype(np.int8),
                '1 where a piece begins or ends as its flight grazes a wall')) | impact_table(
        'saddle', [(orbit.walls, orbit.points)]) | impact_table(
        'crossing', crossings) | impact_table('cell', [
            (np.full(len(cell.outline), cell.wall), cell.outline) for cell in cells],
            'number of the cell'))


def leads_to(segment: Segment, catalogue: Catalogue, threads: int | None = None) -> str:
    """
    Put in words on which attractors one period of an unstable manifold settles.

    Where that is one alone, the saddle is accessible from its basin: along this manifold.
    """
    walls, points = segment.at((np.arange(LABELLED) + 0.5) / LABELLED)
    labels, numbers = np.unique(catalogue.label(make_initial_conditions(
        catalogue.parameters, np.mod(points[:, 0], math.tau), -1.0 * walls,
        points[:, 1]), threads=threads)['label'], return_counts=True)
    titles = {each.label: each.title for each in catalogue.attractors} | {UNSETTLED: 'unsettled'}
    if len(labels) == 1 and labels[0] != UNSETTLED:
        return f'leads to {titles[labels[0]]} alone: the saddle is accessible from its basin'
    return 'leads to ' + ', '.join(f'{titles.get(label, label)} ({100.0 * part / LABELLED:.1f} %)'
                                   for label, part in zip(labels.tolist(), numbers, strict=True))


def describe(dataset: Arrays) -> str:
    """Put the curves, where they lead and cross, and the basins in words."""
    a = dataset.attrs
    first, second = a['multipliers']
    axis = a.get('touch_along', 'alpha')
    touch = (f'\nthe manifolds first touch at {axis} = {a[f"touch_{axis}"]:.9f} +- '
             f'{a["touch_error"]:.1e}' if 'touch_error' in a else '')
    return (f'saddle {a["orbit"]}: multipliers {first:.6g} and {second:.6g}\n{a["curves"]}{touch}'
            f'\n{basins.describe(dataset)}')
