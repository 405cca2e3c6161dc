"""
The letters of attractors at the parameters of the paper, the same at every alpha.

A letter belongs to a periodic orbit that is followed in alpha by Newton's method. While that is
stable, it is the attractor of this letter. Past its doublings the attractor is the one, if there
is one, to which all of its unstable manifold leads.
"""

from collections.abc import Iterable, Mapping
import dataclasses
import functools
from typing import Final, NamedTuple

import numpy as np

from .catalogue import Catalogue
from ..core.defaults import BETA, GAMMA, RESTITUTION
from ..core.many.recorded import initial_after, record_impacts
from ..core.model import Parameters
from ..core.orbits.orbit import close_near, close_orbit, fire, Orbit, same_orbit


class Founder(NamedTuple):
    """An orbit that gives an attractor its letter, by one of its impacts at some alpha."""

    letter: str
    alpha: float
    impacts: int
    phase: float
    velocity: float


# A, B and C are those of the paper; the others are small, and it does not name them.
FOUNDERS: Final = (
    Founder('A', 0.48, 3, 4.0915, 0.6273), Founder('B', 0.48, 2, 5.4554, 0.8585),
    Founder('C', 0.5, 3, 5.1607, 0.9647), Founder('D', 0.523, 6, 5.3233, 0.8390),
    Founder('E', 0.5715, 8, 4.9454, 0.9591), Founder('F', 0.5975, 5, 4.8835, 0.9998))
LETTERS: Final = tuple(founder.letter for founder in FOUNDERS)
# Amplitudes between which the paper gives letters to what has doubled.
LOWEST, HIGHEST = 0.47, 0.60
# Steps in which an orbit is followed [1], the distance within which two are the same one, and how
# far it is followed.
STEP: Final = 0.005
SAME: Final = 1e-6
REACH: Final = 0.3
# Points of the unstable manifold that are followed, and how near to the orbit they begin [1].
SAMPLES: Final = 8
NUDGE: Final = 1e-5


def with_letters(catalogue: Catalogue) -> Catalogue:
    """Return a catalogue that knows the letters of its attractors."""
    p = catalogue.parameters
    if (p.beta, p.gamma, p.restitution) != (BETA, GAMMA, RESTITUTION):
        return catalogue
    followed = [(founder.letter, _followed(founder, p)) for founder in FOUNDERS]
    found: dict[int, str] = {}
    for letter, orbit in followed:
        if orbit is not None and orbit.is_stable:
            found |= {each.label: letter for each in catalogue.attractors
                      if each.orbit and same_orbit(each.orbit, orbit, SAME)}
    left = {each.label for each in catalogue.attractors if each.label >= 0} - set(found)
    for letter, orbit in followed:
        if left and LOWEST <= p.alpha <= HIGHEST and orbit is not None:
            label = _descendant(orbit, catalogue)
            if label in left:
                found[label] = letter
                left.remove(label)
    return dataclasses.replace(catalogue, letters=found)


def numbers_of(labels: Iterable[int], letters: Mapping[int, str]) -> dict[int, int]:
    """Return the number of each attractor, which is that of its colour, by label."""
    # Without a letter it has a number that no letter has.
    first = len(LETTERS) if any(letters.values()) else 0
    numbers, others = {}, 0
    for label in labels:
        if letters.get(label):
            numbers[label] = LETTERS.index(letters[label])
        elif label >= 0:
            numbers[label] = first + others
            others += 1
    return numbers


def _followed(founder: Founder, parameters: Parameters) -> Orbit | None:
    ahead = parameters.alpha - founder.alpha
    if abs(ahead) > REACH:
        return None
    orbit = _after(founder, int(ahead / STEP))
    return orbit and close_orbit(orbit.walls, orbit.points, parameters)


@functools.lru_cache(4096)
def _after(founder: Founder, steps: int) -> Orbit | None:
    parameters = Parameters(founder.alpha + steps * STEP, BETA, GAMMA, RESTITUTION)
    if not steps:
        (row,), _ = record_impacts(initial_after(
            parameters, np.array([founder.phase]), np.array([founder.velocity])), 0,
            founder.impacts)
        return close_near(parameters, row)
    before = _after(founder, steps - 1 if steps > 0 else steps + 1)
    return before and close_orbit(before.walls, before.points, parameters)


def _descendant(orbit: Orbit, catalogue: Catalogue) -> int | None:
    shot = fire(orbit.walls, orbit.points, orbit.parameters)
    # The first multiplier has the largest modulus: below -1 past a doubling.
    if shot is None or not orbit.multipliers[0].real < -1.0:
        return None
    values, vectors = np.linalg.eig(shot.derivative())
    ahead = np.real(vectors[:, np.argmax(np.abs(values))])
    # Once round and round again: what is between has its image on either side.
    sides = NUDGE * np.abs(orbit.multipliers[0])**np.linspace(0.0, 2.0, SAMPLES, endpoint=False)
    points = orbit.points[0] + sides[:, None] * ahead
    labels = catalogue.label(initial_after(orbit.parameters, *points.T), threads=1)['label']
    return int(labels[0]) if np.all(labels == labels[0]) else None
