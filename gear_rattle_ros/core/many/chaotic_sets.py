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

"""Chaotic sets, on which trajectories that settle on no orbit move, as boxes of the section."""

import dataclasses
import functools
from typing import Final

import numpy as np
import numpy.typing as npt

from .recorded import initial_after, record_impacts
from .settling import BOXES, cell_of, RecordArray
from ..arrays import FloatArray, IntArray, Record, Whole
from ..compiled import kernel
from ..flight.closed_form import wall_of
from ..flight.elementary import TWO_PI
from ..flight.lanes_step import LANES
from ..flight.simulation import Simulation
from ..model import Parameters, State
from ..orbits.orbit import close_near, Orbit
from ..orbits.section import distance, distances, shortest_recurrence
from ..stream.lyapunov import LyapunovReport, RunningLyapunov

# Trajectories that share at least this fraction of their boxes are on the same set.
OVERLAP: Final = 0.5
# The orbit that names a set: its longest period, how near impacts must recur, how near those are
# that lead to the same orbit, the orbits tried for a period, the impacts that are searched, and
# the share of them that comes near to each of its points.
LONGEST: Final = 64
RECURS: Final = 0.06
ALIKE: Final = 0.01
TRIED: Final = 60
NAMED: Final = 96_000
VISITED: Final = 6e-5
# This many times that share is beyond doubt.
CERTAIN: Final = 3.0
UNNAMED: Final = 'none'
# Otherwise impacts from the orbit itself decide: how many, the digits to which its points are
# rounded, and the impacts that lead away from it.
DECIDED: Final = 96_000
DIGITS: Final = 6
LEADS_AWAY: Final = 200
# Distance of trajectories that begin with the same impacts [1].
NUDGE: Final = 1e-7
# Boxes along an edge on which pieces are distinguished.
FINE: Final = 4096
# Impacts of a trajectory that fall into each box on average, and the fewest boxes along an edge.
FILLED: Final = 8
COARSEST: Final = 16
# How far boxes reach beyond the fastest impact [1].
ROOM: Final = 1.02


@dataclasses.dataclass(frozen=True)
class Effort:
    """How long trajectories are looked at in a search."""

    # Impacts after which orbits are looked for, impacts then looked at, and longest period.
    stages: tuple[tuple[int, int, int], ...]
    length: int  # least number of impacts of each trajectory from which boxes are filled
    coarser: int  # boxes are filled in blocks of at least this many along an edge
    averaged: int  # impacts over which exponents are averaged


# The first look: a tenth of a second for some hundred initial conditions.
GLANCE: Final = (300, 200, 64)
THOROUGH: Final = Effort((GLANCE, (2_000, 200, 64), (10_000, 200, 64), (30_000, 1_600, 512)),
                         24_000, 1, 200_000)
BRIEF: Final = Effort((GLANCE, (2_000, 1_600, 512)), 3_000, 8, 20_000)
# One of many amplitudes.
SWEEP: Final = Effort((GLANCE, (3_000, 600, 256)), 3_000, 8, 8_000)


@dataclasses.dataclass(frozen=True)
class ChaoticSet:
    """A set on which trajectories stay, by its boxes."""

    boxes: npt.NDArray[np.bool_]  # (wall, speed, phase), shape (2, BOXES, BOXES)
    speed: float  # greatest speed of the boxes [1]
    states: RecordArray  # INITIAL of trajectories on it, after the impacts that fill the boxes
    impacts: int  # all of these impacts
    # Which of these trajectories recur and so have left for an orbit; all if others came to rest.
    recurs: npt.NDArray[np.bool_]
    # Name of the shortest periodic orbit in it, which repels. An orbit is exact, while averages
    # over the set have an error and fall on both sides of any rounding.
    orbit: str
    # INITIAL of its impacts: the same whichever trajectories led to the orbit.
    origin: RecordArray
    exponents: LyapunovReport  # of its first trajectory

    @property
    def key(self) -> str:
        return f'chaotic-{self.orbit}'

    @functools.cached_property
    def pieces(self) -> int:
        """Return how many parts are visited in turn."""
        # It is the greatest k for which impacts n, n + k, n + 2 k, ... on one wall (the upper, if
        # it is touched) never come where those from n + 1 on do.
        return count_pieces(rows_from(self.origin))


def chaotic_sets(parameters: Parameters, initial: RecordArray, length: int, effort: Effort,
                 tolerance: float) -> list[ChaoticSet]:
    """Find the sets on which trajectories move after their transients, in the order of names."""
    # Each is followed for `length` impacts; impacts within `tolerance` [1] recur.
    rows, made = record_impacts(initial, 0, length)
    whole = made == length
    if not np.any(whole):
        return []
    speed = ROOM * float(np.max(np.abs(rows['velocity'])))
    edge = BOXES // effort.coarser
    hit: npt.NDArray[np.bool_] = np.zeros((len(rows), 2, edge, edge), np.bool_)
    for row, count, boxes in zip(rows, made, hit, strict=True):
        mark_boxes(row[:count], speed, boxes.reshape(-1), edge)
    while edge > COARSEST and length < FILLED * np.count_nonzero(hit) / len(rows):
        edge //= 2
        hit = np.asarray(hit.reshape(len(rows), 2, edge, 2, edge, 2).any(axis=(3, 5)))
    # What settles on an orbit recurs at the end, whether that orbit is known or not.
    _, look, longest = effort.stages[-1]
    recurs = np.array([shortest_recurrence(row[-look:], longest, tolerance) > 0 for row in rows])
    named: dict[str, tuple[list[int], Orbit | None]] = {}
    for members in _grouped(hit):
        on = [number for number in members if whole[number]]
        leaves = len(on) < len(members) or np.any(recurs[on])
        orbit = shortest_orbit(parameters, rows[on] if leaves else enough_of(parameters, rows[on]))
        name = orbit.name if orbit else UNNAMED
        # An orbit belongs to one set: groups of one name are one.
        name = f'{name}-{len(named)}' if name == UNNAMED and name in named else name
        named.setdefault(name, ([], orbit))[0].extend(members)
    sets = []
    for name, (members, orbit) in sorted(named.items()):
        members.sort()
        on = [number for number in members if whole[number]]
        if not on:
            continue
        last = rows[on, -1]
        states = initial_after(parameters, last['phase'], last['velocity'])
        boxes = hit[members].any(axis=0).repeat(BOXES // edge, 1).repeat(BOXES // edge, 2)
        # Those that have come to rest have left, too.
        sets.append(ChaoticSet(boxes, speed, states, len(on) * length,
                               recurs[on] | (len(on) < len(members)), name,
                               initial_from(orbit) if orbit else states,
                               averages(parameters, states[0], effort.averaged)))
    return sets


@kernel
def mark_boxes(row: Record, speed: float, boxes: npt.NDArray[np.bool_], edge: int) -> None:
    """Mark the boxes (edge by edge on each wall) that impacts hit, as `classify` numbers them."""
    for k in range(len(row)):
        velocity = row[k].velocity
        box = cell_of(wall_of(velocity), row[k].phase, abs(velocity), speed, edge)
        if box >= 0:
            boxes[box] = True


def fill_lanes(states: RecordArray) -> RecordArray:
    """Use states again, nudged, until there are as many as lanes."""
    filled = states[np.arange(LANES) % len(states)]
    filled['velocity'] *= 1.0 + NUDGE * (np.arange(LANES) // len(states))
    return filled


def enough_of(parameters: Parameters, rows: RecordArray) -> RecordArray:
    """Return `NAMED` impacts of trajectories, however few and short they are."""
    each = -(-NAMED // len(rows))
    if rows.shape[1] >= each:
        return np.ascontiguousarray(rows[:, :each])
    last = rows[:, -1]
    initial = initial_after(parameters, last['phase'], last['velocity'])
    more, made = record_impacts(fill_lanes(initial), 0, NAMED // LANES)
    return more if np.all(made == more.shape[1]) else rows


def shortest_orbit(parameters: Parameters, rows: RecordArray) -> Orbit | None:
    """Find the orbit that names a chaotic set: the shortest in it; None if none is seen."""
    # Of those with the fewest impacts it is the first by drive periods, wall and phase. Where the
    # trajectories do not decide whether an orbit is in the set, those that start from it do.
    for q in range(1, LONGEST + 1):
        for orbit in sorted(orbits_in(parameters, rows, q), key=lambda orbit: (
                orbit.drive_periods, orbit.walls[0], orbit.phases[0])):
            seen = least_share(rows, orbit)
            if seen >= CERTAIN * VISITED or seen > 0.0 and least_share(
                    rows_from(initial_from(orbit)), orbit) >= VISITED:
                return orbit
    return None


def orbits_in(parameters: Parameters, rows: RecordArray, q: int) -> list[Orbit]:
    """Find the periodic orbits of q impacts near which trajectories recur."""
    places, apart = close_returns(rows, q, RECURS)
    near = places[np.argsort(apart, kind='stable')]
    found: dict[str, Orbit] = {}
    for _ in range(TRIED):
        if not len(near):
            break
        row, first = near[0]
        orbit = close_near(parameters, rows[row, first:first + q])
        seen = [(rows[row, first]['phase'], rows[row, first]['velocity'])]
        if orbit is not None and orbit.impacts == q:
            seen += orbit.points.tolist()
            found[orbit.canonical().name] = orbit.canonical()
        here = rows[near[:, 0], near[:, 1]]
        for phase, velocity in seen:
            gone = distances(here['velocity'], here['phase'], velocity, phase) < ALIKE
            near, here = near[~gone], here[~gone]
    return list(found.values())


def least_share(rows: RecordArray, orbit: Orbit) -> float:
    """Return the share of impacts that come near the point of an orbit that is visited least."""
    fewest = min(visits(rows, phase, velocity, ALIKE) for phase, velocity in orbit.points)
    return fewest / max(1, rows.size)


def initial_from(orbit: Orbit) -> RecordArray:
    """Return the impacts of an orbit as INITIAL: the same to the bit, however it was found."""
    return initial_after(orbit.parameters, *np.round(orbit.points, DIGITS).T)


def rows_from(initial: RecordArray) -> RecordArray:
    """Follow initial conditions in all lanes; return only trajectories that do not end."""
    rows, made = record_impacts(fill_lanes(initial), LEADS_AWAY, DECIDED // LANES)
    return rows[made == rows.shape[1]]


@kernel
def close_returns(rows: Record, q: int, most: float) -> tuple[IntArray, FloatArray]:
    """Find impacts that recur after q impacts: (row, place) and distance, at most `most` [1]."""
    places = np.zeros((1024, 2), np.int64)
    apart = np.zeros(1024)
    count = 0
    for i in range(rows.shape[0]):
        for k in range(rows.shape[1] - q):
            a = rows[i, k]
            b = rows[i, k + q]
            d = distance(a.velocity, a.phase, b.velocity, b.phase)
            if d < most and b.cycle > a.cycle:
                if count == len(apart):
                    places = np.concatenate((places, np.zeros_like(places)))
                    apart = np.concatenate((apart, np.zeros_like(apart)))
                places[count, 0] = i
                places[count, 1] = k
                apart[count] = d
                count += 1
    return places[:count], apart[:count]


@kernel
def visits(rows: Record, phase: float, velocity: float, most: float) -> int:
    """Count the impacts within a distance of a point of the section."""
    count = 0
    for i in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            count += distance(rows[i, k].velocity, rows[i, k].phase, velocity, phase) < most
    return count


def averages(parameters: Parameters, state: np.void, impacts: int) -> LyapunovReport:
    """Average exponents along one trajectory."""
    simulation = Simulation(parameters, State(
        0, float(state['phase']), float(state['displacement']), float(state['velocity'])))
    running = RunningLyapunov()
    while simulation.impacts < impacts and not simulation.is_permanently_at_rest:
        cycle, _ = simulation.moment
        running.update(simulation.advance(cycle + impacts, 0.0, 20_000))
    return running.report


def count_pieces(rows: RecordArray) -> int:
    """Count the parts of a set that trajectories visit in turn; see `ChaoticSet`."""
    if not rows.size:
        return 1
    upper = rows['velocity'] > 0.0
    counted = upper if upper.any() else ~upper
    row, _ = np.nonzero(counted)
    turn = np.cumsum(counted, axis=1)[counted]
    speed = np.abs(rows['velocity'][counted])
    box = (speed * (FINE / (ROOM * float(np.max(speed))))).astype(np.int64) * FINE
    box += (rows['phase'][counted] * (FINE / TWO_PI)).astype(np.int64)
    order = np.argsort(box, kind='stable')
    return max(1, common_period(box[order], row[order], turn[order], len(rows)))


@kernel
def common_period(box: IntArray, row: IntArray, turn: Record, rows: int) -> Whole:
    """Return the greatest k so that what shares a box shares its turn modulo k; 0 for any k."""
    # Each row is ahead of another by `ahead` turns, as a box that they share shows.
    other = np.arange(rows)
    ahead = np.zeros(rows, np.int64)
    period = 0
    for n in range(1, len(box)):
        if box[n] != box[n - 1]:
            continue
        a, b = row[n - 1], row[n]
        apart = turn[n - 1] - turn[n]
        while other[a] != a:
            apart += ahead[a]
            a = other[a]
        while other[b] != b:
            apart -= ahead[b]
            b = other[b]
        if a != b:
            other[a] = b
            ahead[a] = -apart
            continue
        apart = abs(apart)
        while apart:
            period, apart = apart, period % apart
    return period


def _grouped(hit: npt.NDArray[np.bool_]) -> list[list[int]]:
    groups: list[tuple[list[int], npt.NDArray[np.bool_]]] = []
    for number, boxes in enumerate(hit):
        for members, filled in groups:
            common = int(np.count_nonzero(filled & boxes))
            if common > OVERLAP * min(np.count_nonzero(filled), np.count_nonzero(boxes)):
                members.append(number)
                filled |= boxes
                break
        else:
            groups.append(([number], boxes.copy()))
    return [members for members, _ in groups]
