"""Periodic orbits: found in impacts, refined by Newton's method, named by their points."""

import dataclasses
import math
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from .classify import RecordArray
from .compiled import kernel
from .elementary import sine_cosine, TWO_PI
from .flight import acceleration, elapsed, is_pressed
from .lanes import IMPACT
from .model import Parameters, STICKING_SPEED
from .neighbourhood import attracted
from .recorded import record_impacts, starts_after
from .tangent import flight_matrix, impact_matrix

FloatArray: TypeAlias = npt.NDArray[np.float64]

# Newton's method: steps at the most, largest step before it is given up, and what is left of the
# residual where it ends [1].
NEWTON_STEPS: Final = 40
NEWTON_REACH: Final = 0.05
NEWTON_END: Final = 1e-11
# Points are rounded to this, so that an orbit is the same whatever trajectory it was found from.
GRAIN: Final = 2.0**-33
# Orbits nearer than this are the same [1].
SAME: Final = 1e-7
# A multiplier this near to the unit circle is not told from it.
NEUTRAL: Final = 1e-9


@dataclasses.dataclass(frozen=True)
class Orbit:
    """
    A periodic orbit that attracts.

    Attributes
    ----------
    sides : ndarray of int, shape (q,)
        Wall of every impact, 0 upper, 1 lower; the first has the least (wall, phase).
    phases, velocities : ndarray of float, shape (q,)
        Phase [rad] and velocity just before every impact [1].
    flight_times : ndarray of float, shape (q,)
        Time since the impact before [1].
    drive_periods : int
        Period in drive periods.
    multipliers : tuple of complex
        Eigenvalues of the tangent over one period; zeros where it sticks.
    sticks : int
        Wall to which it sticks for a while, 0 or 1; -1 if it does not.
    forms : ndarray of float, shape (q, 3)
        Quadratic form of (phase, velocity) at every point, at most 1 in the neighbourhood that
        the orbit attracts for certain; inf where none was tried.

    """

    sides: npt.NDArray[np.int64]
    phases: FloatArray
    velocities: FloatArray
    flight_times: FloatArray
    drive_periods: int
    multipliers: tuple[complex, complex]
    sticks: int
    forms: FloatArray

    @property
    def key(self) -> str:
        """Name of its own: impacts and drive periods of a period, and its first point."""
        return 'orbit-' + name_of(len(self.sides), self.drive_periods, int(self.sides[0]),
                                  float(self.phases[0]), float(self.velocities[0]))


def name_of(impacts: int, drive_periods: int, side: int, phase: float, velocity: float) -> str:
    """
    Name a periodic orbit.

    Parameters
    ----------
    impacts, drive_periods : int
        Its period.
    side : int
        Wall of its first impact, 0 or 1.
    phase, velocity : float
        The first impact [rad, 1].

    Returns
    -------
    str
        The name; the point is known far better than it is written.

    """
    return f'{impacts}-{drive_periods}-{"UL"[side]}{phase:.4f}{velocity:+.4f}'


@kernel
def apart(a, b):  # type: ignore[no-untyped-def]
    """
    Compare two impacts.

    Parameters
    ----------
    a, b : IMPACT record
        The impacts.

    Returns
    -------
    float
        Largest difference in phase, around the circle, and velocity [1]; inf at different walls.

    """
    if math.copysign(1.0, a.velocity) != math.copysign(1.0, b.velocity):
        return math.inf
    turn = abs(a.phase - b.phase)
    return max(min(turn, TWO_PI - turn), abs(a.velocity - b.velocity))


@kernel
def shortest_recurrence(row, longest, tolerance):  # type: ignore[no-untyped-def]
    """
    Find the smallest lag at which impacts recur until the end.

    Parameters
    ----------
    row : ndarray of IMPACT, shape (m,)
        The impacts.
    longest : int
        Longest lag; two of them must fit.
    tolerance : float
        Largest difference, also of flight times [1].

    Returns
    -------
    int
        The lag, 0 for none.

    """
    m = len(row)
    for q in range(1, min(longest, m // 2) + 1):
        cycles = row[m - 1].cycle - row[m - 1 - q].cycle
        if cycles < 1:
            continue
        k = m - 1
        while (k >= q and row[k].cycle - row[k - q].cycle - cycles <= 1
               and cycles - (row[k].cycle - row[k - q].cycle) <= 1
               and apart(row[k], row[k - q]) <= tolerance):
            k -= 1
        if k < q:
            return q
    return 0


@kernel
def first_stick(row, start, side):  # type: ignore[no-untyped-def]
    """
    Find the last two impacts that stick to a wall.

    Parameters
    ----------
    row : ndarray of IMPACT, shape (m,)
        The impacts.
    start : START record
        For the parameters.
    side : int
        The wall, 0 or 1.

    Returns
    -------
    tuple of int
        Their places in the row, -1 for none.

    """
    last = -1
    for k in range(len(row) - 1, -1, -1):
        velocity = row[k].velocity
        if (math.copysign(1.0, velocity) < 0.0) != (side == 1):
            continue
        if not abs(start.restitution * velocity) < STICKING_SPEED:
            continue
        sine, cosine = sine_cosine(row[k].phase)
        if not is_pressed(1.0 - 2.0 * side, sine, cosine, start.alpha, start.beta, start.gamma):
            continue
        if last >= 0:
            return k, last
        last = k
    return -1, last


@kernel
def section_tangents(row, start, tangents):  # type: ignore[no-untyped-def]
    """
    Tangent of the map from every impact to the next, in (phase, velocity) before the impact.

    Parameters
    ----------
    row : ndarray of IMPACT, shape (q + 1,)
        Successive impacts, none of which sticks.
    start : START record
        For the parameters.
    tangents : ndarray of float, shape (q, 2, 2)
        Receives the matrices.

    """
    alpha, beta, gamma, r = start.alpha, start.beta, start.gamma, start.restitution
    for k in range(len(tangents)):
        v = row[k].velocity
        sine, cosine = sine_cosine(row[k].phase)
        a = acceleration(sine, cosine, v, alpha, beta, gamma)
        s11, s21, s22 = impact_matrix(row[k].phase, v, -r * v, alpha, beta, gamma, r)
        d = elapsed(row[k + 1].cycle - row[k].cycle, row[k].phase, row[k + 1].phase)
        integral, decay = flight_matrix(d, beta)
        w = row[k + 1].velocity
        sine, cosine = sine_cosine(row[k + 1].phase)
        b = acceleration(sine, cosine, w, alpha, beta, gamma)
        for column in range(2):
            # A later or faster impact, seen at the time of this one ...
            ds = -v if column == 0 else 0.0
            dv = -a if column == 0 else 1.0
            dv = s21 * ds + s22 * dv
            ds = s11 * ds
            ds += integral * dv
            dv *= decay
            # ... and the change of phase and velocity at the next wall.
            tangents[k, 0, column] = -ds / w
            tangents[k, 1, column] = dv - b * ds / w


def find_orbit(parameters: Parameters, row: RecordArray, longest: int,
               tolerance: float) -> Orbit | None:
    """
    Find the stable periodic orbit that a trajectory approaches.

    Parameters
    ----------
    parameters : Parameters
        Of the trajectory.
    row : ndarray of IMPACT, shape (m,)
        Its last impacts.
    longest : int
        Longest period [impacts].
    tolerance : float
        Largest difference of recurring impacts, and of a trajectory that is on the orbit [1].

    Returns
    -------
    Orbit or None
        The orbit; None where nothing recurs, or what recurs is not stable.

    """
    start = starts_after(parameters, [0], [0.0], [0.0])[0]
    for side in (0, 1):
        first, last = first_stick(row, start, side)
        if first >= 0:
            return _sticking_orbit(row[first:last + 1], side)
    q = int(shortest_recurrence(row, longest, tolerance))
    if q == 0:
        return None
    refined = _refine(parameters, row[-1], q)
    if refined is None:
        return None
    impacts = _smallest_period(refined)
    return _stable_orbit(parameters, impacts, tolerance)


def name_near(parameters: Parameters, impact: np.void, q: int
              ) -> tuple[str, npt.NDArray[np.int64], FloatArray, FloatArray] | None:
    """
    Name the periodic orbit near an impact that recurs, whether it attracts or repels.

    Parameters
    ----------
    parameters : Parameters
        Of the trajectory.
    impact : IMPACT record
        An impact which comes back to nearly the same place.
    q : int
        After so many impacts.

    Returns
    -------
    tuple or None
        The name, and walls, phases [rad] and velocities [1] of the orbit, each of shape (q,);
        None if Newton's method does not find one, or its period is shorter than q.

    """
    row = _refine(parameters, impact, q)
    if row is None or len(_smallest_period(row)) != len(row):
        return None
    sides, phases, velocities, _ = _canonical(row)
    name = name_of(q, int(row['cycle'][-1] - row['cycle'][0]), int(sides[0]), float(phases[0]),
                   float(velocities[0]))
    return name, sides, phases, velocities


def _sticking_orbit(impacts: RecordArray, side: int) -> Orbit:
    # From one release to the next nothing differs: the orbit is what has been seen.
    q = len(impacts) - 1
    arrays = _canonical(impacts)
    return Orbit(*arrays, int(impacts['cycle'][-1] - impacts['cycle'][0]), (0j, 0j), side,
                 np.full((q, 3), np.inf))


def _refine(parameters: Parameters, impact: np.void, q: int) -> RecordArray | None:
    side = int(np.signbit(impact['velocity']))
    seed = np.array([impact['phase'], impact['velocity']], np.float64)
    x = seed.copy()
    best = math.inf
    for _ in range(NEWTON_STEPS):
        row = _one_period(parameters, side, x, q)
        if row is None:
            return None
        residual = np.array([_turn(row['phase'][-1] - row['phase'][0]),
                             row['velocity'][-1] - row['velocity'][0]])
        size = float(np.max(np.abs(residual)))
        # Until rounding keeps it from getting better.
        if size == 0.0 or (size < NEWTON_END and size >= best):
            return row
        best = min(best, size)
        matrix = _tangent_over(parameters, row) - np.eye(2)
        if not np.all(np.isfinite(matrix)) or abs(np.linalg.det(matrix)) < 1e-13:
            return None
        x = x - np.linalg.solve(matrix, residual)
        if not np.max(np.abs(x - seed)) < NEWTON_REACH:
            return None
    return row if size < NEWTON_END else None


def _one_period(parameters: Parameters, side: int, x: FloatArray, q: int) -> RecordArray | None:
    # The impact itself and the q after it.
    if math.copysign(1.0, x[1]) != (1.0, -1.0)[side]:
        return None
    rows, counts = record_impacts(starts_after(parameters, [side], x[:1], x[1:]), 0, q)
    if counts[0] < q or bool(np.signbit(rows[0, -1]['velocity'])) != bool(side):
        return None
    row = np.zeros(q + 1, IMPACT)
    row[1:] = rows[0]
    row[0] = (0, np.mod(x[0], TWO_PI), x[1])
    return row


def _tangent_over(parameters: Parameters, row: RecordArray) -> FloatArray:
    product = np.eye(2)
    for tangent in _tangents(parameters, row):
        product = tangent @ product
    return product


def _tangents(parameters: Parameters, row: RecordArray) -> FloatArray:
    tangents = np.zeros((len(row) - 1, 2, 2))
    section_tangents(row, starts_after(parameters, [0], [0.0], [0.0])[0], tangents)
    return tangents


def _smallest_period(row: RecordArray) -> RecordArray:
    q = len(row) - 1
    for p in range(1, q):
        if q % p == 0 and all(apart(row[k], row[k - p]) < SAME for k in range(p, q + 1)):
            return row[:p + 1]
    return row


def _stable_orbit(parameters: Parameters, row: RecordArray, tolerance: float) -> Orbit | None:
    q = len(row) - 1
    tangents = _tangents(parameters, row)
    periods: list[FloatArray] = []
    for k in range(q):
        product = np.eye(2)
        for j in range(q):
            product = tangents[(k + j) % q] @ product
        periods.append(product)
    multipliers = np.linalg.eigvals(periods[0])
    if not float(np.max(np.abs(multipliers))) < 1.0 - NEUTRAL:
        return None
    sides, phases, velocities, flight_times = _canonical(row)
    turned = int(np.argmin(np.abs(row['velocity'][:q] - velocities[0])
                           + np.abs(np.vectorize(_turn)(row['phase'][:q] - phases[0]))))
    orbit = Orbit(sides, phases, velocities, flight_times,
                  int(row['cycle'][-1] - row['cycle'][0]),
                  (complex(multipliers[0]), complex(multipliers[1])), -1,
                  np.full((q, 3), np.inf))
    matrices = [periods[(turned + k) % q] for k in range(q)]
    forms = attracted(parameters, orbit, matrices, tolerance)
    return None if not np.any(np.isfinite(forms)) else dataclasses.replace(orbit, forms=forms)


def _canonical(row: RecordArray) -> tuple[npt.NDArray[np.int64], FloatArray, FloatArray,
                                          FloatArray]:
    # Of impacts 0 to q, the last the same as the first, from the least (wall, phase) on.
    q = len(row) - 1
    sides = np.signbit(row['velocity'][1:]).astype(np.int64)
    phases = GRAIN * np.round(row['phase'][1:] / GRAIN)
    velocities = GRAIN * np.round(row['velocity'][1:] / GRAIN)
    times = np.array([elapsed(row['cycle'][k + 1] - row['cycle'][k], row['phase'][k],
                              row['phase'][k + 1]) for k in range(q)])
    least = min(range(q), key=lambda k: (sides[k], phases[k]))
    order = [(least + k) % q for k in range(q)]
    return sides[order], phases[order], velocities[order], times[order]


def _turn(angle: float) -> float:
    return float(angle - TWO_PI * round(angle / TWO_PI))
