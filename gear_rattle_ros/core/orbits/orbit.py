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

"""Periodic orbits, stable or not: closed by Newton's method, described, named."""

import dataclasses
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from .impact_map import close_ring, CLOSED, shoot
from .section import distance, distances
from ..arrays import FloatArray, IntArray, RecordArray
from ..compiled import kernel
from ..flight.closed_form import NO_WALL
from ..flight.elementary import TWO_PI
from ..model import Parameters

# Points nearer than this are one [rad, 1].
REPEATS: Final = 1e-7
# A point that moves further than this has left the orbit [1].
REACH: Final = 0.5
# Impacts that nearly recur lie this near to their orbit [1].
NEAR: Final = 0.05
# A multiplier this near to the unit circle counts as on it.
NEUTRAL: Final = 1e-9


@dataclasses.dataclass(frozen=True)
class Orbit:
    """A periodic orbit of q impacts, stable or not."""

    parameters: Parameters
    walls: npt.NDArray[np.int64]  # `Wall` of each impact in order
    points: FloatArray  # phase and velocity just before each impact [rad, 1], shape (q, 2)
    flight_times: FloatArray  # since the impact before [1]
    drive_periods: int
    multipliers: npt.NDArray[np.complex128]  # of one period, the larger first; zeros if it sticks
    sticks: int = NO_WALL  # the wall to which it sticks for a while
    # At each point, a quadratic form of (phase, velocity) that is at most 1 in a neighbourhood
    # which the orbit certainly attracts, inf where none is known, shape (q, 3); None: not sought.
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
    """One round of a closed sequence of q impacts."""

    defects: FloatArray  # how far it is from closing [rad, 1], shape (q, 2)
    # Derivatives of each impact by phase and velocity of the one before, and by alpha, beta,
    # gamma, restitution, shape (q, 2, 6).
    slopes: FloatArray
    times: FloatArray  # flight time from each impact to the next [1]

    @property
    def blocks(self) -> FloatArray:
        """Return the derivative of each impact by the one before, shape (q, 2, 2)."""
        return self.slopes[:, :, :2]

    @property
    def by_parameters(self) -> FloatArray:
        """Return the derivatives by alpha, beta, gamma, restitution, shape (2 q, 4)."""
        return self.slopes[:, :, 2:].reshape(-1, 4)

    @property
    def jacobian(self) -> FloatArray:
        """Return the derivatives of all defects by the points, shape (2 q, 2 q)."""
        q = len(self.times)
        k, whole = np.arange(q), np.zeros((q, 2, q, 2))
        whole[k, :, k] = self.blocks
        whole[k, :, (k + 1) % q] -= np.eye(2)
        return whole.reshape(2 * q, 2 * q)

    def derivative(self, first: int = 0) -> FloatArray:
        """Return the derivative of the whole round from one of its points, shape (2, 2)."""
        product = np.eye(2)
        for k in range(len(self.times)):
            product = self.blocks[(first + k) % len(self.times)] @ product
        return product


def fire(walls: npt.NDArray[np.int64], points: FloatArray, parameters: Parameters) -> Shot | None:
    """Map a closed sequence of impacts on; None where a flight sticks or ends at another wall."""
    closed, defects, slopes, times = shoot(walls, points, parameters.model, True)
    return Shot(defects, slopes, times) if closed else None


def close_orbit(walls: npt.NDArray[np.int64], points: FloatArray, parameters: Parameters,
                reach: float = REACH) -> Orbit | None:
    """Find a periodic orbit near impacts (phase, velocity) by Newton's method."""
    # None where there is none, or a point would have to move farther than `reach` [1].
    walls = np.ascontiguousarray(walls, np.int64)
    x = np.array(points, np.float64).reshape(len(walls), 2)
    if not close_ring(walls, x, reach, parameters.model):
        return None
    q = least_period(walls, x)
    return orbit_at(walls[:q], x[:q], parameters)


@kernel
def least_period(walls: IntArray, points: FloatArray) -> int:
    """Return after how many of its points a closed sequence repeats."""
    # A slow approach from alternating sides looks like an orbit of twice the period.
    q = len(walls)
    for p in range(1, q):
        same = q % p == 0
        for k in range(q if same else 0):
            n = (k + p) % q
            same = same and distance(
                points[k, 1], points[k, 0], points[n, 1], points[n, 0]) < REPEATS
        if same:
            return p
    return q


def solve_ring(shot: Shot, direction: FloatArray, defects: FloatArray, row: FloatArray,
               right: float) -> FloatArray:
    """Solve for changes z of the points and of the place on a path: defects, ``row z = right``."""
    # The path goes through the parameters in a direction, the last column of the Jacobian.
    # Each impact depends on the one before alone, so all are expressed by the first, which leaves
    # three equations however long the orbit is. Raises LinAlgError where they are singular.
    q, defects = len(shot.times), defects.reshape(-1, 2)
    # Impact k is carried[k] times (first phase, first velocity, place, 1).
    carried = np.zeros((q + 1, 2, 4))
    carried[0, 0, 0] = carried[0, 1, 1] = 1.0
    along = shot.by_parameters @ direction
    for k in range(q):
        carried[k + 1] = shot.blocks[k] @ carried[k]
        carried[k + 1, :, 2] += along[2 * k:2 * k + 2]
        carried[k + 1, :, 3] -= defects[k]
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
    # Of a large and a tiny one the matrix alone would lose the tiny one; their product is exact.
    half = 0.5 * float(np.trace(shot.derivative()))
    product = (parameters.restitution**(2 * len(walls))
               * math.exp(-parameters.beta * TWO_PI * turns))
    inside = half * half - product
    first = (complex(half, math.sqrt(-inside)) if inside < 0.0
             else half + math.copysign(math.sqrt(inside), half))
    second = first.conjugate() if inside < 0.0 else product / first if first else 0.0
    x = points.copy()
    x[:, 0] = np.mod(x[:, 0], TWO_PI)
    return Orbit(parameters, walls, x, np.roll(shot.times, 1), turns,
                 np.array([first, second], np.complex128))


def close_near(parameters: Parameters, row: RecordArray, reach: float = NEAR) -> Orbit | None:
    """Close a row of IMPACT, about one period, to an orbit, as `close_orbit` does."""
    return close_orbit(np.signbit(row['velocity']).astype(np.int64),
                       np.stack([row['phase'], row['velocity']], axis=1), parameters, reach)


def same_orbit(a: Orbit, b: Orbit, tolerance: float) -> bool:
    """Whether two orbits agree to a tolerance [rad, 1], whichever impact they begin with."""
    if a.impacts != b.impacts or a.drive_periods != b.drive_periods:
        return False
    for shift in range(a.impacts):
        points = np.roll(b.points, shift, axis=0)
        apart = distances(a.velocities, a.phases, points[:, 1], points[:, 0])
        if np.max(apart) <= tolerance:
            return True
    return False
