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

"""Attractors and their shares followed along a path; where each is born, doubles and ends."""

from typing import Final, Unpack

import numpy as np

from .bifurcations import Event, HEADING, Search
from ..attractors import swept
from ..sweeps.diagram import Diagram
from ..sweeps.orbit_diagram import compute
from ..work import Arrays, Study, Work, WorkOptions
from ...attractors.columns import Window
from ...attractors.listing import named
from ...attractors.plane import Plane
from ...core.defaults import HOLD, SEED
from ...core.path import Path
from ...core.words import counted
from ...store.store import Store

NAME: Final = 'continuation'
# Of the velocities by which attractors are matched from column to column.
BINS: Final = 1200


@Study
def continuation(path: Path, plane: Plane | None = None, *, columns: int = 131,
                 trajectories: int = 256, keep: int = 512, hold: int = HOLD,
                 tolerance: float = 1e-7, seed: int = SEED, boundary: bool = False,
                 kicks: bool = False, **options: Unpack[WorkOptions]) -> Store:
    """
    Follow attractors and their shares along a path; locate where they are born, double and end.

    The dataset has what `orbit_diagram` has, and the events.

    Parameters
    ----------
    path, plane, columns, trajectories, keep, seed
        As `orbit_diagram` takes them.
    hold : int
        A chaotic attractor lasts where trajectories stay for this number of impacts.
    tolerance : float
        Accuracy of the ends of chaotic attractors, along the path [1].
    boundary : bool
        Whether the boundary between the basins is measured in each column, coarsely.
    kicks : bool
        Whether the smallest kick that changes each attractor is carried along.

    """
    require_tolerance(tolerance)
    work = Work(**options)
    diagram = Diagram(path, columns, plane or Plane(), trajectories, seed,
                      Window(keep, bins=BINS, hold=hold, kicks=kicks), ('random',), boundary)
    store = compute(diagram, work, NAME)
    search = Search(diagram, store, tolerance, hold)
    with work.report('continuation, searches for events', search.size, uneven=True) as progress:
        events = search.events(progress.add)
    write_events(store, events, path.name)
    return store


def require_tolerance(tolerance: float) -> None:
    """Refuse a tolerance outside 1e-12 to 1e-2 with a ValueError."""
    if not 1e-12 <= tolerance <= 1e-2:
        raise ValueError(f'--tolerance {tolerance:g} is not between 1e-12 and 1e-2')


def describe(dataset: Arrays) -> str:
    lines = [str(dataset.attrs['events'])]
    if 'boundary' in dataset.attrs:
        lines += [_extremes(dataset, name, words) for name, words in (
            ('boundary_exponent', 'uncertainty exponent of the boundary'),
            ('boundary_entropy', 'boundary basin entropy S_bb'))]
    return '\n'.join(lines)


def _extremes(dataset: Arrays, name: str, words: str) -> str:
    axis = swept(dataset.attrs)
    places, values, errors = dataset[axis].values, *(
        dataset[each].values[0] for each in (name, f'{name}_error'))
    there = np.flatnonzero(np.isfinite(values))
    if not len(there):
        return f'{words}: at no {axis}'
    least, most = there[np.argmin(values[there])], there[np.argmax(values[there])]
    return f'{words}: at {len(there):,} of {counted(len(places), axis)}, ' + ' to '.join(
        f'{values[k]:.3f} +- {errors[k]:.3f} at {places[k]:.6f}' for k in (least, most))


def write_events(store: Store, events: list[Event], axis: str) -> None:
    store.write_table({f'event_{name}': (('event',), np.array(values, dtype), named(*words))
                       for name, values, dtype, words in (
        ('attractor', [e.attractor for e in events], 'i4', ('number of the attractor', None)),
        ('kind', [e.what for e in events], 'U15', ('what happens', None)),
        ('orbit', [e.key for e in events], 'U48',
         ('what changes, or on what trajectories then settle', None)),
        (axis, [e.value for e in events], 'f8', ('where',)),
        ('tolerance', [e.tolerance for e in events], 'f8', ('how well it is located',)),
        ('period_impacts', [e.orbit.impacts if e.orbit else 0 for e in events], 'i4',
         ('period of the orbit', 'impacts')),
        ('period_drive', [e.orbit.drive_periods if e.orbit else 0 for e in events], 'i4',
         ('period of the orbit', 'drive periods')),
        ('multiplier', [e.multiplier for e in events], 'f8',
         ('critical multiplier, real part',)))})
    numbers, letters = store.read_all('attractor'), store.read_all('letter')
    lines = [HEADING.format(axis), *(event.describe(
        max(letters[numbers == event.attractor], default='')) for event in events)]
    store.set_attributes({'tool': NAME, 'events': '\n'.join(lines)})
