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

"""Hops through noise beyond the tolerance: those that the cores of known attractors give."""

import numpy as np
import pytest

from gear_rattle_ros import find_attractors, Parameters, Simulation, State, TransientDetector
from gear_rattle_ros.attractors.cores import core_radius, find_jumps
from gear_rattle_ros.core.flight.noise import jittered
from gear_rattle_ros.core.model import EventArray, EventKind
from gear_rattle_ros.core.orbits.cores import radius_of
from gear_rattle_ros.core.orbits.section import distances
from gear_rattle_ros.core.stream.drift import ramped
from gear_rattle_ros.core.stream.hops import AWAY
from gear_rattle_ros.core.stream.report_values import hop_values, texts, transient_values
from gear_rattle_ros.core.stream.transients import Regime

FAR = 10**8
P = Parameters(alpha=0.48)


@pytest.fixture(scope='module')
def known():
    """Find the attractors B, label 0, and A, label 1, of the paper."""
    return find_attractors(P)


def noisy(noise: float, count: int, seed: int = 1) -> EventArray:
    """Return the first events of a run with noise."""
    return Simulation(P, State(velocity=-1.0), noise=noise, seed=seed).advance(FAR, 0.0, count)


def test_cores_are_those_of_the_attractors(known):
    """Found by following impacts here, by the labels of the catalogue there."""
    for each in known.attractors:
        assert radius_of(each.orbit, 1e-3) == core_radius(known, each, each.orbit)


def test_hops_are_those_of_core_sets_once_both_orbits_are_known(known):
    """From, to, residence and rates at sigma = 0.02, against cores known from the beginning."""
    events = noisy(0.02, 60_000)
    impacts = events[events['kind'] <= EventKind.STICK]
    detector = TransientDetector()
    orbits = [each for each in detector.update(events) if each.regime is Regime.ORBIT]
    assert len(orbits) == 1 + sum(bool(each.previous) for each in orbits) > 40
    keys = {each.label: each.key for each in known.attractors}
    last = find_jumps(known, impacts['phase'], impacts['velocity']).last
    at = np.flatnonzero(last[1:] != last[:-1]) + 1
    exact = [(int(impacts['index'][k]), keys[int(last[k])]) for k in at]
    # The second orbit is known after some stays on it, and from the first impact of this one.
    found = [(each.start + each.lifetime, each.key) for each in orbits]
    assert found[0] == exact[0] and set(found) <= set(exact)
    assert found[1:] == exact[exact.index(found[1]):]
    assert [each.residence for each in orbits[1:]] == np.diff([n for n, _ in found]).tolist()
    assert [each.previous for each in orbits[1:]] == [to for _, to in found[:-1]]
    # The spread is that of all impacts in the core since.
    values = hop_values(detector.hops, int(impacts['index'][-1]))
    a = next(each for each in known.attractors if each.letter == 'A')
    apart = np.min([distances(impacts['velocity'], impacts['phase'], velocity, phase)
                    for phase, velocity in a.orbit.points], axis=0)[found[0][0] - 1:]
    inside = apart[apart <= values['radius A']]
    assert values['spread A'] == pytest.approx(np.sqrt(np.mean(inside**2)))
    stay = sum(n for n, (_, to) in zip(
        np.diff([*(n for n, _ in found), len(impacts)]), found, strict=True) if to == a.key)
    b = next(each.key for each in known.attractors if each.letter == 'B')
    assert values['occupation A'] == pytest.approx(
        stay / (len(impacts) - found[0][0]), abs=1e-4)
    count = sum(to == b for _, to in found[1:])
    assert values['rate A to B'] == pytest.approx(count / stay, rel=1e-4)
    assert values['rate_error A to B'] == pytest.approx(count**0.5 / stay, rel=1e-4)


def test_hops_do_not_depend_on_how_the_stream_was_cut():
    """To the bit, also of what has been counted."""
    events = noisy(0.02, 20_000)
    whole, pieces = TransientDetector(), TransientDetector()
    reports = [whole.update(events), []]
    cuts = np.sort(np.random.default_rng(2).integers(0, len(events), 700))
    for piece in np.split(events, cuts):
        reports[1] += pieces.update(piece)
    assert len(reports[0]) > 5
    assert [[texts(transient_values(each)) for each in row] for row in reports[:1]] == [
        [texts(transient_values(each)) for each in row] for row in reports[1:]]
    assert hop_values(whole.hops, 20_000) == hop_values(pieces.hops, 20_000)


def test_noise_that_ends_leaves_the_orbit_and_a_retune_another_one():
    """Then recurrence recognises it, with no spread; at other parameters all begins anew."""
    simulation = Simulation(P, State(velocity=-0.5), noise=0.005, seed=3)
    detector = TransientDetector()
    detector.update(simulation.advance(FAR, 0.0, 3000))
    assert detector.report.period_impacts == 3 and detector.hops.spread(0)[1] < 0.03
    simulation.noise = 0.0
    changes = detector.update(simulation.advance(FAR, 0.0, 2000))
    assert [each.regime for each in changes] == [Regime.TRANSIENT, Regime.ORBIT]
    assert (changes[1].period_impacts, changes[1].previous) == (3, '')
    assert changes[1].spread_rms < 1e-12 and not detector.hops.known
    simulation.noise = 0.005
    simulation.advance(FAR, 0.0, 3000)
    detector.update(simulation.retune(Parameters(0.49))[:1])
    events = simulation.advance(FAR, 0.0, 2000)
    again = detector.update(events)[-1]
    assert again.orbit.parameters.alpha == 0.49 and len(detector.hops.known) == 1
    assert again.epoch == 1


def test_an_orbit_without_a_core_for_long_is_left():
    """Kicks of 0.3 leave no orbit; those before are at A."""
    simulation = Simulation(P, State(velocity=-0.5), noise=0.005, seed=3)
    detector = TransientDetector()
    detector.update(simulation.advance(FAR, 0.0, 2000))
    simulation.noise = 2.0
    changes = detector.update(simulation.advance(FAR, 0.0, 20_000))
    gone = next(each for each in changes if each.regime is Regime.TRANSIENT)
    assert gone.index - gone.start == AWAY and gone.start >= 2000


def jittering(noise: float, periods: int) -> EventArray:
    """Return the events of a run with jitter, as the simulator makes them."""
    simulation, made = Simulation(P, State(velocity=-0.5)), []
    for cycle in range(1, periods + 1):
        made += [simulation.advance(cycle, 0.0, 400), simulation.retune(
            Parameters(jittered(0.48, noise, 3, cycle)))]
    return np.concatenate(made)


def test_hops_through_jitter_are_those_of_core_sets(known):
    """The orbits are those at the mean of 64 amplitudes; cores at 0.48 see the same hops."""
    events = jittering(0.02, 10_000)
    detector = TransientDetector()
    orbits = [each for each in detector.update(events) if each.regime is Regime.ORBIT]
    mean = np.mean(events['alpha'][events['kind'] == EventKind.RETUNE][:64])
    alpha, = {each.orbit.parameters.alpha for each in orbits}
    assert alpha == pytest.approx(mean, abs=1e-15)
    assert all(0.01 < each.spread_rms < 0.1 for each in orbits)
    impacts = events[events['kind'] <= EventKind.STICK]
    last = find_jumps(known, impacts['phase'], impacts['velocity']).last
    letters = {each.label: each.letter for each in known.attractors}
    at = np.flatnonzero(last[1:] != last[:-1]) + 1
    exact = [(int(impacts['index'][k]), letters[int(last[k])]) for k in at]
    found = [(each.start + each.lifetime, each.letter) for each in orbits]
    # Balls about slightly other points may be entered some impacts earlier or later.
    near = [one for one in found if any(
        abs(one[0] - number) <= 12 and one[1] == letter for number, letter in exact)]
    assert len(found) > 20 and len(near) >= 0.9 * len(found)
    assert abs(len(found) - len(exact)) <= 0.1 * len(exact)


def test_a_retune_beyond_jitter_begins_anew_and_a_ramp_is_none(known):
    """Also one of another parameter; a slow ramp is followed as before."""
    events = jittering(0.01, 400)
    last = events[-1:].copy()
    for name, value in (('alpha', 0.7), ('beta', 0.11)):
        detector = TransientDetector()
        assert detector.update(events)[-1].letter == 'A' and len(detector.hops.known) == 1
        last[name], last['epoch'] = value, events['epoch'][-1] + 1
        last['cycle'] = events['cycle'][-1] + 1
        change, = detector.update(last)
        assert change.regime is Regime.TRANSIENT and not detector.hops.known
        last = events[-1:].copy()
    ramp = np.concatenate(list(ramped(Parameters(0.48), State(velocity=-0.5), 0.481, 1e-5)))
    detector = TransientDetector()
    assert detector.update(ramp)[-1].period_impacts == 3 and not detector.hops.known
