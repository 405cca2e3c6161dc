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

"""Statistics of many trajectories against an integrator that shares nothing with the flights."""

import math
from typing import Any, Final

import numba
import numpy as np
import pytest

from gear_rattle_ros.core.flight.elementary import TWO_PI
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EventArray, EventKind, Parameters, State

Array = np.ndarray[Any, Any]
TRAJECTORIES: Final = 400
# Drive periods that are left out, and the last one.
SKIPPED, LAST = 8, 24
PHASE_BINS: Final = 6
# On a pressed wall, an impact this slow is the last for the integrator.
SLOW: Final = 1e-6

# alpha, beta, gamma, restitution: far beyond the paper's, with every special value.
SETTINGS: Final = [
    (1.5, 0.0, 0.1, 1.0), (2.0, 0.0, 0.0, 0.5), (5.0, 0.02, -0.3, 0.8), (10.0, 0.0, 0.4, 0.7),
    (10.0, 1.0, -0.5, 0.95), (3.0, 0.3, 0.0, 0.2), (1.2, 0.1, 0.05, 0.0), (0.8, 0.0, -0.1, 0.6),
    (0.6, 2.0, 0.1, 0.9), (7.0, 10.0, 2.0, 0.4), (0.0, 0.0, 0.3, 1.0), (0.5, 0.1, -0.1, 0.3)]


def some_states(seed: int) -> tuple[Array, Array, Array]:
    """Return phases, displacements and velocities."""
    random = np.random.default_rng(seed)
    return (random.uniform(0.0, TWO_PI, TRAJECTORIES), -random.uniform(0.05, 0.95, TRAJECTORIES),
            random.normal(0.0, 1.0, TRAJECTORIES))


@numba.njit
def force(tau, v, alpha, beta, gamma):  # type: ignore[no-untyped-def]
    """Return the acceleration, eq. (3)."""
    return gamma - beta * v + alpha * (beta * math.cos(tau) - math.sin(tau))


@numba.njit
def runge_kutta(tau, s, v, h, alpha, beta, gamma):  # type: ignore[no-untyped-def]
    """Take one step of the fourth order."""
    k1 = force(tau, v, alpha, beta, gamma)
    v2 = v + 0.5 * h * k1
    k2 = force(tau + 0.5 * h, v2, alpha, beta, gamma)
    v3 = v + 0.5 * h * k2
    k3 = force(tau + 0.5 * h, v3, alpha, beta, gamma)
    v4 = v + h * k3
    k4 = force(tau + h, v4, alpha, beta, gamma)
    return (s + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4),
            v + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4))


@numba.njit
def integrated(states, alpha, beta, gamma, restitution):  # type: ignore[no-untyped-def]
    """Return number, phase and velocity of the impacts, by bisection of the step that crosses."""
    found = []
    longest = 0.01 / max(1.0, math.sqrt(alpha))
    for number in range(states.shape[1]):
        tau, s, v = states[:, number]
        while tau < LAST * TWO_PI:
            s1, v1 = runge_kutta(tau, s, v, longest, alpha, beta, gamma)
            if -1.0 <= s1 <= 0.0:
                tau, s, v = tau + longest, s1, v1
                continue
            wall = 0.0 if s1 > 0.0 else -1.0
            low, high = 0.0, longest
            for _ in range(45):
                middle = 0.5 * (low + high)
                s1, v1 = runge_kutta(tau, s, v, middle, alpha, beta, gamma)
                if -1.0 <= s1 <= 0.0:
                    low = middle
                else:
                    high = middle
            tau += high
            if SKIPPED * TWO_PI <= tau < LAST * TWO_PI:
                found.append((float(number), tau % TWO_PI, v1))
            s, v = wall, -restitution * v1
            towards = 1.0 if wall == 0.0 else -1.0
            if abs(v) < SLOW and restitution < 1.0:
                while (towards * force(tau, 0.0, alpha, beta, gamma) > 0.0
                       and tau < LAST * TWO_PI):
                    tau += longest
                    v = 0.0
                # Released a part of a step ago: any later, and an orbit that sticks is lost.
                low, high = 0.0, longest if v == 0.0 else 0.0
                for _ in range(45):
                    middle = 0.5 * (low + high)
                    if towards * force(tau - middle, 0.0, alpha, beta, gamma) > 0.0:
                        high = middle
                    else:
                        low = middle
                tau -= low
    return found


def simulated(parameters: Parameters, state: tuple[float, float, float]) -> EventArray:
    """Return the events of a trajectory."""
    return Simulation(parameters, State(0, *state)).advance(LAST, 0.0, 10**5)


def require_sound_flights(events: EventArray, parameters: Parameters) -> None:
    """No flight leaves the walls by eq. (4) as printed; without a drive none gains energy."""
    alpha, beta, gamma = parameters.alpha, parameters.beta, parameters.gamma
    one, two = events[:-1], events[1:]
    time = (two['cycle'].astype(float) - one['cycle']) * TWO_PI + two['phase'] - one['phase']
    d = time * np.linspace(0.01, 0.99, 33)[:, None]
    fall = d if beta == 0.0 else -np.expm1(-beta * d) / beta
    pull = gamma * (0.5 * d * d if beta == 0.0 else (d - fall) / beta)
    place = (one['displacement'] + pull + fall * (
        one['velocity_after'] - alpha * np.cos(one['phase']))
        + alpha * (np.sin(one['phase'] + d) - np.sin(one['phase'])))
    flies = one['kind'] != EventKind.STICK
    assert np.all(np.abs(place[:, flies] + 0.5) < 0.5 + 1e-11)
    if alpha == 0.0:
        energy = [0.5 * v * v - gamma * s for v, s in (
            (one['velocity_after'], one['displacement']), (two['velocity'], two['displacement']))]
        assert np.all(energy[1] < energy[0] + 1e-13)


def summaries(number: Array, phase: Array, velocity: Array) -> Array:
    """Return a row for each trajectory: impacts, of them upper, sum of speeds, phases in bins."""
    columns = [np.ones(len(number)), velocity > 0.0, np.abs(velocity)]
    columns += [np.floor(phase / TWO_PI * PHASE_BINS) == k for k in range(PHASE_BINS)]
    return np.stack([np.bincount(number, column, TRAJECTORIES) for column in columns], axis=1)


def independent(rows: Array) -> float:
    """Return how many of these trajectories are independent: many that stuck are copies."""
    copies = np.unique(rows.round(6), axis=0, return_counts=True)[1]
    return float(copies.sum()**2 / (copies**2).sum())


@pytest.mark.long
@pytest.mark.parametrize('setting', SETTINGS)
def test_means_and_histograms_equal_those_of_an_integrator(setting: tuple[float, ...]) -> None:
    """Rates of impacts, share of the walls, mean speeds and phases, within their errors."""
    states = some_states(1)
    parameters = Parameters(*setting)
    parts = []
    for number, state in enumerate(zip(*(row.tolist() for row in states), strict=True)):
        events = simulated(parameters, state)
        assert len(events) < 10**5
        require_sound_flights(events, parameters)
        # Impacts too weak for the integrator to tell from rest are left out on both sides.
        counted = events[((events['kind'] == EventKind.IMPACT)
                          | (events['kind'] == EventKind.STICK)) & (events['cycle'] >= SKIPPED)]
        parts.append(np.array([np.full(len(counted), number), counted['phase'],
                               counted['velocity']]))
    number, phase, velocity = np.concatenate(parts, axis=1)
    strong = np.abs(velocity) > 1e-2
    own = summaries(number[strong].astype(int), phase[strong], velocity[strong])
    number, phase, velocity = np.array(integrated(np.array(states), *setting)).T
    strong = np.abs(velocity) > 1e-2
    other = summaries(number[strong].astype(int), phase[strong], velocity[strong])
    difference = own.mean(0) - other.mean(0)
    error = np.sqrt(own.var(0) / independent(own) + other.var(0) / independent(other))
    assert np.all(np.abs(difference) < 4.0 * error + 0.005 * own.mean(0).max())
