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

"""How a slow ramp of alpha delays what happens to a periodic orbit."""

from collections.abc import Iterator
import dataclasses
import math
from typing import Final, NamedTuple

import numpy as np

from .lyapunov import RunningLyapunov
from ..arrays import FloatArray
from ..flight.simulation import ramp_step, Simulation
from ..model import EventArray, EventKind, Parameters, State
from ..orbits.branches import Branch
from ..orbits.section import distances

# Drive periods whose events are looked at together, and records of one call.
BATCH: Final = 64
RECORDS: Final = 256
# A trajectory has left its branch when it is farther than this from it [rad, 1] for this number of
# impacts.
AWAY: Final = 0.02
FOR: Final = 12


class Ramp(NamedTuple):
    """Impacts of a ramp, and finite-time exponents along it."""

    alphas: FloatArray  # at each impact [1]
    points: FloatArray  # phase and velocity before it [rad, 1], shape (n, 2)
    exponent_alphas: FloatArray  # in the middle of each window [1]
    exponents: FloatArray  # over the window, per impact [1]


def ramped(parameters: Parameters, initial: State, last: float, rate: float
           ) -> Iterator[EventArray]:
    """Make the events of a ramp to an alpha, changed at the end of each drive period by a rate."""
    # As the simulator makes them, until the period in which alpha is there.
    simulation = Simulation(parameters, initial)
    alpha = parameters.alpha
    while alpha != last:
        batch = []
        for _ in range(BATCH):
            cycle, count = simulation.moment[0] + 1, RECORDS
            while count == RECORDS:
                batch.append(simulation.advance(cycle, 0.0, RECORDS))
                count = len(batch[-1])
            alpha = ramp_step(alpha, last, rate)
            batch.append(simulation.retune(dataclasses.replace(parameters, alpha=alpha)))
            if alpha == last:
                break
        yield np.concatenate(batch)


def ramp_along(parameters: Parameters, initial: State, last: float, rate: float, window: int
               ) -> Ramp:
    """Follow a ramp from the alpha of some parameters to another; see `ramped`."""
    running = RunningLyapunov(window)
    impacts: list[EventArray] = []
    alphas, exponents = [], []
    seen, due = 0, window
    for events in ramped(parameters, initial, last, rate):
        running.update(events)
        impacts.append(events[events['kind'] <= EventKind.STICK])
        seen += len(impacts[-1])
        # Windows hardly overlap; a batch may hold several, of which the last is known.
        if seen >= due:
            due = seen + window
            exponents.append(running.report.lambda_1_finite)
            alphas.append(_alpha_before(impacts, window // 2))
    made = np.concatenate(impacts)
    return Ramp(made['alpha'], np.column_stack([made['phase'], made['velocity']]),
                np.array(alphas), np.array(exponents))


def _alpha_before(impacts: list[EventArray], count: int) -> float:
    """Return alpha at an impact counted from the last."""
    for part in reversed(impacts):
        if count < len(part):
            return float(part['alpha'][-1 - count])
        count -= len(part)
    return float(impacts[0]['alpha'][0]) if len(impacts[0]) else math.nan


def departure(ramp: Ramp, branch: Branch, change: float) -> float:
    """Return how far beyond a change of its orbit a ramp leaves the branch [1]; nan if never."""
    # The orbit beyond the change, unstable or its last, is what it would go on with.
    direction = math.copysign(1.0, ramp.alphas[-1] - ramp.alphas[0])
    orbits = sorted(branch.orbits, key=lambda orbit: orbit.parameters.alpha)
    at = [orbit.parameters.alpha for orbit in orbits]
    phases = np.unwrap([orbit.phases for orbit in orbits], axis=0)
    velocities = np.array([orbit.velocities for orbit in orbits])
    beyond = direction * (ramp.alphas - change) > 0.0
    alphas, points = ramp.alphas[beyond], ramp.points[beyond]
    apart = np.min([distances(points[:, 1], points[:, 0], np.interp(alphas, at, velocity),
                              np.interp(alphas, at, phase))
                    for phase, velocity in zip(phases.T, velocities.T, strict=True)], axis=0)
    far = np.concatenate([[0], np.cumsum(apart > AWAY)])
    left = np.flatnonzero(far[FOR:] - far[:-FOR] == FOR)
    return abs(float(alphas[left[0]]) - change) if len(left) else math.nan
