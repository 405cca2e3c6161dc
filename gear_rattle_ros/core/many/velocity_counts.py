"""Impact velocities of many trajectories counted in bins, with their largest exponents."""

import dataclasses
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from .settling import STEPS
from ..arrays import FloatArray, IntArray, Record, RecordArray
from ..compiled import kernel
from ..flight.closed_form import elapsed, rebound
from ..flight.elementary import length, logarithm
from ..flight.lanes import advance, EMPTY, is_busy, new_impacts, new_tiles, refill, release
from ..flight.lanes_step import LANES
from ..flight.tangent import flight_matrix, impact_matrix

# Block means of the exponent, for its error.
BLOCKS: Final = 16
# Impacts over which the tangent vector turns to the direction of growth, before it is measured.
TURN_IMPACTS: Final = 64


@dataclasses.dataclass(frozen=True)
class Counted:
    """Impact velocities counted and exponents measured, a row for each trajectory."""

    counts: npt.NDArray[np.uint32]  # shape (n, bins)
    growth: FloatArray  # mean per impact in each of BLOCKS blocks [1]; -inf where the gear sticks
    times: FloatArray  # total time of the counted flights [1]


@kernel
def is_stuck(impact: Record, towards: float, tile: Record, i: int) -> bool:
    """Whether the gear sticks at an impact of a lane; `towards` is +1 at the upper wall."""
    return rebound(impact.velocity, towards, impact.phase, tile.alpha[i], tile.beta[i],
                   tile.gamma[i], tile.restitution[i], 0.0) == 0.0


@kernel
def fill(tile: Record, impacts: RecordArray, starts: RecordArray, skip: int, keep: int, low: float,
         high: float, counts: npt.NDArray[np.uint32], growth: FloatArray, times: FloatArray,
         vectors: FloatArray, moments: FloatArray, made: IntArray) -> None:
    """Follow trajectories and fill in the fields of `Counted` from impact `skip` on."""
    # The rest is working memory: tangent vectors, (cycle, phase) of the last impacts, impacts
    # made.
    bins = counts.shape[1]
    scale = bins / (high - low)
    block = keep // BLOCKS
    following = 0
    while True:
        following = refill(tile, starts, following, float(skip + keep))
        if not is_busy(tile):
            return
        advance(tile, impacts, STEPS)
        for i in range(LANES):
            t = tile.start[i]
            if t == EMPTY:
                continue
            for k in range(tile.count[i]):
                one = impacts[i, k]
                n, made[t] = made[t], made[t] + 1
                d = elapsed(one.cycle - np.int64(moments[t, 0]), moments[t, 1], one.phase)
                moments[t, 0], moments[t, 1] = one.cycle, one.phase
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
                    vectors[t, 0], vectors[t, 1] = s / size, v / size
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
    """Count `keep` >= BLOCKS impact velocities of each trajectory in bins over [low, high]."""
    n = len(starts)
    counted = Counted(np.zeros((n, bins), np.uint32), np.zeros((n, BLOCKS)), np.zeros(n))
    moments = np.stack([np.zeros(n), starts['phase']], axis=1)
    fill(new_tiles(1)[0], new_impacts(STEPS), starts, TURN_IMPACTS, keep, low, high,
         counted.counts, counted.growth, counted.times, np.ones((n, 2)), moments,
         np.zeros(n, np.int64))
    return counted
