"""Families of periodic orbits followed in alpha through folds, up to doublings and grazings."""

import dataclasses
import enum
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from .closed_orbits import CLOSED, fire, FloatArray, Orbit, orbit_at, solve_ring
from .model import ALPHA_MAXIMUM, Parameters

FIRST_STEP: Final = 2e-3
SHORTEST_STEP: Final = 1e-10
CORRECTIONS: Final = 10
# The corrected point may be so far from the predicted one, in steps.
STRAY: Final = 0.3


class Change(enum.Enum):
    """What happens to an orbit on its branch."""

    FOLD = 'fold'
    DOUBLING = 'doubling'
    TORUS = 'torus'
    GRAZING = 'grazing'


@dataclasses.dataclass(frozen=True)
class Turn:
    """
    A place on a branch where the orbit changes.

    Attributes
    ----------
    change : Change
        A multiplier is +1 (fold), -1 (doubling), a pair is on the unit circle (torus); or the
        orbit cannot go on, as an impact would be lost or gained (grazing).
    alpha, uncertainty : float
        Where, and how far off that can be [1].
    orbit : Orbit
        There, or the last one before.

    """

    change: Change
    alpha: float
    uncertainty: float
    orbit: Orbit


@dataclasses.dataclass(frozen=True)
class Branch:
    """
    A family of orbits.

    Attributes
    ----------
    orbits : tuple of Orbit
        In order along the branch.
    turns : tuple of Turn
        Where it changes, in order.

    """

    orbits: tuple[Orbit, ...]
    turns: tuple[Turn, ...]


@dataclasses.dataclass(frozen=True)
class _Point:
    walls: npt.NDArray[np.int64]
    x: FloatArray
    alpha: float
    parameters: Parameters

    @property
    def vector(self) -> FloatArray:
        return np.append(self.x.ravel(), self.alpha)

    def at(self, vector: FloatArray) -> '_Point | None':
        alpha = float(vector[-1])
        if not 0.0 <= alpha <= ALPHA_MAXIMUM:
            return None
        return _Point(self.walls, vector[:-1].reshape(-1, 2), alpha,
                      dataclasses.replace(self.parameters, alpha=alpha))


def follow(orbit: Orbit, direction: float, low: float, high: float, *,
           tolerance: float = 1e-9, longest: float = 0.02, most: int = 2000,
           past_doublings: bool = True) -> Branch:
    """
    Follow a periodic orbit in alpha by pseudo-arclength, through folds.

    Parameters
    ----------
    orbit : Orbit
        Where to begin.
    direction : float
        Sign of the first step in alpha.
    low, high : float
        Stop outside this range of alpha [1].
    tolerance : float
        Changes are located to this in alpha [1].
    longest : float
        Longest step [1], in all coordinates together.
    most : int
        Stop after so many orbits.
    past_doublings : bool
        Whether to go on, unstable, after a doubling or torus.

    Returns
    -------
    Branch
        The orbits and the changes.

    """
    here = _Point(orbit.walls, orbit.points, orbit.parameters.alpha, orbit.parameters)
    ahead = np.zeros(len(here.vector))
    ahead[-1] = direction
    tangent = _tangent(here, ahead)
    orbits, turns = [orbit], []
    step = min(FIRST_STEP, longest)
    while len(orbits) < most:
        reached = _correct(here, tangent, step)
        if reached is None:
            step *= 0.5
            if step < SHORTEST_STEP:
                turns.append(Turn(Change.GRAZING, here.alpha, 10.0 * SHORTEST_STEP, orbits[-1]))
                break
            continue
        found = _orbit(reached)
        if found is None:
            break
        for change in _changes(orbits[-1], found):
            turns.append(_locate(change, here, tangent, step, tolerance))
        orbits.append(found)
        tangent = _tangent(reached, tangent)
        here = reached
        step = min(1.4 * step, longest)
        if not low <= here.alpha <= high:
            break
        if not past_doublings and turns and turns[-1].change in (Change.DOUBLING, Change.TORUS):
            break
    return Branch(tuple(orbits), tuple(turns))


def _tangent(point: _Point, ahead: FloatArray) -> FloatArray:
    shot = fire(point.walls, point.x, point.parameters)
    assert shot is not None
    try:
        tangent = solve_ring(shot, np.zeros(len(ahead) - 1), ahead, 1.0)
    except np.linalg.LinAlgError:
        # The first direction may lie across the branch.
        tangent = np.linalg.svd(shot.jacobian)[2][-1]
        tangent = tangent if tangent @ ahead >= 0.0 else -tangent
    return np.asarray(tangent / np.linalg.norm(tangent))


def _correct(point: _Point, tangent: FloatArray, step: float) -> _Point | None:
    # Back to the branch at right angles to the step; regular at a fold too (Keller 1977).
    predicted = point.vector + step * tangent
    vector = predicted
    for _ in range(CORRECTIONS):
        moved = point.at(vector)
        shot = None if moved is None else fire(moved.walls, moved.x, moved.parameters)
        if shot is None:
            return None
        try:
            change = solve_ring(shot, shot.defects, tangent, 0.0)
        except np.linalg.LinAlgError:
            return None
        vector = vector - change
        if np.max(np.abs(vector - predicted)) > STRAY * step + 1e3 * CLOSED:
            return None
        if np.max(np.abs(change)) < CLOSED:
            return point.at(vector)
    return None


def _orbit(point: _Point) -> Orbit | None:
    return orbit_at(point.walls, point.x, point.parameters)


def _test(orbit: Orbit, change: Change) -> float:
    # Zero where a multiplier is +1 or -1, or where the product of a complex pair is 1.
    first, second = orbit.multipliers
    if change is Change.TORUS:
        return float((first * second).real) - 1.0
    sign = 1.0 if change is Change.FOLD else -1.0
    return float(((sign - first) * (sign - second)).real)


def _changes(before: Orbit, after: Orbit) -> list[Change]:
    found = [change for change in (Change.FOLD, Change.DOUBLING)
             if _test(before, change) * _test(after, change) < 0.0]
    if (_test(before, Change.TORUS) * _test(after, Change.TORUS) < 0.0
            and abs(after.multipliers[0].imag) > 0.0):
        found.append(Change.TORUS)
    return found


def _locate(change: Change, here: _Point, tangent: FloatArray, step: float,
            tolerance: float) -> Turn:
    # Bisection in the length of the step: alpha itself turns round at a fold.
    low, high = 0.0, step
    lower = _orbit(here)
    assert lower is not None
    at_low = _test(lower, change)
    middle = upper = lower
    while True:
        half = 0.5 * (low + high)
        reached = _correct(here, tangent, half)
        found = None if reached is None else _orbit(reached)
        if found is None:
            break
        middle = found
        if _test(middle, change) * at_low > 0.0:
            low, lower = half, middle
        else:
            high, upper = half, middle
        if high - low < 1e-2 * tolerance or half in (low, high) and high - low < 1e-15:
            break
    spread = max(abs(lower.parameters.alpha - middle.parameters.alpha),
                 abs(upper.parameters.alpha - middle.parameters.alpha), math.ulp(1.0))
    return Turn(change, middle.parameters.alpha, max(spread, tolerance), middle)
