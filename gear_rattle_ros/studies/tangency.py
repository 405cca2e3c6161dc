"""The alpha of a crisis, where an unstable manifold first touches the stable one of a saddle."""

from collections.abc import Callable, Iterator
import dataclasses
import math
from typing import Any, Final

from .endings import Herd
from ..attractors.plane import at_parameters
from ..core.arrays import RecordArray
from ..core.many.chaotic_sets import enough_of, orbits_in, shortest_orbit
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
# Samples of a manifold, their impacts and the maxima that are refined; samples at the end.
SCREEN: Final[Any] = {'samples': 3000, 'impacts': 120, 'candidates': 6}
FINE: Final = 20_000


@dataclasses.dataclass(frozen=True)
class Contact:
    """Two saddles, the unstable manifold of one leading to the stable one of the other."""

    source: Saddle  # in the attractor, or the same as the target
    target: Saddle  # with which the attractor collides

    def at(self, alpha: float) -> 'Contact':
        """Carry both to another alpha; ValueError where one ends on the way."""
        target = saddle_of(carry(self.target.orbit, alpha), self.target.unstable)
        orbit = target.orbit if self.is_homoclinic else carry(self.source.orbit, alpha)
        return Contact(saddle_of(orbit, self.source.unstable), target)

    def edge(self, alpha: float, sides: tuple[bool, ...] = (False, True), **how: Any
             ) -> tuple[Edge, bool]:
        """
        Find the edge at another alpha, and whether it is that on the other side of the target.

        They cross where there are returns on both sides, so the lesser edge counts.
        """
        here = self.at(alpha)
        return min(((find_edge(here.source, here.target.other_side if side else here.target,
                               **how), side) for side in sides),
                   key=lambda found: found[0].distance)

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


def find_contact(herd: Herd, inside: float, outside: float) -> Contact | None:
    """
    Find with which orbit an attractor collides between an alpha where it is and one beyond.

    Candidates are the saddles that trajectories visit beyond and not before. None where no
    manifold begins to cross that of one of them.
    """
    within, beyond = (dataclasses.replace(herd.parameters, alpha=alpha)
                      for alpha in (inside, outside))
    named = shortest_orbit(within, enough_of(within, _impacts(within, herd.states)))
    if named is None:
        return None
    leaves = saddle_of(named)
    others: list[Contact] = []
    for orbit in _saddles(beyond, _impacts(beyond, herd.states)):
        try:
            meets = saddle_of(carry(orbit, inside))
            through = [Contact(source, meets) for source in _sides(leaves)]
            through = [one for one in through if one.begins(inside, outside)]
            if not through:
                continue
            # On the boundary lies the saddle whose own manifold leads into the attractor; what
            # has passed it crosses the manifolds of others, too.
            for own in _sides(meets):
                if Contact(own, meets).begins(inside, outside):
                    return Contact(own, meets)
            others += through
        except ValueError:
            continue
    return others[0] if others else None


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
    while abs(below.distance) > SMOOTH or abs(above.distance) > SMOOTH:
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
    for seed in (SEED_DISTANCE, 3.0 * SEED_DISTANCE):
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
