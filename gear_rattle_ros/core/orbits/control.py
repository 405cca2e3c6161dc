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

"""Laws that hold an unstable orbit, and the multipliers of the orbit under them."""

import math
from typing import Final

import numpy as np

from .orbit import fire, Orbit, Shot
from ..arrays import FloatArray
from ..flight.closed_form import NO_WALL
from ..flight.law import Acts, Law

# Gains of delayed feedback that are tried, in powers of ten and of both signs.
TRIED: Final = np.concatenate([sign * np.geomspace(1e-3, 10.0, 400) for sign in (-1.0, 1.0)])


def law_of(orbit: Orbit, acts: Acts, limit: float, reach: float = 0.5) -> Law:
    """
    Make the law that holds an orbit.

    Parameters
    ----------
    orbit : Orbit
        With one multiplier outside the unit circle, which is real.
    acts : Acts
        What is changed: alpha or the velocity after impacts by the law of Ott, Grebogi & Yorke
        (1990), which puts the next impact on the stable manifold; or alpha by delayed feedback
        (Pyragas 1992), with the gain that makes the largest multiplier smallest.
    limit, reach
        Of `Law`.

    Returns
    -------
    Law
        ValueError where the orbit sticks, is stable, or cannot be held so.

    """
    shot = None if orbit.sticks != NO_WALL else fire(
        orbit.walls, orbit.points, orbit.parameters)
    if shot is None:
        raise ValueError(f'{orbit.name} sticks and cannot be held; choose another orbit')
    if orbit.is_stable:
        raise ValueError(f'{orbit.name} is stable and keeps itself; choose an unstable orbit')
    if acts is not Acts.DELAYED:
        return Law(acts, orbit.points, _projecting(orbit, shot, acts), limit, reach)
    # With an odd number of them no gain does it (Nakajima 1997).
    if np.sum((orbit.multipliers.imag == 0.0) & (orbit.multipliers.real > 1.0)) % 2:
        raise ValueError(f'{orbit.name} has an odd number of real multipliers beyond +1, and '
                         'delayed feedback cannot hold it; choose another law')
    laws = [Law(acts, orbit.points, np.tile([0.0, gain], (orbit.impacts, 1)), limit, reach)
            for gain in TRIED]
    largest = [float(np.max(np.abs(held_multipliers(orbit, law)))) for law in laws]
    best = int(np.argmin(largest))
    if largest[best] >= 1.0:
        raise ValueError(f'no gain of delayed feedback holds {orbit.name}: the largest multiplier '
                         f'is at least {largest[best]:.3f}; choose another law')
    return laws[best]


def held_multipliers(orbit: Orbit, law: Law) -> FloatArray:
    """Return the multipliers of an orbit under a law that is made for it, the larger first."""
    # Under delayed feedback the state has the velocities of the last period, too.
    shot = fire(orbit.walls, orbit.points, orbit.parameters)
    assert shot is not None
    q = orbit.impacts
    size = 2 + q * (law.acts is Acts.DELAYED)
    product = np.eye(size)
    for k in range(q):
        matrix = np.zeros((size, size))
        by_change = _by_change(orbit, shot, law.acts, k)
        matrix[:2, :2] = shot.blocks[k]
        if law.acts is Acts.DELAYED:
            # The oldest of the velocities is that of this point a period ago.
            gain = law.gains[k, 1]
            matrix[:2, 1] += gain * by_change
            matrix[:2, -1] -= gain * by_change
            matrix[2, 1] = 1.0
            matrix[3:, 2:-1] = np.eye(q - 1)
        else:
            matrix[:2, :2] -= np.outer(by_change, law.gains[k])
        product = matrix @ product
    multipliers = np.linalg.eigvals(product)
    return np.asarray(multipliers[np.argsort(-np.abs(multipliers))])


def _by_change(orbit: Orbit, shot: Shot, acts: Acts, k: int) -> FloatArray:
    """Differentiate the impact after the k-th by what the law changes."""
    if acts is Acts.PULSES:
        return np.asarray(shot.blocks[k][:, 1] / -orbit.parameters.restitution)
    return np.asarray(shot.by_parameters[2 * k:2 * k + 2, 0])


def _projecting(orbit: Orbit, shot: Shot, acts: Acts) -> FloatArray:
    """Return the gains that put the next impact on the stable manifold, to first order."""
    if orbit.parameters.restitution == 0.0 and acts is Acts.PULSES:
        raise ValueError('without restitution a pulse after the impact has no gain; change alpha')
    q, gains = orbit.impacts, np.zeros((orbit.impacts, 2))
    for k in range(q):
        # The left vector of the unstable direction at the impact that follows.
        values, vectors = np.linalg.eig(shot.derivative((k + 1) % q).T)
        most = int(np.argmax(np.abs(values)))
        if abs(values[most].imag) > 0.0 or np.min(np.abs(values)) >= 1.0:
            raise ValueError(f'{orbit.name} has no single unstable direction; choose another')
        left = np.real(vectors[:, most])
        moved = float(left @ _by_change(orbit, shot, acts, k))
        if abs(moved) < 1e-9 * math.hypot(*left):
            raise ValueError(f'impact {k} of {orbit.name} cannot be steered; choose another orbit')
        gains[k] = left @ shot.blocks[k] / moved
    return gains
