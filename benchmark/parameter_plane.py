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

"""
A parameter plane of 200 x 200, one thread, and a plain scan of the same plane beside it.

The scan is what is usually written: numba, the closed form of the flight sampled at a fixed step
and bisected at a wall, as many impacts of as many initial conditions, the tangent carried along,
a period where the last impacts recur. It runs on cells spread over the plane and its time is that
of all; seconds are of processors. Prints rows of a Markdown table and how many cells agree.
Run: make bench, or python benchmark/parameter_plane.py
"""

import math
import time

import numba
import numpy as np

from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.core.arrays import FloatArray
from gear_rattle_ros.core.many.survey import LOOK
from gear_rattle_ros.core.path import Path
from gear_rattle_ros.studies.sweeps.parameter_plane import parameter_plane

PLANE = Path.over(alpha=(0.2, 1.8), gamma=(0.0, 0.4))
CELLS, SPREAD = 200, 20
SKIP, KEEP, INITIAL = 1000, LOOK, 4
# The scan: step, halvings, the speed below which rounding hides what chatters, what recurs, the
# longest period, and where it gives a flight up.
STEP, HALVINGS, SLOW, RECURS, LONGEST, LONGEST_FLIGHT = 0.02, 48, 1e-6, 1e-6, 128, 200.0


@numba.njit(error_model='numpy')  # type: ignore[untyped-decorator]
def fly(d, tau, s, v, alpha, beta, gamma):  # type: ignore[no-untyped-def]
    """Return displacement and velocity after a time, eqs. (4) and (5)."""
    decay, g = math.exp(-beta * d), gamma / beta
    w = v - alpha * math.cos(tau) - g
    return (s + alpha * (math.sin(tau + d) - math.sin(tau)) + g * d + (1.0 - decay) / beta * w,
            alpha * math.cos(tau + d) + w * decay + g)


@numba.njit(error_model='numpy')  # type: ignore[untyped-decorator]
def scan(tau, s, v, alpha, beta, gamma, r):  # type: ignore[no-untyped-def]
    """Follow one trajectory; return its period, 0 for none, and the exponent per impact."""
    seen = np.zeros((2 * LONGEST, 3))
    ds, dv, total = 1.0, 1.0, 0.0
    for n in range(SKIP + KEEP):
        low, high = 0.0, STEP
        while True:
            there, _ = fly(high, tau, s, v, alpha, beta, gamma)
            if not -1.0 <= there <= 0.0:
                break
            low, high = high, high + STEP
            if high > LONGEST_FLIGHT:
                return 0, -math.inf
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            there, _ = fly(middle, tau, s, v, alpha, beta, gamma)
            if -1.0 <= there <= 0.0:
                low = middle
            else:
                high = middle
        _, speed = fly(low, tau, s, v, alpha, beta, gamma)
        decay = math.exp(-beta * low)
        tau = (tau + low) % (2.0 * math.pi)
        s, v = 0.0 if speed > 0.0 else -1.0, -r * speed
        if abs(v) < SLOW:
            return 0, -math.inf
        force = gamma - alpha * math.sin(tau) + alpha * beta * math.cos(tau)
        ds += (1.0 - decay) / beta * dv
        dv *= decay
        ds, dv = -r * ds, (r * (force - beta * speed) + force - beta * v) / speed * ds - r * dv
        size = math.hypot(ds, dv)
        ds, dv = ds / size, dv / size
        if n >= SKIP:
            total += math.log(size)
        seen[n % (2 * LONGEST)] = tau, s, v
    last = (SKIP + KEEP - 1) % (2 * LONGEST)
    for q in range(1, LONGEST + 1):
        apart = 0.0
        for k in range(LONGEST):
            a, b = seen[(last - k) % (2 * LONGEST)], seen[(last - k - q) % (2 * LONGEST)]
            turned = abs(a[0] - b[0])
            apart = max(apart, min(turned, 2.0 * math.pi - turned), abs(a[1] - b[1]),
                        abs(a[2] - b[2]))
        if apart < RECURS:
            return q, total / KEEP
    return 0, total / KEEP


@numba.njit  # type: ignore[untyped-decorator]
def scan_cells(cells, initial, beta, r):  # type: ignore[no-untyped-def]
    """Scan every cell, (alpha, gamma), from every initial condition (phase, velocity)."""
    found = np.zeros((len(cells), len(initial), 2))
    for k in range(len(cells)):
        for m in range(len(initial)):
            found[k, m, 0], found[k, m, 1] = scan(
                initial[m, 0], 0.0, initial[m, 1], cells[k, 0], beta, cells[k, 1], r)
    return found


def agreement(ours, theirs: FloatArray) -> float:  # type: ignore[no-untyped-def]
    """Return the share of cells where the attractor of most of our trajectories is theirs, too."""
    same = 0
    for cell, scans in zip(ours, theirs, strict=True):
        period, exponent, error = cell
        same += any(abs(rate - exponent) < 0.05 + 8.0 * error if math.isfinite(exponent)
                    and q == period * (exponent < 0.0) else exponent == rate for q, rate in scans)
    return same / len(ours)


def main() -> None:
    """Print the rows."""
    parameters = PLANE.first
    for cells in (2, CELLS):
        before = time.process_time()
        dataset = parameter_plane(PLANE, size=(cells,), initial_conditions=INITIAL, skip=SKIP,
                                  keep=KEEP, threads=1)
        ours = time.process_time() - before
    places = np.arange(CELLS // SPREAD // 2, CELLS, CELLS // SPREAD)
    part = dataset.isel(alpha=places, gamma=places)
    drawn = Plane().draw(parameters, INITIAL, 1)
    initial = np.stack([drawn['phase'], drawn['velocity']], axis=1)
    cells = np.stack([each.ravel() for each in np.meshgrid(part['alpha'], part['gamma'])], axis=1)
    scan_cells(cells[:1], initial, parameters.beta, parameters.restitution)
    before = time.process_time()
    theirs = scan_cells(cells, initial, parameters.beta, parameters.restitution)
    scanned = (time.process_time() - before) / len(cells) * CELLS**2
    first = part.isel(slot=0)
    values = np.stack([first[name].values.ravel() for name in (
        'period_impacts', 'exponent', 'exponent_error')], axis=1)
    print('| what | seconds of one core | beside it |\n|---|---|---|')
    print(f'| parameter plane, {CELLS} x {CELLS} cells of {INITIAL} initial conditions, '
          f'{" and ".join(PLANE.varied)} | {ours:.0f} s | plain scan in numba, from {len(cells)} '
          f'cells: {scanned:.0f} s, {scanned / ours:.1f} times as long; '
          f'{agreement(values, theirs):.1%} of these cells agree |')


if __name__ == '__main__':
    main()
