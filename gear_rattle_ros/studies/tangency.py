"""The alpha of a boundary crisis, where the manifolds of the saddle on the boundary touch."""

from collections.abc import Callable
import dataclasses
from typing import Any, Final

import numpy as np

from ..attractors.finding import find_attractors
from ..attractors.plane import Plane
from ..core.model import Parameters
from ..core.orbits.branches import Change, follow
from ..core.orbits.manifolds import (
    ACROSS,
    Edge,
    find_edge,
    NEVER,
    Saddle,
    saddle_of,
    SEED_DISTANCE,
)
from ..core.orbits.orbit import close_orbit, Orbit
from ..core.orbits.section import distances
from ..core.words import counted

# Impacts after which trajectories are given up.
HOLD: Final = 20_000
# An orbit is carried on in alpha in steps no longer than this.
STEP: Final = 2e-3
# The distance is taken to be smooth in alpha where it is below this [1].
SMOOTH: Final = 0.2 * ACROSS / 25.0
# How far below and above the bracket the captor is followed for its fold [1].
BEYOND: Final = 0.3
ROOT: Final = 1e-12
MOST_STEPS: Final = 60
# Searches of the manifold with shifted samples at the end.
SHIFTS: Final = 5
# Searches of the manifold in all, nearly.
SEARCHES: Final = 24 + SHIFTS


@dataclasses.dataclass(frozen=True)
class Boundary:
    """An orbit that captures, the saddle on its boundary, and the alpha where both are born."""

    captor: Orbit
    saddle: Orbit
    fold: float

    def at(self, alpha: float) -> 'Boundary':
        """Carry both orbits to another alpha; ValueError where one ends on the way."""
        return Boundary(carry(self.captor, alpha), carry(self.saddle, alpha), self.fold)

    @property
    def directions(self) -> Saddle:
        return saddle_of(self.saddle, self.captor)


@dataclasses.dataclass(frozen=True)
class Tangency:
    """The crisis, where the manifolds touch, and how well its alpha is located [1]."""

    alpha: float
    uncertainty: float
    saddle: Saddle
    fold: float  # alpha where the captor and the saddle are born [1]
    edge: Edge  # of the manifold, nearly there


def carry(orbit: Orbit, alpha: float) -> Orbit:
    """Follow an orbit to another alpha, without a fold between; ValueError where it ends."""
    now = orbit.parameters.alpha
    for value in np.linspace(now, alpha, max(2, 1 + round(abs(alpha - now) / STEP)))[1:]:
        parameters = dataclasses.replace(orbit.parameters, alpha=float(value))
        carried = close_orbit(orbit.walls, orbit.points, parameters)
        if carried is None:
            raise ValueError(f'the orbit of {counted(orbit.impacts, "impact")} cannot be followed '
                             f'to alpha = {alpha:g}; give a narrower bracket')
        orbit = carried
    return orbit


def find_boundary(parameters: Parameters, low: float, seed: int = 1) -> Boundary:
    """Find the orbit that captures trajectories beyond a crisis, and its saddle."""
    # The crisis lies between `low` and the alpha of the parameters, where all trajectories are
    # captured in the end. ValueError where none is by a periodic orbit, or that has no saddle.
    found = find_attractors(parameters, Plane().draw(parameters, 64, seed), hold=HOLD,
                            chaotic=False)
    if not found.orbits:
        raise ValueError(f'alpha = {parameters.alpha:g}: no trajectory settles on a periodic '
                         'orbit; give a bracket that ends beyond the crisis')
    captor = found.orbits[int(np.argmax(np.bincount(
        found.labels[found.labels >= 0], minlength=len(found.orbits))))]
    for direction in (-1.0, 1.0):
        branch = follow(captor, direction, low - BEYOND, parameters.alpha + BEYOND)
        folds = [turn.alpha for turn in branch.turns if turn.change is Change.FOLD]
        saddles = [orbit for orbit in branch.orbits if orbit.multipliers[0].real > 1.0]
        if folds and saddles:
            nearest = min(saddles, key=lambda o: abs(o.parameters.alpha - parameters.alpha))
            return Boundary(captor, carry(nearest, parameters.alpha), folds[0])
    raise ValueError(f'alpha = {parameters.alpha:g}: no saddle belongs to the orbit of '
                     f'{counted(captor.impacts, "impact")}')


def find_tangency(boundary: Boundary, low: float, high: float,
                  searched: Callable[[int], None] = lambda count: None) -> Tangency:
    """Find where the unstable manifold of the saddle first crosses its stable one."""
    # Bisection is followed by secants once the distance is smooth; a finer search at the end gives
    # part of the uncertainty. `searched` is called with the searches of the manifold made.
    # ValueError where `low` and `high` do not bracket a crisis.
    def look(alpha: float, **how: Any) -> Edge:
        searched(1)
        return find_edge(boundary.at(alpha).directions, **how)

    below, above = look(low), look(high)
    if below.distance > 0.0 or above.distance < 0.0:
        raise ValueError(f'no crisis between alpha = {low:g} and {high:g}: escape is '
                         f'{"possible" if below.distance > 0.0 else "impossible"} at both; give '
                         'another bracket')
    while abs(below.distance) > SMOOTH or abs(above.distance) > SMOOTH:
        middle = 0.5 * (low + high)
        edge = look(middle)
        if edge.distance < 0.0:
            low, below = middle, edge
        else:
            high, above = middle, edge
        if high - low < 1e-9:
            raise ValueError(f'the distance jumps at alpha = {low:.9g}: this is not a tangency')
    roots, slope = [], (above.distance - below.distance) / (high - low)
    for seed in (SEED_DISTANCE, 3.0 * SEED_DISTANCE):
        alpha, edge = low, look(low, seed=seed)
        for _ in range(MOST_STEPS):
            edge = look(alpha, near=edge.place, seed=seed)
            if edge.distance == NEVER or abs(edge.distance / slope) < ROOT:
                break
            alpha -= edge.distance / slope
        roots.append((alpha, edge))
    (alpha, edge), (other, _) = roots
    # A narrower fold that crosses earlier would show here.
    missed = max(0.0, *(look(alpha, impacts=100, offset=shift / SHIFTS).distance / slope
                        for shift in range(SHIFTS)))
    uncertainty = max(abs(other - alpha), missed, abs(edge.distance) / slope, 1e-10)
    return Tangency(alpha - missed, uncertainty, boundary.at(alpha).directions, boundary.fold,
                    edge)


def radius_of(boundary: Boundary) -> float:
    """Choose how near to the captor a trajectory counts as captured [rad, 1]."""
    # A tenth of the way to the saddle at their nearest points, rounded: the same on every machine.
    captor, saddle = boundary.captor, boundary.saddle
    apart = distances(captor.velocities[:, None], captor.phases[:, None], saddle.velocities,
                      saddle.phases)
    return round(0.1 * float(np.min(apart)), 6)
