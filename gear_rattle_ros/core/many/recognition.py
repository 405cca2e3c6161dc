"""Stable periodic orbits recognised in the impacts of a trajectory."""

import dataclasses
import math

import numpy as np

from .neighbourhood import attracted
from ..arrays import RecordArray
from ..compiled import kernel
from ..flight.closed_form import elapsed, is_pressed
from ..flight.elementary import sine_cosine
from ..model import Parameters, STICKING_SPEED, Wall
from ..orbits.orbit import close_near, Orbit
from ..orbits.section import shortest_recurrence


@kernel
def last_sticks(row: RecordArray, restitution: float, alpha: float, beta: float, gamma: float,
                wall: int) -> tuple[int, int]:
    """Return the places of the last two impacts that stick to a wall, -1 for none."""
    last = -1
    for k in range(len(row) - 1, -1, -1):
        velocity = row[k].velocity
        if (math.copysign(1.0, velocity) < 0.0) != (wall == 1):
            continue
        if not abs(restitution * velocity) < STICKING_SPEED:
            continue
        sine, cosine = sine_cosine(row[k].phase)
        if not is_pressed(1.0 - 2.0 * wall, sine, cosine, alpha, beta, gamma):
            continue
        if last >= 0:
            return k, last
        last = k
    return -1, last


def find_orbit(parameters: Parameters, row: RecordArray, longest: int,
               tolerance: float) -> Orbit | None:
    """
    Find the stable periodic orbit that a row of IMPACT approaches, in canonical order.

    Its period is at most `longest` impacts unless it sticks; None where nothing recurs within the
    tolerance [1], or what recurs is unstable.
    """
    p = parameters
    for wall in Wall:
        first, last = last_sticks(row, p.restitution, p.alpha, p.beta, p.gamma, int(wall))
        if first >= 0:
            # From one release to the next nothing differs: the orbit is what has been seen.
            return _observed(parameters, row[first:last + 1], wall).canonical()
    q = int(shortest_recurrence(row, longest, tolerance))
    orbit = close_near(parameters, row[len(row) - q:]) if q else None
    if orbit is None or not orbit.is_stable:
        return None
    return with_neighbourhood(orbit, tolerance)


def with_neighbourhood(orbit: Orbit, tolerance: float) -> Orbit | None:
    """Put a stable orbit in its order, and find what it attracts; None where that is too small."""
    orbit = orbit.canonical()
    forms = attracted(orbit, tolerance)
    return dataclasses.replace(orbit, forms=forms) if np.any(np.isfinite(forms)) else None


def _observed(parameters: Parameters, row: RecordArray, sticks: Wall) -> Orbit:
    q = len(row) - 1
    times = [elapsed(row['cycle'][k + 1] - row['cycle'][k], row['phase'][k], row['phase'][k + 1])
             for k in range(q)]
    return Orbit(parameters, np.signbit(row['velocity'][1:]).astype(np.int64),
                 np.stack([row['phase'][1:], row['velocity'][1:]], axis=1), np.array(times),
                 int(row['cycle'][-1] - row['cycle'][0]), np.zeros(2, np.complex128), int(sticks))
