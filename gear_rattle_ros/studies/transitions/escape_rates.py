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

"""The law by which escape rates of transients vanish at a crisis."""

import dataclasses
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from ...core.arrays import FloatArray

ITERATIONS: Final = 500
CONVERGED: Final = 1e-12
# Parts of a jackknife, and places that it takes.
QUARTERS: Final = 4
FITTED: Final = 2 * QUARTERS


@dataclasses.dataclass(frozen=True)
class LifetimeLaw:
    """The law ``rate = scale (place - critical)^exponent``, fitted, with standard errors [1]."""

    critical: float  # place at which the rate vanishes
    critical_error: float
    exponent: float
    exponent_error: float
    scale: float
    chi_square: float  # per degree of freedom


def fit_law(places: npt.ArrayLike, rates: npt.ArrayLike, errors: npt.ArrayLike) -> LifetimeLaw:
    """Fit the law to four or more positive escape rates, by least squares of their logarithms."""
    # The rates of a fractal set oscillate about the law by some per cent, whatever the number of
    # trajectories. So the errors are the largest of those of the fit, those of a jackknife that
    # leaves out a quarter of the places at a time, and the change when only the nearer half is
    # fitted. That of the place is at least its distance from the nearest amplitude.
    given = np.array([places, rates, errors], np.float64)
    a, k, e = given[:, np.argsort(given[0])]
    if len(a) < 4 or not np.all(k > 0.0):
        raise ValueError(f'{np.count_nonzero(k > 0.0)} escape rates are not enough for a law with '
                         'three constants; take more places or more trajectories')
    law = _fit(a, k, e)
    nearest = float(a[0]) - law.critical
    if len(a) < FITTED:
        return dataclasses.replace(law, critical_error=max(law.critical_error, nearest))
    part = np.arange(len(a)) * QUARTERS // len(a)
    others = [_fit(a[part != p], k[part != p], e[part != p]) for p in range(QUARTERS)]
    half = len(a) // 2
    near = _fit(a[:half], k[:half], e[:half])
    return dataclasses.replace(
        law,
        critical_error=max(law.critical_error, _jackknife([one.critical for one in others]),
                           abs(near.critical - law.critical), nearest),
        exponent_error=max(law.exponent_error, _jackknife([one.exponent for one in others]),
                           abs(near.exponent - law.exponent)))


def fit_exponent(places: npt.ArrayLike, rates: npt.ArrayLike, errors: npt.ArrayLike,
                 critical: float) -> tuple[float, float]:
    """Fit the exponent and its jackknife error [1] where the place of the crisis is known."""
    x = np.log(np.asarray(places, np.float64) - critical)
    k, e = np.asarray(rates, np.float64), np.asarray(errors, np.float64)
    part = np.arange(len(x)) * QUARTERS // len(x)
    whole, *others = (float(np.polyfit(x[part != p], np.log(k[part != p]), 1,
                                       w=(k / e)[part != p])[0]) for p in range(-1, QUARTERS))
    return whole, _jackknife(others)


def _jackknife(values: list[float]) -> float:
    return float(math.sqrt(len(values) - 1) * np.std(values))


def _fit(a: FloatArray, k: FloatArray, e: FloatArray) -> LifetimeLaw:
    weight = k / e
    # The distance of the first amplitude from the crisis, as a logarithm: it stays positive.
    x = np.array([0.0, 1.0, math.log(0.5 * (a[1] - a[0]))])
    damping = 1e-3
    residual, slope = _law(x, a, k, weight)
    best = float(np.sum(residual**2))
    for _ in range(ITERATIONS):
        normal = slope.T @ slope
        # Rates that do not depend on the place leave the critical one undetermined.
        step = np.linalg.lstsq(normal + damping * np.diag(np.diag(normal)), -slope.T @ residual,
                               rcond=None)[0]
        trial, trial_slope = _law(x + step, a, k, weight)
        if float(np.sum(trial**2)) <= best:
            best, x, damping = float(np.sum(trial**2)), x + step, max(0.3 * damping, 1e-12)
            residual, slope = trial, trial_slope
            if np.max(np.abs(step)) < CONVERGED:
                break
        else:
            damping *= 4.0
            if damping > 1e12:
                break
    chi = best / max(1, len(a) - 3)
    covariance = np.linalg.pinv(slope.T @ slope) * max(1.0, chi)
    first = math.exp(x[2])
    return LifetimeLaw(float(a[0] - first), float(first * math.sqrt(covariance[2, 2])),
                       float(x[1]), float(math.sqrt(covariance[1, 1])), math.exp(x[0]), chi)


def _law(x: FloatArray, a: FloatArray, k: FloatArray,
         weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    first = math.exp(min(max(float(x[2]), -600.0), 50.0))
    beyond = np.log(a - a[0] + first)
    residual = (x[0] + x[1] * beyond - np.log(k)) * weight
    slope = np.stack([np.ones(len(a)), beyond, x[1] * first / (a - a[0] + first)], axis=1)
    return residual, slope * weight[:, None]
