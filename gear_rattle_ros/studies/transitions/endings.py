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

"""Where a chaotic attractor ends: it is followed in small steps on a path, with its own states."""

from collections.abc import Callable, Iterator
import dataclasses
import math
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from .escape_rates import fit_law, FITTED
from ...attractors.catalogue import OTHERS
from ...attractors.plane import at_parameters
from ...core.arrays import FloatArray
from ...core.flight.closed_form import NO_WALL
from ...core.flight.elementary import TWO_PI
from ...core.flight.lanes import make_initial_conditions
from ...core.flight.lanes_step import LANES
from ...core.many.escape import EscapeRate
from ...core.many.orbit_table import dilated
from ...core.many.recognition import find_orbit
from ...core.many.recorded import initial_after, record_impacts
from ...core.many.settling import RecordArray, RESTS_LOWER, RESTS_UPPER
from ...core.model import Parameters
from ...core.orbits.branches import Change, follow, is_own_image, Turn
from ...core.orbits.orbit import close_near, Orbit
from ...core.orbits.section import shortest_recurrence
from ...core.path import Path

# Impacts of a round, the last of them that are examined, and the fewest rounds.
ROUND: Final = 2048
KEPT: Final = 256
ROUNDS: Final = 8
# Impacts that recur within this are searched for an orbit [1].
RECURS: Final = 1e-4
# The region of an attractor: boxes along phase and speed, up to a multiple of the fastest impact.
BOXES: Final = 128
ROOM: Final = 1.2
# Beyond a crisis escapes are timed where the mean lifetime is at least this fraction of the
# impacts over which the attractor is watched, and up to `SPAN` times as long; `ESCAPES` at each
# place, whose distances go by a factor.
SHORTEST: Final = 0.25
SPAN: Final = 16.0
ESCAPES: Final = 48
FACTOR: Final = math.sqrt(2.0)
# Distance, in the parameters, over which an orbit is followed to the end of its window [1], which
# is left by a leap.
WIDEST: Final = 0.05
LEAP: Final = 2.5
# Where this number of escapes is expected, none is seen once in twenty times; the rate grows
# with the distance at most as a power (Grebogi, Ott & Yorke 1987: 1/2 and more).
UNSEEN: Final = 3.0
EXPONENT: Final = 2.0


@dataclasses.dataclass(frozen=True)
class Herd:
    """Trajectories that are on a chaotic attractor."""

    parameters: Parameters
    states: RecordArray  # where they are
    region: npt.NDArray[np.bool_]  # where impacts were, with neighbours: (wall, speed, phase)
    speed: float  # greatest speed of the boxes [1]

    def strays(self, phases: FloatArray, velocities: FloatArray) -> npt.NDArray[np.bool_]:
        """Whether each row of impacts lies mostly outside the region."""
        inside = self.region[_places(phases, velocities, self.speed)]
        inside &= np.abs(velocities) < self.speed
        return np.asarray(np.mean(inside, axis=-1) < 0.5)


# What captures trajectories that leave an attractor: a stable orbit, the key of rest, or nothing
# where they go on elsewhere.
Captor: TypeAlias = Orbit | str | None


@dataclasses.dataclass(frozen=True)
class End:
    """Where a chaotic attractor ends."""

    # window: a stable orbit is born and replaces it; crisis: trajectories escape from it; interior
    # crisis: they come back to it now and then; orbit: it does not end, but goes on as an orbit
    # whose doublings lead up to it.
    kind: str
    path: Path
    value: float  # its coordinate [1]
    uncertainty: float  # how far off that can be [1]
    captor: Captor  # what trajectories settle on: of a window where it is born, else beyond
    last: Herd  # that did not escape
    direction: float = 1.0  # in which it was followed, +1 or -1

    @property
    def parameters(self) -> Parameters:
        return self.last.parameters

    @property
    def states(self) -> RecordArray:
        return self.last.states


def spread_out(parameters: Parameters, state: FloatArray) -> RecordArray:
    """Make states of many trajectories from one; in chaos they diverge."""
    phase, displacement, velocity = state
    return make_initial_conditions(parameters, phase, displacement,
                                   velocity * (1.0 + 1e-6 * np.arange(LANES) / LANES))


def watch(parameters: Parameters, states: RecordArray, hold: int,
          before: Herd | None = None) -> Herd | Captor:
    """Watch for `hold` impacts each whether trajectories stay on their attractor."""
    # Return their herd, or what has captured the first that has left. Without `before`, the
    # attractor a little earlier, it is what they are seen on.
    seen: list[RecordArray] = []
    away = np.ones(LANES, bool)
    rounds = max(ROUNDS, -(-hold // ROUND))
    # Outside for a while is a burst; what does not come back has left.
    while len(seen) < rounds or before is not None and len(seen) < 2 * rounds and away.any():
        states, impacts, captors = _go_on(parameters, states)
        for _, captor in captors:
            return captor
        seen.append(impacts)
        if before is not None and len(seen) >= rounds:
            away &= before.strays(impacts['phase'], impacts['velocity'])
    if before is not None and away.any():
        return None
    # The first impacts are still on their way from where the attractor was.
    impacts = np.concatenate(seen[1:])
    speed = ROOM * float(np.max(np.abs(impacts['velocity'])))
    region = np.zeros((2, BOXES, BOXES), bool)
    region[_places(impacts['phase'], impacts['velocity'], speed)] = True
    return Herd(parameters, states, dilated(region), speed)


def find_end(herd: Herd, path: Path, direction: float, width: float, edge: float,
             tolerance: float, hold: int) -> End | None:
    """Follow a chaotic attractor along a path to its end, as far as the column at `edge`."""
    # The steps have the sign of `direction`; `width` is the first and the longest, `tolerance` the
    # shortest. An attractor lasts where `LANES` trajectories stay for `hold` impacts. None where
    # it does not end.
    step, stayed = width, 0
    captor: Captor = None
    turn = None

    def go_to(value: float) -> Herd | Captor:
        return watch(path.at(value, nearest=True), herd.states, hold, herd)

    while step >= tolerance:
        low = path.of(herd.parameters)
        left = direction * (edge - low)
        if left < tolerance:
            return None
        value = low + direction * min(step, left)
        trial = go_to(value)
        if isinstance(trial, Herd):
            herd, stayed = trial, stayed + 1
            # Once is what a bisection does; twice, the step had failed for its length alone.
            step = min(width, 2.0 * step) if stayed > 1 else step
            continue
        captor, stayed = trial, 0
        turn = _born(captor, path, herd, low, direction) if isinstance(captor, Orbit) else None
        if isinstance(captor, Orbit) and turn is not None:
            if turn.orbit.impacts == captor.impacts and (
                    turn.change is Change.DOUBLING
                    or turn.change is Change.PITCHFORK and is_own_image(captor)):
                return End('orbit', path, value, 0.0, captor, herd)
            if abs(math.remainder(value - edge, width)) < 1e-6 * width:
                # A column shows it.
                before = go_to(turn.value - direction * tolerance)
                if isinstance(before, Herd):
                    herd = before
                    after = go_to(turn.value + direction * tolerance)
                    if isinstance(after, Herd):
                        herd = after
                        continue
                    if isinstance(after, Orbit):
                        break
            else:
                # A window narrower than a column is not an end: chaos is back beyond it.
                column = edge - direction * width * (
                    math.ceil(direction * (edge - low) / width - 1e-6) - 1)
                beyond = go_to(direction * min(direction * _far_side(captor, path, turn,
                                                                     direction),
                                               direction * column))
                if isinstance(beyond, Herd):
                    herd = beyond
                    continue
        step *= 0.5
    return _crisis(herd, path, direction, step, captor, hold, width) if turn is None else End(
        'window', path, turn.value, turn.uncertainty, turn.orbit, herd)


def _far_side(captor: Orbit, path: Path, turn: Turn, direction: float) -> float:
    # A window is 9/4 times as wide as its first orbit is stable (Yorke et al. 1985).
    value, widest = path.of(captor.parameters), WIDEST * path.unit
    last = follow(captor, path, direction, value - widest, value + widest,
                  to_first_turn=True).orbits[-1]
    return turn.value + LEAP * (path.of(last.parameters) - turn.value)


def _born(captor: Orbit, path: Path, herd: Herd, low: float, direction: float) -> Turn | None:
    # Where an orbit in the midst of the attractor was born, if that was not before.
    if captor.sticks != NO_WALL or herd.strays(captor.phases, captor.velocities):
        return None
    value = path.of(captor.parameters)
    turns = follow(captor, path, -direction, min(low, value), max(low, value),
                   to_first_turn=True).turns
    return turns[0] if turns and direction * (turns[0].value - low) > 0.0 else None


def _crisis(herd: Herd, path: Path, direction: float, step: float, captor: Captor, hold: int,
            width: float) -> End:
    low, high = path.of(herd.parameters), 2.0 * step
    shortest = max(SHORTEST * hold, 2.0 * ROUND)

    def rate(distance: float, wanted: int) -> EscapeRate:
        return time_escapes(path.at(low + direction * distance, nearest=True), herd, wanted,
                            2.0 * wanted * SPAN * shortest)

    far = distance_of(rate, high, width, shortest)
    kind = 'interior crisis' if captor is None and returns(
        path.at(low + direction * far, nearest=True), herd, hold) else 'crisis'
    beyond, uncertainty = locate(rate, high, far, width, hold)
    return End(kind, path, low + direction * beyond, uncertainty, captor, herd, direction)


# The rate at a distance, measured until there are so many events.
Rate: TypeAlias = Callable[[float, int], EscapeRate]


def distance_of(rate: Rate, high: float, width: float, shortest: float) -> float:
    """Find a distance between two at which the mean time is short, seen by doubling the first."""
    distance = high
    while distance < width and rate(distance, ROUNDS).mean > shortest:
        distance *= 2.0
    return distance


def locate(rate: Rate, high: float, far: float, width: float, hold: int) -> tuple[float, float]:
    """
    Find where a rate begins, and how far off that can be, both as distances.

    Nothing was seen at 0 while `LANES` trajectories made `hold` impacts each; something at `high`.
    The rate is measured from `far` on inwards.
    """
    # Long lifetimes hide the place itself; the law by which they shorten beyond it gives it.
    shortest = max(SHORTEST * hold, 2.0 * ROUND)
    seen: list[tuple[float, EscapeRate]] = []
    distance, mean = far, 0.0
    while distance >= high and mean < SPAN * shortest:
        timed = rate(distance, ESCAPES)
        mean = timed.mean
        if timed.escapes >= ROUNDS:
            seen.append((distance, timed))
        distance /= FACTOR
    # At the last place none of all trajectories escaped, so the crisis is not far before it.
    hidden = width
    for d, k in seen:
        share = (UNSEEN / (LANES * hold * k.rate))**(1.0 / EXPONENT)
        if share < 1.0:
            hidden = min(hidden, d * share / (1.0 - share))
    beyond, uncertainty = 0.5 * (high - hidden), 0.5 * (high + hidden)
    # What is faster than a round is not timed.
    timed_well = [(d, k.rate, k.error) for d, k in seen if k.mean > ROUND]
    if len(timed_well) >= FITTED:
        law = fit_law(*zip(*timed_well, strict=True))
        if law.critical_error < uncertainty:
            beyond = min(max(law.critical, -hidden), high)
            uncertainty = max(law.critical_error, 0.5 * high, abs(law.critical - beyond))
    return beyond, uncertainty


def returns(parameters: Parameters, herd: Herd, hold: int) -> bool:
    """Whether trajectories come back that have been away, so that the attractor has grown."""
    states, away = herd.states, np.zeros(LANES, bool)
    for _ in range(max(ROUNDS, -(-hold // ROUND))):
        states, impacts, _ = _go_on(parameters, states)
        strays = herd.strays(impacts['phase'], impacts['velocity'])
        if np.any(away & ~strays):
            return True
        away = strays
    return False


def time_escapes(parameters: Parameters, herd: Herd, wanted: int, most: float) -> EscapeRate:
    """Measure how fast trajectories escape beyond the end of their attractor."""
    # It is enough after `wanted` escapes, or `most` impacts of all together. They are seen every
    # `ROUND` impacts; what escapes is replaced, and the first round of each does not count.
    states = herd.states
    counts = np.zeros(LANES, bool)
    escapes = rounds = made = 0
    while escapes < wanted and made < most:
        states, impacts, captors = _go_on(parameters, states)
        gone = herd.strays(impacts['phase'], impacts['velocity'])
        gone[[i for i, _ in captors]] = True
        made += LANES * ROUND
        if gone.all():
            # Faster than a round.
            return EscapeRate(1.0 / ROUND, 1.0 / ROUND, LANES, float(LANES * ROUND))
        escapes += int(np.count_nonzero(gone & counts))
        rounds += int(np.count_nonzero(counts))
        counts = ~gone
        if gone.any():
            pool = states[~gone]
            anew = pool[np.arange(np.count_nonzero(gone)) % len(pool)]
            anew['velocity'] *= 1.0 + 1e-6 * np.arange(1, 1 + len(anew)) / LANES
            states[gone] = anew
    rate = -math.log1p(-escapes / (rounds + 1.0)) / ROUND
    return EscapeRate(rate, rate / math.sqrt(max(1, escapes)), escapes, float(rounds * ROUND))


def _go_on(parameters: Parameters, states: RecordArray
           ) -> tuple[RecordArray, RecordArray, Iterator[tuple[int, Orbit | str]]]:
    # States after a round, its last impacts, and who is at rest or on a stable orbit.
    rows, counts = record_impacts(at_parameters(parameters, states), ROUND - KEPT, KEPT)
    last = rows[:, -1]
    after = initial_after(parameters, last['phase'], last['velocity'])

    def captors() -> Iterator[tuple[int, Orbit | str]]:
        for i, row in enumerate(rows):
            if counts[i] < KEPT:
                # The load presses it to one wall.
                yield i, OTHERS[RESTS_UPPER if parameters.gamma > 0.0 else RESTS_LOWER][0]
                continue
            q = int(shortest_recurrence(row, KEPT // 2, RECURS))
            if q:
                # Newton's method does not find an orbit that sticks.
                orbit = close_near(parameters, row[-q:]) or find_orbit(
                    parameters, row, KEPT // 2, RECURS)
                if orbit is not None and orbit.is_stable:
                    yield i, orbit

    return after, rows, captors()


def _places(phases: FloatArray, velocities: FloatArray, speed: float
            ) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    rows = np.minimum(np.abs(velocities) * (BOXES / speed), BOXES - 1).astype(np.int64)
    columns = np.minimum(phases * (BOXES / TWO_PI), BOXES - 1).astype(np.int64)
    return np.signbit(velocities).astype(np.int64), rows, columns
