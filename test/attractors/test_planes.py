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

"""Planes of initial conditions: one state, one label; public scripts integrated by scipy."""

from collections.abc import Callable
import dataclasses
import functools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gear_rattle_ros.attractors.catalogue import Catalogue
from gear_rattle_ros.attractors.finding import find_attractors
from gear_rattle_ros.attractors.plane import Plane, PLANES
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EventKind, Parameters, State

P = Parameters(0.48)
# Errors of rounding do not grow to the size of the basins within so many impacts.
SHORT = 60
ACCURATE = {'method': 'DOP853', 'rtol': 1e-12, 'atol': 1e-13}


@functools.cache
def known() -> Catalogue:
    return find_attractors(P, Plane().draw(P, 300, 1), hold=20_000)


def labels(plane: Plane, across: float, velocity: float) -> tuple[int, int]:
    """Return label and lifetime of a point of a plane."""
    (result,) = known().label(plane.at(P, [across], [velocity]))
    return int(result['label']), int(result['lifetime'])


def flight(acceleration: Callable[[float, float], float], walls: tuple[float, float], time: float,
           place: float, velocity: float, end: float) -> tuple[float, float, float]:
    """Integrate from one impact to the next, or to the end: time, place, velocity."""
    events = [lambda t, y, wall=wall: y[0] - wall for wall in walls]
    for event, direction in zip(events, (-1.0, 1.0), strict=True):
        event.terminal, event.direction = True, direction
    found = solve_ivp(lambda t, y: (y[1], acceleration(t, y[1])), (time, end), (place, velocity),
                      events=events, **ACCURATE)
    place = next((wall for wall, times in zip(walls, found.t_events, strict=True) if len(times)),
                 found.y[0, -1])
    return found.t[-1], place, found.y[1, -1]


def script(time: float, velocity: float) -> float:
    """Return the acceleration as gear_rattle_souza.jl of BasinsCollection has it."""
    return (-P.beta * velocity + P.gamma - P.alpha * P.beta * math.cos(time)
            + P.alpha * math.sin(time))


def test_the_same_state_has_the_same_label_on_every_plane() -> None:
    """A trajectory from the strobe, where it crosses a displacement, and at its next impact."""
    strobe, section, before = (Plane(phase=2.0, kind='strobe'), Plane(kind='section'),
                               Plane(kind='impact'))
    random, compared = np.random.default_rng(7), np.zeros(2, int)
    while min(compared) < 12:
        s, v = random.uniform((-1.0, -2.0), (0.0, 2.0))
        label, lifetime = labels(strobe, s, v)
        if not 1 < lifetime < SHORT:
            continue
        events = Simulation(P, State(0, 2.0, s, v)).advance(10, 0.0, 2)
        impact = events[events['kind'] == EventKind.IMPACT][0]
        assert labels(before, impact['phase'], impact['velocity']) == (label, lifetime)
        # Just after it the first impact is over.
        assert labels(section, impact['phase'], impact['velocity_after']) == (
            label, lifetime - 1)
        wall = Plane(displacement=impact['displacement'])
        assert labels(wall, impact['phase'], impact['velocity']) == (label, lifetime)
        compared[0] += 1
        # On the way there it crosses the middle, or has done so.
        if (s + 0.5) * (impact['displacement'] + 0.5) < 0.0:
            time, middle, velocity = flight(
                lambda t, y: script(t - math.pi, y), (-0.5, -0.5), 2.0, s, v, 20.0)
            assert labels(Plane(displacement=middle), time, velocity) == (label, lifetime)
            compared[1] += 1


def test_impacts_lie_on_the_section_and_on_their_wall() -> None:
    walls = np.array([0, 1, 1])
    for plane, expected in (*((Plane(kind=kind), [True] * 3) for kind in ('section', 'impact')),
                            (Plane(), [True, False, False]),
                            (Plane(displacement=-1.0), [False, True, True]),
                            (Plane(displacement=-0.5), [False] * 3),
                            (Plane(kind='strobe'), [False] * 3)):
        assert plane.holds(walls).tolist() == expected
    for kind, places in (('section', [-1.0, 0.0, 0.0]), ('impact', [0.0, -1.0, 0.0])):
        initial = Plane(kind=kind).at(P, [0.0, 0.0, 0.0], [1.0, -1.0, 0.0])
        assert initial['displacement'].tolist() == places


def attractor(time: float, s: float, v: float, settled: int) -> int:
    """Return the impacts in a period of the orbit on which the script's equation settles."""
    impacts = np.zeros((settled + 12, 2))
    for n in range(len(impacts)):
        time, s, v = flight(script, (-1.0, 0.0), time, s, v, time + 100.0)
        impacts[n], v = (time % (2.0 * math.pi), v), -0.9 * v
    last = impacts[settled:]
    return next(q for q in range(1, 7) if np.abs(last[q:] - last[:-q]).max() < 0.02)


@pytest.mark.long
def test_the_picture_of_the_public_script_has_the_labels_of_scipy() -> None:
    """Cells of its window, drive and grid: e = -alpha sin, so that its phase is less by pi."""
    plane = Plane((-0.99, -0.02), math.pi, (-1.0, 1.0), 1200, 1200, 'strobe')
    periods = {each.label: each.impacts for each in known().attractors}
    assert sorted(periods.values()) == [2, 3]
    random, seen = np.random.default_rng(4), []
    while len(seen) < 36:
        row, column = random.integers(1, 1199, 2)
        around = known().label(plane.cells(P, slice(row - 1, row + 2), slice(column - 1,
                                                                             column + 2)))
        one = around[4]
        if np.ptp(around['label']) or one['lifetime'] > SHORT or one['stick'] >= 0:
            continue
        s, v = plane.across_values()[column], plane.velocity_values()[row]
        seen.append(attractor(0.0, s, v, int(one['lifetime']) + 10))
        assert seen[-1] == periods[int(one['label'])]
    assert {2, 3} == set(seen)


@pytest.mark.parametrize(('backlash', 'damping', 'eccentricity'), [
    (0.6, 0.6, 0.1), (0.1, 0.6, 0.15)])
def test_the_gear_of_mason_and_others_is_this_one(backlash, damping, eccentricity) -> None:
    """Their equation between rigid walls at -b and b: phase later by pi/2, and scaled."""
    def acceleration(t: float, v: float) -> float:
        turn = 2.0 * math.pi
        return (-damping * v + 2.0 * turn * damping - turn**2 * eccentricity * math.cos(turn * t)
                - turn * eccentricity * damping * math.sin(turn * t))

    parameters = Parameters(eccentricity / (2.0 * backlash), damping / (2.0 * math.pi),
                            damping / (2.0 * math.pi * backlash), 0.9)
    (initial,) = Plane(phase=math.pi / 2.0, kind='strobe').at(parameters, [-0.3], [1.1])
    events = Simulation(parameters, State(
        0, initial['phase'], initial['displacement'], initial['velocity'])).advance(100, 0.0, 13)
    impacts = events[events['kind'] == EventKind.IMPACT][:12]
    time, x, v = 0.0, backlash * (2.0 * -0.3 + 1.0), 4.0 * math.pi * backlash * 1.1
    for impact in impacts:
        time, x, v = flight(acceleration, (-backlash, backlash), time, x, v, time + 20.0)
        tau = impact['cycle'] * 2.0 * math.pi + impact['phase'] - math.pi / 2.0
        assert 2.0 * math.pi * time == pytest.approx(tau, abs=1e-8)
        assert x / (2.0 * backlash) - 0.5 == pytest.approx(impact['displacement'], abs=1e-12)
        assert v / (4.0 * math.pi * backlash) == pytest.approx(impact['velocity'], abs=1e-8)
        v *= -0.9


@pytest.mark.parametrize('plane', [
    Plane(-0.25, (-1.0, 2.0), (-0.5, 0.75), 40, 30), Plane(None, (1.0, 7.0), kind='section'),
    Plane((-0.75, -0.125), 3.0, (0.0, 1.0), 40, 30, 'strobe'), *(Plane(kind=k) for k in PLANES)])
def test_a_magnified_plane_keeps_its_point_and_its_attributes_describe_it(plane: Plane) -> None:
    again = Plane.of(plane.attributes())
    assert (again.kind, again.window, again.velocity) == (plane.kind, plane.window, plane.velocity)
    x, v = (low + 0.25 * (high - low) for low, high in (plane.window, plane.velocity))
    near = plane.magnified(x, v, 2.0**20)
    for (low, high), at in ((near.window, x), (near.velocity, v)):
        assert (at - low) / (high - low) == pytest.approx(0.25, abs=1e-6)
    assert (near.kind, near.phases) == (plane.kind, plane.phases)
    assert near.whole() == plane.whole() == dataclasses.replace(
        plane, **{plane.across: None}, velocity=(-2.0, 2.0), phases=400, velocities=400)


@pytest.mark.parametrize(('values', 'words'), [
    ({'kind': 'poincare'}, "'poincare' is not one of section, impact, displacement, strobe"),
    ({'kind': 'section', 'displacement': 0.0}, 'leave it out'),
    ({'kind': 'strobe', 'displacement': -0.5}, 'displacement -0.5.*a window, two numbers'),
    ({'kind': 'strobe', 'displacement': (-1.5, 0.0)}, 'displacement = -1.5 is outside'),
    ({'kind': 'strobe', 'displacement': (0.0, -1.0)}, 'empty or reversed'),
    ({'kind': 'strobe', 'phase': (0.0, 1.0)}, 'phase .*one number'),
    ({'phase': 1.0}, 'phase 1.0.*a window, two numbers'),
    ({'displacement': (-1.0, 0.0)}, 'displacement .*one number')])
def test_a_plane_that_cannot_be_is_refused(values, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Plane(**values)
