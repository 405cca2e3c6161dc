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


"""Control laws: what they hold, how fast they catch it, and that their streams verify."""

import math

import numpy as np
import pytest

from gear_rattle_ros.core.flight.law import Acts, Law
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EventKind, Parameters, State
from gear_rattle_ros.core.orbits.control import held_multipliers, law_of
from gear_rattle_ros.core.orbits.orbit import close_orbit
from gear_rattle_ros.core.orbits.section import distances, turn
from gear_rattle_ros.core.stream.succession import Succession

P = Parameters(alpha=0.57)


def orbit_of(impacts):
    """Close an orbit of B from the last near return of a trajectory."""
    simulation = Simulation(P, State(0, 0.5, -0.3, -0.7))
    events = simulation.advance(4000, 0.0, 20_000)
    events = events[events['kind'] == EventKind.IMPACT][500:]
    x = np.column_stack([events['phase'], events['velocity']])
    apart = distances(x[:-impacts, 1], x[:-impacts, 0], x[impacts:, 1], x[impacts:, 0])
    for k in np.argsort(apart):
        found = close_orbit(np.signbit(x[k:k + impacts, 1]).astype(int), x[k:k + impacts], P)
        if found and found.impacts == impacts and not found.is_stable:
            return found
    raise AssertionError('no near return closes')


@pytest.fixture(scope='module')
def two():
    return orbit_of(2)


@pytest.fixture(scope='module')
def four():
    return orbit_of(4)


def impacts_of(events):
    return events[events['kind'] <= EventKind.STICK]


def away(events, orbit):
    """Return the distance of impacts from the nearest point of an orbit."""
    return np.min([distances(events['velocity'], events['phase'], velocity, phase)
                   for phase, velocity in orbit.points], axis=0)


@pytest.mark.parametrize('acts', [Acts.DRIVE, Acts.PULSES])
@pytest.mark.parametrize('name', ['two', 'four'])
def test_a_law_catches_its_orbit_and_the_stream_verifies(acts, name, request):
    """To 1e-12, with corrections that die out; however it is cut, every record follows."""
    orbit = request.getfixturevalue(name)
    streams = []
    for step, most in ((1, 1000), (7, 3)):
        simulation = Simulation(P, State(0, 0.5, -0.3, -0.7))
        simulation.control(law_of(orbit, acts, 0.01))
        parts = []
        for cycle in range(step, 1400, step):
            while not parts or simulation.moment < (cycle, 0.0):
                parts.append(simulation.advance(cycle, 0.0, most))
        streams.append(np.concatenate(parts))
    size = min(map(len, streams))
    events = streams[0][:size]
    assert np.array_equal(events, streams[1][:size])
    assert np.all(away(impacts_of(events)[-200:], orbit) < 1e-12)
    check = Succession()
    assert check.take(events) is None and check.kicked == np.sum(
        impacts_of(events)['velocity_after'] != -P.restitution * impacts_of(events)['velocity'])
    changes = np.abs(events['alpha'][events['kind'] == EventKind.RETUNE] - P.alpha)
    assert np.max(changes, initial=0.0) <= 0.01 and np.all(changes[-100:] < 1e-12)


@pytest.mark.parametrize('acts', [Acts.DRIVE, Acts.PULSES])
def test_held_multipliers_are_those_of_the_simulator(acts, four):
    """Against differences of the controlled simulation over one period."""
    law = law_of(four, acts, 0.1)
    deviations = []
    for change in ((1e-6, 0.0), (0.0, 1e-6)):
        phase, velocity = four.points[0] + change
        simulation = Simulation(P, State(0, phase, -float(four.walls[0]),
                                         -P.restitution * velocity))
        simulation.control(law)
        made = impacts_of(simulation.advance(10, 0.0, 100))[[0, 4]]
        point = four.points[1]
        deviations.append([(turn(one['phase'] - point[0]), one['velocity'] - point[1])
                           for one in made])
    first, second = np.transpose(deviations, (1, 2, 0))
    matrix = second @ np.linalg.inv(first)
    assert np.sort(np.abs(np.linalg.eigvals(matrix))) == pytest.approx(
        np.sort(np.abs(held_multipliers(four, law))), abs=2e-5)
    # The stable direction stays as it is.
    assert np.max(np.abs(held_multipliers(four, law))) == pytest.approx(
        np.min(np.abs(four.multipliers)), rel=1e-6)


def test_delayed_feedback_has_the_multipliers_of_its_recurrence(two):
    """Deviations once a period obey their characteristic polynomial (Cayley & Hamilton)."""
    law = law_of(two, Acts.DELAYED, 0.1)
    phase, velocity = two.points[0] + (1e-5, 0.0)
    simulation = Simulation(P, State(0, phase, -float(two.walls[0]), -P.restitution * velocity))
    simulation.control(law)
    made = impacts_of(simulation.advance(12, 0.0, 100))
    # One period passes before the law knows a velocity of the period before.
    at = turn(made['phase'][2::2] - two.points[1, 0])
    multipliers = held_multipliers(two, law)
    recurrence = np.real(np.poly(multipliers))
    left = [np.dot(recurrence, at[k:k + 5][::-1]) for k in range(1, 5)]
    assert np.max(np.abs(left)) < 1e-3 * np.max(np.abs(at)) and np.max(np.abs(multipliers)) < 1.0
    far = impacts_of(simulation.advance(400, 0.0, 2000))
    assert away(far[-1:], two)[0] < 1e-10


def test_what_cannot_be_held_is_refused(two):
    """Stable orbits, an odd number of multipliers beyond +1, bad numbers."""
    simulation = Simulation(P, State(0, 4.1609, 0.0, -0.9 * 0.6251))
    events = impacts_of(simulation.advance(300, 0.0, 2000))[-3:]
    stable = close_orbit(np.signbit(events['velocity']).astype(int), np.column_stack(
        [events['phase'], events['velocity']]), P)
    with pytest.raises(ValueError, match='is stable'):
        law_of(stable, Acts.DRIVE, 0.01)
    saddle = close_orbit(np.array([0, 1]), np.array([[5.0692, 0.8785], [1.9, -0.5]]), P, 2.0)
    assert saddle is not None and saddle.multipliers[0].real > 1.0
    with pytest.raises(ValueError, match='odd number'):
        law_of(saddle, Acts.DELAYED, 0.01)
    law = law_of(two, Acts.DRIVE, 0.01)
    assert np.array_equal(Law.of_text(law.to_text()).gains, law.gains)
    for text in ('{', '{}', '[]', '{"acts": "x"}', law.to_text().replace('0.01', '1e9')):
        with pytest.raises(ValueError):
            Law.of_text(text)


@pytest.mark.long
def test_catch_time_scales_as_ott_grebogi_and_yorke_have_it(two):
    """Over two decades of the limit: exponent 1 + ln|l_u| / (2 ln(1/|l_s|))."""
    unstable, stable = np.abs(two.multipliers)
    exponent = 1.0 + math.log(unstable) / (2.0 * math.log(1.0 / stable))
    random = np.random.default_rng(2)
    limits = np.geomspace(1e-4, 1e-2, 5)
    means = []
    free = Simulation(P, State(0, 0.5, -0.3, -0.7))
    free.advance(500, 0.0, 10_000)
    for limit in limits:
        law, times = law_of(two, Acts.DRIVE, float(limit)), []
        for _ in range(150):
            cycle = free.moment[0] + int(random.integers(20, 60))
            while free.moment[0] < cycle:
                free.advance(cycle, 0.0, 10_000)
            simulation = Simulation(P, free.state)
            simulation.control(law)
            made = 0
            while True:
                events = impacts_of(simulation.advance(simulation.moment[0] + 200, 0.0, 5000))
                outside = np.flatnonzero(away(events, two) > 1e-3)
                if not len(outside) or outside[-1] < len(events) - 60:
                    times.append(made + (outside[-1] + 1 if len(outside) else 0))
                    break
                made += len(events)
        means.append(np.mean(times))
    slope, _ = np.polyfit(np.log(limits), np.log(means), 1)
    assert -slope == pytest.approx(exponent, abs=0.12)
