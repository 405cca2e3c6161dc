"""Chaotic attractors as sets of occupied boxes of the section."""

import dataclasses
from typing import Final

import numpy as np
import numpy.typing as npt

from .classify import BOXES, RecordArray
from .elementary import TWO_PI
from .lyapunov import LyapunovReport, RunningLyapunov
from .model import Parameters, State
from .periodic import record_impacts
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
    mean_speeds : tuple of float
        Mean speed before impacts at the upper and the lower wall [1]; 0 without impacts.
    exponents : LyapunovReport
        Of its first trajectory.

    """

    boxes: npt.NDArray[np.bool_]
    members: tuple[int, ...]
    pieces: int
    mean_speeds: tuple[float, float]
    exponents: LyapunovReport

    @property
    def key(self) -> str:
        """Name of its own: pieces and mean speeds at both walls."""
        return 'chaotic-{}-U{:.2f}-L{:.2f}'.format(self.pieces, *self.mean_speeds)


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
    sums = np.zeros((len(traced), 2, 2))
    rows, made = record_impacts(traced, 0, LENGTH)
    for number in range(len(traced)):
        row = rows[number, :made[number]]
        counts[number] = np.bincount(_boxes_hit(row, speed), minlength=2 * BOXES * BOXES)
        for side in (0, 1):
            of_side = np.abs(row['velocity'][np.signbit(row['velocity']) == bool(side)])
            sums[number, side] = len(of_side), float(np.sum(of_side))
    sets = []
    for members in _grouped(counts > 0):
        total = counts[members].sum(axis=0, dtype=np.int64).reshape(2, BOXES, BOXES)
        number, speeds = np.moveaxis(sums[members].sum(axis=0), 1, 0)
        means = speeds / np.maximum(number, 1.0)
        sets.append(BoxSet(
            total > 0, tuple(members), count_pieces(total), (float(means[0]), float(means[1])),
            exponents_of(parameters, traced[members[0]])))
    return sets, speed


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


def _boxes_hit(row: RecordArray, speed: float) -> npt.NDArray[np.int64]:
    side = np.signbit(row['velocity']).astype(np.int64)
    level = np.minimum((np.abs(row['velocity']) * (BOXES / speed)).astype(np.int64), BOXES - 1)
    column = np.minimum((row['phase'] * (BOXES / TWO_PI)).astype(np.int64), BOXES - 1)
    return np.asarray((side * BOXES + level) * BOXES + column)


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
