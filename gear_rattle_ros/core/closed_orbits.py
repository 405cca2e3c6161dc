"""Periodic orbits as zeros of the impact map, and their multipliers."""

import dataclasses
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from .elementary import TWO_PI
from .impact_map import shoot
from .model import Parameters

# Defects below this are rounding [1].
CLOSED: Final = 1e-12
# Points nearer than this are one [rad, 1].
REPEATS: Final = 1e-9
NEWTON_STEPS: Final = 25
# A step longer than this has left the orbit [1].
LONGEST_STEP: Final = 0.5

FloatArray = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Orbit:
    """
    A periodic orbit, stable or not.

    Attributes
    ----------
    parameters : Parameters
        The parameters.
    walls : ndarray of int, shape (q,)
        Walls of its impacts in order, as `Wall`.
    points : ndarray of float, shape (q, 2)
        Phase and velocity just before each impact [rad, 1].
    drive_periods : int
        Period [drive periods].
    multipliers : ndarray of complex, shape (2,)
        Eigenvalues of the derivative of one period [1], the larger first.

    """

    parameters: Parameters
    walls: npt.NDArray[np.int64]
    points: FloatArray
    drive_periods: int
    multipliers: npt.NDArray[np.complex128]

    @property
    def impacts(self) -> int:
        """Impacts in one period [1]."""
        return len(self.walls)

    @property
    def is_stable(self) -> bool:
        """Whether both multipliers lie inside the unit circle."""
        return bool(np.max(np.abs(self.multipliers)) < 1.0)


@dataclasses.dataclass(frozen=True)
class Shot:
    """
    One round of a closed sequence of impacts.

    Attributes
    ----------
    defects : ndarray of float, shape (2 q,)
        What is missing to a periodic orbit [rad, 1].
    jacobian : ndarray of float, shape (2 q, 2 q + 1)
        Its derivatives by the points, and in the last column by alpha.
    time : float
        Sum of the flight times [1].

    """

    defects: FloatArray
    jacobian: FloatArray
    time: float

    @property
    def derivative(self) -> FloatArray:
        """Return the derivative of the whole round, shape (2, 2)."""
        q = len(self.defects) // 2
        product = np.eye(2)
        for k in range(q):
            block = self.jacobian[2 * k:2 * k + 2, 2 * k:2 * k + 2]
            product = (block + np.eye(2) if q == 1 else block) @ product
        return product


def fire(walls: npt.NDArray[np.int64], points: FloatArray, parameters: Parameters) -> Shot | None:
    """
    Map a closed sequence of impacts on.

    Parameters
    ----------
    walls : ndarray of int, shape (q,)
        Walls in order.
    points : ndarray of float, shape (q, 2)
        Phases and velocities [rad, 1].
    parameters : Parameters
        The parameters.

    Returns
    -------
    Shot or None
        None where a flight ends at another wall, or sticks.

    """
    q = len(walls)
    defects, jacobian = np.zeros(2 * q), np.zeros((2 * q, 2 * q + 1))
    p = parameters
    time = shoot(walls, points, p.alpha, p.beta, p.gamma, p.restitution, defects, jacobian)
    return Shot(defects, jacobian, time) if time > 0.0 else None


def close_orbit(walls: npt.NDArray[np.int64], points: FloatArray,
                parameters: Parameters) -> Orbit | None:
    """
    Find a periodic orbit near a sequence of impacts, by Newton's method.

    Parameters
    ----------
    walls : ndarray of int, shape (q,)
        Walls in order.
    points : ndarray of float, shape (q, 2)
        Phases and velocities [rad, 1], near the orbit.
    parameters : Parameters
        The parameters.

    Returns
    -------
    Orbit or None
        None where there is none near.

    """
    walls = np.ascontiguousarray(walls, np.int64)
    x = np.array(points, np.float64).reshape(len(walls), 2)
    at_alpha = np.zeros(2 * len(walls) + 1)
    at_alpha[-1] = 1.0
    for _ in range(NEWTON_STEPS):
        shot = fire(walls, x, parameters)
        if shot is None:
            return None
        try:
            step = solve_ring(shot, shot.defects, at_alpha, 0.0)[:-1]
        except np.linalg.LinAlgError:
            return None
        if np.max(np.abs(step)) > LONGEST_STEP:
            return None
        x = x - step.reshape(x.shape)
        if np.max(np.abs(step)) < CLOSED:
            q = _least_period(walls, x)
            return orbit_at(walls[:q], x[:q], parameters)
    return None


def _least_period(walls: npt.NDArray[np.int64], points: FloatArray) -> int:
    # A slow approach from alternating sides looks like an orbit of twice the period.
    q = len(walls)
    for p in range(1, q):
        if q % p == 0 and np.array_equal(np.roll(walls, p), walls):
            apart = np.abs(np.roll(points, p, axis=0) - points)
            apart[:, 0] = np.abs(apart[:, 0] - TWO_PI * np.round(apart[:, 0] / TWO_PI))
            if np.max(apart) < REPEATS:
                return p
    return q


def solve_ring(shot: Shot, defects: FloatArray, row: FloatArray, right: float) -> FloatArray:
    """
    Solve ``jacobian z = defects`` with one more equation, ``row z = right``.

    Every impact depends on the one before alone, so all are expressed by the first: what is left
    are three equations, however long the orbit is.

    Parameters
    ----------
    shot : Shot
        With its derivatives.
    defects : ndarray of float, shape (2 q,)
        The right-hand side.
    row : ndarray of float, shape (2 q + 1,)
        The equation that is added.
    right : float
        Its right-hand side.

    Returns
    -------
    ndarray of float, shape (2 q + 1,)
        The solution: changes of the points, and of alpha.

    Raises
    ------
    LinAlgError
        If there is none, or more than one.

    """
    q = len(defects) // 2
    # Impact k is carried[k] times (first phase, first velocity, alpha, 1).
    carried = np.zeros((q + 1, 2, 4))
    carried[0, 0, 0] = carried[0, 1, 1] = 1.0
    for k in range(q):
        block = shot.jacobian[2 * k:2 * k + 2, 2 * k:2 * k + 2]
        carried[k + 1] = (block + np.eye(2) if q == 1 else block) @ carried[k]
        carried[k + 1, :, 2] += shot.jacobian[2 * k:2 * k + 2, -1]
        carried[k + 1, :, 3] -= defects[2 * k:2 * k + 2]
    system = np.zeros((3, 4))
    system[:2] = carried[q] - carried[0]
    system[2] = np.einsum('i,ij->j', row[:-1], carried[:q].reshape(2 * q, 4))
    system[2, 2] += row[-1]
    system[2, 3] -= right
    first = np.linalg.solve(system[:, :3], -system[:, 3])
    return np.append(carried[:q].reshape(2 * q, 4) @ np.append(first, 1.0), first[2])


def orbit_at(walls: npt.NDArray[np.int64], points: FloatArray,
             parameters: Parameters) -> Orbit | None:
    """
    Describe the periodic orbit through given points.

    Parameters
    ----------
    walls : ndarray of int, shape (q,)
        Walls in order.
    points : ndarray of float, shape (q, 2)
        Phases and velocities [rad, 1].
    parameters : Parameters
        The parameters.

    Returns
    -------
    Orbit or None
        None where they do not close to an orbit of whole drive periods.

    """
    shot = fire(walls, points, parameters)
    if shot is None or np.max(np.abs(shot.defects)) > 1e3 * CLOSED:
        return None
    turns = round(shot.time / TWO_PI)
    if turns < 1 or abs(shot.time - turns * TWO_PI) > 1e-8:
        return None
    multipliers = np.linalg.eigvals(shot.derivative).astype(np.complex128)
    multipliers = multipliers[np.argsort(-np.abs(multipliers), kind='stable')]
    x = points.copy()
    x[:, 0] = np.mod(x[:, 0], TWO_PI)
    return Orbit(parameters, walls, x, turns, multipliers)


def shortest_period(walls: npt.NDArray[np.int64], phases: FloatArray, velocities: FloatArray,
                    tolerance: float) -> int:
    """
    Find the period of a stretch of impacts.

    Parameters
    ----------
    walls : ndarray of int, shape (n,)
        Walls.
    phases, velocities : ndarray of float, shape (n,)
        Phases and velocities before the impacts [rad, 1].
    tolerance : float
        Largest distance of an impact from the one a period before [rad, 1].

    Returns
    -------
    int
        Impacts [1], at most half the stretch; 0 where nothing recurs.

    """
    for q in range(1, len(walls) // 2 + 1):
        turn = np.abs(phases[q:] - phases[:-q])
        turn = np.minimum(turn, TWO_PI - turn)
        apart = np.maximum(turn, np.abs(velocities[q:] - velocities[:-q]))
        if np.array_equal(walls[q:], walls[:-q]) and float(np.max(apart)) <= tolerance:
            return q
    return 0


def same_orbit(a: Orbit, b: Orbit, tolerance: float) -> bool:
    """
    Tell whether two orbits are the same, whichever impact they begin with.

    Parameters
    ----------
    a, b : Orbit
        The orbits.
    tolerance : float
        Largest distance of an impact [rad, 1].

    Returns
    -------
    bool
        Whether they are.

    """
    if a.impacts != b.impacts or a.drive_periods != b.drive_periods:
        return False
    for shift in range(a.impacts):
        apart = np.abs(np.roll(b.points, shift, axis=0) - a.points)
        apart[:, 0] = np.minimum(apart[:, 0], TWO_PI - apart[:, 0])
        if np.max(apart) <= tolerance and np.array_equal(np.roll(b.walls, shift), a.walls):
            return True
    return False


def exponents(orbit: Orbit) -> tuple[float, float]:
    """
    Lyapunov exponents of a periodic orbit.

    Parameters
    ----------
    orbit : Orbit
        The orbit.

    Returns
    -------
    tuple of float
        Per impact [1], from the multipliers; their sum is ``2 ln r - beta 2 pi p/q``.

    """
    moduli = np.abs(orbit.multipliers)
    rates = [math.log(float(m)) / orbit.impacts if m > 0.0 else -math.inf for m in moduli]
    return rates[0], rates[1]
