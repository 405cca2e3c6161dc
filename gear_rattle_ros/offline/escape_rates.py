"""Escape rates of transients and the law by which they vanish at a crisis."""

import dataclasses
import math
from typing import Final

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

ITERATIONS: Final = 500
CONVERGED: Final = 1e-12


@dataclasses.dataclass(frozen=True)
class EscapeRate:
    """
    Rate of an exponential law, from lifetimes of which some are censored.

    Attributes
    ----------
    rate, error : float
        Per impact [1], and its standard error.
    escapes : int
        Lifetimes that were seen to end.
    at_risk : float
        Impacts made by all trajectories while the law was counted [1].

    """

    rate: float
    error: float
    escapes: int
    at_risk: float

    @property
    def mean(self) -> float:
        """Mean lifetime [impacts], inf where nothing escaped."""
        return 1.0 / self.rate if self.rate > 0.0 else math.inf

    @property
    def mean_error(self) -> float:
        """Its standard error [impacts]."""
        return self.error / self.rate**2 if self.rate > 0.0 else math.inf


def escape_rate(lifetimes: npt.ArrayLike, censored: npt.ArrayLike, skip: float) -> EscapeRate:
    """
    Estimate an escape rate: the maximum of the likelihood of an exponential law.

    Parameters
    ----------
    lifetimes : array_like
        Impacts until each trajectory escaped or was given up [1].
    censored : array_like of bool
        Which were given up.
    skip : float
        The law holds from so many impacts on; what escapes earlier says nothing [1].

    Returns
    -------
    EscapeRate
        Escapes over impacts at risk.

    """
    life = np.asarray(lifetimes, np.float64)
    given_up = np.asarray(censored, bool)
    late = life > skip
    at_risk = float(np.sum(life[late] - skip))
    escapes = int(np.count_nonzero(late & ~given_up))
    if at_risk <= 0.0:
        return EscapeRate(math.nan, math.nan, 0, 0.0)
    return EscapeRate(escapes / at_risk, math.sqrt(escapes) / at_risk, escapes, at_risk)


@dataclasses.dataclass(frozen=True)
class LifetimeLaw:
    """
    The law ``rate = C (alpha - alpha_c)^exponent``.

    Attributes
    ----------
    alpha_c, alpha_c_error : float
        Where lifetimes diverge, and its standard error [1].
    exponent, exponent_error : float
        Of the law [1]: the mean lifetime goes as ``(alpha - alpha_c)^-exponent``.
    scale : float
        C [1].
    chi_square : float
        Of the fit per degree of freedom [1]; the errors are raised by its root where above 1.

    """

    alpha_c: float
    alpha_c_error: float
    exponent: float
    exponent_error: float
    scale: float
    chi_square: float


def fit_law(alphas: npt.ArrayLike, rates: npt.ArrayLike, errors: npt.ArrayLike) -> LifetimeLaw:
    """
    Fit the law to escape rates, by least squares of their logarithms.

    Parameters
    ----------
    alphas : array_like
        Amplitudes [1], four at least, all beyond the crisis.
    rates, errors : array_like
        Escape rates [1], positive, and standard errors.

    Returns
    -------
    LifetimeLaw
        With the place of the crisis free.

    Raises
    ------
    ValueError
        If there are fewer than four rates, or no law fits.

    """
    a, k, e = (np.asarray(x, np.float64) for x in (alphas, rates, errors))
    order = np.argsort(a)
    a, k, e = a[order], k[order], e[order]
    if len(a) < 4 or not np.all(k > 0.0):
        raise ValueError(f'{np.count_nonzero(k > 0.0)} escape rates are not enough for a law with '
                         'three constants; take more amplitudes or more trajectories')
    weight = k / e
    # The distance of the first amplitude from the crisis, as a logarithm: it stays positive.
    x = np.array([0.0, 1.0, math.log(0.5 * (a[1] - a[0]))])
    damping, best = 1e-3, math.inf
    for _ in range(ITERATIONS):
        residual, slope = _law(x, a, k, weight)
        normal = slope.T @ slope
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), -slope.T @ residual)
        trial = float(np.sum(_law(x + step, a, k, weight)[0]**2))
        if math.isfinite(trial) and trial <= best * (1.0 + 1e-14):
            best, x, damping = trial, x + step, max(damping * 0.3, 1e-12)
            if np.max(np.abs(step)) < CONVERGED:
                break
        else:
            best = min(best, float(np.sum(residual**2)))
            damping *= 4.0
            if damping > 1e12:
                break
    residual, slope = _law(x, a, k, weight)
    chi = float(np.sum(residual**2)) / max(1, len(a) - 3)
    covariance = np.linalg.pinv(slope.T @ slope) * max(1.0, chi)
    first = math.exp(x[2])
    return LifetimeLaw(a[0] - first, first * math.sqrt(covariance[2, 2]), float(x[1]),
                       math.sqrt(covariance[1, 1]), math.exp(x[0]), chi)


def _law(x: FloatArray, a: FloatArray, k: FloatArray,
         weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    first = math.exp(min(float(x[2]), 50.0))
    beyond = np.log(a - a[0] + first)
    residual = (x[0] + x[1] * beyond - np.log(k)) * weight
    slope = np.stack([np.ones(len(a)), beyond, x[1] * first / (a - a[0] + first)], axis=1)
    return residual, slope * weight[:, None]
