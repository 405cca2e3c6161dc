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

"""Every transition of the attractors along paths; what chaos does, by two methods."""

from collections.abc import Iterator
import dataclasses
import itertools
import math
from typing import Any, Final, Unpack

import numpy as np

from .bifurcations import DOUBLINGS, Family, Search, state_on
from .cascades import accumulate, Accumulation
from .continuation import BINS, require_tolerance
from .endings import End
from .mergings import find_growth, find_mergings, Reshaping, Shape, shape_at
from ..attractors import identity_along, swept
from ..skeleton.tangency import birth_of, Tangency, touch
from ..sweeps.diagram import Diagram, KEY
from ..sweeps.orbit_diagram import compute
from ..work import Arrays, Study, Work, WorkOptions
from ...attractors.columns import Window
from ...attractors.listing import named
from ...attractors.plane import Plane
from ...core.arrays import FloatArray
from ...core.defaults import SEED
from ...core.model import Model
from ...core.orbits.branches import Change, Turn
from ...core.orbits.orbit import Orbit
from ...core.path import Path
from ...core.words import counted, in_columns
from ...store.layout import Axis, Layout, Variable
from ...store.store import Store

NAME: Final = 'transitions'
# Transitions of a window.
MOST: Final = 256
# A cascade is joined in the chaos beyond its end, where there are eight times as many pieces as
# before it; in parts of the distance of the doubling that leads to eight.
JOINED: Final = 0.5
EIGHT: Final = 3
# What is looked for by a second method.
OF_CHAOS: Final = ('merging', 'growth', 'crisis', 'interior crisis')


@dataclasses.dataclass(frozen=True)
class Transition:
    """A transition of an attractor."""

    attractor: int
    what: str  # as of an event; or accumulation, merging, growth
    value: float  # coordinate of the path [1]
    tolerance: float  # how well it is located [1]
    orbit: str  # key of what changes, or on what trajectories then settle
    seen: End | Reshaping | Accumulation | None = None
    # The orbit at which pieces merge, if it doubled before; what the manifolds show.
    doubled: Orbit | None = None
    tangency: Tangency | None = None


@Study
def transitions(paths: tuple[Path, ...], plane: Plane | None = None, *, columns: int = 131,
                trajectories: int = 256, keep: int = 512, hold: int = 20_000,
                tolerance: float = 1e-7, seed: int = SEED,
                **options: Unpack[WorkOptions]) -> Store:
    """
    Locate every transition of the attractors: births, doublings, chaos, mergings, crises, ends.

    The dataset has them as arrays over window and transition: where, how well that is known, what
    happens to which attractor; and of chaos the same place from the tangency of manifolds, with
    the orbit that it collides with.

    Parameters
    ----------
    paths : tuple of Path
        Windows of the same parameter, or straight paths on which the same ones vary.
    plane, columns, trajectories, keep, hold, tolerance, seed
        As `continuation` takes them, for each path.

    """
    require_tolerance(tolerance)
    plane, work = plane or Plane(), Work(**options)
    if work.cluster:
        raise ValueError('the searches run on this machine; leave out --cluster')
    alike = {tuple(None if name in each.varied else getattr(each.first, name)
                   for name in Model._fields) for each in paths}
    if len(alike) != 1:
        raise ValueError(f'{counted(len(paths), "path")}: give one or more, on which the same '
                         'parameters vary and the others have the same values')
    diagrams = [Diagram(path, columns, plane, trajectories, seed,
                        Window(keep, bins=BINS, hold=hold), ('random',)) for path in paths]
    store = work.begin(_layout(diagrams, tolerance))
    for number in store.pending():
        found, letters = find_transitions(diagrams[number], tolerance, hold, work)
        if len(found) > MOST:
            raise ValueError(f'{len(found)} transitions in the window {paths[number].ends} are '
                             f'more than {MOST}; give narrower ones')
        store.write(number, _arrays(found, letters, paths[number]))
        store.mark(number)
    return store


def find_transitions(diagram: Diagram, tolerance: float, hold: int, work: Work
                     ) -> tuple[list[Transition], dict[int, str]]:
    """Find the transitions on a path, by attractor and place; and letters of attractors."""
    here = '{} in {:g} to {:g}'.format(NAME, *diagram.path.ends)
    store = compute(diagram, Work(threads=work.threads, progress=work.progress),
                    f'{here}, columns')
    search = Closely(diagram, store, tolerance, hold)
    with work.report(f'{here}, searches for events', search.size, uneven=True) as progress:
        events = search.events(progress.add)
    found = [Transition(e.attractor, e.what, e.value, e.tolerance, e.key, e.end) for e in events]
    found += search.accumulations()

    steps = [pair for run in work.each(f'{here}, looks at chaos', search.chaos(), search.steps)
             for pair in run]
    for some in work.each(f'{here}, searches for mergings and growth', steps, search.reshapings):
        found += some
    found = [one for one in found if not any(_same(one, other) for other in found)]
    return sorted(work.each(f'{here}, tangencies', found, _with_tangency),
                  key=lambda one: (one.attractor, one.value)), search.letters


class Closely(Search):
    """Finds what attractors do inside the window, too."""

    def __init__(self, diagram: Diagram, store: Store, tolerance: float, hold: int) -> None:
        super().__init__(diagram, store, tolerance, hold)
        letters = store.read_all('letter')[0]
        self.letters = {n: max(letters[self._numbers == n])
                        for n in np.unique(self._numbers[self._numbers >= 0]).tolist()}

    def accumulations(self) -> list[Transition]:
        return [Transition(n, 'accumulation', end.value, end.uncertainty, chain[0].orbit.key, end)
                for n, chain, end in self._cascades_followed()]

    def chaos(self) -> list[tuple[int, list[tuple[float, FloatArray]]]]:
        """List where an attractor is seen to be chaotic in one column after another."""
        runs = []
        width = float(np.diff(self._diagram.values[:2])[0])
        for n, cells, _, _ in self._runs:
            places = [(float(self._diagram.values[cell[0]]), self._states[cell]) for cell in cells]
            for number, chain, end in self._cascades_followed():
                value = end.value + JOINED * (end.value - chain[EIGHT].value)
                place = value, state_on(chain[EIGHT].orbit)
                if number == n and chain[0].value < value and 0.0 < places[0][0] - value < width:
                    places.insert(0, place)
                if number == n and chain[0].value > value and 0.0 < value - places[-1][0] < width:
                    places.append(place)
            if len(places) > 1:
                runs.append((n, places))
        return runs

    def steps(self, run: tuple[int, list[tuple[float, FloatArray]]]
              ) -> list[tuple[int, Shape, Shape]]:
        """Look at an attractor at neighbouring places."""
        n, places = run
        shapes = [shape_at(self._path, value, state) for value, state in places]
        return [(n, a, b) for a, b in itertools.pairwise(shapes) if a and b]

    def reshapings(self, step: tuple[int, Shape, Shape]) -> list[Transition]:
        """Find where an attractor changes its shape between two places."""
        n, *ends = step
        return [Transition(n, what, one.value, one.uncertainty, '', one, self._doubled(n, one))
                for inside, outside in (ends, ends[::-1])
                for what, found in (
                    ('merging', find_mergings(inside, outside, self._tolerance, self._hold)),
                    ('growth', filter(None, [find_growth(inside, outside, self._tolerance,
                                                         self._hold)])))
                for one in found]

    def _doubled(self, n: int, merging: Reshaping) -> Orbit | None:
        # The orbit of that attractor that has as many points on the counted wall as pieces remain.
        doubled = [turn.orbit for family in self._families if family.number == n
                   for turn in family.turns if turn.change is Change.DOUBLING
                   and np.count_nonzero(turn.orbit.walls == turn.orbit.walls.min())
                   == merging.outside.pieces]
        return min(doubled, default=None, key=lambda one: abs(
            self._path.of(one.parameters) - merging.value))

    def _cascades_followed(self) -> Iterator[tuple[int, list[Turn], Accumulation]]:
        for family in self._families:
            parent = family.parent
            if parent and parent.orbits[0].impacts < family.orbits[0].impacts:
                continue
            for turn in family.turns:
                chain = list(self._chain(family, turn))
                end = accumulate([one.value for one in chain],
                                 [one.uncertainty for one in chain])
                if end:
                    yield family.number, chain, end

    def _chain(self, family: Family, turn: Turn) -> Iterator[Turn]:
        # Doublings, each of the orbit that was born at the one before.
        while turn.change is Change.DOUBLING:
            yield turn
            born = [(min(abs(child.value_of(one) - turn.value) for one in child.orbits), child)
                    for child in self._families if child.parent is family
                    and child.orbits[0].impacts == 2 * turn.orbit.impacts]
            if not born:
                return
            distance, family = min(born, key=lambda pair: pair[0])
            if not family.turns or distance > min(
                    abs(turn.value - one.value) for one in family.turns):
                return
            turn = max(family.turns, key=lambda one: abs(one.value - turn.value))


def _same(one: Transition, other: Transition) -> bool:
    # An interior crisis at which the attractor merges or grows, seen by what it does.
    return (one.what == 'interior crisis' and other.what in ('merging', 'growth')
            and one.attractor == other.attractor
            and abs(one.value - other.value) <= one.tolerance + other.tolerance)


def _with_tangency(one: Transition) -> Transition:
    if one.what not in OF_CHAOS or not isinstance(one.seen, End | Reshaping):
        return one
    try:
        return dataclasses.replace(one, tangency=touch(one.seen, merging=one.doubled))
    except ValueError:
        return one


def _layout(diagrams: list[Diagram], tolerance: float) -> Layout:
    first = diagrams[0]
    identity = identity_along(
        NAME, [each.path for each in diagrams], first.plane, '_windows', columns=first.columns,
        trajectories=first.trajectories, seed=first.seed,
        initial_velocity_window=list(first.plane.velocity), hold=first.window.hold,
        impacts_counted=first.window.keep, located_within=tolerance)
    del identity['velocity_window']
    return Layout(
        (Axis('window', np.arange(len(diagrams)), named('number of the window', None), 1),
         Axis('transition', np.arange(MOST), named(f'by attractor and {first.path.name}', None)),
         Axis('interval', np.arange(DOUBLINGS), named('of successive doublings', None))),
        tuple(Variable(name, ('window', 'transition', *others), dtype, named(words, units))
              for name, dtype, words, units, *others in columns_of(first.path.name)), identity)


def columns_of(axis: str) -> tuple[tuple[Any, ...], ...]:
    """Return name, type, words, unit and further dimensions of each array of the dataset."""
    return (
        ('attractor', '<i4', 'number of the attractor in its window, -1 for no transition', None),
        ('letter', '<U1', 'its letter, empty for none', None),
        ('kind', '<U15', 'what happens', None),
        (axis, '<f8', 'where', '1'),
        (f'{axis}_error', '<f8', 'how well it is located', '1'),
        ('orbit', KEY, 'what changes, or on what trajectories then settle', None),
        ('pieces', '<i4', 'pieces before a merging', '1'),
        ('pieces_left', '<i4', 'pieces after it', '1'),
        (f'tangency_{axis}', '<f8', 'where the manifolds touch, nan where none is found', '1'),
        ('tangency_error', '<f8', 'how well it is located', '1'),
        ('saddle', KEY, 'orbit that the attractor collides with', None),
        ('saddle_born', '<f8', f'{axis} of the fold in which it was born, or nan', '1'),
        ('ratio', '<f8', 'ratio of successive intervals of a cascade, nan for fewer', '1',
         'interval'))


def _arrays(found: list[Transition], letters: dict[int, str], path: Path) -> dict[str, Any]:
    axis = path.name
    values: dict[str, Any] = {
        name: np.full((1, MOST, *(DOUBLINGS for _ in others)),
                      {'f': math.nan, 'i': -1, 'U': ''}[dtype[1]], dtype)
        for name, dtype, _, _, *others in columns_of(axis)}
    for k, one in enumerate(found):
        row: dict[str, Any] = {
            'attractor': one.attractor, 'letter': letters.get(one.attractor, ''),
            'kind': one.what, axis: one.value, f'{axis}_error': one.tolerance, 'orbit': one.orbit}
        if isinstance(one.seen, Reshaping):
            row |= {'pieces': one.seen.inside.pieces, 'pieces_left': one.seen.outside.pieces}
        if one.tangency:
            saddle = one.tangency.contact.target.orbit
            birth = birth_of(saddle, path)
            row |= {f'tangency_{axis}': one.tangency.value,
                    'tangency_error': one.tangency.uncertainty, 'saddle': saddle.canonical().name,
                    'saddle_born': birth.value if birth and birth.change is Change.FOLD
                    else math.nan}
        for name, value in row.items():
            values[name][0, k] = value
        if isinstance(one.seen, Accumulation):
            values['ratio'][0, k, :len(one.seen.ratios)] = one.seen.ratios
    return values


def describe(dataset: Arrays) -> str:
    """List the transitions, window by window."""
    parts, axis = [], swept(dataset.attrs)
    windows = {name: np.reshape(dataset.attrs[f'{name}_windows'], (-1, 2))
               for name in Model._fields if name not in dataset.attrs}
    for number in range(len(dataset['window'].values)):
        columns = {name: dataset[name].values[number] for name, *_ in columns_of(axis)}
        rows = [_row({name: values[k] for name, values in columns.items()}, axis)
                for k in np.flatnonzero(columns['attractor'] >= 0)]
        parts.append(', '.join('{} from {:g} to {:g}'.format(name, *each[number])
                               for name, each in windows.items()) + '\n' + in_columns(
            [' attractor', 'transition', f' {axis} [1]', ' tangency of manifolds at', 'orbit'],
            rows))
    return '\n\n'.join(parts)


def _row(one: dict[str, Any], axis: str) -> list[str]:
    what, about = str(one['kind']), str(one['orbit'])
    if what == 'accumulation':
        what, ratios = 'chaos begins', [f'{x:.3f}' for x in one['ratio'] if math.isfinite(x)]
        about = f'doublings of {about}, ratios of intervals {" ".join(ratios)}'
    elif what == 'merging':
        what += f' {one["pieces"]} -> {one["pieces_left"]}'
    touched = ''
    if one['saddle']:
        born = f', born at {one["saddle_born"]:.7f}' if math.isfinite(one['saddle_born']) else ''
        about = f'collides with {one["saddle"]}{born}' + (f'; then {about}' if about else '')
        touched = _place(one[f'tangency_{axis}'], one['tangency_error'])
    elif one['kind'] in OF_CHAOS:
        touched = 'none found'
        about = about and f'then {about}'
    return [f'{one["letter"]} {one["attractor"]}'.strip(), what,
            _place(one[axis], one[f'{axis}_error']), touched, about]


def _place(value: float, error: float) -> str:
    return f'{value:.{max(0, 1 - math.floor(math.log10(error)))}f} +- {error:.1e}'
