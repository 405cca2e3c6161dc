"""Colours of attractors that stay while a parameter moves: matched from value to value."""

from collections.abc import Mapping
import dataclasses
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from .catalogue import Catalogue, Kind
from ..core.classify import FLOATING, RESTS_LOWER, RESTS_UPPER, UNRESOLVED
from ..core.section import turn

# Told apart by the colour-blind too (after Okabe & Ito), then darker and lighter ones of them.
HUES: Final = ('#0072b2', '#e69f00', '#009e73', '#cc79a7', '#d55e00', '#56b4e9', '#f0e442',
               '#004a75', '#8f5f00', '#00523c', '#7d3c63', '#7a3600')
ENDS: Final = {UNRESOLVED: '#d9d9d9', RESTS_UPPER: '#6b6b6b', RESTS_LOWER: '#a3a3a3',
               FLOATING: '#4d4d4d'}
# Attractors whose points lie further apart than this are not the same one, moved [1].
FAR: Final = 0.35
# Points of a chaotic attractor that are compared.
MOST: Final = 400

FloatArray = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Trace:
    """
    An attractor that has a colour.

    Attributes
    ----------
    hue : int
        Number of its colour, from 0 on.
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
           is_complete: bool = True) -> tuple[tuple[Trace, ...], tuple[int, ...]]:
    """
    Give every attractor the colour of the one that it was at the parameters before.

    Parameters
    ----------
    known : tuple of Trace
        Attractors at the parameters before.
    found : list of tuple
        Attractors now, as `points_of` lists them.
    is_complete : bool
        Whether the search has looked for chaotic attractors; if not, their colours are kept.

    Returns
    -------
    tuple
        What is known from now on, and the number of the colour of every attractor. The nearest
        pairs are matched first; the colour of one that has vanished is free for the next.

    """
    pairs = sorted(
        (distance(points, trace.points), place, before)
        for place, (points, _) in enumerate(found) for before, trace in enumerate(known))
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
            hues[place] = next(hue for hue in range(len(found) + len(known) + 1)
                               if hue not in taken)
            taken.add(hues[place])
    traces = tuple(Trace(hues[place], points, is_chaotic)
                   for place, (points, is_chaotic) in enumerate(found))
    return (*traces, *kept), tuple(hues[place] for place in range(len(found)))


def colours_of(hues: tuple[int, ...]) -> dict[int, str]:
    """
    List the colour of every label.

    Parameters
    ----------
    hues : tuple of int
        Numbers of the colours of labels 0, 1, ..., as `follow` gives them.

    Returns
    -------
    dict
        Colours as HTML writes them, by label; those of the unresolved and of rest among them.

    """
    return ENDS | {label: HUES[hue % len(HUES)] for label, hue in enumerate(hues)}


def painted(labels: npt.NDArray[np.signedinteger], colours: Mapping[int, str]
            ) -> npt.NDArray[np.uint8]:
    """
    Paint a grid of labels.

    Parameters
    ----------
    labels : ndarray of int, shape (velocities, phases)
        Label of every start.
    colours : mapping
        Colour of every label.

    Returns
    -------
    ndarray of uint8, shape (velocities, phases, 4)
        Red, green, blue, opacity.

    """
    lowest = min(colours)
    table = np.zeros((max(colours) - lowest + 1, 4), np.uint8)
    for label, colour in colours.items():
        table[label - lowest] = [*bytes.fromhex(colour[1:]), 255]
    return table[labels - lowest]
