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

"""The alpha of a crisis, where an unstable manifold first touches the stable one of a saddle."""

from collections.abc import Callable, Iterator
import dataclasses
import itertools
import math
from typing import Any, Final, Protocol

from ..attractors.plane import at_parameters
from ..core.arrays import RecordArray
from ..core.many.chaotic_sets import (
    enough_of,
    least_share,
    orbits_in,
    shortest_orbit,
    VISITED,
)
from ..core.many.recorded import record_impacts
from ..core.model import Parameters
from ..core.orbits.branches import Change, follow, Turn
from ..core.orbits.manifolds import (
    ACROSS,
    Edge,
    find_edge,
    Saddle,
    saddle_of,
    SEED_DISTANCE,
)
from ..core.orbits.orbit import close_orbit, Orbit
from ..core.words import counted

# The distance is taken to be smooth in alpha where it is below this [1].
SMOOTH: Final = 0.2 * ACROSS / 25.0
# Each step towards the root is shorter than the last at least by this factor.
CONVERGES: Final = 0.7
# Where the distance jumps, the place is found by bisection to this [1].
JUMP: Final = 1e-9
# How far from its alpha an orbit is followed for its birth [1].
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
    # Where pieces merge, what crosses comes from the piece at one side of the target, after whole
    # periods.
    merges: bool = False
    seed: float = SEED_DISTANCE  # where the unstable manifold begins [1]

    def at(self, alpha: float) -> 'Contact':
        """Carry both to another alpha; ValueError where one ends on the way."""
        target = saddle_of(carry(self.target.orbit, alpha), self.target.unstable)
        orbit = target.orbit if self.is_homoclinic else carry(self.source.orbit, alpha)
        return dataclasses.replace(self, source=saddle_of(orbit, self.source.unstable),
                                   target=target)

    def edge(self, alpha: float, sides: tuple[bool, ...] = (False, True), **how: Any
             ) -> tuple[Edge, bool]:
        """
        Find the edge at another alpha, and whether it is that on the other side of the target.

        They cross where there are returns on both sides, so the lesser edge counts.
        """
        here, impacts = self.at(alpha), FOLLOWED
        if self.merges:
            sides, impacts = (False,), max(FOLLOWED, PERIODS * self.target.impacts)
        return min(((find_edge(here.source, here.target.other_side if side else here.target,
                               impacts=impacts, whole=self.merges,
                               **{'seed': self.seed, **how}), side)
                    for side in sides), key=lambda found: found[0].distance)

    def begins(self, inside: float, outside: float) -> bool:
        """Whether the manifolds cross at one alpha and not at another."""
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
    """Where the manifolds touch, and how well its alpha is located [1]."""

    alpha: float
    uncertainty: float
    contact: Contact
    edge: Edge  # nearly there


def carry(orbit: Orbit, alpha: float) -> Orbit:
    """Follow an orbit to another alpha, without a fold between; ValueError where it ends."""
    now = orbit.parameters.alpha
    if alpha == now:
        return orbit
    branch = follow(orbit, math.copysign(1.0, alpha - now), min(now, alpha), max(now, alpha))
    for near in sorted(branch.orbits, key=lambda one: abs(one.parameters.alpha - alpha)):
        carried = close_orbit(near.walls, near.points,
                              dataclasses.replace(orbit.parameters, alpha=alpha))
        if carried is not None and carried.impacts == orbit.impacts:
            return carried
        break
    raise ValueError(f'the orbit of {counted(orbit.impacts, "impact")} cannot be followed to '
                     f'alpha = {alpha:g}; give a narrower bracket')


def birth_of(orbit: Orbit) -> Turn | None:
    """Find where an orbit was born, or branched off; None where its branch does not show it."""
    alpha = orbit.parameters.alpha
    for direction in (-1.0, 1.0):
        branch = follow(orbit, direction, max(0.0, alpha - BEYOND), alpha + BEYOND,
                        to_first_turn=True)
        for turn in branch.turns:
            if turn.change in (Change.FOLD, Change.PITCHFORK):
                return turn
    return None


class Seen(Protocol):
    """A crisis of a chaotic attractor, as its trajectories show it."""

    @property
    def parameters(self) -> Parameters: ...

    @property
    def states(self) -> RecordArray: ...  # on the attractor at these parameters, before it

    @property
    def alpha(self) -> float: ...

    @property
    def uncertainty(self) -> float: ...

    @property
    def direction(self) -> float: ...  # in which alpha goes beyond it, +1 or -1


def touch(seen: Seen, searched: Callable[[int], None] = lambda count: None,
          merging: Orbit | None = None) -> Tangency:
    """
    Find the tangency at a crisis; ValueError where no manifolds touch there.

    Pieces merge at the orbit `merging` if its own manifolds touch, otherwise at another. Where a
    tangency disagrees with what was seen, other manifolds touch; the next one is tried.
    """
    for aside in ASIDE:
        inside, outside = (seen.alpha + side * seen.direction * aside * seen.uncertainty
                           for side in (-1.0, 1.0))
        at_doubled = merging and merging_at(merging, inside, outside)
        for contact in itertools.islice(itertools.chain(
                [at_doubled] if at_doubled else [],
                find_contacts(seen.parameters, seen.states, inside, outside)), CONTACTS):
            found = find_tangency(contact, inside, outside, searched)
            if (found.uncertainty <= WORTH * seen.uncertainty and abs(found.alpha - seen.alpha)
                    <= AGREES * (seen.uncertainty + found.uncertainty)):
                return found
    raise ValueError(f'no manifold touches that of a saddle near alpha = {seen.alpha:.7f}, where '
                     'trajectories begin to escape; give another bracket')


def merging_at(orbit: Orbit, inside: float, outside: float) -> Contact | None:
    """
    Return how pieces merge at an orbit that has doubled, if they do so between two alphas.

    They lie on both sides of it, and merge where its unstable manifold, on one side, first crosses
    the stable one to the other side.
    """
    try:
        target = saddle_of(carry(orbit, inside))
        contact = Contact(target, target.other_side, True, SEED_OF_PIECES)
        return contact if contact.begins(inside, outside) else None
    except ValueError:
        return None


def find_contacts(parameters: Parameters, states: RecordArray, inside: float, outside: float
                  ) -> Iterator[Contact]:
    """
    Find with which orbits an attractor collides between an alpha where it is and one beyond.

    Candidates are the saddles that trajectories visit beyond. A contact is where a manifold begins
    to cross that of one of them. First come saddles that cross themselves where the attractor
    crosses them, then those that only the attractor crosses, then those that only they cross.
    """
    within, beyond = (dataclasses.replace(parameters, alpha=alpha) for alpha in (inside, outside))
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
            meets = saddle_of(carry(orbit, inside))
            through = [one for one in (Contact(source, meets) for source in _sides(leaves))
                       if one.begins(inside, outside)]
            # On the boundary lies the saddle whose own manifold leads into the attractor; what
            # has passed it crosses the manifolds of others, too.
            own = _own(meets, inside, outside) if through else None
            if own:
                yield own
        except ValueError:
            continue
        others += through if not own else []
        alone += [meets] if not through else []
    yield from others
    for meets in alone:
        own = _own(meets, inside, outside)
        if own:
            yield own


def _own(saddle: Saddle, inside: float, outside: float) -> Contact | None:
    # How the manifolds of a saddle begin to cross each other.
    try:
        return next((contact for contact in (Contact(side, saddle) for side in _sides(saddle))
                     if contact.begins(inside, outside)), None)
    except ValueError:
        return None


def first_touch(orbit: Orbit, low: float, high: float,
                searched: Callable[[int], None] = lambda count: None) -> Tangency:
    """
    Find the alpha between two others at which the manifolds of a saddle first touch each other.

    A boundary of basins on which the saddle lies is smooth on one side of it and fractal on the
    other. ValueError where they cross at both ends or at neither.
    """
    for inside, outside in ((low, high), (high, low)):
        contact = _own(saddle_of(carry(orbit, inside)), inside, outside)
        if contact:
            return find_tangency(contact, inside, outside, searched)
    raise ValueError(f'the manifolds of the orbit {orbit.name} do not begin to cross between '
                     f'alpha = {low:g} and {high:g}; give a window at one end of which they cross')


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
    Find the alpha between two others at which the manifolds of a contact first touch.

    Bisection is followed by secants once the distance is smooth; a finer search at the end gives
    part of the uncertainty. Where an impact is gained or lost at the edge the distance jumps, and
    bisection alone locates it. `searched` is called with the searches of the manifold made.
    """
    def look(alpha: float, *sides: bool, **how: Any) -> tuple[Edge, bool]:
        searched(1)
        return contact.edge(alpha, sides or (False, True), **{**SCREEN, **how})

    (below, side), (above, _) = look(inside), look(outside)
    while max(abs(below.distance), abs(above.distance)) > SMOOTH:
        if abs(outside - inside) < JUMP:
            alpha = 0.5 * (inside + outside)
            return Tangency(alpha, abs(outside - inside), contact.at(alpha), above)
        middle = 0.5 * (inside + outside)
        edge, binding = look(middle)
        if edge.distance < 0.0:
            inside, below, side = middle, edge, binding
        else:
            outside, above = middle, edge
    roots, slope = [], (above.distance - below.distance) / (outside - inside)
    for seed in (contact.seed, 3.0 * contact.seed):
        alpha, edge = inside, look(inside, side, seed=seed)[0]
        step = outside - inside
        while True:
            edge = look(alpha, side, near=edge.place, seed=seed, samples=FINE)[0]
            # Rounding ends the approach, before that a fold of the manifold.
            if abs(edge.distance / slope) >= CONVERGES * abs(step):
                break
            step = edge.distance / slope
            alpha -= step
        roots.append((alpha, edge))
    (alpha, edge), (other, _) = roots
    # A narrower fold that crosses earlier would show here.
    missed = max(0.0, *(look(alpha, side, samples=FINE, offset=shift / SHIFTS)[0].distance
                        for shift in range(SHIFTS))) / slope
    uncertainty = max(abs(other - alpha), abs(missed), abs(edge.distance / slope), 1e-10)
    return Tangency(alpha - missed, uncertainty, contact.at(alpha), edge)
