"""Attractors matched from one alpha to the next."""

import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
# Two histograms are of one attractor where they share so much, after spreading.
ALIKE: Final = 0.15
# An attractor may be missed over so many columns (few starts may reach it).
GAP: Final = 5
# Or where nearly all of each lies within so much of the other [1].
NEARLY: Final = 0.95
REACH: Final = 0.04
# How fast velocities move with alpha, at the most; histograms are spread by so much.
DRIFT: Final = 6.0


def track(counts: npt.NDArray[Any], kinds: npt.NDArray[Any], periods: npt.NDArray[Any],
          alphas: FloatArray, velocities: FloatArray) -> npt.NDArray[np.int64]:
    """
    Give numbers to the attractors of an orbit diagram.

    Parameters
    ----------
    counts : ndarray, shape (sweep, alpha, slot, velocity)
        Impacts counted.
    kinds, periods : ndarray, shape (sweep, alpha, slot)
        What each is, -1 for nothing, and its period in impacts.
    alphas : ndarray of float, shape (alpha,)
        Amplitudes [1].
    velocities : ndarray of float, shape (velocity,)
        Centres of the bins [1].

    Returns
    -------
    ndarray of int, shape (sweep, alpha, slot)
        Numbers from 0 on, -1 for nothing; the one seen over most columns first.

    """
    sweeps, columns, slots = kinds.shape
    bin_width = float(velocities[1] - velocities[0]) if len(velocities) > 1 else math.inf
    step = float(alphas[1] - alphas[0])
    radius = max(2, math.ceil(DRIFT * step / bin_width))
    reach = max(2, round(REACH / bin_width))
    numbers = np.full(kinds.shape, -1, np.int64)
    # For each attractor the column, histogram, kind and period seen last, in each sweep.
    count = 0
    for s in range(sweeps):
        seen: dict[int, tuple[int, FloatArray, int, int]] = {}
        for c in range(columns):
            wide = {k: spread(counts[s, c, k], radius)
                    for k in range(slots) if kinds[s, c, k] >= 0}
            likeness: list[tuple[float, int, int]] = []
            for k, histogram in wide.items():
                for number, (last, theirs, kind, period) in seen.items():
                    if c - last <= GAP:
                        same = kind == kinds[s, c, k] and period == periods[s, c, k]
                        likeness.append((_alike(histogram, theirs, 0.5 * same, reach), k, number))
                # The same column of another sweep is surer than a neighbour.
                for t, j in np.argwhere(numbers[:s, c] >= 0):
                    theirs = spread(counts[t, c, j], radius)
                    likeness.append((_alike(histogram, theirs, 1.0, reach), k,
                                     int(numbers[t, c, j])))
            for alike, k, number in sorted(likeness, key=lambda one: -one[0]):
                if alike > 0.0 and numbers[s, c, k] < 0 and number not in numbers[s, c]:
                    numbers[s, c, k] = number
            for k, histogram in wide.items():
                if numbers[s, c, k] < 0:
                    numbers[s, c, k] = count
                    count += 1
                seen[int(numbers[s, c, k])] = (c, histogram, int(kinds[s, c, k]),
                                               int(periods[s, c, k]))
    return _by_length(numbers, count)


def spread(histogram: npt.NDArray[Any], radius: int) -> FloatArray:
    """
    Spread a histogram over neighbouring bins, and normalise it.

    Parameters
    ----------
    histogram : ndarray, shape (bins,)
        Counts.
    radius : int
        Over so many bins on either side.

    Returns
    -------
    ndarray of float, shape (bins,)
        Its sum is 1, or 0 where nothing was counted.

    """
    wide = np.convolve(np.asarray(histogram, np.float64), np.ones(2 * radius + 1), 'same')
    total = float(np.sum(wide))
    return wide / total if total > 0.0 else wide


def _alike(a: FloatArray, b: FloatArray, bonus: float, reach: int) -> float:
    shared = float(np.sum(np.minimum(a, b)))
    if shared > ALIKE:
        return shared + bonus
    # Where an orbit doubles its velocities part as a square root: faster than they drift.
    near = min(float(np.sum(one[spread(other, reach) > 0.0])) for one, other in ((a, b), (b, a)))
    return near - NEARLY if near > NEARLY else 0.0


def _by_length(numbers: npt.NDArray[np.int64], count: int) -> npt.NDArray[np.int64]:
    lengths = np.bincount(numbers[numbers >= 0], minlength=count)
    order = np.argsort(-lengths, kind='stable')
    renamed = np.full(count + 1, -1, np.int64)
    renamed[order] = np.arange(count)
    return renamed[numbers]
