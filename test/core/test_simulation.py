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

"""The stream of events: cuts, retunes, resets, noise, long runs, wrap-around."""

import math

from hypothesis import assume, given, strategies as st
import mpmath as mp
import numpy as np
import pytest
from reference import DIGITS, Flight
from scipy import stats

from gear_rattle_ros.core.flight.elementary import TWO_PI
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EVENT, EventArray, EventKind, Parameters, State

PHASES = st.floats(0.0, TWO_PI, exclude_max=True)
PARAMETERS = st.builds(
    Parameters, alpha=st.floats(0.0, 10.0), beta=st.floats(0.0, 5.0), gamma=st.floats(-3.0, 3.0),
    restitution=st.floats(0.0, 1.0))
STATES = st.builds(
    State, phase=PHASES, displacement=st.floats(-1.0, 0.0), velocity=st.floats(-10.0, 10.0))
MOMENTS = st.lists(st.tuples(st.integers(0, 5), PHASES), max_size=8)


def gather(simulation: Simulation, cycle: int, phase: float, most: int,
           room: int = 3000) -> EventArray:
    """Return the events up to a moment, at most `most` at a time, `room` in all."""
    pieces = [np.empty(0, EVENT)]
    count = 0
    while count < room:
        piece = simulation.advance(cycle, phase, min(most, room - count))
        pieces.append(piece)
        count += len(piece)
        if len(piece) < min(most, room - count + len(piece)):
            break
    return np.concatenate(pieces)


@given(parameters=PARAMETERS, state=STATES, cuts=MOMENTS, most=st.integers(1, 40),
       noise=st.sampled_from([0.0, 0.1]))
def test_events_do_not_depend_on_how_a_run_is_cut(
        parameters: Parameters, state: State, cuts: list[tuple[int, float]], most: int,
        noise: float) -> None:
    """Any moments and any room on the way give the same bytes."""
    room = 2000
    whole = Simulation(parameters, state, noise=noise, seed=5).advance(6, 0.0, room)
    simulation = Simulation(parameters, state, noise=noise, seed=5)
    pieces, left = [], room
    for cycle, phase in sorted((c, p) for c, p in cuts if (c, p) >= (0, state.phase)):
        present = simulation.state
        if (cycle, phase) < (present.cycle, present.phase):
            continue
        pieces.append(gather(simulation, cycle, phase, most, left))
        left -= len(pieces[-1])
        if left == 0:
            break
    if left:
        pieces.append(gather(simulation, 6, 0.0, most, left))
    assert np.concatenate(pieces).tobytes() == whole.tobytes()


@given(parameters=PARAMETERS, state=STATES)
def test_every_event_is_a_possible_one(parameters: Parameters, state: State) -> None:
    """Order, place, direction, impact law and numbering hold record by record."""
    events = Simulation(parameters, state).advance(5, 0.0, 2000)
    assert events['kind'][0] == EventKind.RESET
    tau = events['cycle'] * TWO_PI + events['phase']
    assert np.all(np.diff(tau) >= -1e-14)
    assert np.all((events['phase'] >= 0.0) & (events['phase'] < TWO_PI))
    rest = events[1:]
    hits = rest['kind'] <= EventKind.STICK
    assert np.array_equal(np.cumsum(hits), rest['index'])
    assert np.all(np.isin(rest['displacement'], (0.0, -1.0)))
    towards = np.where(rest['displacement'] == 0.0, 1.0, -1.0)
    assert np.all(towards[hits] * rest['velocity'][hits] >= 0.0)
    struck = rest['kind'] == EventKind.IMPACT
    assert np.array_equal(rest['velocity_after'][struck],
                          -parameters.restitution * rest['velocity'][struck])
    assert np.all(rest['velocity_after'][~struck] == 0.0)
    if parameters.restitution == 1.0:
        assert np.all(np.abs(rest['velocity'][rest['kind'] == EventKind.STICK]) < 1e-10)


@given(parameters=PARAMETERS, state=STATES, cycle=st.integers(0, 3), phase=PHASES)
def test_state_stays_between_the_walls(
        parameters: Parameters, state: State, cycle: int, phase: float) -> None:
    """At any time asked for, the gear is where State allows."""
    assume((cycle, phase) >= (0, state.phase))
    simulation = Simulation(parameters, state)
    events = simulation.advance(cycle, phase, 3000)
    if len(events) < 3000:
        now = simulation.state
        assert (now.cycle, now.phase) == (cycle, phase)
        assert -1.0 <= now.displacement <= 0.0


def test_state_in_flight_in_50_digits() -> None:
    """The state between two impacts is that of eqs. (4)-(5) since the last one."""
    simulation = Simulation(Parameters(1.2), State(0, 0.3, -0.5, 0.4))
    last = simulation.advance(50, 1.0, 5000)[-1]
    flight = Flight(*(float(last[name]) for name in (
        'phase', 'displacement', 'velocity_after', 'alpha', 'beta', 'gamma')))
    with mp.workdps(DIGITS):
        d = (50 - int(last['cycle'])) * 2 * mp.pi + 1 - mp.mpf(float(last['phase']))
        assert abs(simulation.state.displacement - flight.displacement_at(d)) < 3e-15
        assert abs(simulation.state.velocity - flight.velocity_at(d)) < 3e-15


def test_retune_keeps_the_state_and_changes_the_force() -> None:
    """State and velocity are continuous; the next impact is right in 50 digits."""
    simulation = Simulation(Parameters(1.2), State(0, 0.3, -0.5, 0.4))
    simulation.advance(20, 2.0, 5000)
    before = simulation.state
    new = Parameters(0.7, 0.3, -0.2, 0.6)
    record = simulation.retune(new)
    assert len(record) == 1 and record['kind'][0] == EventKind.RETUNE
    assert simulation.state == before
    for name, value in (('displacement', before.displacement), ('velocity', before.velocity),
                        ('velocity_after', before.velocity), ('cycle', 20), ('phase', 2.0),
                        ('alpha', 0.7), ('beta', 0.3), ('gamma', -0.2), ('restitution', 0.6),
                        ('epoch', 1)):
        assert record[name][0] == value
    event = simulation.advance(99, 0.0, 1)[0]
    assert event['velocity_after'] == -0.6 * event['velocity']
    flight = Flight(2.0, before.displacement, before.velocity, 0.7, 0.3, -0.2)
    with mp.workdps(DIGITS):
        guess = (int(event['cycle']) - 20) * TWO_PI + event['phase'] - 2.0
        d = mp.findroot(lambda x: flight.displacement_at(x) - float(event['displacement']), guess)
        assert abs(guess - d) < 1e-14
        assert not [x for x in mp.linspace(0, d * 0.999, 500)
                    if not -1 < flight.displacement_at(x) < 0]


@given(parameters=PARAMETERS, state=STATES, cycle=st.integers(1, 2), phase=PHASES)
def test_a_retune_to_the_same_parameters_changes_nothing(
        parameters: Parameters, state: State, cycle: int, phase: float) -> None:
    """But for rounding of a state taken in mid-flight: the next strong impact is the same."""
    assume(parameters.alpha > 0.1)
    plain, retuned = (Simulation(parameters, state) for _ in range(2))
    if len(plain.advance(cycle, phase, 2000)) == 2000:
        return
    retuned.advance(cycle, phase, 2000)
    retuned.retune(parameters)
    a, b = plain.advance(9, 0.0, 1), retuned.advance(9, 0.0, 1)
    if len(b) and b['kind'] == EventKind.RELEASE and abs(
            float(b['cycle'][0] - cycle) * TWO_PI + b['phase'][0] - phase) < 1e-12:
        # It was released at this moment, to rounding, and is once more.
        b = retuned.advance(9, 0.0, 1)
    if len(a) and abs(a['velocity'][0]) > 0.1:
        assert a['kind'] == b['kind']
        tau = [float(e['cycle'][0] * TWO_PI + e['phase'][0]) for e in (a, b)]
        assert tau[0] == pytest.approx(tau[1], abs=1e-11)
        assert a['velocity'][0] == pytest.approx(b['velocity'][0], abs=1e-11)


def test_retune_releases_a_resting_gear() -> None:
    """A gear permanently at rest leaves when the load changes sign, at that moment."""
    simulation = Simulation(Parameters(0.2, 0.1, 0.5, 0.9), State())
    simulation.advance(7, 3.0, 10)
    assert simulation.is_permanently_at_rest
    simulation.retune(Parameters(0.0, 0.0, -0.5, 0.9))
    event = simulation.advance(99, 0.0, 1)[0]
    assert event['displacement'] == -1.0
    assert event['cycle'] * TWO_PI + event['phase'] == pytest.approx(
        7 * TWO_PI + 3.0 + 2.0, rel=1e-15)


@given(start=PHASES, target=PHASES, moment=st.tuples(st.integers(1, 3), PHASES))
def test_reset_never_turns_time_back(
        start: float, target: float, moment: tuple[int, float]) -> None:
    """The state is set at the next moment with the phase asked for."""
    simulation = Simulation(Parameters(1.2), State(0, start, -0.2, 0.1))
    last = simulation.advance(*moment, 1000)[-1]
    record = simulation.reset(target, -0.3, 0.7)[0]
    assert record['kind'] == EventKind.RESET and record['epoch'] == 1
    assert record['index'] == last['index']
    assert record['cycle'] == moment[0] + (1 if target < moment[1] else 0)
    assert (record['phase'], record['displacement'], record['velocity']) == (target, -0.3, 0.7)
    again = simulation.advance(int(record['cycle']) + 5, 0.0, 50)
    fresh = Simulation(Parameters(1.2), State(int(record['cycle']), target, -0.3, 0.7))
    expected = fresh.advance(int(record['cycle']) + 5, 0.0, 51)[1:]
    assert again['phase'].tobytes() == expected['phase'].tobytes()


def test_records_not_yet_handed_out_come_before_a_retune() -> None:
    """The initial RESET is never lost or overtaken."""
    simulation = Simulation(Parameters(), State())
    records = simulation.retune(Parameters(0.5))
    assert records['kind'].tolist() == [EventKind.RESET, EventKind.RETUNE]
    assert records['alpha'].tolist() == [0.48, 0.5]


@pytest.mark.parametrize('cycle, phase', [
    (0, 0.5), (1, math.nan), (1, -0.1), (1, TWO_PI), (1, math.inf)])
def test_impossible_moments_are_refused(cycle: int, phase: float) -> None:
    """Going back, no number, and no phase: ValueError, and nothing has moved."""
    simulation = Simulation(Parameters(), State(0, 1.0, -0.5, 0.3))
    with pytest.raises(ValueError, match='phase'):
        simulation.advance(cycle, phase, 10)
    assert simulation.state == State(0, 1.0, -0.5, 0.3)


@pytest.mark.parametrize('name, value', [
    ('noise', math.nan), ('noise', -0.1), ('noise', 1e9), ('seed', -1), ('seed', 2**63),
    ('seed', 1.5), ('seed', math.nan)])
def test_impossible_noise_is_refused(name: str, value: float) -> None:
    """A ValueError names noise or seed."""
    with pytest.raises(ValueError, match=f'^{name} = '):
        Simulation(Parameters(), State(), **{name: value})
    with pytest.raises(ValueError, match='^most = 0'):
        Simulation(Parameters(), State()).advance(1, 0.0, 0)


@pytest.mark.parametrize('cycle', [10**9, 2**32 - 3])
def test_long_runs_lose_no_digits(cycle: int) -> None:
    """Begun many periods later, the events are the same to the bit; cycles wrap at 2^32."""
    early = Simulation(Parameters(1.2), State(0, 0.3, -0.5, 0.4)).advance(100, 0.0, 5000)
    late = Simulation(Parameters(1.2), State(cycle, 0.3, -0.5, 0.4)).advance(
        cycle + 100, 0.0, 5000)
    assert np.array_equal(late['cycle'], (early['cycle'].astype(np.uint64) + cycle) % 2**32)
    for name in EVENT.names or ():
        if name != 'cycle':
            assert late[name].tobytes() == early[name].tobytes()


def test_impact_numbers_wrap() -> None:
    """Impact 2^32 has index 0, and nothing else changes."""
    simulation = Simulation(Parameters(1.2), State(0, 0.3, -0.5, 0.4))
    plain = Simulation(Parameters(1.2), State(0, 0.3, -0.5, 0.4)).advance(30, 0.0, 1000)[1:]
    simulation.advance(0, 0.3, 1)
    simulation._trajectory[0]['index'] = 2**32 - 5
    events = simulation.advance(30, 0.0, 1000)
    assert np.array_equal(events['index'], (plain['index'].astype(np.int64) - 5) % 2**32)
    assert events['velocity'].tobytes() == plain['velocity'].tobytes()


@pytest.mark.parametrize('alpha, gamma', [(0.0, 1e-6), (1e-4, 1e-7), (0.01, -1e-8)])
def test_flights_longer_than_64_periods(alpha: float, gamma: float) -> None:
    """A tiny load takes hundreds of periods to the wall: right in 50 digits all the same."""
    start = State(0, math.pi / 2, -0.5, 0.0)
    simulation = Simulation(Parameters(alpha, 0.0, gamma, 0.9), start)
    event = simulation.advance(10**5, 0.0, 2)[1]
    flight = Flight(math.pi / 2, -0.5, 0.0, alpha, 0.0, gamma)
    found = event['cycle'] * TWO_PI + event['phase'] - math.pi / 2
    assert found > 64 * TWO_PI
    with mp.workdps(DIGITS):
        d = mp.findroot(lambda x: flight.displacement_at(x) - float(event['displacement']),
                        float(found))
        speed = abs(flight.velocity_at(d))
        # A rounding of the velocity in each leg of 64 periods, carried to the end.
        legs = float(d) / (64 * TWO_PI)
        assert abs(found - d) < 1e-15 * d * (1.0 + legs * (alpha + speed) / speed)
        assert event['velocity'] == pytest.approx(float(flight.velocity_at(d)), rel=1e-9)
        before = np.linspace(0.0, float(d) * 0.9999, 20000)
        path = -0.5 + alpha * (np.sin(math.pi / 2 + before) - 1.0) + gamma * before**2 / 2
        assert -1.0 < path.min() and path.max() < 0.0


@pytest.mark.parametrize('beta', [0.0, pytest.param(0.1, marks=pytest.mark.long)])
def test_a_flight_without_any_impact_does_not_hang(beta: float) -> None:
    """A gear that always oscillates between the walls: no event in 2^31 - 1 periods."""
    alpha = 0.3
    simulation = Simulation(Parameters(alpha, beta, 0.0, 0.9), State(0, 0.0, -0.5, alpha))
    cycle = 2**31 - 1
    assert len(simulation.advance(cycle, 1.0, 10)) == 1
    # The drive alone moves it, whatever the damping.
    expected = -0.5 + alpha * math.sin(1.0)
    assert simulation.state.displacement == pytest.approx(expected, abs=1e-9)


def test_noise_has_the_same_bytes_for_the_same_seed() -> None:
    """Reproducible, and another seed is another run."""
    first, second, other = (
        Simulation(Parameters(1.2), State(0, 0.3, -0.5, 0.4), noise=0.05, seed=seed).advance(
            50, 0.0, 1000) for seed in (7, 7, 8))
    assert first.tobytes() == second.tobytes() != other.tobytes()


def test_kicks_are_normal_and_independent() -> None:
    """Kicks that reach the wall on neither side: mean 0, the stated deviation, no memory."""
    sigma = 0.01
    events = Simulation(Parameters(1.2), State(0, 0.3, -0.5, 0.4), noise=sigma, seed=3).advance(
        10**6, 0.0, 40001)[1:]
    kicks = (events['velocity_after'] + 0.9 * events['velocity']) / sigma
    clear = np.abs(events['velocity']) > 10 * sigma
    assert stats.kstest(kicks[clear], 'norm').pvalue > 1e-3
    assert stats.normaltest(kicks[clear]).pvalue > 1e-3
    both = clear[1:] & clear[:-1]
    assert abs(np.corrcoef(kicks[1:][both], kicks[:-1][both])[0, 1]) < 5 / math.sqrt(both.sum())
    other = Simulation(Parameters(1.2), State(0, 0.3, -0.5, 0.4), noise=sigma, seed=4).advance(
        10**6, 0.0, 40001)[1:]
    others = (other['velocity_after'] + 0.9 * other['velocity']) / sigma
    both = clear & (np.abs(other['velocity']) > 10 * sigma)
    assert abs(np.corrcoef(kicks[both], others[both])[0, 1]) < 5 / math.sqrt(both.sum())


def test_a_kick_never_drives_the_gear_through_the_wall() -> None:
    """Even the strongest noise leaves the velocity away from the wall."""
    events = Simulation(Parameters(0.48), State(), noise=10.0, seed=1).advance(
        10**6, 0.0, 20000)[1:]
    events = events[events['kind'] <= EventKind.STICK]
    towards = np.where(events['displacement'] == 0.0, 1.0, -1.0)
    assert np.all(towards * events['velocity_after'] < 0.0)
    assert np.all(towards * events['velocity'] >= 0.0)


def test_velocities_without_bound_can_be_looked_at() -> None:
    """An elastic gear without friction always gains speed; its state is still a State."""
    simulation = Simulation(Parameters(1000.0, 0.0, 0.0, 1.0), State(0, 0.2, -0.3, 9999.0))
    for _ in range(20):
        simulation.advance(10**6, 0.0, 1000)
        assert math.isfinite(simulation.state.velocity)
