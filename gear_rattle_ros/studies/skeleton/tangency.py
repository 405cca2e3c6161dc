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

"""The place of a crisis, where an unstable manifold first touches the stable one of a saddle."""

from collections.abc import Callable, Iterator
import dataclasses
import itertools
import math
from typing import Any, Final, Protocol

from ...attractors.plane import at_parameters
from ...core.arrays import RecordArray
from ...core.many.chaotic_sets import enough_of, least_share, orbits_in, shortest_orbit, VISITED
from ...core.many.recorded import record_impacts
from ...core.model import Parameters
from ...core.orbits.branches import Change, follow, Turn
from ...core.orbits.manifolds import ACROSS, Edge, find_edge, Saddle, saddle_of, SEED_DISTANCE
from ...core.orbits.orbit import close_orbit, Orbit
from ...core.path import Path
from ...core.words import counted

# The distance is taken to be smooth along the path where it is below this [1].
SMOOTH: Final = 0.2 * ACROSS / 25.0
# Each step towards the root is shorter than the last at least by this factor.
CONVERGES: Final = 0.7
# Where the distance jumps, the place is found by bisection to this; nor is it better known than
# that of any tangency [1]. All in the parameters.
JUMP: Final = 1e-9
KNOWN: Final = 1e-10
# How far an orbit is followed for its birth [1].
BEYOND: Final = 0.3
# Searches of the manifold with shifted samples at the end.
SHIFTS: Final = 5
# Searches of the manifold in all, nearly.
SEARCHES: Final = 60 + SHIFTS
# Impacts of each trajectory that are searched for orbits, and the longest of these.
SEARCHED: Final = 16_384
LONGEST: Final = 16
# Saddles that are tried.
TRIED: Final = 60
# The manifolds are compared this far from where a crisis was seen, in its uncertainty, and farther
# if need be.
ASIDE: Final = (20.0, 100.0)
# Contacts that are tried; a tangency is that of the crisis where both places differ by at most
# this many of their errors, and where its own is not more than this many times the other.
CONTACTS: Final = 6
AGREES: Final = 2.0
WORTH: Final = 30.0
# Samples of a manifold, their impacts and the maxima that are refined; samples at the end.
SCREEN: Final[Any] = {'samples': 3000, 'candidates': 6}
FINE: Final = 20_000
# Impacts over which a manifold is followed: these, or this number of periods of the target.
FOLLOWED: Final = 120
PERIODS: Final = 24
# Beside an orbit at which pieces merge, what is not on the manifold soon vanishes.
SEED_OF_PIECES: Final = 1e-4


@dataclasses.dataclass(frozen=True)
class Contact:
    """Two saddles, the unstable manifold of one leading to the stable one of the other."""

    source: Saddle  # in the attractor, or the same as the target
    target: Saddle  # with which the attractor collides
    path: Path  # along which both are carried
    # Where pieces merge, what crosses comes from the piece at one side of the target, after whole
    # periods.
    merges: bool = False
    seed: float = SEED_DISTANCE  # where the unstable manifold begins [1]

    def at(self, value: float) -> 'Contact':
        """Carry both to another place; ValueError where one ends on the way."""
        target = saddle_of(carry(self.target.orbit, self.path, value), self.target.unstable)
        orbit = target.orbit if self.is_homoclinic else carry(
            self.source.orbit, self.path, value)
        return dataclasses.replace(self, source=saddle_of(orbit, self.source.unstable),
                                   target=target)

    def edge(self, value: float, sides: tuple[bool, ...] = (False, True), **how: Any
             ) -> tuple[Edge, bool]:
        """
        Find the edge at another place, and whether it is that on the other side of the target.

        They cross where there are returns on both sides, so the lesser edge counts.
        """
        here, impacts = self.at(value), FOLLOWED
        if self.merges:
            sides, impacts = (False,), max(FOLLOWED, PERIODS * self.target.impacts)
        return min(((find_edge(here.source, here.target.other_side if side else here.target,
                               impacts=impacts, whole=self.merges,
                               **{'seed': self.seed, **how}), side)
                    for side in sides), key=lambda found: found[0].distance)

    def begins(self, inside: float, outside: float) -> bool:
        """Whether the manifolds cross at one place and not at another."""
        return (self.edge(outside, **SCREEN)[0].distance > 0.0
                > self.edge(inside, **SCREEN)[0].distance)

    @property
    def is_homoclinic(self) -> bool:
        """Whether both are one orbit."""
        return self.source.orbit is self.target.orbit

    @property
    def lifetime_exponent(self) -> float:
        """Exponent of the lifetimes beyond it (Grebogi, Ott & Yorke 1986)."""
        out, into = (math.log(abs(m)) for m in (self.source.expansion, self.source.contraction))
        return into / (2.0 * (out + into)) if self.is_homoclinic else 0.5 + out / abs(into)


@dataclasses.dataclass(frozen=True)
class Tangency:
    """Where the manifolds touch, and how well it is located [1]."""

    value: float  # coordinate of the path [1]
    uncertainty: float
    contact: Contact
    edge: Edge  # nearly there


def carry(orbit: Orbit, path: Path, value: float) -> Orbit:
    """Follow an orbit along a path, without a fold between; ValueError where it ends."""
    now = path.of(orbit.parameters)
    if value == now:
        return orbit
    branch = follow(orbit, path, math.copysign(1.0, value - now), min(now, value), max(now, value))
    for near in sorted(branch.orbits, key=lambda one: abs(path.of(one.parameters) - value)):
        carried = close_orbit(near.walls, near.points, path.at(value))
        if carried is not None and carried.impacts == orbit.impacts:
            return carried
        break
    raise ValueError(f'the orbit of {counted(orbit.impacts, "impact")} cannot be followed to '
                     f'{path.name} = {value:g}; give a narrower bracket')


def birth_of(orbit: Orbit, path: Path) -> Turn | None:
    """Find where an orbit was born, or branched off; None where its branch does not show it."""
    value, beyond = path.of(orbit.parameters), BEYOND * path.unit
    for direction in (-1.0, 1.0):
        branch = follow(orbit, path, direction, value - beyond, value + beyond,
                        to_first_turn=True)
        for turn in branch.turns:
            if turn.change in (Change.FOLD, Change.PITCHFORK):
                return turn
    return None


class Seen(Protocol):
    """A crisis of a chaotic attractor, as its trajectories show it."""

    @property
    def states(self) -> RecordArray: ...  # on the attractor, before it

    @property
    def path(self) -> Path: ...

    @property
    def value(self) -> float: ...

    @property
    def uncertainty(self) -> float: ...

    @property
    def direction(self) -> float: ...  # in which it goes on beyond, +1 or -1


def touch(seen: Seen, searched: Callable[[int], None] = lambda count: None,
          merging: Orbit | None = None) -> Tangency:
    """
    Find the tangency at a crisis; ValueError where no manifolds touch there.

    Pieces merge at the orbit `merging` if its own manifolds touch, otherwise at another. Where a
    tangency disagrees with what was seen, other manifolds touch; the next one is tried.
    """
    for aside in ASIDE:
        inside, outside = (seen.value + side * seen.direction * aside * seen.uncertainty
                           for side in (-1.0, 1.0))
        at_doubled = merging and merging_at(merging, seen.path, inside, outside)
        for contact in itertools.islice(itertools.chain(
                [at_doubled] if at_doubled else [],
                find_contacts(seen.path, seen.states, inside, outside)), CONTACTS):
            found = find_tangency(contact, inside, outside, searched)
            if (found.uncertainty <= WORTH * seen.uncertainty and abs(found.value - seen.value)
                    <= AGREES * (seen.uncertainty + found.uncertainty)):
                return found
    raise ValueError(f'no manifold touches that of a saddle near {seen.path.name} = '
                     f'{seen.value:.7f}, where trajectories begin to escape; give another bracket')


def merging_at(orbit: Orbit, path: Path, inside: float, outside: float) -> Contact | None:
    """
    Return how pieces merge at an orbit that has doubled, if they do so between two places.

    They lie on both sides of it, and merge where its unstable manifold, on one side, first crosses
    the stable one to the other side.
    """
    try:
        target = saddle_of(carry(orbit, path, inside))
        contact = Contact(target, target.other_side, path, True, SEED_OF_PIECES)
        return contact if contact.begins(inside, outside) else None
    except ValueError:
        return None


def find_contacts(path: Path, states: RecordArray, inside: float, outside: float
                  ) -> Iterator[Contact]:
    """
    Find with which orbits an attractor collides between a place where it is and one beyond.

    Candidates are the saddles that trajectories visit beyond. A contact is where a manifold begins
    to cross that of one of them. First come saddles that cross themselves where the attractor
    crosses them, then those that only the attractor crosses, then those that only they cross.
    """
    within, beyond = path.at(inside), path.at(outside)
    before = enough_of(within, _impacts(within, states))
    named = shortest_orbit(within, before)
    if named is None:
        return
    leaves = saddle_of(named)
    others: list[Contact] = []
    alone: list[Saddle] = []
    # Shortest first of those that are not in the attractor.
    for orbit in sorted(_saddles(beyond, _impacts(beyond, states)),
                        key=lambda one: least_share(before, one) >= VISITED)[:TRIED]:
        try:
            meets = saddle_of(carry(orbit, path, inside))
            through = [one for one in (Contact(source, meets, path) for source in _sides(leaves))
                       if one.begins(inside, outside)]
            # On the boundary lies the saddle whose own manifold leads into the attractor; what
            # has passed it crosses the manifolds of others, too.
            own = _own(meets, path, inside, outside) if through else None
            if own:
                yield own
        except ValueError:
            continue
        others += through if not own else []
        alone += [meets] if not through else []
    yield from others
    for meets in alone:
        own = _own(meets, path, inside, outside)
        if own:
            yield own


def _own(saddle: Saddle, path: Path, inside: float, outside: float) -> Contact | None:
    # How the manifolds of a saddle begin to cross each other.
    try:
        return next((contact for side in _sides(saddle) if (
            contact := Contact(side, saddle, path)).begins(inside, outside)), None)
    except ValueError:
        return None


def first_touch(orbit: Orbit, path: Path,
                searched: Callable[[int], None] = lambda count: None) -> Tangency:
    """
    Find where on a path the manifolds of a saddle first touch each other.

    A boundary of basins on which the saddle lies is smooth on one side of it and fractal on the
    other. ValueError where they cross at both ends or at neither.
    """
    low, high = path.ends
    for inside, outside in ((low, high), (high, low)):
        contact = _own(saddle_of(carry(orbit, path, inside)), path, inside, outside)
        if contact:
            return find_tangency(contact, inside, outside, searched)
    raise ValueError(f'the manifolds of the orbit {orbit.name} do not begin to cross between '
                     f'{path.name} = {low:g} and {high:g}; give a window at one end of which they '
                     'cross')


def _sides(saddle: Saddle) -> tuple[Saddle, ...]:
    # Trajectories beside an orbit that changes sides are on both.
    return (saddle,) if saddle.turns == 2 else (saddle, saddle.other_side)


def _impacts(parameters: Parameters, states: RecordArray) -> RecordArray:
    rows, counts = record_impacts(at_parameters(parameters, states), 0, SEARCHED)
    return rows[counts == SEARCHED]


def _saddles(parameters: Parameters, rows: RecordArray) -> Iterator[Orbit]:
    for q in range(1, LONGEST + 1):
        for orbit in orbits_in(parameters, rows, q):
            first, second = orbit.multipliers
            if first.imag == 0.0 and abs(first) > 1.0 > abs(second):
                yield orbit


def find_tangency(contact: Contact, inside: float, outside: float,
                  searched: Callable[[int], None] = lambda count: None) -> Tangency:
    """
    Find where between two places the manifolds of a contact first touch.

    Bisection is followed by secants once the distance is smooth; a finer search at the end gives
    part of the uncertainty. Where an impact is gained or lost at the edge the distance jumps, and
    bisection alone locates it. `searched` is called with the searches of the manifold made.
    """
    def look(value: float, *sides: bool, **how: Any) -> tuple[Edge, bool]:
        searched(1)
        return contact.edge(value, sides or (False, True), **{**SCREEN, **how})

    (below, side), (above, _) = look(inside), look(outside)
    while max(abs(below.distance), abs(above.distance)) > SMOOTH:
        if abs(outside - inside) < JUMP * contact.path.unit:
            value = 0.5 * (inside + outside)
            return Tangency(value, abs(outside - inside), contact.at(value), above)
        middle = 0.5 * (inside + outside)
        edge, binding = look(middle)
        if edge.distance < 0.0:
            inside, below, side = middle, edge, binding
        else:
            outside, above = middle, edge
    roots, slope = [], (above.distance - below.distance) / (outside - inside)
    for seed in (contact.seed, 3.0 * contact.seed):
        value, edge = inside, look(inside, side, seed=seed)[0]
        step = outside - inside
        while True:
            edge = look(value, side, near=edge.place, seed=seed, samples=FINE)[0]
            # Rounding ends the approach, before that a fold of the manifold.
            if abs(edge.distance / slope) >= CONVERGES * abs(step):
                break
            step = edge.distance / slope
            value -= step
        roots.append((value, edge))
    (value, edge), (other, _) = roots
    # A narrower fold that crosses earlier would show here.
    missed = max(0.0, *(look(value, side, samples=FINE, offset=shift / SHIFTS)[0].distance
                        for shift in range(SHIFTS))) / slope
    uncertainty = max(abs(other - value), abs(missed), abs(edge.distance / slope),
                      KNOWN * contact.path.unit)
    return Tangency(value - missed, uncertainty, contact.at(value), edge)
