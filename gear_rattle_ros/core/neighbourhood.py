"""The neighbourhood of a stable orbit that one period maps into itself, found by trial."""

import math
from typing import Final, TYPE_CHECKING, TypeAlias

import numpy as np
import numpy.typing as npt

from .elementary import TWO_PI
from .model import Parameters
from .recorded import record_impacts, starts_after

if TYPE_CHECKING:
    from .periodic import Orbit

FloatArray: TypeAlias = npt.NDArray[np.float64]

# It is tried by starts on so many rays and shells, at most at so many points of an orbit, and
# halved so often.
RAYS: Final = 24
SHELLS: Final = (1.0, 0.7, 0.4)
POINTS_TRIED: Final = 8
HALVINGS: Final = 14


def attracted(parameters: Parameters, orbit: 'Orbit', matrices: list[FloatArray],
              tolerance: float) -> FloatArray:
    """
    Find by trial, at some points, an ellipse that one period takes into itself.

    Parameters
    ----------
    parameters : Parameters
        Of the model.
    orbit : Orbit
        The orbit; its own forms are not looked at.
    matrices : list of ndarray, shape (2, 2)
        Tangent of one period in (phase, velocity), from every point on.
    tolerance : float
        Farthest from the orbit that anything in the ellipse may come within a period [1].

    Returns
    -------
    ndarray of float, shape (q, 3)
        Quadratic form at every point, at most 1 in the ellipse; inf where none was found or tried.

    """
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


def _stays(parameters: Parameters, orbit: 'Orbit', k: int, offsets: FloatArray, form: FloatArray,
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
