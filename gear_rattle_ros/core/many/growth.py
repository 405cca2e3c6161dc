"""Finite-time exponents of many initial conditions: the growth of a small difference."""

import math
from typing import Final

import numpy as np

from .settling import STEPS as STEPS
from .velocity_counts import is_stuck
from ..arrays import FloatArray, Record, RecordArray
from ..compiled import kernel
from ..flight.closed_form import elapsed
from ..flight.elementary import length, logarithm
from ..flight.lanes import advance, EMPTY, FLOATS, is_busy, refill, release, RESTS
from ..flight.lanes_step import LANES
from ..flight.tangent import flight_matrix, impact_matrix

# A matrix is scaled back when an entry is larger or all are smaller than this or its inverse.
LARGE: Final = 1e60


@kernel
def largest_singular(a: float, b: float, c: float, d: float) -> float:
    """Return the largest singular value of a 2 x 2 matrix, given row by row."""
    return 0.5 * (length(a + d, b - c) + length(a - d, b + c))


@kernel
def grow(tile: Record, impacts: RecordArray, starts: RecordArray, count: int,
         exponents: FloatArray) -> int:
    """
    Follow initial conditions for `count` impacts with their tangent; return the impacts made.

    `exponents` receives the logarithm per impact of the product of all flight and saltation
    matrices (Ott, Chaos in Dynamical Systems, ch. 4.4): -inf where the gear sticks or comes to
    rest, nan where it floats between the walls.
    """
    product = np.zeros((LANES, 4))
    scale = np.zeros(LANES)
    cycle = np.zeros(LANES, np.int64)
    phase = np.zeros(LANES)
    following = 0
    total = 0
    while True:
        before = following
        following = refill(tile, starts, following, float(count))
        for i in range(LANES):
            if tile.start[i] >= before:
                product[i, 0] = product[i, 3] = 1.0
                product[i, 1] = product[i, 2] = scale[i] = 0.0
                cycle[i], phase[i] = 0, starts[tile.start[i]].phase
        if not is_busy(tile):
            return total
        advance(tile, impacts, STEPS)
        for i in range(LANES):
            number = tile.start[i]
            if number == EMPTY:
                continue
            total += tile.count[i]
            stuck = False
            for k in range(tile.count[i]):
                one = impacts[i, k]
                if is_stuck(one, math.copysign(1.0, one.velocity), tile, i):
                    stuck = True
                    break
                d = elapsed(one.cycle - cycle[i], phase[i], one.phase)
                cycle[i], phase[i] = one.cycle, one.phase
                integral, decay = flight_matrix(d, tile.beta[i])
                s11, s21, s22 = impact_matrix(
                    one.phase, one.velocity, -tile.restitution[i] * one.velocity, tile.alpha[i],
                    tile.beta[i], tile.gamma[i], tile.restitution[i])
                size = 0.0
                for j in range(2):
                    s = product[i, j] + integral * product[i, j + 2]
                    v = decay * product[i, j + 2]
                    product[i, j] = s11 * s
                    product[i, j + 2] = s21 * s + s22 * v
                    size += abs(product[i, j]) + abs(product[i, j + 2])
                if size > LARGE or size < 1.0 / LARGE:
                    if size == 0.0:
                        stuck = True
                        break
                    scale[i] += logarithm(size)
                    for j in range(4):
                        product[i, j] /= size
            if stuck or tile.end[i] == RESTS:
                exponents[number] = -math.inf
            elif tile.end[i] == FLOATS:
                exponents[number] = math.nan
            elif tile.left[i] > 0.0:
                continue
            else:
                exponents[number] = (scale[i] + logarithm(largest_singular(
                    product[i, 0], product[i, 1], product[i, 2], product[i, 3]))) / count
            release(tile, i)
