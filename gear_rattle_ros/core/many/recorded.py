"""Trajectories that are followed for some impacts, which are kept."""

import dataclasses

import numpy as np
import numpy.typing as npt

from .settling import STEPS
from ..arrays import IntArray, Record, RecordArray
from ..compiled import kernel
from ..flight.elementary import TWO_PI
from ..flight.lanes import (
    advance,
    EMPTY,
    IMPACT,
    is_busy,
    new_impacts,
    new_tiles,
    refill,
    release,
    START,
)
from ..flight.lanes_step import LANES
from ..model import Parameters


@kernel
def record(tile: Record, impacts: RecordArray, starts: RecordArray, skip: int, rows: RecordArray,
           counts: IntArray) -> None:
    """Follow initial conditions and keep the impacts after the first `skip`, a row each."""
    # `counts` receives how many there are: fewer than the row holds where the trajectory ends.
    most = float(skip + rows.shape[1])
    following = 0
    while True:
        following = refill(tile, starts, following, most)
        if not is_busy(tile):
            return
        advance(tile, impacts, STEPS)
        for i in range(LANES):
            number = tile.start[i]
            if number == EMPTY:
                continue
            # `left` has counted these already; a lane that has ended has none left.
            for k in range(tile.count[i]):
                place = counts[number] - skip
                if 0 <= place < rows.shape[1]:
                    rows[number, place] = impacts[i, k]
                counts[number] += 1
            if tile.left[i] <= 0.0:
                counts[number] = max(0, counts[number] - skip)
                release(tile, i)


def record_impacts(starts: RecordArray, skip: int,
                   count: int) -> tuple[RecordArray, npt.NDArray[np.int64]]:
    """Keep `count` impacts after the first `skip` of each; return them and how many there are."""
    rows = np.zeros((len(starts), count), IMPACT)
    counts = np.zeros(len(starts), np.int64)
    record(new_tiles(1)[0], new_impacts(STEPS), starts, skip, rows, counts)
    return rows, counts


def starts_after(parameters: Parameters, walls: npt.ArrayLike, phases: npt.ArrayLike,
                 velocities: npt.ArrayLike) -> RecordArray:
    """Make initial conditions just after impacts with these phases [rad] and velocities before."""
    phases = np.mod(np.asarray(phases, np.float64), TWO_PI)
    starts = np.zeros(phases.shape, START)
    starts['phase'] = np.where(phases >= TWO_PI, 0.0, phases)
    starts['displacement'] = -np.asarray(walls, np.float64)
    starts['velocity'] = -parameters.restitution * np.asarray(velocities, np.float64)
    for name, value in dataclasses.asdict(parameters).items():
        starts[name] = value
    return starts
