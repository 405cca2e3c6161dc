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

"""Attractors matched from one value of a parameter to the next, so that each keeps its number."""

from collections.abc import Mapping
import dataclasses
import itertools
import math
from typing import Final

import numpy as np

from .catalogue import Catalogue, Kind
from .letters import numbers_of
from ..core.arrays import FloatArray
from ..core.orbits.letters import LETTERS
from ..core.orbits.section import turn

# Attractors whose points are farther apart than this are different ones [1].
FAR: Final = 0.35
# Distances that differ by less count as equal [1].
ALIKE: Final = 0.05
# Points of a chaotic attractor that are compared.
MOST: Final = 400


@dataclasses.dataclass(frozen=True)
class Trace:
    """An attractor that has a number."""

    hue: int  # its number, from 0 on, which is that of its colour
    points: FloatArray  # wall (0 upper, 1 lower), phase [rad] and velocity [1] of its impacts
    is_chaotic: bool


def points_of(catalogue: Catalogue) -> list[tuple[FloatArray, bool]]:
    """List where the attractors of a catalogue hit the walls, by label."""
    return [(each.points(MOST), each.kind is Kind.CHAOTIC) for each in catalogue.attractors
            if each.label >= 0]


def distance(first: FloatArray, second: FloatArray) -> float:
    """Return how far apart the points of two attractors are on the section [1]."""
    # It is the mean distance of a point from the nearest of the other, the larger of both ways,
    # and inf where one touches a wall that the other does not.
    apart = np.hypot(turn(first[:, None, 1] - second[None, :, 1]),
                     first[:, None, 2] - second[None, :, 2])
    apart = np.where(first[:, None, 0] == second[None, :, 0], apart, math.inf)
    return float(max(np.mean(np.min(apart, axis=0)), np.mean(np.min(apart, axis=1))))


def follow(known: tuple[Trace, ...], found: list[tuple[FloatArray, bool]], *,
           is_complete: bool = True, fresh: int = 0, lettered: Mapping[int, int] | None = None
           ) -> tuple[tuple[Trace, ...], tuple[int, ...]]:
    """Give every attractor the number of the one that it was at the parameters before."""
    # The nearest pairs are matched first; the number of one that has vanished is free for the
    # next. Where the search was not `is_complete`, the numbers of chaotic attractors are kept; a
    # new one has at least the number `fresh`; `lettered` are the numbers of those with a letter,
    # by place. Returns what is known from now on, and every number.
    pairs = sorted(
        ((distance(points, trace.points), place, before)
         for place, (points, _) in enumerate(found) for before, trace in enumerate(known)),
        # Among those that are about as near the first goes on.
        key=lambda pair: (math.ceil(min(pair[0], FAR + 1.0) / ALIKE), pair[2], pair[0], pair[1]))
    hues = dict(lettered or {})
    matched = {before for before, trace in enumerate(known) if trace.hue in hues.values()}
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


def recognise(known: tuple[Trace, ...], catalogue: Catalogue, *, is_complete: bool = True
              ) -> tuple[tuple[Trace, ...], tuple[int, ...]]:
    """Give the attractors of a catalogue numbers, those of their letters where they have any."""
    numbers = numbers_of(catalogue.letters, catalogue.letters)
    return follow(known, points_of(catalogue), is_complete=is_complete, lettered=numbers,
                  fresh=len(LETTERS) if numbers else 0)
