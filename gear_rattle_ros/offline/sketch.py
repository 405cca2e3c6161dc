"""Chaotic attractors from few impacts: for a picture that is wanted soon."""

from typing import Final

import numpy as np
import numpy.typing as npt

from ..core.chaos import BoxSet, exponents_of, shortest_orbit
from ..core.classify import BOXES, RecordArray
from ..core.elementary import TWO_PI
from ..core.model import Parameters
from ..core.recorded import record_impacts

# Trajectories that are traced, and impacts of each.
TRACED: Final = 48
LENGTH: Final = 4_000
# Boxes are so many times larger than those of a thorough search, so that few impacts fill them.
COARSER: Final = 8
# Trajectories that have so much of their boxes in common are on the same attractor.
OVERLAP: Final = 0.5
# Impacts over which exponents are averaged, and trajectories that are searched for the orbit
# that names an attractor.
AVERAGED: Final = 20_000
NAMED: Final = 8
# Boxes reach so much beyond the fastest impact.
ROOM: Final = 1.05
EDGE: Final = BOXES // COARSER

Boxes = npt.NDArray[np.bool_]


def sketched_sets(parameters: Parameters, starts: RecordArray) -> tuple[list[BoxSet], float]:
    """
    Find the sets on which trajectories move, roughly; their pieces are not counted.

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
    rows, made = record_impacts(traced, 0, LENGTH)
    traced, rows = traced[made == LENGTH], rows[made == LENGTH]
    if not len(rows):
        return [], 1.0
    speed = ROOM * float(np.max(np.abs(rows['velocity'])))
    sets = []
    for members, boxes in _grouped([_boxes_hit(row, speed) for row in rows]):
        wide = boxes.repeat(COARSER, axis=1).repeat(COARSER, axis=2)
        named = [rows[number] for number in members[:NAMED]]
        sets.append(BoxSet(
            wide, tuple(members), 0, shortest_orbit(parameters, named),
            exponents_of(parameters, traced[members[0]], AVERAGED)))
    return sets, speed


def _boxes_hit(row: RecordArray, speed: float) -> Boxes:
    side = np.signbit(row['velocity']).astype(np.int64)
    level = np.minimum((np.abs(row['velocity']) * (EDGE / speed)).astype(np.int64), EDGE - 1)
    column = np.minimum((row['phase'] * (EDGE / TWO_PI)).astype(np.int64), EDGE - 1)
    boxes = np.zeros((2, EDGE, EDGE), np.bool_)
    boxes[side, level, column] = True
    return boxes


def _grouped(every: list[Boxes]) -> list[tuple[list[int], Boxes]]:
    groups: list[tuple[list[int], Boxes]] = []
    for number, boxes in enumerate(every):
        for members, filled in groups:
            common = np.count_nonzero(filled & boxes)
            if common > OVERLAP * min(np.count_nonzero(filled), np.count_nonzero(boxes)):
                members.append(number)
                filled |= boxes
                break
        else:
            groups.append(([number], boxes.copy()))
    return groups
