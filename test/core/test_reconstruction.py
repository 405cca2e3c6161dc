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

"""The motion between events against an independent integrator and against the events."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EventArray, EventKind, Parameters, State
from gear_rattle_ros.core.stream.reconstruction import drive_phases, rebuild, state_after

TWO_PI = 2.0 * math.pi


def right_side(tau: float, y: list[float], alpha: float, beta: float, gamma: float) -> list[float]:
    """Return the right side of eq. (3) as a first-order system."""
    force = -alpha * math.sin(tau) + alpha * beta * math.cos(tau) + gamma
    return [y[1], force - beta * y[1]]


def stream(parameters: Parameters, periods: int = 10, cycle: int = 0) -> EventArray:
    """Return the events of a short run."""
    simulation = Simulation(parameters, State(cycle, 0.5, -0.5, -0.7))
    return simulation.advance(cycle + periods, 0.0, 1000)


@pytest.mark.parametrize('parameters', [
    Parameters(0.48), Parameters(1.244), Parameters(0.57, 0.0, 0.0, 1.0),
    Parameters(0.6, 30.0, -2.0, 0.5),
])
def test_flights_agree_with_an_integrator(parameters: Parameters) -> None:
    """Every sampled flight solves the differential equation, to 1e-10."""
    events = stream(parameters)
    motion = rebuild(events, 0.05)
    begins = drive_phases(events)
    assert len(events) > 5
    for event, begin, end in zip(events[:-1], begins[:-1], begins[1:], strict=True):
        inside = (motion.tau > begin + 1e-9) & (motion.tau < end - 1e-9)
        if event['kind'] == EventKind.STICK or not inside.any():
            continue
        solution = solve_ivp(
            right_side, (begin, end), [event['displacement'], event['velocity_after']], 'DOP853',
            t_eval=motion.tau[inside], args=(event['alpha'], event['beta'], event['gamma']),
            rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(motion.displacement[inside], solution.y[0], atol=1e-10)
        np.testing.assert_allclose(motion.velocity[inside], solution.y[1], atol=1e-10)


@pytest.mark.parametrize('cycle', [0, 2**32 - 5])
def test_flights_end_in_the_recorded_events(cycle: int) -> None:
    """A flight rebuilt from one record ends in the state of the next, whatever kind it is."""
    simulation = Simulation(Parameters(0.5), State(cycle, 0.5, -0.5, -0.7))
    parts = [simulation.advance(cycle + 3, 1.0, 1000), simulation.retune(Parameters(1.1)),
             simulation.advance(cycle + 40, 0.0, 1000), simulation.reset(0.2, 0.0, 0.0),
             simulation.advance(cycle + 80, 0.0, 1000)]
    events = np.concatenate(parts)
    assert {int(kind) for kind in events['kind']} >= {
        EventKind.IMPACT, EventKind.RETUNE, EventKind.RESET}
    tau = drive_phases(events)
    for event, after, duration in zip(events[:-1], events[1:], np.diff(tau), strict=True):
        if after['kind'] == EventKind.RESET:
            continue
        s, v = state_after(event, duration)
        assert s == pytest.approx(after['displacement'], abs=1e-11)
        assert v == pytest.approx(after['velocity'], abs=1e-11)


def test_a_gear_that_sticks_stands_still() -> None:
    """From the record of sticking to the release, s is the wall's and s' is zero."""
    events = stream(Parameters(0.3, 0.1, 0.3, 0.3), 40)
    stuck = np.flatnonzero(events['kind'] == EventKind.STICK)
    released = [i for i in stuck if i + 1 < len(events)]
    assert released
    for i in released:
        assert events['kind'][i + 1] == EventKind.RELEASE
        motion = rebuild(events[i:i + 2], 0.1)
        assert (motion.displacement == events['displacement'][i]).all()
        assert (motion.velocity == 0.0).all()
        following = rebuild(events[i + 1:i + 3], 0.01)
        assert abs(following.velocity[1:]).min() > 0.0


def test_only_the_last_periods_are_sampled() -> None:
    """A stretch begins where it was asked to and is as fine as requested."""
    events = stream(Parameters(0.48), 30)
    whole = rebuild(events, 0.1)
    motion = rebuild(events, 0.1, 4.0)
    assert motion.tau[0] == pytest.approx(-4.0 * TWO_PI, abs=1e-12)
    assert motion.tau[-1] == pytest.approx(float(events['phase'][-1]), abs=1e-12)
    assert np.diff(motion.tau).max() <= 0.1 + 1e-9
    assert np.diff(motion.tau).min() > -1e-9
    assert len(motion.tau) < len(whole.tau)
    assert motion.displacement.max() <= 1e-12 and motion.displacement.min() >= -1.0 - 1e-12


def test_what_cannot_be_sampled() -> None:
    """One event has no motion after it, and a step must be positive."""
    events = stream(Parameters())
    assert len(rebuild(events[:1], 0.1).tau) == 0
    with pytest.raises(ValueError, match='step = 0.0 must be positive'):
        rebuild(events, 0.0)
