"""Where the attractors of an orbit diagram are born, double and end."""

from collections.abc import Callable, Iterator
import dataclasses
import itertools
import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from .diagram import Diagram, KINDS
from .endings import Captor, End, find_end, Herd, spread_out, watch
from ..attractors.catalogue import Kind
from ..attractors.plane import make_initial_conditions
from ..core.many.recorded import record_impacts
from ..core.orbits.branches import Change, follow, leaving, Turn
from ..core.orbits.orbit import close_orbit, Orbit, same_orbit
from ..core.orbits.section import turn as turned
from ..store.store import Store

PERIODIC: Final = KINDS.index(Kind.PERIODIC.value)
CHAOTIC: Final = KINDS.index(Kind.CHAOTIC.value)
# Doublings followed of each orbit, and the longest period [impacts].
DOUBLINGS: Final = 7
LONGEST: Final = 256
# Distance outside the window to which orbits are followed for their birth and their end [1].
OUTSIDE: Final = 0.2
# Two orbits are one where their points agree to this [rad, 1]; at a change they diverge as a root.
SAME: Final = 1e-6
SAME_CHANGE: Final = 1e-4
# Distance in alpha beside a change at which the stability of an orbit is decided [1].
BESIDE: Final = 1e-6
# To follow a chaotic attractor takes as long as this number of orbits.
FOLLOWING: Final = 10


@dataclasses.dataclass(frozen=True)
class Event:
    """
    Where an attractor changes.

    `attractor`: its number; `what`: of an orbit: fold, pitchfork, doubling, grazing. Of a chaotic
    attractor: window (a stable orbit is born and replaces it), crisis (trajectories leave it for
    good), interior crisis (it suddenly grows). Of any: not located (it is seen at one alpha and
    not at the next; at rest, or on an orbit that sticks, it cannot be followed); `alpha`,
    `tolerance`: where, and how well that is located [1]; `orbit`: that changes, or on which
    trajectories then settle; `name`: key of what is no orbit that can be followed.
    """

    attractor: int
    what: str
    alpha: float
    tolerance: float
    orbit: Orbit | None
    name: str = ''

    @property
    def key(self) -> str:
        """Name of the orbit or of what else it is about; empty where nothing has one."""
        return self.orbit.key if self.orbit else self.name

    @property
    def multiplier(self) -> float:
        """Real part of the multiplier that is critical [1], nan where there is none."""
        if self.orbit is None or self.what == 'crisis':
            return math.nan
        critical = -1.0 if self.what == Change.DOUBLING.value else 1.0
        return float(min(self.orbit.multipliers, key=lambda m: abs(m - critical)).real)

    def describe(self) -> str:
        """Put it in words."""
        digits = 1 - math.floor(math.log10(self.tolerance))
        return (f'{self.attractor:9d}  {self.what:15s}  {self.alpha:.{digits}f} +- '
                f'{self.tolerance:.1e}  {self.key}').rstrip()


HEADING: Final = 'attractor  event            alpha [1]  orbit'


@dataclasses.dataclass
class Family:
    """
    The stable orbits of a branch between two changes.

    `orbits`: in the order of alpha; `turns`: where it ends; `parent`: the family from which it
    branches, -1 for none; `numbers`: of the attractors that were seen on it.
    """

    orbits: list[Orbit]
    turns: list[Turn]
    parent: int
    numbers: list[int] = dataclasses.field(default_factory=list)

    def holds(self, orbit: Orbit) -> bool:
        """Whether an orbit belongs to it."""
        if (orbit.impacts, orbit.drive_periods) != (self.orbits[0].impacts,
                                                    self.orbits[0].drive_periods):
            return False
        alpha = orbit.parameters.alpha
        after = sum(one.parameters.alpha < alpha for one in self.orbits)
        pair = self.orbits[max(after - 1, 0):after + 1]
        near, far = pair[0], pair[-1]
        gap = far.parameters.alpha - near.parameters.alpha
        share = (alpha - near.parameters.alpha) / gap if gap > 0.0 else 0.0
        ahead = far.points - near.points
        ahead[:, 0] = turned(ahead[:, 0])
        here = close_orbit(near.walls, near.points + share * ahead, orbit.parameters)
        return here is not None and same_orbit(here, orbit, SAME)


@dataclasses.dataclass(frozen=True)
class _Run:
    # Columns and slots without a gap in which an attractor is chaotic, and the alphas to which it
    # is followed: where it is seen next, or the ends of the window.
    number: int
    cells: list[tuple[int, int]]
    low: float
    high: float


def events_of(diagram: Diagram, store: Store, tolerance: float, hold: int,
              searched: Callable[[int], None] = lambda count: None) -> list[Event]:
    """
    Locate where the attractors of a diagram are born, double and end.

    A periodic one ends where its branch does, so its branch is followed without any
    trajectory; a chaotic one is followed with its own states.
    """
    ends: list[tuple[int, End]] = []
    families: list[Family] = []

    def take(n: int, orbit: Orbit | None) -> None:
        if orbit is None:
            return
        home = next((one for one in families if one.holds(orbit)), None)
        if home is None:
            home = _family(orbit, (-1.0, 1.0), diagram, -1)
            _add(home, families, diagram)
        home.numbers.append(n)

    def follow_chaos(n: int, herd: Herd | Captor, direction: float, edge: float) -> None:
        if not isinstance(herd, Herd):
            return
        width = (diagram.alphas[1] - diagram.alphas[0]) / (diagram.columns - 1)
        end = find_end(herd, direction, width, edge, tolerance, hold)
        if end is None:
            return
        if end.kind == 'orbit':
            take(n, end.captor if isinstance(end.captor, Orbit) else None)
        elif not any(_same_end(end, known) for _, known in ends):
            ends.append((n, end))

    followed: set[tuple[int, int]] = set()
    for n, column, slot in _seen(diagram, store, PERIODIC):
        orbit = orbit_in(diagram, store, column, slot)
        if orbit is not None:
            followed.add((column, slot))
            take(n, orbit)
        searched(1)
    for run in _runs(diagram, store):
        for direction, edge in ((-1.0, run.low), (1.0, run.high)):
            herd = _herd_of(diagram, store, run.cells, direction, hold)
            if herd is not None:
                followed.update(run.cells)
            follow_chaos(run.number, herd, direction, edge)
            searched(FOLLOWING)
    for family in families:
        n = _number(family, families)
        for orbit, direction in _cascades(family, families, diagram, store, n):
            state = np.array([orbit.phases[0], -float(orbit.walls[0]), orbit.velocities[0]])
            parameters = orbit.parameters
            follow_chaos(n, watch(parameters, spread_out(parameters, state), hold), direction,
                         diagram.alphas[int(direction > 0.0)])
    events = [Event(n, end.kind, end.alpha, end.uncertainty,
                    *((end.captor, '') if isinstance(end.captor, Orbit) else
                      (None, end.captor or ''))) for n, end in ends]
    events += _not_located(diagram, store, followed)
    for family in families:
        n = _number(family, families)
        for turn in family.turns:
            event = Event(n, turn.change.value, turn.alpha, turn.uncertainty, turn.orbit)
            if not any(_same_change(event, known) for known in events):
                events.append(event)
    return sorted(events, key=lambda event: (event.attractor, event.alpha))


def searches_of(diagram: Diagram, store: Store) -> int:
    """Foresee how many searches `events_of` takes."""
    return (sum(1 for _ in _seen(diagram, store, PERIODIC))
            + 2 * FOLLOWING * sum(1 for _ in _runs(diagram, store)))


def orbit_in(diagram: Diagram, store: Store, column: int, slot: int) -> Orbit | None:
    """Take a periodic attractor from a store."""
    parameters = diagram.at(column)
    state = _read(diagram, store, 'member_state')[column, slot]
    period = int(_read(diagram, store, 'period_impacts')[column, slot])
    rows, _ = record_impacts(make_initial_conditions(parameters, *state[:, None]), 0, period)
    walls = np.signbit(rows[0]['velocity']).astype(np.int64)
    points = np.stack([rows[0]['phase'], rows[0]['velocity']], axis=1)
    orbit = close_orbit(walls, points, parameters)
    return orbit if orbit is not None and orbit.is_stable else None


def _read(diagram: Diagram, store: Store, name: str) -> npt.NDArray[Any]:
    return np.asarray(store.read_all(name)[diagram.sweeps.index('starts')])


def _seen(diagram: Diagram, store: Store, kind: int) -> Iterator[tuple[int, int, int]]:
    # Number, column and slot of every attractor of a kind.
    numbers = _read(diagram, store, 'attractor')
    for column, slot in np.argwhere(_read(diagram, store, 'kind') == kind):
        yield int(numbers[column, slot]), int(column), int(slot)


def _runs(diagram: Diagram, store: Store) -> Iterator[_Run]:
    chaos: dict[int, list[tuple[int, int]]] = {}
    for n, column, slot in _seen(diagram, store, CHAOTIC):
        chaos.setdefault(n, []).append((column, slot))
    for n, cells in chaos.items():
        # What is not seen in a column may have ended before it.
        breaks = [0, *(i for i in range(1, len(cells)) if cells[i][0] > cells[i - 1][0] + 1),
                  len(cells)]
        for first, after in itertools.pairwise(breaks):
            yield _Run(n, cells[first:after],
                       float(diagram.values[cells[first - 1][0] if first else 0]),
                       float(diagram.values[cells[after][0] if after < len(cells) else -1]))


def _not_located(diagram: Diagram, store: Store,
                 followed: set[tuple[int, int]]) -> Iterator[Event]:
    # The ends of what could not be followed are known by the columns alone.
    numbers, keys = (_read(diagram, store, name) for name in ('attractor', 'key'))
    for n in range(int(numbers.max()) + 1):
        cells = np.argwhere(numbers == n).tolist()
        for (column, slot), beyond in ((cells[0], -1), (cells[-1], 1)):
            if (column, slot) not in followed and 0 <= column + beyond < diagram.columns:
                seen, missed = diagram.values[[column, column + beyond]]
                yield Event(n, 'not located', float(0.5 * (seen + missed)),
                            float(0.5 * abs(seen - missed)), None, str(keys[column, slot]))


def _family(orbit: Orbit, directions: tuple[float, ...], diagram: Diagram, parent: int) -> Family:
    low, high = max(0.0, diagram.alphas[0] - OUTSIDE), diagram.alphas[1] + OUTSIDE
    orbits, turns = [orbit], list[Turn]()
    for direction in directions:
        branch = follow(orbit, direction, low, high, to_first_turn=True)
        orbits += [one for one in branch.orbits[1:] if one.is_stable]
        turns += branch.turns
    # The last step may have gone round a fold.
    orbits.sort(key=lambda one: one.parameters.alpha)
    return Family(orbits, turns, parent)


def _add(family: Family, families: list[Family], diagram: Diagram, depth: int = 0) -> None:
    # With the families that branch from it, one from another, inside the window.
    families.append(family)
    number = len(families) - 1
    for turn in family.turns:
        if (turn.change not in (Change.DOUBLING, Change.PITCHFORK) or depth == DOUBLINGS
                or not diagram.alphas[0] <= turn.alpha <= diagram.alphas[1]
                or 2 * turn.orbit.impacts > LONGEST):
            continue
        there = turn.orbit.parameters
        beside = [close_orbit(turn.orbit.walls, turn.orbit.points,
                              dataclasses.replace(there, alpha=turn.alpha + step))
                  for step in (-BESIDE, BESIDE) if turn.alpha >= BESIDE]
        for orbit in (*leaving(turn), *beside):
            if (orbit is not None and orbit.is_stable
                    and not any(one.holds(orbit) for one in families)):
                # Back at the change there is nothing new.
                away = math.copysign(1.0, orbit.parameters.alpha - turn.alpha)
                _add(_family(orbit, (away,), diagram, number), families, diagram, depth + 1)


def _number(family: Family, families: list[Family]) -> int:
    # Of the attractor seen on it most often, or on the one from which it branches.
    while not family.numbers:
        family = families[family.parent]
    return max(sorted(set(family.numbers)), key=family.numbers.count)


def _herd_of(diagram: Diagram, store: Store, cells: list[tuple[int, int]], direction: float,
             hold: int) -> Herd | None:
    states = _read(diagram, store, 'member_state')
    # What is called chaotic may be a long transient at the end of the run, or all along it.
    for cell in sorted(cells, reverse=direction > 0.0):
        parameters = diagram.at(cell[0])
        herd = watch(parameters, spread_out(parameters, states[cell]), hold)
        if isinstance(herd, Herd):
            return herd
    return None


def _cascades(family: Family, families: list[Family], diagram: Diagram, store: Store,
              n: int) -> Iterator[tuple[Orbit, float]]:
    # Where doublings lead to chaos that no column shows: just beyond, and the direction.
    ends = [orbit.parameters.alpha for orbit in (family.orbits[0], family.orbits[-1])]
    seen = diagram.values[(_read(diagram, store, 'attractor') == n).any(axis=1)]
    for turn in family.turns:
        # The doublings that follow crowd within a third of the way from the one before.
        gap = turn.alpha - max(ends, key=lambda alpha: abs(turn.alpha - alpha))
        direction, beyond = math.copysign(1.0, gap), turn.alpha + 0.5 * gap
        if (turn.change is Change.DOUBLING and turn.orbit.impacts == family.orbits[0].impacts
                and diagram.alphas[0] < beyond < diagram.alphas[1]
                and not np.any(direction * seen > direction * turn.alpha)
                and not any(families[one.parent] is family
                            and one.orbits[0].impacts > turn.orbit.impacts
                            for one in families if one.parent >= 0)):
            yield dataclasses.replace(turn.orbit, parameters=dataclasses.replace(
                turn.orbit.parameters, alpha=beyond)), direction


def _same_end(a: End, b: End) -> bool:
    # Seen twice, under two numbers; mirror images end at the same place, elsewhere.
    if a.kind != b.kind or abs(a.alpha - b.alpha) > a.uncertainty + b.uncertainty:
        return False
    shared = np.count_nonzero(a.last.region & b.last.region)
    return bool(2 * shared > np.count_nonzero(a.last.region))


def _same_change(event: Event, known: Event) -> bool:
    # Of one orbit at one place; where an orbit replaces chaos, only that is reported.
    return (abs(event.alpha - known.alpha) <= event.tolerance + known.tolerance
            and event.orbit is not None and known.orbit is not None
            and (event.what == known.what
                 or known.what == 'window' and event.what in ('fold', 'grazing'))
            and same_orbit(event.orbit, known.orbit, SAME_CHANGE))
