"""Periodic orbits, stable or not: closed by Newton's method, described, named."""

import dataclasses
import functools
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from .impact_map import shoot
from .section import distances
from ..arrays import FloatArray
from ..flight.closed_form import NO_WALL
from ..flight.elementary import TWO_PI
from ..model import Parameters

# Defects below this are rounding [1]; steps that get no smaller below it are, too.
CLOSED: Final = 1e-12
ROUNDING: Final = 1e-11
# Points nearer than this are one [rad, 1].
REPEATS: Final = 1e-7
NEWTON_STEPS: Final = 40
# A point that moves further than this has left the orbit [1].
REACH: Final = 0.5
# Impacts that nearly recur are so near to the orbit that they belong to [1].
NEAR: Final = 0.05
# A multiplier this near to the unit circle is not told from it.
NEUTRAL: Final = 1e-9

RecordArray = npt.NDArray[np.void]


@dataclasses.dataclass(frozen=True)
class Orbit:
    """
    A periodic orbit, stable or not.

    Attributes
    ----------
    parameters : Parameters
        Of the model.
    walls : ndarray of int, shape (q,)
        `Wall` of each impact in order.
    points : ndarray of float, shape (q, 2)
        Phase and velocity just before each impact [rad, 1].
    flight_times : ndarray of float, shape (q,)
        Time since the impact before [1].
    drive_periods : int
        Period [drive periods].
    multipliers : ndarray of complex, shape (2,)
        Eigenvalues of the derivative of one period [1], the larger first; zeros where it sticks.
    sticks : int
        The wall to which it sticks for a while, NO_WALL if it does not.
    forms : ndarray of float, shape (q, 3), or None
        Quadratic form of (phase, velocity) at each point, at most 1 in a neighbourhood that the
        orbit attracts for certain, inf where none is known; None where none was sought.

    """

    parameters: Parameters
    walls: npt.NDArray[np.int64]
    points: FloatArray
    flight_times: FloatArray
    drive_periods: int
    multipliers: npt.NDArray[np.complex128]
    sticks: int = NO_WALL
    forms: FloatArray | None = None

    @property
    def impacts(self) -> int:
        """Impacts in one period [1]."""
        return len(self.walls)

    @property
    def phases(self) -> FloatArray:
        """Drive phase of each impact [rad]."""
        return self.points[:, 0]

    @property
    def velocities(self) -> FloatArray:
        """Velocity just before each impact [1]."""
        return self.points[:, 1]

    @property
    def is_stable(self) -> bool:
        """Whether both multipliers lie inside the unit circle."""
        return bool(np.max(np.abs(self.multipliers)) < 1.0 - NEUTRAL)

    @property
    def exponents(self) -> tuple[float, float]:
        """Lyapunov exponents per impact [1], from the multipliers."""
        first, second = (math.log(m) / self.impacts if m > 0.0 else -math.inf
                         for m in np.abs(self.multipliers).tolist())
        return first, second

    @property
    def exact_sum(self) -> float:
        """Return the sum of the exponents, ``2 ln r - beta 2 pi p / q`` [1]; -inf if it sticks."""
        if self.sticks != NO_WALL or not self.parameters.restitution:
            return -math.inf
        return (2.0 * math.log(self.parameters.restitution)
                - self.parameters.beta * TWO_PI * self.drive_periods / self.impacts)

    @property
    def name(self) -> str:
        """Impacts and drive periods of one period, and the point of least (wall, phase)."""
        least = self._least
        phase, velocity = self.points[least]
        return (f'{self.impacts}-{self.drive_periods}-{"UL"[self.walls[least]]}{phase:.4f}'
                f'{velocity:+.4f}')

    @property
    def key(self) -> str:
        """Name as an attractor; a point is known far better than it is written."""
        return f'orbit-{self.name}'

    @property
    def _least(self) -> int:
        return min(range(self.impacts), key=lambda k: (self.walls[k], self.points[k, 0]))

    def canonical(self) -> 'Orbit':
        """Return the orbit beginning with its point of least (wall, phase)."""
        order = (self._least + np.arange(self.impacts)) % self.impacts
        return dataclasses.replace(
            self, walls=self.walls[order], points=self.points[order],
            flight_times=self.flight_times[order],
            forms=None if self.forms is None else self.forms[order])


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
    times : ndarray of float, shape (q,)
        Flight time from each impact to the next [1].

    """

    defects: FloatArray
    jacobian: FloatArray
    times: FloatArray

    @functools.cached_property
    def blocks(self) -> FloatArray:
        """Return the derivative of each impact by the one before, shape (q, 2, 2)."""
        q = len(self.times)
        blocks = np.stack([self.jacobian[2 * k:2 * k + 2, 2 * k:2 * k + 2] for k in range(q)])
        return blocks + np.eye(2) if q == 1 else blocks

    def derivative(self, first: int = 0) -> FloatArray:
        """Return the derivative of the whole round from one of its points, shape (2, 2)."""
        product = np.eye(2)
        for k in range(len(self.times)):
            product = self.blocks[(first + k) % len(self.times)] @ product
        return product


def fire(walls: npt.NDArray[np.int64], points: FloatArray, parameters: Parameters) -> Shot | None:
    """Map a closed sequence of impacts on; None where a flight sticks or ends at another wall."""
    q = len(walls)
    defects, jacobian, times = np.zeros(2 * q), np.zeros((2 * q, 2 * q + 1)), np.zeros(q)
    p = parameters
    closed = shoot(walls, points, p.alpha, p.beta, p.gamma, p.restitution, defects, jacobian,
                   times)
    return Shot(defects, jacobian, times) if closed else None


def close_orbit(walls: npt.NDArray[np.int64], points: FloatArray, parameters: Parameters,
                reach: float = REACH) -> Orbit | None:
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
    reach : float
        Farthest that a point may move [1].

    Returns
    -------
    Orbit or None
        None where there is none near.

    """
    walls = np.ascontiguousarray(walls, np.int64)
    seed = np.array(points, np.float64).reshape(len(walls), 2)
    x = seed.copy()
    at_alpha = np.zeros(2 * len(walls) + 1)
    at_alpha[-1] = 1.0
    shortest = math.inf
    for _ in range(NEWTON_STEPS):
        shot = fire(walls, x, parameters)
        if shot is None:
            return None
        try:
            change = solve_ring(shot, shot.defects, at_alpha, 0.0)[:-1]
        except np.linalg.LinAlgError:
            return None
        size = float(np.max(np.abs(change)))
        x = x - change.reshape(x.shape)
        if not np.max(np.abs(x - seed)) <= reach:
            return None
        if size < CLOSED or (size >= shortest and np.max(np.abs(shot.defects)) < ROUNDING):
            q = _least_period(walls, x)
            return orbit_at(walls[:q], x[:q], parameters)
        shortest = min(shortest, size)
    return None


def _least_period(walls: npt.NDArray[np.int64], points: FloatArray) -> int:
    # A slow approach from alternating sides looks like an orbit of twice the period.
    q = len(walls)
    for p in range(1, q):
        if q % p == 0 and np.max(distances(points[:, 1], points[:, 0], np.roll(
                points[:, 1], p), np.roll(points[:, 0], p))) < REPEATS:
            return p
    return q


def solve_ring(shot: Shot, defects: FloatArray, row: FloatArray, right: float) -> FloatArray:
    """
    Solve ``jacobian z = defects`` and ``row z = right``: changes of the points, then of alpha.

    Every impact depends on the one before alone, so all are expressed by the first: what is left
    are three equations, however long the orbit is. It raises LinAlgError where they are singular.
    """
    q = len(defects) // 2
    # Impact k is carried[k] times (first phase, first velocity, alpha, 1).
    carried = np.zeros((q + 1, 2, 4))
    carried[0, 0, 0] = carried[0, 1, 1] = 1.0
    for k in range(q):
        carried[k + 1] = shot.blocks[k] @ carried[k]
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
    """Return the orbit through points; None where they do not close in whole drive periods."""
    shot = fire(walls, points, parameters)
    if shot is None or np.max(np.abs(shot.defects)) > 1e3 * CLOSED:
        return None
    time = float(np.sum(shot.times))
    turns = round(time / TWO_PI)
    if turns < 1 or abs(time - turns * TWO_PI) > 1e-8:
        return None
    multipliers = np.linalg.eigvals(shot.derivative()).astype(np.complex128)
    multipliers = multipliers[np.argsort(-np.abs(multipliers), kind='stable')]
    x = points.copy()
    x[:, 0] = np.mod(x[:, 0], TWO_PI)
    return Orbit(parameters, walls, x, np.roll(shot.times, 1), turns, multipliers)


def close_near(parameters: Parameters, row: RecordArray) -> Orbit | None:
    """
    Close a stretch of impacts that nearly recurs to a periodic orbit.

    Parameters
    ----------
    parameters : Parameters
        Of the trajectory.
    row : ndarray of IMPACT, shape (q,)
        The impacts of about one period.

    Returns
    -------
    Orbit or None
        None where there is none within `NEAR`.

    """
    return close_orbit(np.signbit(row['velocity']).astype(np.int64),
                       np.stack([row['phase'], row['velocity']], axis=1), parameters, NEAR)


def same_orbit(a: Orbit, b: Orbit, tolerance: float) -> bool:
    """
    Whether two orbits are the same, whichever impact they begin with.

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
        points = np.roll(b.points, shift, axis=0)
        apart = distances(a.velocities, a.phases, points[:, 1], points[:, 0])
        if np.max(apart) <= tolerance:
            return True
    return False
