"""Folds and doublings against eq. (9), finite differences and the exact determinant."""

import math

import numpy as np
import pytest

from gear_rattle_ros.core.branches import Change, follow
from gear_rattle_ros.core.closed_orbits import (
    close_orbit,
    exponents,
    fire,
    Orbit,
    solve_ring,
)
from gear_rattle_ros.core.flight import UPPER
from gear_rattle_ros.core.impact_map import derivatives, next_impact
from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.offline.continuation import main
from gear_rattle_ros.offline.diagram import Diagram
from gear_rattle_ros.offline.ensembles import run_ensemble, settle, Window
from gear_rattle_ros.offline.events import cascade, find_end
from gear_rattle_ros.offline.grid import Plane
from gear_rattle_ros.offline.store import open_dataset

B, G, R = 0.1, 0.1, 0.9


def orbits_at(alpha, trajectories=64):
    """Find the stable orbits at an alpha, by impacts in a period and greatest velocity."""
    parameters = Parameters(alpha=alpha)
    starts = Plane().random_starts(parameters, trajectories, 1)
    found = settle(run_ensemble(starts, parameters, Window(bins=300)))
    return {(one.orbit.impacts, round(float(one.orbit.points[:, 1].max()), 1)): one.orbit
            for one in found if one.orbit}


def jacobian_of_the_paper(tau0, v0, tau1, v1, duration, alpha):
    """Write down eq. (9)."""
    decay = math.exp(-B * duration)
    g = G / B
    w = -R * v0 - alpha * math.cos(tau0) - g
    a1 = -alpha * math.sin(tau1) + alpha * B * math.cos(tau1) + G - B * v1
    t_t = -(-alpha * math.cos(tau0) - g - decay * w
            + (1 - decay) / B * alpha * math.sin(tau0)) / v1
    t_v = R * (1 - decay) / (B * v1)
    return np.array([[t_t, t_v], [decay * alpha * math.sin(tau0) + B * w * decay + a1 * t_t,
                                  -R * decay + a1 * t_v]])


def multipliers_of_the_paper(orbit: Orbit):
    """Multiply eq. (9) along an orbit."""
    product = np.eye(2)
    alpha = orbit.parameters.alpha
    for k in range(orbit.impacts):
        phase, velocity = orbit.points[k]
        _, _, phase_1, velocity_1, duration = next_impact(
            int(orbit.walls[k]), phase, velocity, alpha, B, G, R)
        product = jacobian_of_the_paper(phase, velocity, phase_1, velocity_1, duration,
                                        alpha) @ product
    return np.linalg.eigvals(product)


def test_derivatives_against_differences_and_eq_9():
    wall, phase, velocity, alpha = UPPER, 4.2, 1.1, 1.23
    _, _, phase_1, velocity_1, d = next_impact(wall, phase, velocity, alpha, B, G, R)
    exact = np.array(derivatives(phase, velocity, d, phase_1, velocity_1, alpha, B, G, R)
                     ).reshape(2, 3)
    h = 1e-6
    for k in range(3):
        ends = []
        for sign in (1.0, -1.0):
            x = np.array([phase, velocity, alpha])
            x[k] += sign * h
            ends.append(np.array(next_impact(wall, x[0], x[1], x[2], B, G, R)[2:4]))
        assert exact[:, k] == pytest.approx((ends[0] - ends[1]) / (2.0 * h), rel=1e-6, abs=1e-7)
    paper = jacobian_of_the_paper(phase, velocity, phase_1, velocity_1, d, alpha)
    assert exact[:, :2] == pytest.approx(paper, rel=1e-12)
    # det D = r^2 E v0/v1.
    assert np.linalg.det(paper) == pytest.approx(R * R * math.exp(-B * d) * velocity / velocity_1)


def test_a_ring_is_solved_as_the_whole_system_is():
    orbit = orbits_at(0.48)[3, 0.6]
    shot = fire(orbit.walls, orbit.points, orbit.parameters)
    rng = np.random.default_rng(1)
    defects, row = rng.normal(size=6), rng.normal(size=7)
    whole = np.linalg.solve(np.vstack([shot.jacobian, row]), np.append(defects, 0.7))
    assert solve_ring(shot, defects, row, 0.7) == pytest.approx(whole, rel=1e-10)


def test_multipliers_obey_the_exact_determinant():
    for (impacts, _), orbit in orbits_at(0.48).items():
        product = complex(orbit.multipliers[0] * orbit.multipliers[1])
        assert product.real == pytest.approx(
            R**(2 * impacts) * math.exp(-B * 2.0 * math.pi * orbit.drive_periods), rel=1e-10)
        assert sum(exponents(orbit)) == pytest.approx(
            2.0 * math.log(R) - B * 2.0 * math.pi * orbit.drive_periods / impacts, abs=1e-12)


def test_b_doubles_where_its_multiplier_is_minus_one():
    orbit = orbits_at(0.48)[2, 0.9]
    branch = follow(orbit, 1.0, 0.4, 0.6)
    assert [turn.change for turn in branch.turns] == [Change.DOUBLING]
    turn = branch.turns[0]
    assert 0.52 < turn.alpha < 0.53
    nearest = min(multipliers_of_the_paper(turn.orbit), key=lambda m: abs(m + 1.0))
    assert nearest == pytest.approx(-1.0, abs=1e-6)
    # On either side of it, what many trajectories settle on.
    before, after = orbits_at(turn.alpha - 1e-3), orbits_at(turn.alpha + 1e-3)
    assert {key[0] for key in before} == {2, 3} and {key[0] for key in after} == {3, 4}


def test_the_cascade_of_b_goes_on_as_feigenbaum_says():
    orbit = orbits_at(0.48)[2, 0.9]
    first = follow(orbit, 1.0, 0.4, 0.6).turns[0]
    events = cascade(1, first.orbit, 1.0, 1e-10, doublings=4)
    places = [first.alpha, *(event.alpha for event in events)]
    assert [event.period_impacts for event in events] == [4, 8, 16, 32]
    gaps = np.diff(places)
    assert gaps[-2] / gaps[-1] == pytest.approx(4.669, abs=0.03)


def test_folds_are_where_the_multiplier_is_one_and_nothing_is_beyond():
    orbit = orbits_at(0.505)[3, 1.0]
    fold = follow(orbit, -1.0, 0.4, 0.6).turns[0]
    assert fold.change is Change.FOLD
    nearest = min(multipliers_of_the_paper(fold.orbit), key=lambda m: abs(m - 1.0))
    assert nearest == pytest.approx(1.0, abs=1e-3)
    assert 0.49 < fold.alpha < 0.5
    beyond = close_orbit(orbit.walls, fold.orbit.points, Parameters(alpha=fold.alpha - 1e-4))
    assert beyond is None


def test_the_end_of_b_is_between_where_it_is_seen_and_where_it_is_not():
    diagram = Diagram(Parameters(), (0.57, 0.576), 3, Plane(), 48, 1, Window(2000, 512, bins=300),
                      ('starts',))
    found = settle(run_ensemble(diagram.starts(0), diagram.at(0), diagram.window))
    chaotic = next(one for one in found if one.orbit is None)
    event = find_end(1, chaotic, diagram, 0, 1e-4, 10_000)
    assert event.what == 'vanishes' and 0.572 < event.alpha < 0.573 and event.tolerance <= 5e-5


def test_the_tool_writes_its_events(tmp_path, capsys):
    path, picture = tmp_path / 'k.zarr', tmp_path / 'k.png'
    assert main(['--alpha', '0.5', '0.54', '--columns', '5', '--trajectories', '32', '--hold',
                 '2000', '--tolerance', '1e-4', '--output', str(path), '--picture',
                 str(picture)]) == 0
    dataset = open_dataset(path)
    doubling = dataset.event_alpha.values[dataset.event_kind.values == 'doubling']
    assert np.min(np.abs(doubling - 0.52915)) < 1e-4
    assert 'doubling' in capsys.readouterr().out
    assert picture.stat().st_size > 10_000


def test_bad_input_is_refused_in_one_line(capsys):
    assert main(['--tolerance', '0']) == 2
    assert capsys.readouterr().err.count('\n') == 1
