"""Impact velocities of many trajectories counted in bins, with their largest exponents."""

import dataclasses
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from .settling import RecordArray, STEPS
from ..arrays import FloatArray
from ..compiled import kernel
from ..flight.closed_form import elapsed, rebound
from ..flight.elementary import length, logarithm
from ..flight.lanes import advance, EMPTY, new_impacts, new_tiles, refill, release
from ..flight.lanes_step import LANES
from ..flight.tangent import flight_matrix, impact_matrix

# Block means of the exponent, for its error.
BLOCKS: Final = 16
# The tangent vector turns to the direction of growth over so many impacts before it is measured.
TURN_IMPACTS: Final = 64


@dataclasses.dataclass(frozen=True)
class Counted:
    """
    What some trajectories have done.

    Attributes
    ----------
    counts : ndarray of uint32, shape (n, bins)
        Impact velocities counted.
    growth : ndarray of float, shape (n, BLOCKS)
        Mean growth of a tangent vector per impact in each block [1]; -inf where the mass sticks.
    times : ndarray of float, shape (n,)
        Time of the counted flights [1].

    """

    counts: npt.NDArray[np.uint32]
    growth: FloatArray
    times: FloatArray


@kernel
def is_stuck(impact, towards, tile, i):  # type: ignore[no-untyped-def]
    """Whether the mass sticks at an impact of a lane; `towards` is +1 at the upper wall."""
    return rebound(impact.velocity, towards, impact.phase, tile.alpha[i], tile.beta[i],
                   tile.gamma[i], tile.restitution[i], 0.0) == 0.0


@kernel
def fill(  # type: ignore[no-untyped-def]
        tile, impacts, starts, skip, keep, low, high, counts, growth, times, vectors, moments,
        made):
    """
    Follow trajectories and fill in what `Counted` has, from the impact number `skip` on.

    Before that the tangent vectors turn. The rest is room to work in: tangent vectors, (cycle,
    phase) of the last impacts, and impacts made.
    """
    bins = counts.shape[1]
    scale = bins / (high - low)
    block = keep // BLOCKS
    following = 0
    while True:
        following = refill(tile, starts, following, float(skip + keep))
        busy = 0
        for i in range(LANES):
            busy += tile.start[i] != EMPTY
        if busy == 0:
            return
        advance(tile, impacts, STEPS)
        for i in range(LANES):
            t = tile.start[i]
            if t == EMPTY:
                continue
            for k in range(tile.count[i]):
                one = impacts[i, k]
                n = made[t]
                made[t] = n + 1
                d = elapsed(one.cycle - np.int64(moments[t, 0]), moments[t, 1], one.phase)
                moments[t, 0] = one.cycle
                moments[t, 1] = one.phase
                integral, decay = flight_matrix(d, tile.beta[i])
                s11, s21, s22 = impact_matrix(
                    one.phase, one.velocity, -tile.restitution[i] * one.velocity,
                    tile.alpha[i], tile.beta[i], tile.gamma[i], tile.restitution[i])
                s = vectors[t, 0] + integral * vectors[t, 1]
                v = s21 * s + s22 * decay * vectors[t, 1]
                s *= s11
                size = length(s, v)
                if size == 0.0 or is_stuck(one, math.copysign(1.0, one.velocity), tile, i):
                    rate = -math.inf
                    vectors[t] = 1.0
                else:
                    rate = logarithm(size)
                    vectors[t, 0] = s / size
                    vectors[t, 1] = v / size
                if n < skip:
                    continue
                times[t] += d
                if n < skip + block * BLOCKS:
                    growth[t, (n - skip) // block] += rate / block
                bin_ = int(math.floor((one.velocity - low) * scale))
                if 0 <= bin_ < bins:
                    counts[t, bin_] += 1
            if tile.left[i] <= 0.0:
                release(tile, i)


def count_velocities(starts: RecordArray, keep: int, low: float, high: float, bins: int
                     ) -> Counted:
    """
    Count the impact velocities of trajectories, and measure how their neighbours diverge.

    Parameters
    ----------
    starts : ndarray of START, shape (n,)
        Where they are.
    keep : int
        Impacts that are counted, at least `BLOCKS`.
    low, high : float
        Velocities between which the bins lie [1]; others are in none.
    bins : int
        How many.

    Returns
    -------
    Counted
        Trajectory by trajectory.

    """
    n = len(starts)
    counted = Counted(np.zeros((n, bins), np.uint32), np.zeros((n, BLOCKS)), np.zeros(n))
    moments = np.stack([np.zeros(n), starts['phase']], axis=1)
    fill(new_tiles(1)[0], new_impacts(STEPS), starts, TURN_IMPACTS, keep, low, high,
         counted.counts, counted.growth, counted.times, np.ones((n, 2)), moments,
         np.zeros(n, np.int64))
    return counted
