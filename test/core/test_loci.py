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

"""Curves of folds, doublings, pitchforks and grazings against closed forms along all of them."""

import math

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.core.orbits.branches import Change, follow, leaving, Turn
from gear_rattle_ros.core.orbits.loci import crossings, Mark, trace_locus
from gear_rattle_ros.core.orbits.orbit import close_orbit, Orbit
from gear_rattle_ros.core.path import Path
from gear_rattle_ros.studies.sweeps.plane_curves import rest_curves


def closed(beta: float, gamma: float, r: float) -> tuple[float, float, float, float]:
    """Return speed, c, fold and doubling of the orbit of one impact a period (upper wall)."""
    v = 2.0 * math.pi * gamma / (1.0 + r)
    if beta:
        decay = math.exp(-2.0 * math.pi * beta)
        integral = (1.0 - decay) / beta
        c = -r * v - gamma / beta + 2.0 * math.pi * gamma / (1.0 - decay)
    else:
        decay, integral, c = 1.0, 2.0 * math.pi, gamma * math.pi * (1.0 - r) / (1.0 + r)
    return v, c, abs(c), math.hypot(
        c, gamma + beta * c + v * (1.0 - r) * (1.0 - r * decay) / (integral * (1.0 + r)))


def one_impact(parameters: Parameters, n: int = 1) -> Orbit:
    """Return the stable orbit of one impact a period, or at beta = 0 in n periods."""
    v, c, _, _ = closed(parameters.beta, parameters.gamma, parameters.restitution)
    v, c = n * v, n * c
    orbit = close_orbit(np.array([0]), np.array([[math.acos(c / parameters.alpha), v]]),
                        parameters)
    assert orbit is not None and orbit.is_stable
    return orbit


def turns_of(orbit: Orbit, **window: tuple[float, float]) -> dict[Change, Turn]:
    """Return the changes of an orbit in a window."""
    path = Path.over(orbit.parameters, **window)
    return {turn.change: turn for direction in (1.0, -1.0)
            for turn in follow(orbit, path, direction, *path.ends).turns}


@pytest.mark.parametrize(('name', 'window'), [
    ('gamma', (0.02, 0.25)), ('beta', (0.01, 0.4)), ('restitution', (0.1, 0.98))])
@pytest.mark.parametrize('change', [Change.FOLD, Change.DOUBLING])
def test_curves_of_the_orbit_of_one_impact_are_the_closed_forms(
        name: str, window: tuple[float, float], change: Change) -> None:
    """Every point of them, over (alpha, gamma), (alpha, beta) and (alpha, r)."""
    orbit = one_impact(Parameters(0.1))
    locus = trace_locus(turns_of(orbit, alpha=(0.01, 0.2))[change],
                        {'alpha': (0.0, 0.5), name: window})
    assert locus is not None and locus.ring.title[1:] == (1, 1)
    assert len(locus.points) > 20 and np.ptp(locus.points[:, 1]) > 0.5 * (window[1] - window[0])
    fixed = {'beta': 0.1, 'gamma': 0.1, 'restitution': 0.9}
    exact = [closed(*(fixed | {name: y}).values())[2 if change is Change.FOLD else 3]
             for y in locus.points[:, 1].tolist()]
    np.testing.assert_allclose(locus.points[:, 0], exact, atol=1e-9, rtol=0.0)


def test_curves_of_different_orbits_cross_where_their_closed_forms_do() -> None:
    """The doubling of one impact a period meets the fold of one in two periods at one r."""
    gamma, windows = 0.03, {'alpha': (0.005, 0.2), 'restitution': (0.4, 0.95)}
    one, two = (trace_locus(turns_of(
        one_impact(Parameters(alpha, 0.0, gamma, 0.8), n), alpha=(0.005, 0.2))[change], windows)
        for n, alpha, change in ((1, 0.03, Change.DOUBLING), (2, 0.03, Change.FOLD)))
    assert one is not None and two is not None and two.ring.title[1:] == (1, 2)
    # 2 k = hypot(k, 2 (1 + r^2)/(1 + r)^2) with k = pi (1 - r)/(1 + r), both times gamma.
    third = math.sqrt(3.0) * math.pi
    r = math.sqrt((third - 2.0) / (third + 2.0))
    exact = 2.0 * math.pi * gamma * (1.0 - r) / (1.0 + r), r
    for both in ((one, two), (two, one)):
        (found,) = crossings(*both)
        assert found == pytest.approx(exact, abs=1e-9)


def test_grazings_of_the_orbit_of_one_impact_touch_the_other_wall() -> None:
    """The least displacement of its motion, in closed form, is -1 at every point."""
    r = 0.8
    turn = turns_of(one_impact(Parameters(0.1, 0.0, 0.16, r)), alpha=(0.01, 0.2))[Change.GRAZING]
    assert abs(turn.value - 0.1165370437882) < 1e-9
    locus = trace_locus(turn, {'alpha': (0.05, 0.2), 'gamma': (0.02, 0.3)})
    assert locus is not None and len(locus.points) > 10
    for alpha, gamma, _ in locus.points.tolist():
        v, c, _, _ = closed(0.0, gamma, r)
        below = []
        for tau in (math.acos(c / alpha), -math.acos(c / alpha)):
            def s(d: float, tau: float = tau, alpha: float = alpha, gamma: float = gamma,
                  v: float = v) -> float:
                return (alpha * (math.sin(tau + d) - math.sin(tau)) + 0.5 * gamma * d * d
                        - (r * v + alpha * math.cos(tau)) * d)

            grid = np.linspace(0.0, 2.0 * math.pi, 400)
            least = grid[np.argmin([s(d) for d in grid])]
            below.append(minimize_scalar(s, bounds=(least - 0.05, least + 0.05), method='bounded',
                                         options={'xatol': 1e-9}).fun)
        assert min(abs(value + 1.0) for value in below) < 1e-9


def symmetric(alpha: float, r: float) -> Orbit:
    """Return the orbit of two impacts a period at beta = gamma = 0."""
    k = math.pi * (1.0 + r) / (1.0 - r)
    tau = math.atan2(2.0, k) + math.acos(1.0 / (alpha * math.hypot(2.0, k)))
    v = 2.0 * alpha * math.cos(tau) / (1.0 - r)
    orbit = close_orbit(np.array([0, 1]), np.array([[tau, v], [tau + math.pi, -v]]),
                        Parameters(alpha, 0.0, 0.0, r))
    assert orbit is not None
    return orbit


def test_the_impact_pair_loses_its_symmetry_where_it_is_known_to() -> None:
    """Pitchforks and folds over (alpha, r) at beta = gamma = 0, the impact pair."""
    turns = turns_of(symmetric(0.2, 0.8), alpha=(0.01, 0.6))
    windows = {'alpha': (0.0, 1.0), 'restitution': (0.3, 0.95)}
    fold = trace_locus(turns[Change.FOLD], windows)
    assert fold is not None and len(fold.points) > 20
    alpha, r, _ = fold.points.T
    np.testing.assert_allclose(alpha, 1.0 / np.hypot(2.0, math.pi * (1.0 + r) / (1.0 - r)),
                               atol=1e-9, rtol=0.0)
    pitchfork = trace_locus(turns[Change.PITCHFORK], windows, longest=2e-3)
    assert pitchfork is not None and pitchfork.ring.title[1] == 2
    alpha, r, _ = pitchfork.points[np.argsort(pitchfork.points[:, 1])].T
    found = CubicSpline(r, alpha)([0.5, 0.8, 0.9])
    np.testing.assert_allclose(found, [0.3846204847, 0.3458892783, 0.3419009408], atol=2e-9)


def test_mirror_images_have_one_curve_without_a_load() -> None:
    """The two that the pitchfork leaves double on the same curve, which is found once."""
    path = Path.over(Parameters(0.3, 0.0, 0.0, 0.8), alpha=(0.2, 0.6))
    turn = turns_of(symmetric(0.2, 0.8), alpha=(0.01, 0.6))[Change.PITCHFORK]
    windows = {'alpha': (0.2, 0.8), 'restitution': (0.7, 0.9)}
    doublings = [next(each for each in follow(
        one, path, 1.0, 0.2, 0.6).turns if each.change is Change.DOUBLING)
        for one in leaving(path, turn)]
    assert len(doublings) == 2
    locus = trace_locus(doublings[0], windows)
    assert locus is not None and trace_locus(doublings[1], windows, [locus]) is None


def test_the_impact_pair_grazes_twice_at_once() -> None:
    """Its symmetric orbit, in closed form, touches a wall between its impacts at every point."""
    turn = turns_of(symmetric(0.3, 0.5), alpha=(0.01, 2.0))[Change.GRAZING]
    locus = trace_locus(turn, {'alpha': (0.01, 2.0), 'restitution': (0.2, 0.9)})
    assert locus is not None and locus.ring.title[1] == 2 and len(locus.points) > 20
    for alpha, r, _ in locus.points.tolist():
        k = math.pi * (1.0 + r) / (1.0 - r)
        tau = math.atan2(2.0, k) - math.acos(1.0 / (alpha * math.hypot(2.0, k)))
        speed = alpha * math.cos(tau) * (1.0 + r) / (1.0 - r)

        def gap(d: float, tau: float = tau, alpha: float = alpha, speed: float = speed) -> float:
            s = alpha * (math.sin(tau + d) - math.sin(tau)) - speed * d
            return min(-s, 1.0 + s)

        grid = np.linspace(0.02, math.pi - 0.02, 2000)
        gaps = np.array([gap(d) for d in grid])
        dips = grid[1:-1][(gaps[1:-1] < gaps[:-2]) & (gaps[1:-1] < gaps[2:])]
        least = min(minimize_scalar(gap, bounds=(d - 0.01, d + 0.01), method='bounded',
                                    options={'xatol': 1e-9}).fun for d in dips)
        assert abs(least) < 1e-9


def test_a_load_turns_the_pitchfork_into_a_cusp_of_folds() -> None:
    """Over (alpha, gamma) it lies at the pitchfork without load, and its folds part as 3/2."""
    r = 0.9
    path = Path.over(Parameters(0.3, 0.0, 0.0, r), alpha=(0.2, 0.4))
    turn = turns_of(symmetric(0.3, r), alpha=(0.01, 0.4))[Change.PITCHFORK]
    aside = leaving(path, turn)[0]
    away = follow(aside, path, 1.0, 0.2, turn.value + 2e-3).orbits[-1]
    folds = [one for direction in (1.0, -1.0) for one in follow(
        away, Path.over(away.parameters, gamma=(-0.1, 0.1)), direction, -0.1, 0.1).turns
        if one.change is Change.FOLD]
    windows = {'alpha': (0.3, 0.36), 'gamma': (-0.05, 0.05)}
    locus = trace_locus(folds[0], windows, longest=5e-3)
    assert locus is not None
    (mark, alpha, gamma), = [one for one in locus.marks if one[0] is Mark.CUSP]
    assert mark is Mark.CUSP
    assert abs(alpha - 0.3419009408) < 1e-8 and abs(gamma) < 1e-8
    way, load = locus.points[:, 0] - alpha, np.abs(locus.points[:, 1])
    near = (way > 2e-4) & (way < 4e-3)
    assert np.ptp(np.sign(locus.points[near, 1])) == 2
    assert abs(np.polyfit(np.log(way[near]), np.log(load[near]), 1)[0] - 1.5) < 0.05
    assert trace_locus(folds[0], windows, [locus]) is None


@pytest.mark.parametrize('windows', [
    {'alpha': (0.0, 0.5), 'beta': (0.0, 2.0)}, {'alpha': (0.0, 0.5), 'gamma': (-0.3, 0.3)},
    {'alpha': (0.0, 0.5), 'restitution': (0.0, 1.0)}, {'beta': (0.0, 2.0), 'gamma': (-0.4, 0.4)},
    {'beta': (0.0, 2.0), 'restitution': (0.0, 1.0)},
    {'gamma': (0.0, 0.4), 'restitution': (0.0, 1.0)}])
def test_rest_begins_where_the_drive_never_lifts_the_gear(
        windows: dict[str, tuple[float, float]]) -> None:
    """The acceleration of the gear on its wall just reaches zero at every point."""
    fixed = Parameters(0.2, 0.1, 0.3)
    curves = list(rest_curves(windows, fixed))
    assert curves
    for curve in curves:
        for place in curve[::20].tolist():
            p = vars(fixed) | dict(zip(windows, place, strict=True))
            tau = np.linspace(0.0, 2.0 * math.pi, 100_001)
            least = np.min(abs(p['gamma']) - p['alpha'] * (np.sin(tau) + p['beta'] * np.cos(tau)))
            assert abs(least) < 1e-8
