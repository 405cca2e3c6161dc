"""Chaotic attractors as sets of occupied boxes of the section."""

from collections.abc import Sequence
import dataclasses
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from .classify import BOXES, cell_of, RecordArray
from .compiled import kernel
from .elementary import TWO_PI
from .lyapunov import LyapunovReport, RunningLyapunov
from .model import Parameters, State
from .periodic import name_near
from .recorded import record_impacts
from .simulation import Simulation
from .table import dilated

# Trajectories from which the boxes are filled, and impacts of each.
TRACED: Final = 96
LENGTH: Final = 24_000
# Trajectories that have so much of their boxes in common are on the same attractor.
OVERLAP: Final = 0.5
# Impacts over which exponents are averaged.
AVERAGED: Final = 200_000
# Pieces are counted on boxes so many times larger, and those with less of the impacts than this
# are dust of the sampling.
COARSER: Final = 2
DUST: Final = 1e-2
# The orbit that names an attractor: trajectories that are searched, its longest period, how near
# impacts must recur, and how near others are taken to lead to the same; the orbits that are tried
# for a period, and the share of impacts that come near to one that counts.
NAMED: Final = 24
LONGEST: Final = 64
RECURS: Final = 0.02
ALIKE: Final = 0.01
TRIED: Final = 60
VISITED: Final = 1e-4
# Boxes reach so much beyond the fastest impact.
ROOM: Final = 1.02


@dataclasses.dataclass(frozen=True)
class BoxSet:
    """
    A set on which trajectories stay, by its boxes.

    Attributes
    ----------
    boxes : ndarray of bool, shape (2, BOXES, BOXES)
        Wall, speed, phase.
    members : tuple of int
        Numbers of the trajectories that fill it.
    pieces : int
        Connected parts, with phase as a circle.
    orbit : str
        Name of the shortest periodic orbit on it, which repels.
    exponents : LyapunovReport
        Of its first trajectory.

    """

    boxes: npt.NDArray[np.bool_]
    members: tuple[int, ...]
    pieces: int
    orbit: str
    exponents: LyapunovReport

    @property
    def key(self) -> str:
        """
        Name of its own: the shortest periodic orbit on it.

        Averages over the attractor are known with an error and fall on both sides of any
        rounding; an orbit is exact.
        """
        return f'chaotic-{self.orbit}'


def box_sets(parameters: Parameters, starts: RecordArray) -> tuple[list[BoxSet], float]:
    """
    Find the sets on which trajectories move.

    Parameters
    ----------
    parameters : Parameters
        Of the trajectories.
    starts : ndarray of START, shape (n,)
        States of trajectories that are past their transients; the first of them are traced.

    Returns
    -------
    tuple
        The sets, disjoint, and the greatest speed of their boxes [1].

    """
    traced = starts[:TRACED]
    first, _ = record_impacts(traced, 0, 2000)
    speed = ROOM * float(np.max(np.abs(first['velocity'])))
    counts = np.zeros((len(traced), 2 * BOXES * BOXES), np.uint16)
    rows, made = record_impacts(traced, 0, LENGTH)
    for number in range(len(traced)):
        row = rows[number, :made[number]]
        count_boxes(row, speed, counts[number])
    sets = []
    for members in _grouped(counts > 0):
        total = counts[members].sum(axis=0, dtype=np.int64).reshape(2, BOXES, BOXES)
        full = [rows[number] for number in members if made[number] == LENGTH]
        sets.append(BoxSet(
            total > 0, tuple(members), count_pieces(total), shortest_orbit(parameters, full),
            exponents_of(parameters, traced[members[0]])))
    return sets, speed


@kernel
def count_boxes(row, speed, counts):  # type: ignore[no-untyped-def]
    """
    Count impacts in boxes.

    Parameters
    ----------
    row : ndarray of IMPACT, shape (m,)
        The impacts; those faster than the boxes are passed over, as they are in `classify`.
    speed : float
        Greatest speed of the boxes [1].
    counts : ndarray of int, shape (2 * BOXES * BOXES,)
        Added to.

    """
    for k in range(len(row)):
        velocity = row[k].velocity
        side = 1 if math.copysign(1.0, velocity) < 0.0 else 0
        box = cell_of(side, row[k].phase, abs(velocity), speed, BOXES)
        if box >= 0:
            counts[box] += 1


def shortest_orbit(parameters: Parameters, rows: Sequence[RecordArray]) -> str:
    """
    Name the shortest periodic orbit on a chaotic attractor.

    Of those with the fewest impacts that trajectories often come near to, it is the first by
    drive periods, wall and phase: nothing of that depends on the trajectories.

    Parameters
    ----------
    parameters : Parameters
        Of the trajectories.
    rows : sequence of ndarray of IMPACT, shape (m,)
        Long trajectories on the attractor.

    Returns
    -------
    str
        Its name; 'none' where no orbit up to `LONGEST` impacts is seen.

    """
    if not rows:
        return 'none'
    impacts = np.stack(rows[:NAMED])
    for q in range(1, LONGEST + 1):
        early, late = impacts[:, :-q].ravel(), impacts[:, q:].ravel()
        apart = np.where(
            (np.signbit(early['velocity']) == np.signbit(late['velocity']))
            & (late['cycle'] > early['cycle']), distance(early, late['phase'], late['velocity']),
            np.inf)
        near = np.flatnonzero(apart < RECURS)
        near = near[np.argsort(apart[near], kind='stable')]
        found: dict[str, tuple[int, int, float]] = {}
        for _ in range(TRIED):
            if not len(near):
                break
            impact = early[near[0]]
            named = name_near(parameters, impact, q)
            gone = distance(early[near], impact['phase'], impact['velocity']) < ALIKE
            if named is not None:
                name, sides, phases, velocities = named
                for phase, velocity in zip(phases, velocities, strict=True):
                    gone |= distance(early[near], phase, velocity) < ALIKE
                visits = int(np.sum(distance(early, phases[0], velocities[0]) < ALIKE))
                if visits > VISITED * len(early):
                    found[name] = int(name.split('-')[1]), int(sides[0]), float(phases[0])
            near = near[~gone]
        if found:
            return min(found, key=lambda name: found[name])
    return 'none'


def distance(impacts: RecordArray, phase: npt.ArrayLike, velocity: npt.ArrayLike
             ) -> npt.NDArray[np.float64]:
    """
    Compare impacts with points of the section.

    Parameters
    ----------
    impacts : ndarray of IMPACT, shape (n,)
        The impacts.
    phase, velocity : array_like
        The points [rad, 1]; velocities differ in sign at different walls.

    Returns
    -------
    ndarray of float
        Largest difference in phase, around the circle, and velocity [1].

    """
    turn = np.abs(impacts['phase'] - phase)
    return np.maximum(np.minimum(turn, TWO_PI - turn), np.abs(impacts['velocity'] - velocity))


def exponents_of(parameters: Parameters, start: np.void, impacts: int = AVERAGED
                 ) -> LyapunovReport:
    """
    Average exponents along one trajectory.

    Parameters
    ----------
    parameters : Parameters
        Of the trajectory.
    start : START record
        Its state.
    impacts : int
        About how many.

    Returns
    -------
    LyapunovReport
        Exponents per impact with standard errors.

    """
    simulation = Simulation(parameters, State(
        0, float(start['phase']), float(start['displacement']), float(start['velocity'])))
    running = RunningLyapunov()
    while simulation.impacts < impacts and not simulation.is_resting_for_ever:
        cycle, _ = simulation.moment
        running.update(simulation.advance(cycle + impacts, 0.0, 20_000))
    return running.report()


def count_pieces(counts: npt.NDArray[np.int64]) -> int:
    """
    Count the connected parts of a set of boxes.

    Parameters
    ----------
    counts : ndarray of int, shape (2, BOXES, BOXES)
        Impacts in each.

    Returns
    -------
    int
        Parts that have their share of impacts; boxes with at most one empty between them are
        connected.

    """
    edge = BOXES // COARSER
    counts = counts.reshape(2, edge, COARSER, edge, COARSER).sum(axis=(2, 4))
    boxes = dilated(counts > 0)
    left = boxes.copy()
    total = int(counts.sum())
    pieces = 0
    while left.any():
        seed = np.unravel_index(int(np.argmax(left)), left.shape)
        part = _flooded(boxes, seed)
        left &= ~part
        pieces += int(counts[part].sum()) >= DUST * total
    return pieces


def _flooded(boxes: npt.NDArray[np.bool_], seed: tuple[np.intp, ...]) -> npt.NDArray[np.bool_]:
    part = np.zeros_like(boxes)
    part[seed] = True
    waiting = [tuple(int(n) for n in seed)]
    while waiting:
        side, row, column = waiting.pop()
        for r in range(max(row - 1, 0), min(row + 2, boxes.shape[1])):
            for c in (column - 1, column, (column + 1) % boxes.shape[2]):
                if boxes[side, r, c] and not part[side, r, c]:
                    part[side, r, c] = True
                    waiting.append((side, r, c % boxes.shape[2]))
    return part


def _grouped(occupied: npt.NDArray[np.bool_]) -> list[list[int]]:
    groups: list[tuple[list[int], npt.NDArray[np.bool_]]] = []
    for number, boxes in enumerate(occupied):
        for members, filled in groups:
            common = int(np.count_nonzero(filled & boxes))
            if common > OVERLAP * min(np.count_nonzero(filled), np.count_nonzero(boxes)):
                members.append(number)
                filled |= boxes
                break
        else:
            groups.append(([number], boxes.copy()))
    return [members for members, _ in groups]
