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

"""
Where a chaotic attractor changes its shape: its pieces merge, or it suddenly grows.

Pieces are visited in turn on one wall. Once they have merged, trajectories pass now and then to a
piece whose turn it is not; once an attractor has grown, they burst beyond its former edge. Both
are rare at first, so their rates are measured beyond and followed to where they vanish.
"""

from collections.abc import Callable, Iterator
import dataclasses
import functools
import itertools
import math
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from .endings import (
    distance_of,
    KEPT,
    locate,
    RECURS,
    ROUND,
    ROUNDS,
    SHORTEST,
    SPAN,
    spread_out,
)
from ...attractors.plane import at_parameters, STATE
from ...core.arrays import FloatArray, RecordArray
from ...core.flight.lanes_step import LANES
from ...core.many.chaotic_sets import count_pieces
from ...core.many.escape import EscapeRate
from ...core.many.recorded import initial_after, record_impacts
from ...core.model import Parameters
from ...core.orbits.section import shortest_recurrence
from ...core.path import Path

# Rounds after which trajectories have forgotten where they began, rounds in which the attractor
# is then seen, and boxes along an edge of what they visit in it.
SETTLED: Final = 2
SEEN: Final = 4
BOXES: Final = 512
# Attractors of more pieces are not distinguished.
MOST: Final = 64
# An edge jumps where it moves by this share of the range of speeds on its wall within a step that
# is this part of the distance between two columns.
JUMPS: Final = 0.02
WITHIN: Final = 1.0 / 64.0
# Where a window of a periodic orbit hides the middle of an interval, other places are tried.
SHARES: Final = (0.5, 0.45, 0.6, 0.3)
# What this share of all that can do it does in a round is faster than a round.
FAST: Final = 0.9
NUDGES: Final = (1.0, 0.98, 1.03)

# Which trajectories do something in a round.
Lanes: TypeAlias = npt.NDArray[np.bool_]
# What they do somewhere, round by round; the rounds end where they are not chaotic.
Watch: TypeAlias = Callable[[Parameters], Iterator[Lanes]]


@dataclasses.dataclass(frozen=True)
class Shape:
    """The shape of a chaotic attractor at one place on a path."""

    path: Path
    value: float  # its coordinate [1]
    pieces: int
    edges: FloatArray  # least and greatest speed on the upper and the lower wall [1], or nan
    state: FloatArray  # where one trajectory is: phase, displacement, velocity

    @property
    def parameters(self) -> Parameters:
        return self.path.at(self.value)

    def grown(self, other: 'Shape') -> FloatArray:
        """Return how far another has grown beyond each edge, in parts of the range there."""
        spans = np.repeat(self.edges[1::2] - self.edges[::2], 2)
        return np.nan_to_num((other.edges - self.edges) * (-1.0, 1.0, -1.0, 1.0) / spans)


@dataclasses.dataclass(frozen=True)
class Reshaping:
    """Where a chaotic attractor changes its shape."""

    value: float  # coordinate of the path [1]
    uncertainty: float  # how far off it can be [1]
    inside: Shape  # more pieces, or the smaller one
    outside: Shape

    @property
    def direction(self) -> float:
        """Return the direction from the inside to the outside, +1 or -1."""
        return math.copysign(1.0, self.outside.value - self.inside.value)

    @property
    def path(self) -> Path:
        return self.inside.path

    @property
    def parameters(self) -> Parameters:
        return self.inside.parameters

    @property
    def states(self) -> RecordArray:
        return spread_out(self.inside.parameters, self.inside.state)


def shape_at(path: Path, value: float, state: FloatArray) -> Shape | None:
    """Look at an attractor on which one state lies, or nearly; None where it is not chaotic."""
    parameters = path.at(value)
    seen = list(itertools.islice(_rounds(parameters, state), SETTLED, SETTLED + SEEN))
    if len(seen) < SEEN:
        return None
    rows = np.concatenate(seen, axis=1)
    upper, speed = rows['velocity'] > 0.0, np.abs(rows['velocity'])
    edges = [look(speed[side]) if side.any() else math.nan
             for side in (upper, ~upper) for look in (np.min, np.max)]
    last = initial_after(parameters, rows['phase'][:1, -1], rows['velocity'][:1, -1])[0]
    return Shape(path, value, count_pieces(rows), np.array(edges), np.array(
        [last[name] for name in STATE]))


def find_mergings(inside: Shape, outside: Shape, tolerance: float, hold: int
                  ) -> Iterator[Reshaping]:
    """Find where the pieces of an attractor merge, from more of them to fewer."""
    while outside.pieces < inside.pieces <= MOST:
        watch = functools.partial(passages, state=inside.state, pieces=inside.pieces)
        ends = _narrow(inside, outside, watch, tolerance, hold)
        found = ends and _locate(ends, watch, abs(outside.value - inside.value), hold,
                                 1.0 - outside.pieces / inside.pieces)
        if found is None:
            return
        yield found
        inside = found.outside


def find_growth(inside: Shape, outside: Shape, tolerance: float, hold: int) -> Reshaping | None:
    """Find where the edge of an attractor suddenly jumps outwards, if that is between."""
    width = abs(outside.value - inside.value)
    while True:
        edge = int(np.argmax(inside.grown(outside)))
        if inside.grown(outside)[edge] < JUMPS:
            return None
        if abs(outside.value - inside.value) < max(tolerance, WITHIN * width):
            break
        middle = _between(inside, outside)
        if middle is None:
            return None
        if inside.grown(middle)[edge] < middle.grown(outside)[edge]:
            inside = middle
        else:
            outside = middle
    beyond = float(0.5 * (inside.edges + outside.edges)[edge])
    watch = functools.partial(bursts, state=inside.state, edge=edge, beyond=beyond)
    ends = _narrow(inside, outside, watch, tolerance, hold)
    return ends and _locate(ends, watch, width, hold, 1.0)


def passages(parameters: Parameters, state: FloatArray, pieces: int) -> Iterator[Lanes]:
    """Watch which trajectories pass to a piece whose turn it is not."""
    turn = np.zeros(LANES, np.int64)
    counts = np.zeros((pieces, BOXES, BOXES), np.int32)
    piece = np.zeros(LANES, np.int64)  # all begin in the same one
    for number, rows in enumerate(_rounds(parameters, state)):
        upper = rows['velocity'] > 0.0
        counted = upper if upper.any() else ~upper
        turns = turn[:, None] + np.cumsum(counted, axis=1)
        turn = turns[:, -1]
        places = np.abs(rows['velocity']), rows['phase']
        if number < SETTLED:
            corners = [(float(x[counted].min()), float(np.ptp(x[counted]))) for x in places]
            continue
        y, x = (np.clip((at - low) * (BOXES / span), 0, BOXES - 1).astype(np.int64)
                for at, (low, span) in zip(places, corners, strict=True))
        if number < SETTLED + SEEN:
            np.add.at(counts, (turns[counted] % pieces, y[counted], x[counted]), 1)
            continue
        if number == SETTLED + SEEN:
            whose = np.where(counts.any(axis=0), np.argmax(counts, axis=0), -1)
        last = np.s_[:, -KEPT:]
        row, k = np.nonzero(counted[last] & (whose[y[last], x[last]] >= 0))
        votes = np.zeros((LANES, pieces), np.int64)
        np.add.at(votes, (row, (whose[y[last], x[last]] - turns[last])[row, k] % pieces), 1)
        before, piece = piece, np.argmax(votes, axis=1)
        yield piece != before


def bursts(parameters: Parameters, state: FloatArray, edge: int, beyond: float
           ) -> Iterator[Lanes]:
    """Watch which trajectories come beyond a speed, at an edge as `Shape` has them."""
    sign = 1.0 if edge % 2 else -1.0
    for rows in itertools.islice(_rounds(parameters, state), SETTLED, None):
        side = (rows['velocity'] > 0.0) == (edge < 2)
        yield np.any(side & (sign * np.abs(rows['velocity']) > sign * beyond), axis=1)


def _rounds(parameters: Parameters, state: FloatArray) -> Iterator[RecordArray]:
    # Trajectories from nearly one state, as long as they are chaotic.
    states = spread_out(parameters, state)
    while True:
        rows, made = record_impacts(at_parameters(parameters, states), 0, ROUND)
        if np.any(made < ROUND) or any(
                shortest_recurrence(row[-KEPT:], KEPT // 2, RECURS) for row in rows):
            return
        yield rows
        states = initial_after(parameters, rows['phase'][:, -1], rows['velocity'][:, -1])


def _between(inside: Shape, outside: Shape) -> Shape | None:
    for share in SHARES:
        found = shape_at(inside.path, inside.value + share * (outside.value - inside.value),
                         inside.state)
        if found is not None:
            return found
    return None


def _narrow(inside: Shape, outside: Shape, watch: Watch, tolerance: float, hold: int
            ) -> tuple[Shape, float] | None:
    # The last place at which nothing was seen, and the step to where something was; None where
    # windows of periodic orbits hide it.
    low, high = inside.value, outside.value
    while abs(high - low) > tolerance:
        for share in SHARES:
            value = low + share * (high - low)
            seen = list(_until_any(itertools.islice(
                watch(inside.path.at(value)), max(ROUNDS, -(-hold // ROUND)))))
            if seen:
                break
        else:
            return None
        if seen[-1].any():
            high = value
        else:
            low = value
    return dataclasses.replace(inside, value=low), high - low


def _until_any(rounds: Iterator[Lanes]) -> Iterator[Lanes]:
    for lanes in rounds:
        yield lanes
        if lanes.any():
            return


def _locate(ends: tuple[Shape, float], watch: Watch, width: float, hold: int, limit: float
            ) -> Reshaping | None:
    # `limit` is the share of trajectories that are seen to do it where that is fast.
    inside, step = ends
    direction, shortest = math.copysign(1.0, step), max(SHORTEST * hold, 2.0 * ROUND)

    def rate(distance: float, wanted: int) -> EscapeRate:
        most = 2.0 * wanted * SPAN * shortest
        for nudge in NUDGES:
            escapes = rounds = 0
            for lanes in watch(inside.path.at(inside.value + direction * nudge * distance)):
                escapes, rounds = escapes + int(np.count_nonzero(lanes)), rounds + LANES
                if escapes >= wanted or rounds * ROUND >= most:
                    break
            if rounds:
                break
        share = escapes / (rounds + 1.0) / limit
        seen = -limit * math.log1p(-share) / ROUND if share < FAST else 1.0 / ROUND
        return EscapeRate(seen, seen / math.sqrt(max(1, escapes)), escapes, float(rounds * ROUND))

    high = abs(step)
    far = distance_of(rate, high, width, shortest)
    beyond, uncertainty = locate(rate, high, far, width, hold)
    outside = shape_at(inside.path, inside.value + direction * max(far, 4.0 * high), inside.state)
    return None if outside is None else Reshaping(
        inside.value + direction * beyond, uncertainty, inside, outside)
