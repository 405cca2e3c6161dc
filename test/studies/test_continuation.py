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

"""Changes of orbits against closed forms and eq. (9), ends of chaos against the crisis."""

import dataclasses
import itertools
import math

import mpmath
import numpy as np
import pytest
import scipy.optimize

from gear_rattle_ros.attractors.catalogue import Kind
from gear_rattle_ros.attractors.finding import find_attractors
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.cli.transitions.continuation import main
from gear_rattle_ros.core.flight.closed_form import UPPER
from gear_rattle_ros.core.flight.lanes_step import LANES
from gear_rattle_ros.core.many.recognition import find_orbit
from gear_rattle_ros.core.many.recorded import record_impacts
from gear_rattle_ros.core.model import Model, Parameters
from gear_rattle_ros.core.orbits.branches import Change, follow, leaving
from gear_rattle_ros.core.orbits.impact_map import derivatives, next_impact, parameter_derivatives
from gear_rattle_ros.core.orbits.letters import LETTERS
from gear_rattle_ros.core.orbits.orbit import close_orbit, fire, Orbit, same_orbit, solve_ring
from gear_rattle_ros.core.path import Path
from gear_rattle_ros.store.store import open_dataset
from gear_rattle_ros.studies.transitions.endings import find_end, returns, spread_out, watch

B, G, R = 0.1, 0.1, 0.9
ALPHA = Path.over(alpha=(0.4, 0.6))


def orbits_of(parameters, trajectories=64):
    """Find the stable orbits."""
    initial = Plane().draw(parameters, trajectories, 1)
    return list(find_attractors(parameters, initial, hold=5000, chaotic=False).orbits)


def orbits_at(alpha):
    """Find the stable orbits at an alpha, by impacts in a period and greatest velocity."""
    return {(orbit.impacts, round(float(orbit.points[:, 1].max()), 1)): orbit
            for orbit in orbits_of(Parameters(alpha=alpha))}


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
            int(orbit.walls[k]), phase, velocity, Model(alpha, B, G, R))
        product = jacobian_of_the_paper(phase, velocity, phase_1, velocity_1, duration,
                                        alpha) @ product
    return np.linalg.eigvals(product)


def test_derivatives_against_differences_and_eq_9():
    wall, phase, velocity, alpha = UPPER, 4.2, 1.1, 1.23
    model = Model(alpha, B, G, R)
    _, _, phase_1, velocity_1, d = next_impact(wall, phase, velocity, model)
    exact = np.column_stack([
        np.array(derivatives(phase, velocity, d, phase_1, velocity_1, model)).reshape(2, 2),
        np.transpose(parameter_derivatives(phase, velocity, d, phase_1, velocity_1, model))])
    h = 1e-6
    for k in range(6):
        ends = []
        for sign in (1.0, -1.0):
            x = np.array([phase, velocity, *model])
            x[k] += sign * h
            ends.append(np.array(next_impact(wall, x[0], x[1], Model(*x[2:]))[2:4]))
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
    direction = np.array([0.3, -1.0, 0.2, 0.5])
    whole = np.column_stack([shot.jacobian, shot.by_parameters @ direction])
    whole = np.linalg.solve(np.vstack([whole, row]), np.append(defects, 0.7))
    assert solve_ring(shot, direction, defects, row, 0.7) == pytest.approx(whole, rel=1e-10)


@pytest.mark.parametrize('beta', [0.0, 1e-9, 0.1, 0.9, 3.0])
def test_derivatives_by_the_parameters_in_50_digits(beta):
    phase, velocity, gamma, alpha, r = 4.2, 1.1, 0.05, 0.8, 0.7
    model = Model(alpha, beta, gamma, r)
    _, _, phase_1, velocity_1, d = next_impact(UPPER, phase, velocity, model)

    def flight(d, alpha, beta, gamma, r):
        # Displacement and velocity after take-off, eqs. (4)-(5); beta is not zero.
        decay = mpmath.exp(-beta * d)
        integral = (1 - decay) / beta
        slow = -r * velocity - alpha * mpmath.cos(phase)
        return (slow * integral + gamma * (d - integral) / beta
                + alpha * (mpmath.sin(phase + d) - mpmath.sin(phase)),
                slow * decay + gamma * integral + alpha * mpmath.cos(phase + d))

    with mpmath.workdps(80):
        there = [d, alpha, mpmath.mpf(beta or 1e-30), gamma, r]
        by_time, *by = (tuple(mpmath.diff(lambda *x, which=which: flight(*x)[which], there, tuple(
            int(k == n) for k in range(5))) for which in (0, 1)) for n in range(5))
        later = [-moved / by_time[0] for moved, _ in by]
        exact = [[float(t), float(v + by_time[1] * t)] for t, (_, v) in zip(
            later, by, strict=True)]
    found = parameter_derivatives(phase, velocity, d, phase_1, velocity_1, model)
    assert np.array(found) == pytest.approx(np.array(exact), rel=1e-13)


def test_multipliers_obey_the_exact_determinant():
    for (impacts, _), orbit in orbits_at(0.48).items():
        product = complex(orbit.multipliers[0] * orbit.multipliers[1])
        assert product.real == pytest.approx(
            R**(2 * impacts) * math.exp(-B * 2.0 * math.pi * orbit.drive_periods), rel=1e-10)
        assert sum(orbit.exponents) == pytest.approx(
            2.0 * math.log(R) - B * 2.0 * math.pi * orbit.drive_periods / impacts, abs=1e-12)


def test_b_doubles_where_its_multiplier_is_minus_one():
    orbit = orbits_at(0.48)[2, 0.9]
    branch = follow(orbit, ALPHA, 1.0, 0.4, 0.6)
    assert [turn.change for turn in branch.turns] == [Change.DOUBLING]
    turn = branch.turns[0]
    assert 0.52 < turn.value < 0.53
    nearest = min(multipliers_of_the_paper(turn.orbit), key=lambda m: abs(m + 1.0))
    assert nearest == pytest.approx(-1.0, abs=1e-6)
    # On either side of it, what many trajectories settle on.
    before, after = orbits_at(turn.value - 1e-3), orbits_at(turn.value + 1e-3)
    assert {key[0] for key in before} == {2, 3} and {key[0] for key in after} == {3, 4}


def test_folds_are_where_the_multiplier_is_one_and_nothing_is_beyond():
    orbit = orbits_at(0.505)[3, 1.0]
    fold = follow(orbit, ALPHA, -1.0, 0.4, 0.6).turns[0]
    assert fold.change is Change.FOLD
    nearest = min(multipliers_of_the_paper(fold.orbit), key=lambda m: abs(m - 1.0))
    assert nearest == pytest.approx(1.0, abs=1e-6)
    assert 0.49 < fold.value < 0.5
    beyond = close_orbit(orbit.walls, fold.orbit.points, Parameters(alpha=fold.value - 1e-4))
    assert beyond is None


def one_impact(beta, gamma, r, periods):
    """Velocity, and cosine of the phase times alpha, of one impact in some drive periods."""
    time = 2.0 * math.pi * periods
    v = gamma * time / (1.0 + r)
    if beta == 0.0:
        return v, 0.5 * gamma * time - r * v
    return v, -r * v - gamma / beta + gamma * time / (1.0 - math.exp(-beta * time))


def fold_and_doubling(beta, gamma, r, periods):
    """Write down both in closed form."""
    v, c = one_impact(beta, gamma, r, periods)
    if beta == 0.0:
        return abs(c), math.hypot(c, 2.0 * gamma * (1.0 + r * r) / (1.0 + r)**2)
    e = math.exp(-2.0 * math.pi * beta * periods)
    b = (1.0 - e) / beta
    sine = gamma + beta * c + v * (1.0 - r) * (1.0 - r * e) / (b * (1.0 + r))
    return abs(c), math.hypot(c, sine)


@pytest.mark.parametrize('beta, gamma, r, periods', [
    (0.1, 0.1, 0.9, 1), (0.05, 0.02, 0.6, 1), (0.0, 0.02, 0.8, 1), (0.0, 0.03, 0.5, 2),
    (0.3, 0.1, 0.9, 1)])
def test_one_impact_in_closed_form(beta, gamma, r, periods):
    fold, doubling = fold_and_doubling(beta, gamma, r, periods)
    alpha = fold + 0.3 * (doubling - fold)
    v, c = one_impact(beta, gamma, r, periods)
    orbit = stable_one(Parameters(alpha, beta, gamma, r), v, c)
    path = Path.over(orbit.parameters, alpha=(0.0, 9.0))
    for direction, change, exact in ((-1.0, Change.FOLD, fold), (1.0, Change.DOUBLING, doubling)):
        turn, = follow(orbit, path, direction, 0.0, 9.0, to_first_turn=True).turns
        assert turn.change is change
        assert abs(turn.value - exact) <= turn.uncertainty <= 1e-9
    # The fold is passed, the doubling not met again: the saddle goes up beside the orbit.
    both = follow(orbit, path, -1.0, 0.0, alpha)
    assert [turn.change for turn in both.turns] == [Change.FOLD]
    assert both.orbits[-1].multipliers[0].real > 1.0


def stable_one(parameters, v, c):
    """Close the stable one of the two orbits of one impact in a drive period."""
    angle = math.acos(c / parameters.alpha)
    return next(orbit for phase in (angle, -angle) for orbit in [
        close_orbit([UPPER], [[phase % (2.0 * math.pi), v]], parameters)]
        if orbit is not None and orbit.is_stable)


@pytest.mark.parametrize('windows', [
    {'beta': (0.02, 1.0)}, {'gamma': (0.01, 0.3)}, {'restitution': (0.3, 0.95)},
    {'beta': (0.02, 0.9), 'gamma': (0.02, 0.3)},
    {'alpha': (0.05, 0.07), 'beta': (0.3, 0.05), 'gamma': (0.2, 0.04), 'restitution': (0.9, 0.7)}])
def test_one_impact_in_closed_form_on_any_path(windows):
    """Where the closed form says that alpha is that of the fold, or of the doubling."""
    path = Path.over(Parameters(0.08, 0.1, 0.1, 0.9), **windows)

    def beyond(value, which):
        p = path.at(value)
        return fold_and_doubling(p.beta, p.gamma, p.restitution, 1)[which] - p.alpha

    grid = path.values(400)
    places = [scipy.optimize.brentq(beyond, a, b, (which,), xtol=1e-15, rtol=1e-15)
              for which in (0, 1) for a, b in itertools.pairwise(grid)
              if beyond(a, which) * beyond(b, which) < 0.0]
    assert places
    inside = next(v for v in grid if beyond(v, 0) < 0.0 < beyond(v, 1))
    p = path.at(inside)
    orbit = stable_one(p, *one_impact(p.beta, p.gamma, p.restitution, 1))
    for direction in (-1.0, 1.0):
        next_one = min((place for place in places if direction * (place - inside) > 0.0),
                       key=lambda place: direction * place, default=None)
        turns = follow(orbit, path, direction, *path.ends, to_first_turn=True).turns
        if next_one is None:
            assert not turns or not path.ends[0] <= turns[0].value <= path.ends[1]
            continue
        assert turns[0].change is (Change.FOLD if abs(beyond(next_one, 0)) < 1e-9
                                   else Change.DOUBLING)
        assert abs(turns[0].value - next_one) <= turns[0].uncertainty <= 1e-9 * path.unit
        assert path.of(turns[0].orbit.parameters) == pytest.approx(turns[0].value, abs=1e-14)


@pytest.mark.parametrize('r, pitchfork', [
    (0.5, 0.3846204847), (0.8, 0.3458892783), (0.9, 0.3419009408)])
def test_two_impacts_lose_their_symmetry(r, pitchfork):
    """Without load and drag: the fold in closed form, and no fold where a pair is born."""
    orbit = next(o for o in orbits_of(Parameters(0.3, 0.0, 0.0, r)) if o.impacts == 2)
    path = Path.over(orbit.parameters, alpha=(0.0, 1.0))
    fold, = follow(orbit, path, -1.0, 0.0, 1.0, to_first_turn=True).turns
    assert fold.change is Change.FOLD
    exact = 1.0 / math.hypot(2.0, math.pi * (1.0 + r) / (1.0 - r))
    assert abs(fold.value - exact) <= fold.uncertainty <= 1e-9
    change, = follow(orbit, path, 1.0, 0.0, 1.0, to_first_turn=True).turns
    assert change.change is Change.PITCHFORK
    # The published value has ten digits.
    assert abs(change.value - pitchfork) <= change.uncertainty + 5e-11 <= 1e-9
    pair = leaving(path, change)
    assert len(pair) == 2 and all(one.is_stable for one in pair)
    assert not same_orbit(*pair, 1e-4)
    mirror = dataclasses.replace(
        pair[1], walls=1 - pair[1].walls, points=np.stack(
            [np.mod(pair[1].points[:, 0] + math.pi, 2.0 * math.pi), -pair[1].points[:, 1]], 1))
    assert same_orbit(pair[0], mirror, 1e-8)
    # Seen from one of the pair it is the same place and the same orbit.
    far = follow(pair[0], path, 1.0, 0.0, change.value + 0.01).orbits[-1]
    birth, = follow(far, path, -1.0, 0.0, 1.0, to_first_turn=True).turns
    assert birth.change is Change.PITCHFORK
    assert birth.value == pytest.approx(change.value, abs=1e-9)


def test_a_doubled_orbit_is_born_where_the_other_doubles():
    doubling = follow(orbits_at(0.48)[2, 0.9], ALPHA, 1.0, 0.4, 0.6, to_first_turn=True).turns[0]
    four = next(orbit for key, orbit in orbits_at(0.535).items() if key[0] == 4)
    birth, = follow(four, ALPHA, -1.0, 0.4, 0.6, to_first_turn=True).turns
    assert (birth.change, birth.orbit.impacts) == (Change.DOUBLING, 2)
    assert birth.value == pytest.approx(doubling.value, abs=1e-9)


def events(tmp_path, words):
    """Run the tool; return its events as tuples."""
    path = tmp_path / 'k.zarr'
    assert main([*words.split(), '--output', str(path)]) == 0
    table = open_dataset(path)
    columns = (table['event_' + name].values.tolist()
               for name in ('attractor', 'kind', 'alpha', 'tolerance', 'orbit'))
    return list(zip(*columns, strict=True))


def of_kind(found, *kinds):
    """Choose some."""
    return [one for one in found if one[1] in kinds]


def test_the_tool_locates_what_is_known_in_closed_form(tmp_path):
    fold, doubling = fold_and_doubling(B, G, R, 1)
    found = events(tmp_path, '--alpha 0.10 0.11 --columns 3 --trajectories 64')
    mine = [one for one in found if one[4].startswith('orbit-1-1-')]
    assert [one[1] for one in mine] == ['fold', 'doubling'] and mine[0][0] == mine[1][0]
    for one, exact in zip(mine, (fold, doubling), strict=True):
        assert abs(one[2] - exact) <= one[3] <= 1e-9


@pytest.mark.long
def test_an_attractor_that_is_missed_ends_where_its_branch_does(tmp_path):
    """Few initial conditions reach the orbit of one impact, hardly any near its grazing."""
    found = events(tmp_path, '--beta 0 --gamma 0.16 --restitution 0.8 --alpha 0.06 0.18 '
                             '--columns 5 --trajectories 64 --hold 2000 --tolerance 1e-4')
    mine = [one for one in found if one[4].startswith('orbit-1-1-')]
    assert [one[1] for one in mine] == ['fold', 'grazing']
    for one, exact in zip(mine, (math.pi * 0.16 * 0.2 / 1.8, 0.1165370437882), strict=True):
        assert abs(one[2] - exact) <= one[3] <= 1e-9
    assert not [one for one in found if one[0] == mine[0][0] and one not in mine]


@pytest.mark.parametrize('window', ['0.30 0.384', '0.37 0.40', '0.386 0.40', '0.25 0.26'])
def test_the_loss_of_symmetry_is_reported_once(tmp_path, window):
    found = events(tmp_path, f'--beta 0 --gamma 0 --restitution 0.5 --alpha {window} --columns 3 '
                             '--trajectories 16')
    (_, _, alpha, error, _), = of_kind(found, 'pitchfork')
    assert abs(alpha - 0.3846204847) <= error + 5e-11
    # Each of the pair doubles: two attractors, two orbits.
    doublings = of_kind(found, 'doubling')
    assert len({one[4] for one in doublings}) == len(doublings)
    assert len({one[0] for one in doublings}) == len(doublings)
    assert all(one[2] > 0.5 for one in doublings)
    folds = of_kind(found, 'fold')
    assert all(abs(one[2] - 1.0 / math.hypot(2.0, 3.0 * math.pi)) <= one[3] for one in folds)


def test_rest_is_one_attractor_at_every_alpha(tmp_path):
    """It has no impacts to be matched by, only a name; it needs alpha below gamma."""
    path = tmp_path / 'k.zarr'
    assert main(['--beta', '0', '--gamma', '0.16', '--alpha', '0.151', '0.167', '--columns', '5',
                 '--trajectories', '32', '--hold', '2000', '--output', str(path)]) == 0
    table = open_dataset(path)
    rests = np.strings.startswith(table.key.values[0], 'rest')
    assert np.array_equal(rests.any(axis=1), table.alpha.values < 0.16)
    assert len(set(table.attractor.values[0][rests])) == 1
    ends = table.event_kind.values[table.event_orbit.values == 'rest-upper']
    assert ends.tolist() == ['not located']
    (place,), (error,) = (values.values[table.event_orbit.values == 'rest-upper']
                          for values in (table.event_alpha, table.event_tolerance))
    assert abs(place - 0.16) <= error == pytest.approx(0.002)


@pytest.mark.long
def test_chaos_ends_on_either_side_of_a_gap(tmp_path):
    """It has one number on both sides of a wide window, which opens where an orbit is born."""
    found = events(tmp_path, '--alpha 1.13 1.165 --columns 3 --trajectories 16 --tolerance 1e-4 '
                             '--hold 2000')
    table = open_dataset(tmp_path / 'k.zarr')
    number, between, again = table.attractor.values[0, :, 0]
    assert number == again != between
    (of, _, alpha, error, _), = of_kind(found, 'window')
    assert of == number and abs(alpha - 1.1357940127) <= error + 5e-11 <= 1e-9


def test_chaos_that_grows_comes_back():
    """Beyond 1.1629 four bands burst over the whole of the chaos, and are visited again."""
    orbit, = orbits_of(Parameters(alpha=1.157), 8)
    there = Parameters(alpha=1.162)
    herd = watch(there, spread_out(there, np.array([
        orbit.phases[0], -float(orbit.walls[0]), orbit.velocities[0]])), 2000)
    assert returns(Parameters(alpha=1.166), herd, 8000)
    assert not returns(there, herd, 2000)


@pytest.mark.long
def test_errors_of_crises_are_how_far_off_they_are():
    """Over 20 seeds and first steps, from the crisis that the manifolds give."""
    parameters, hold = Parameters(alpha=0.572), 8000
    catalogue = find_attractors(parameters, Plane().draw(parameters, 400, 1), hold=hold)
    chaos = max((each for each in catalogue.attractors if each.kind is Kind.CHAOTIC),
                key=lambda each: each.share)
    states = catalogue.states[catalogue.labels == chaos.label]
    rng, apart = np.random.default_rng(7), []
    for state in states[:20]:
        there = Parameters(alpha=0.572 + rng.uniform(-1e-4, 1e-4))
        herd = watch(there, spread_out(there, np.array([
            state['phase'], state['displacement'], state['velocity']])), hold)
        end = find_end(herd, ALPHA, 1.0, 1e-3, 0.575, 1e-5, hold)
        assert end.kind == 'crisis' and end.uncertainty < 2e-5
        apart.append((end.value - 0.572286) / end.uncertainty)
    # Quantiles 0.001 and 0.999 of what is spread evenly over an error to either side, and of what
    # is spread as a Gaussian.
    assert 2.9 < np.sum(np.square(apart)) < 45.3
    assert np.count_nonzero(np.abs(apart) > 1.0) <= 3


# The manifolds touch there: `crisis`, which shares nothing with this but the flight.
CRISIS = 1.2432027802


@pytest.mark.long
@pytest.mark.parametrize('words, exact', [
    ('--alpha 1.2425 1.2445 --columns 3 --trajectories 32 --tolerance 1e-5 --hold 8000', CRISIS),
    ('--alpha 0.5720 0.5726 --columns 3 --trajectories 64 --tolerance 1e-5 --hold 8000',
     0.572286)])
def test_a_crisis_is_where_escapes_begin(tmp_path, words, exact):
    (_, _, alpha, error, key), = of_kind(events(tmp_path, words), 'crisis')
    assert abs(alpha - exact) <= 2.0 * error <= 5e-4
    assert key.startswith('orbit-')


@pytest.mark.long
def test_chaos_ends_where_an_orbit_is_born_in_it(tmp_path):
    found = events(tmp_path, '--alpha 1.135 1.1362 --columns 3 --trajectories 32 --tolerance 1e-6 '
                             '--hold 5000')
    (_, _, alpha, error, key), = of_kind(found, 'window')
    assert key.startswith('orbit-5-1-') and error <= 1e-9
    # One event at one place.
    assert sum(abs(one[2] - alpha) < 1e-6 for one in found) == 1
    # Below it trajectories stay chaotic, above they all settle on the orbit.
    for side, settled in ((-2e-5, 0), (2e-5, LANES)):
        parameters = Parameters(alpha=alpha + side)
        initial = Plane().draw(parameters, LANES, 5)
        rows, _ = record_impacts(initial, 60_000, 256)
        orbits = [find_orbit(parameters, row, 64, 1e-6) for row in rows]
        assert sum(o is not None and o.impacts == 5 for o in orbits) == settled


@pytest.mark.long
@pytest.mark.parametrize('words, kind, exact, shown', [
    ('--alpha 1.20 1.26 --columns 31 --trajectories 64 --tolerance 1e-6', 'crisis', CRISIS, 2e-4),
    ('--alpha 0.5705 0.5735 --columns 31 --trajectories 128', 'crisis', 0.572286, 1e-5),
    ('--alpha 1.13 1.17 --columns 41 --trajectories 64 --tolerance 1e-6 --hold 20000', 'window',
     1.1357940127, 1e-9)])
def test_ends_of_chaos_in_whole_windows(tmp_path, words, kind, exact, shown):
    ends = of_kind(events(tmp_path, words), kind)
    assert any(abs(alpha - exact) <= 2.0 * error <= 2.0 * shown for _, _, alpha, error, _ in ends)


@pytest.mark.long
def test_the_end_of_b_is_not_that_of_a_small_attractor_which_joins_it(tmp_path):
    """At 0.564 there is one of 12 impacts in 6 periods; C and D are not in the window."""
    found = events(tmp_path, '--alpha 0.563 0.574 --columns 12 --trajectories 256 --hold 10000 '
                             '--tolerance 1e-5')
    ends = {round(alpha, 4): number for number, _, alpha, _, _ in of_kind(found, 'crisis')}
    assert ends[0.5723] == LETTERS.index('B')


@pytest.mark.long
def test_one_end_of_a_thin_basin_in_the_whole_window(tmp_path):
    found = events(tmp_path, '--beta 0 --gamma 0.16 --restitution 0.8 --alpha 0.05 0.18 '
                             '--columns 27 --trajectories 128')
    mine = [one for one in found if one[4].startswith('orbit-1-1-')]
    assert [one[1] for one in mine] == ['fold', 'grazing']
    assert abs(mine[1][2] - 0.1165370437882) <= mine[1][3]
    assert not [one for one in found if one[0] == mine[0][0] and one not in mine]


@pytest.mark.long
def test_the_cascade_of_b_has_feigenbaums_ratio(tmp_path, capsys):
    """And the tool prints and draws what it stores."""
    picture = tmp_path / 'k.png'
    found = events(tmp_path, '--alpha 0.5 0.57 --columns 3 --trajectories 32 --hold 2000 '
                             f'--tolerance 1e-4 --picture {picture}')
    places = {one[4].split('-')[1]: one[2] for one in of_kind(found, 'doubling')}
    gaps = np.diff([places[period] for period in ('2', '4', '8', '16', '32', '64')])
    assert gaps[-2] / gaps[-1] == pytest.approx(4.669, abs=0.02)
    assert abs(places['2'] - 0.52915) < 1e-4
    heading, *lines = capsys.readouterr().out.splitlines()[:1 + len(found)]
    assert heading.split() == ['attractor', 'event', 'alpha', '[1]', 'orbit']
    for line, (number, kind, alpha, error, key) in zip(lines, found, strict=True):
        words = line.split()
        head = ['ABCDEF'[number], str(number), *kind.split()]
        place, sign, _, *name = words[len(head):]
        assert (words[:len(head)], sign, name) == (head, '+-', [key] if key else [])
        assert abs(float(place) - alpha) <= error
    assert picture.stat().st_size > 10_000


def test_bad_input_is_refused_in_one_line(capsys):
    assert main(['--tolerance', '0']) == 2
    assert capsys.readouterr().err.count('\n') == 1
