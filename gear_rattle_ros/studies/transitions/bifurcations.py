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

"""Where the attractors of an orbit diagram are born, double and end."""

from collections.abc import Callable, Iterator
import dataclasses
import itertools
import math
from typing import Final, TypeAlias

import numpy as np

from .endings import Captor, End, find_end, Herd, spread_out, watch
from ..sweeps.diagram import Diagram, KINDS
from ...attractors.catalogue import Kind
from ...core.arrays import FloatArray
from ...core.flight.lanes import make_initial_conditions
from ...core.many.recorded import record_impacts
from ...core.model import Parameters
from ...core.orbits.branches import Change, follow, leaving, Turn
from ...core.orbits.orbit import close_near, close_orbit, Orbit, REACH, same_orbit
from ...core.orbits.section import turn as turned
from ...core.path import Path
from ...store.store import Store

PERIODIC: Final = KINDS.index(Kind.PERIODIC.value)
CHAOTIC: Final = KINDS.index(Kind.CHAOTIC.value)
# Doublings followed of each orbit, and the longest period [impacts].
DOUBLINGS: Final = 7
LONGEST: Final = 256
# Distance outside the window, in the parameters, to which orbits are followed for their birth and
# their end [1].
OUTSIDE: Final = 0.2
# Two orbits are one where their points agree to this [rad, 1]; at a change they diverge as a root.
SAME: Final = 1e-6
SAME_CHANGE: Final = 1e-4
# Distance beside a change, in the parameters, at which the stability of an orbit is decided [1].
BESIDE: Final = 1e-6
# To follow a chaotic attractor takes as long as this number of orbits.
FOLLOWING: Final = 10


@dataclasses.dataclass(frozen=True)
class Event:
    """Where an attractor changes."""

    attractor: int
    # Of an orbit: fold, pitchfork, doubling, grazing. Of a chaotic attractor: window (a stable
    # orbit is born and replaces it), crisis (trajectories leave it for good), interior crisis (it
    # suddenly grows). Of any: not located (it is seen in one column and not in the next; at rest,
    # or on an orbit that sticks, it cannot be followed).
    what: str
    value: float  # coordinate of the path [1]
    tolerance: float  # how well it is located [1]
    captor: Captor  # what changes, or on what trajectories then settle
    end: End | None = None  # of chaos, as it was seen

    @property
    def orbit(self) -> Orbit | None:
        return self.captor if isinstance(self.captor, Orbit) else None

    @property
    def key(self) -> str:
        """Name of the orbit or of what else it is about; empty where nothing has one."""
        return self.orbit.key if self.orbit else str(self.captor or '')

    @property
    def multiplier(self) -> float:
        """Real part of the multiplier that is critical [1], nan where there is none."""
        if self.orbit is None or self.what == 'crisis':
            return math.nan
        critical = -1.0 if self.what == Change.DOUBLING.value else 1.0
        return float(min(self.orbit.multipliers, key=lambda m: abs(m - critical)).real)

    def describe(self, letter: str = '') -> str:
        digits = 1 - math.floor(math.log10(self.tolerance))
        return (f'{f"{letter} {self.attractor}":>9s}  {self.what:15s}  {self.value:.{digits}f} +- '
                f'{self.tolerance:.1e}  {self.key}').rstrip()


HEADING: Final = 'attractor  event            {} [1]  orbit'


@dataclasses.dataclass
class Family:
    """The stable orbits of a branch between two changes."""

    path: Path
    orbits: list[Orbit]  # in their order on it
    turns: list[Turn]  # where it ends
    parent: 'Family | None'  # the family from which it branches
    numbers: list[int] = dataclasses.field(default_factory=list)  # of attractors seen on it

    @property
    def number(self) -> int:
        """Return the number of the attractor seen on it most often, or on its parent."""
        if self.parent and not self.numbers:
            return self.parent.number
        return max(sorted(set(self.numbers)), key=self.numbers.count)

    def value_of(self, orbit: Orbit) -> float:
        return self.path.of(orbit.parameters)

    def holds(self, orbit: Orbit) -> bool:
        if (orbit.impacts, orbit.drive_periods) != (self.orbits[0].impacts,
                                                    self.orbits[0].drive_periods):
            return False
        value, values = self.value_of(orbit), [*map(self.value_of, self.orbits)]
        after = sum(one < value for one in values)
        first, last = max(after - 1, 0), min(after, len(values) - 1)
        near, far = self.orbits[first], self.orbits[last]
        gap = values[last] - values[first]
        share = (value - values[first]) / gap if gap > 0.0 else 0.0
        ahead = far.points - near.points
        ahead[:, 0] = turned(ahead[:, 0])
        here = close_orbit(near.walls, near.points + share * ahead, orbit.parameters)
        return here is not None and same_orbit(here, orbit, SAME)


# Column and slot of an attractor in a diagram.
Cell: TypeAlias = tuple[int, int]


class Search:
    """Locates where the attractors of a diagram are born, double and end."""

    # A periodic one ends where its branch does, so its branch is followed without any trajectory;
    # a chaotic one is followed with its own states.
    def __init__(self, diagram: Diagram, store: Store, tolerance: float, hold: int) -> None:
        self._diagram, self._path = diagram, diagram.path
        self._tolerance, self._hold = tolerance, hold
        self._numbers, self._kinds, self._keys, self._states, self._periods = (
            store.read_all(name)[diagram.sweeps.index('random')] for name in (
                'attractor', 'kind', 'key', 'member_state', 'period_impacts'))
        # What is seen over fewer columns may end where another does that it has become.
        self._runs = sorted(self._runs_of_chaos(), key=lambda run: -len(run[1]))
        self._families: list[Family] = []
        self._ends: list[tuple[int, End]] = []
        self._followed: set[Cell] = set()

    @property
    def size(self) -> int:
        """Foresee how many searches it takes."""
        return int(np.count_nonzero(self._kinds == PERIODIC)) + 2 * FOLLOWING * len(self._runs)

    def events(self, searched: Callable[[int], None]) -> list[Event]:
        """Find all events, attractor by attractor; `searched` is called with searches made."""
        for n, cell in self._seen(PERIODIC):
            orbit = self._orbit_in(cell)
            if orbit is not None:
                self._followed.add(cell)
                self._take(n, orbit)
            searched(1)
        for n, cells, low, high in self._runs:
            for direction, edge in ((-1.0, low), (1.0, high)):
                # What seems chaotic may be a long transient, at the end of the run or all along.
                for cell in sorted(cells, reverse=direction > 0.0):
                    if self._follow_chaos(n, self._diagram.at(cell[0]), self._states[cell],
                                          direction, edge):
                        self._followed.update(cells)
                        break
                searched(FOLLOWING)
        for family in self._families:
            n = family.number
            for parameters, orbit, direction in self._cascades(family, n):
                self._follow_chaos(n, parameters, state_on(orbit), direction,
                                   self._path.ends[int(direction > 0.0)])
        events = [Event(n, end.kind, end.value, end.uncertainty, end.captor, end)
                  for n, end in self._ends]
        events += self._not_located()
        for family in self._families:
            for turn in family.turns:
                event = Event(family.number, turn.change.value, turn.value, turn.uncertainty,
                              turn.orbit)
                if not any(_same_change(event, known) for known in events):
                    events.append(event)
        return sorted(events, key=lambda event: (event.attractor, event.value))

    def _take(self, n: int, orbit: Orbit) -> None:
        home = next((one for one in self._families if one.holds(orbit)), None)
        (home or self._grow(orbit, (-1.0, 1.0))).numbers.append(n)

    def _follow_chaos(self, n: int, parameters: Parameters, state: FloatArray, direction: float,
                      edge: float) -> bool:
        # Whether it is chaos.
        herd = watch(parameters, spread_out(parameters, state), self._hold)
        if not isinstance(herd, Herd):
            return False
        low, high = self._path.ends
        end = find_end(herd, self._path, direction, (high - low) / (self._diagram.columns - 1),
                       edge, self._tolerance, self._hold)
        if end and end.kind == 'orbit' and isinstance(end.captor, Orbit):
            self._take(n, end.captor)
        elif end and not any(_same_end(end, known) for _, known in self._ends):
            self._ends.append((n, end))
        return True

    def _orbit_in(self, cell: Cell) -> Orbit | None:
        parameters = self._diagram.at(cell[0])
        (row,), _ = record_impacts(make_initial_conditions(
            parameters, *self._states[cell][:, None]), 0, int(self._periods[cell]))
        orbit = close_near(parameters, row, REACH)
        return orbit if orbit is not None and orbit.is_stable else None

    def _seen(self, kind: int) -> Iterator[tuple[int, Cell]]:
        # The number and the cell of every attractor of a kind.
        for column, slot in np.argwhere(self._kinds == kind).tolist():
            yield int(self._numbers[column, slot]), (column, slot)

    def _runs_of_chaos(self) -> Iterator[tuple[int, list[Cell], float, float]]:
        # The number and the cells without a gap in which an attractor is chaotic, and the places
        # to which it is followed: where it is seen next, or the ends of the path.
        chaos: dict[int, list[Cell]] = {}
        for n, cell in self._seen(CHAOTIC):
            chaos.setdefault(n, []).append(cell)
        values = self._diagram.values
        for n, cells in chaos.items():
            # What is not seen in a column may have ended before it.
            breaks = [0, *(i for i in range(1, len(cells)) if cells[i][0] > cells[i - 1][0] + 1),
                      len(cells)]
            for first, after in itertools.pairwise(breaks):
                yield (n, cells[first:after],
                       float(values[cells[first - 1][0] if first else 0]),
                       float(values[cells[after][0] if after < len(cells) else -1]))

    def _not_located(self) -> Iterator[Event]:
        # The ends of what could not be followed are known from the columns alone.
        for n in np.unique(self._numbers[self._numbers >= 0]).tolist():
            cells = np.argwhere(self._numbers == n).tolist()
            for (column, slot), beyond in ((cells[0], -1), (cells[-1], 1)):
                if ((column, slot) not in self._followed
                        and 0 <= column + beyond < self._diagram.columns):
                    seen, missed = self._diagram.values[[column, column + beyond]].tolist()
                    yield Event(n, 'not located', 0.5 * (seen + missed), 0.5 * abs(seen - missed),
                                str(self._keys[column, slot]))

    def _grow(self, orbit: Orbit, directions: tuple[float, ...], parent: Family | None = None,
              depth: int = 0) -> Family:
        # A family, with those that branch from it, one from another, inside the window.
        path, (low, high) = self._path, self._path.ends
        outside, family = OUTSIDE * path.unit, Family(path, [orbit], [], parent)
        for direction in directions:
            branch = follow(orbit, path, direction, low - outside, high + outside,
                            to_first_turn=True)
            family.orbits += [one for one in branch.orbits[1:] if one.is_stable]
            family.turns += branch.turns
        # The last step may have gone round a fold.
        family.orbits.sort(key=family.value_of)
        self._families.append(family)
        for turn in family.turns:
            if (turn.change not in (Change.DOUBLING, Change.PITCHFORK) or depth == DOUBLINGS
                    or not low <= turn.value <= high or 2 * turn.orbit.impacts > LONGEST):
                continue
            beside = [close_orbit(turn.orbit.walls, turn.orbit.points, path.at(
                turn.value + step * path.unit, nearest=True)) for step in (-BESIDE, BESIDE)]
            for one in (*leaving(path, turn), *beside):
                if (one is not None and one.is_stable
                        and not any(known.holds(one) for known in self._families)):
                    # Back at the change there is nothing new.
                    away = math.copysign(1.0, path.of(one.parameters) - turn.value)
                    self._grow(one, (away,), family, depth + 1)
        return family

    def _cascades(self, family: Family, n: int) -> Iterator[tuple[Parameters, Orbit, float]]:
        # Where doublings lead to chaos that no column shows: just beyond, and the direction.
        ends = [family.value_of(orbit) for orbit in (family.orbits[0], family.orbits[-1])]
        seen = self._diagram.values[(self._numbers == n).any(axis=1)]
        low, high = self._path.ends
        for turn in family.turns:
            # The doublings that follow crowd within a third of the way from the one before.
            gap = turn.value - max(ends, key=lambda end: abs(turn.value - end))
            direction, beyond = math.copysign(1.0, gap), turn.value + 0.5 * gap
            if (turn.change is Change.DOUBLING and turn.orbit.impacts == family.orbits[0].impacts
                    and low < beyond < high
                    and not np.any(direction * seen > direction * turn.value)
                    and not any(one.parent is family
                                and one.orbits[0].impacts > turn.orbit.impacts
                                for one in self._families)):
                yield self._path.at(beyond), turn.orbit, direction


def state_on(orbit: Orbit) -> FloatArray:
    """Return phase, displacement and velocity just before the first impact of an orbit."""
    return np.array([orbit.phases[0], -float(orbit.walls[0]), orbit.velocities[0]])


def _same_end(a: End, b: End) -> bool:
    # Seen twice, under two numbers; mirror images end at the same place, elsewhere.
    if a.kind != b.kind or abs(a.value - b.value) > a.uncertainty + b.uncertainty:
        return False
    shared = np.count_nonzero(a.last.region & b.last.region)
    return bool(2 * shared > np.count_nonzero(a.last.region))


def _same_change(event: Event, known: Event) -> bool:
    # Of one orbit at one place; where an orbit replaces chaos, only that is reported.
    return (abs(event.value - known.value) <= event.tolerance + known.tolerance
            and event.orbit is not None and known.orbit is not None
            and (event.what == known.what
                 or known.what == 'window' and event.what in ('fold', 'grazing'))
            and same_orbit(event.orbit, known.orbit, SAME_CHANGE))
