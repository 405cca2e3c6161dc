"""Attractors matched from one value of a parameter to the next, so that each keeps its number."""

import dataclasses
import itertools
import math
from typing import Final

import numpy as np

from .catalogue import Catalogue, Kind
from ..core.arrays import FloatArray
from ..core.orbits.section import turn

# Attractors whose points lie further apart than this are not the same one, moved [1].
FAR: Final = 0.35
# Distances that differ by less say nothing [1].
ALIKE: Final = 0.05
# Points of a chaotic attractor that are compared.
MOST: Final = 400



@dataclasses.dataclass(frozen=True)
class Trace:
    """
    An attractor that has a number.

    Attributes
    ----------
    hue : int
        Its number, from 0 on, which is that of its colour.
    points : ndarray of float, shape (n, 3)
        Wall (0 upper, 1 lower), phase [rad] and velocity [1] of its impacts.
    is_chaotic : bool
        Whether it is no orbit.

    """

    hue: int
    points: FloatArray
    is_chaotic: bool


def points_of(catalogue: Catalogue) -> list[tuple[FloatArray, bool]]:
    """
    List where the attractors of a catalogue hit the walls.

    Parameters
    ----------
    catalogue : Catalogue
        What a search has found.

    Returns
    -------
    list of tuple
        In the order of their labels: wall, phase [rad] and velocity [1] of every point, and
        whether the attractor is chaotic.

    """
    return [(each.points(MOST), each.kind is Kind.CHAOTIC) for each in catalogue.attractors
            if each.label >= 0]


def distance(first: FloatArray, second: FloatArray) -> float:
    """
    Tell how far apart two attractors are on the section.

    Parameters
    ----------
    first, second : ndarray of float, shape (n, 3)
        Wall, phase [rad] and velocity [1] of their points.

    Returns
    -------
    float
        Mean distance of a point from the nearest of the other [1], the larger of both ways; inf
        where one has a wall that the other does not touch.

    """
    apart = np.hypot(turn(first[:, None, 1] - second[None, :, 1]),
                     first[:, None, 2] - second[None, :, 2])
    apart = np.where(first[:, None, 0] == second[None, :, 0], apart, math.inf)
    return float(max(np.mean(np.min(apart, axis=0)), np.mean(np.min(apart, axis=1))))


def follow(known: tuple[Trace, ...], found: list[tuple[FloatArray, bool]], *,
           is_complete: bool = True, fresh: int = 0) -> tuple[tuple[Trace, ...], tuple[int, ...]]:
    """
    Give every attractor the number of the one that it was at the parameters before.

    Parameters
    ----------
    known : tuple of Trace
        Attractors at the parameters before.
    found : list of tuple
        Attractors now, as `points_of` lists them.
    is_complete : bool
        Whether the search has looked for chaotic attractors; if not, their numbers are kept.
    fresh : int
        The first number that a new attractor may have.

    Returns
    -------
    tuple
        What is known from now on, and the number of every attractor. The nearest pairs are matched
        first; the number of one that has vanished is free for the next.

    """
    pairs = sorted(
        ((distance(points, trace.points), place, before)
         for place, (points, _) in enumerate(found) for before, trace in enumerate(known)),
        # Among those that are about as near the first goes on.
        key=lambda pair: (math.ceil(min(pair[0], FAR + 1.0) / ALIKE), pair[2], pair[0], pair[1]))
    hues: dict[int, int] = {}
    matched: set[int] = set()
    for apart, place, before in pairs:
        if apart <= FAR and place not in hues and before not in matched:
            hues[place] = known[before].hue
            matched.add(before)
    kept = tuple(trace for before, trace in enumerate(known)
                 if not is_complete and trace.is_chaotic and before not in matched)
    taken = {*hues.values(), *(trace.hue for trace in kept)}
    for place in range(len(found)):
        if place not in hues:
            hues[place] = next(hue for hue in itertools.count(fresh) if hue not in taken)
            taken.add(hues[place])
    traces = tuple(Trace(hues[place], points, is_chaotic)
                   for place, (points, is_chaotic) in enumerate(found))
    return (*traces, *kept), tuple(hues[place] for place in range(len(found)))
