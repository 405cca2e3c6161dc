"""Stable periodic orbits: found in impacts, refined, and the neighbourhood that each attracts."""

import dataclasses
import math
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from .classify import record, RecordArray, STEPS
from .compiled import kernel
from .elementary import sine_cosine, TWO_PI
from .flight import acceleration, elapsed, is_pressed
from .lanes import IMPACT, new_impacts, new_tiles, START
from .model import Parameters, STICKING_SPEED
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
# The neighbourhood is tried by starts on so many rays and shells, at most at so many points of an
# orbit, and halved so often.
RAYS: Final = 24
SHELLS: Final = (1.0, 0.7, 0.4)
POINTS_TRIED: Final = 8
HALVINGS: Final = 14


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
        wall = 'UL'[self.sides[0]]
        return (f'orbit-{len(self.sides)}-{self.drive_periods}-{wall}'
                f'{self.phases[0]:.4f}{self.velocities[0]:+.4f}')


def record_impacts(starts: RecordArray, skip: int, count: int) -> tuple[RecordArray,
                                                                        npt.NDArray[np.int64]]:
    """
    Follow starts and keep some impacts of each.

    Parameters
    ----------
    starts : ndarray of START, shape (n,)
        The starts.
    skip, count : int
        Impacts that are not kept, and those that are.

    Returns
    -------
    tuple of ndarray
        Impacts, shape (n, count), and how many there are of each start.

    """
    rows = np.zeros((len(starts), count), IMPACT)
    counts = np.zeros(len(starts), np.int64)
    record(new_tiles(1)[0], new_impacts(STEPS), starts, skip, rows, counts)
    return rows, counts


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


def starts_after(parameters: Parameters, sides: npt.ArrayLike, phases: npt.ArrayLike,
                 velocities: npt.ArrayLike) -> RecordArray:
    """
    Make starts just after impacts.

    Parameters
    ----------
    parameters : Parameters
        Of every trajectory.
    sides, phases, velocities : array_like
        Walls (0 or 1), phases [rad] and velocities just before the impacts [1].

    Returns
    -------
    ndarray of START, shape (n,)
        Their next impact is the one after.

    """
    phases = np.mod(np.asarray(phases, np.float64), TWO_PI)
    starts = np.zeros(phases.shape, START)
    starts['phase'] = np.where(phases >= TWO_PI, 0.0, phases)
    starts['displacement'] = -np.asarray(sides, np.float64)
    starts['velocity'] = -parameters.restitution * np.asarray(velocities, np.float64)
    for name, value in dataclasses.asdict(parameters).items():
        starts[name] = value
    return starts


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
    forms = _attracted(parameters, orbit, matrices, tolerance)
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


def _attracted(parameters: Parameters, orbit: Orbit, matrices: list[FloatArray],
               tolerance: float) -> FloatArray:
    """Find by trial, at some points, an ellipse that one period takes into itself."""
    q = len(orbit.sides)
    forms = np.full((q, 3), np.inf)
    angles = np.arange(RAYS) * (TWO_PI / RAYS)
    circle = np.stack([np.cos(angles), np.sin(angles)])
    disc = np.concatenate([shell * circle for shell in SHELLS], axis=1)
    for k in sorted({(j * q) // min(q, POINTS_TRIED) for j in range(min(q, POINTS_TRIED))}):
        norm = _contracted_norm(matrices[k])
        inverse = np.linalg.inv(norm)
        # The largest ellipse that fits into the tolerance.
        radius = tolerance / math.sqrt(max(inverse[0, 0], inverse[1, 1]))
        shape = np.linalg.inv(np.linalg.cholesky(norm).T)
        for _ in range(HALVINGS):
            if _stays(parameters, orbit, k, shape @ disc * radius, norm / radius**2, tolerance):
                forms[k] = np.array([norm[0, 0], norm[0, 1], norm[1, 1]]) / radius**2
                break
            radius *= 0.5
    return forms


def _contracted_norm(matrix: FloatArray) -> FloatArray:
    """Sum a quadratic form that one period makes smaller (Lyapunov's equation)."""
    largest = float(np.max(np.abs(np.linalg.eigvals(matrix))))
    scaled = matrix / (0.5 * (1.0 + largest))
    # Doubling: after n rounds 2^n terms.
    total, step = np.eye(2), scaled
    for _ in range(40):
        total = total + step.T @ total @ step
        step = step @ step
        if np.max(np.abs(step)) < 1e-12:
            break
    return 0.5 * (total + total.T)


def _stays(parameters: Parameters, orbit: Orbit, k: int, offsets: FloatArray, form: FloatArray,
           tolerance: float) -> bool:
    q = len(orbit.sides)
    phases = orbit.phases[k] + offsets[0]
    velocities = orbit.velocities[k] + offsets[1]
    if np.any(np.signbit(velocities) != bool(orbit.sides[k])):
        return False
    rows, counts = record_impacts(
        starts_after(parameters, np.full(len(phases), orbit.sides[k]), phases, velocities), 0, q)
    if np.any(counts < q):
        return False
    order = (k + 1 + np.arange(q)) % q
    turn = rows['phase'] - orbit.phases[order]
    turn = turn - TWO_PI * np.round(turn / TWO_PI)
    faster = rows['velocity'] - orbit.velocities[order]
    if np.any(np.signbit(rows['velocity']) != orbit.sides[order].astype(bool)):
        return False
    if max(float(np.max(np.abs(turn))), float(np.max(np.abs(faster)))) > tolerance:
        return False
    back = np.stack([turn[:, -1], faster[:, -1]])
    before = np.einsum('in,ij,jn->n', offsets, form, offsets)
    after = np.einsum('in,ij,jn->n', back, form, back)
    return bool(np.all(after < before))


def _turn(angle: float) -> float:
    return float(angle - TWO_PI * round(angle / TWO_PI))
