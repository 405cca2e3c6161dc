"""Impact velocities of many trajectories counted in bins, with their largest exponents."""

import math
from typing import Final

import numpy as np

from .compiled import kernel
from .elementary import length, logarithm
from .flight import elapsed, rebound
from .lanes import advance, RUNS
from .lanes_step import LANES
from .tangent import flight_matrix, impact_matrix

# Block means of the exponent, for its error.
BLOCKS: Final = 16
# The tangent vector turns to the direction of growth over so many impacts before it is measured.
TURN_IMPACTS: Final = 64
STEPS: Final = 256
# Impacts kept at the end of each trajectory.
KEPT: Final = 256


@kernel
def is_stuck(impact, towards, tile, i):  # type: ignore[no-untyped-def]
    """
    Tell whether the mass sticks at an impact.

    Parameters
    ----------
    impact : IMPACT record
        The impact.
    towards : float
        +1 at the upper wall, -1 at the lower.
    tile : TILE record
        The tile.
    i : int
        The lane.

    Returns
    -------
    bool
        Whether it does.

    """
    return rebound(impact.velocity, towards, impact.phase, tile.alpha[i], tile.beta[i],
                   tile.gamma[i], tile.restitution[i], 0.0) == 0.0


@kernel
def fill(  # type: ignore[no-untyped-def]
        tile, impacts, skip, keep, low, high, counts, growth, times, made, last):
    """
    Follow the trajectories of a tile until they park, and count their impact velocities.

    Parameters
    ----------
    tile : TILE record
        Every lane in use has ``skip + keep`` impacts left.
    impacts : ndarray of IMPACT, shape (LANES, STEPS + 1)
        Room to work in.
    skip, keep : int
        Impacts that are passed over, then those that are counted.
    low, high : float
        Velocities between which the bins lie [1].
    counts : ndarray of uint32, shape (LANES, bins)
        Receives how many impacts fall in each bin; others are in none.
    growth : ndarray of float, shape (LANES, BLOCKS)
        Receives the growth of a tangent vector per impact, averaged over each block [1]; -inf
        where the mass sticks.
    times : ndarray of float, shape (LANES,)
        Receives the time of the counted flights [1].
    made : ndarray of int, shape (LANES,)
        Receives how many impacts each has made; fewer where it came to rest.
    last : ndarray of IMPACT, shape (LANES, KEPT)
        Receives the last ones: number n is at ``n % KEPT``.

    """
    bins = counts.shape[1]
    scale = bins / (high - low)
    block = keep // BLOCKS
    turned = max(1, skip - TURN_IMPACTS)
    vector = np.ones((LANES, 2))
    cycle = np.zeros(LANES, np.int64)
    phase = np.zeros(LANES)
    counts[:] = 0
    growth[:] = 0.0
    times[:] = 0.0
    made[:] = 0
    running = True
    while running:
        advance(tile, impacts, STEPS)
        running = False
        for i in range(LANES):
            for k in range(tile.count[i]):
                one = impacts[i, k]
                n = made[i]
                made[i] = n + 1
                last[i, n % KEPT] = one
                if n >= turned:
                    d = elapsed(one.cycle - cycle[i], phase[i], one.phase)
                    towards = math.copysign(1.0, one.velocity)
                    integral, decay = flight_matrix(d, tile.beta[i])
                    s11, s21, s22 = impact_matrix(
                        one.phase, one.velocity, -tile.restitution[i] * one.velocity,
                        tile.alpha[i], tile.beta[i], tile.gamma[i], tile.restitution[i])
                    s = vector[i, 0] + integral * vector[i, 1]
                    v = s21 * s + s22 * decay * vector[i, 1]
                    s *= s11
                    size = length(s, v)
                    rate = logarithm(size) if size > 0.0 else -math.inf
                    if is_stuck(one, towards, tile, i):
                        rate = -math.inf
                    if rate == -math.inf:
                        vector[i, 0] = 1.0
                        vector[i, 1] = 1.0
                    else:
                        vector[i, 0] = s / size
                        vector[i, 1] = v / size
                    if n >= skip:
                        times[i] += d
                        if block > 0 and n < skip + block * BLOCKS:
                            growth[i, (n - skip) // block] += rate / block
                cycle[i] = one.cycle
                phase[i] = one.phase
                if n >= skip:
                    bin_ = int(math.floor((one.velocity - low) * scale))
                    if 0 <= bin_ < bins:
                        counts[i, bin_] += 1
            if tile.left[i] > 0.0 and tile.end[i] == RUNS:
                running = True
