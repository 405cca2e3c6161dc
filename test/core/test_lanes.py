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

"""Many trajectories at once: against the simulation, 50 digits, and themselves."""

import math
import os
from typing import Any

import llvmlite.binding as llvm
import mpmath as mp
import numba
import numpy as np
import numpy.typing as npt
import pytest
from reference import DIGITS, Flight

from gear_rattle_ros.core.arrays import RecordArray
from gear_rattle_ros.core.flight import lanes_step, lanes_stride
from gear_rattle_ros.core.flight.closed_form import displace
from gear_rattle_ros.core.flight.elementary import sine_cosine, TWO_PI
from gear_rattle_ros.core.flight.lanes import (
    advance,
    begin,
    EMPTY,
    FLOATS,
    IMPACT,
    INITIAL,
    is_busy,
    model_in,
    new_impacts,
    new_tiles,
    NO_IMPACTS,
    refill,
    release,
    RESTS,
    RUNS,
)
from gear_rattle_ros.core.flight.lanes_step import LANES
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EventKind, Parameters, State

STEPS = 40


def same_parameters(count: int, seed: int, alpha: float, beta: float = 0.1, gamma: float = 0.1,
                    restitution: float = 0.9) -> RecordArray:
    """Return initial conditions on the upper wall and between the walls, parameters the same."""
    random = np.random.default_rng(seed)
    initial = np.zeros(count, INITIAL)
    initial['phase'] = random.uniform(0.0, TWO_PI, count)
    initial['displacement'] = np.where(random.random(count) < 0.5, 0.0, -random.random(count))
    initial['velocity'] = random.uniform(-1.5, 1.5, count)
    for name, value in (('alpha', alpha), ('beta', beta), ('gamma', gamma),
                        ('restitution', restitution)):
        initial[name] = value
    return initial


def mixed(count: int, seed: int) -> RecordArray:
    """Return initial conditions everywhere, with parameters drawn and with special values."""
    random = np.random.default_rng(seed)
    initial = same_parameters(count, seed, 1.0)
    on_lower = random.random(count) < 0.2
    initial['displacement'][on_lower] = -1.0
    initial['velocity'] = random.normal(0.0, 1.0, count) * 10.0**random.uniform(-3.0, 0.5, count)
    initial['alpha'] = np.where(
        random.random(count) < 0.1, 0.0, 10.0**random.uniform(-1.0, 1.0, count))
    initial['beta'] = np.where(
        random.random(count) < 0.2, 0.0, 10.0**random.uniform(-2.0, 0.5, count))
    initial['gamma'] = np.where(random.random(count) < 0.2, 0.0, random.normal(0.0, 0.3, count))
    initial['restitution'] = random.choice([0.0, 0.5, 0.9, 1.0], count)
    return initial


def follow(initial: RecordArray, count: int, steps: int = STEPS,
           longest: int = 10**6) -> tuple[list[RecordArray], npt.NDArray[np.int64]]:
    """Return the first `count` impacts from each, and why it ended, through one tile."""
    tile, impacts = new_tiles(1)[0], new_impacts(steps)
    pieces: list[list[RecordArray]] = [[] for _ in initial]
    ends = np.full(len(initial), -1)
    following = refill(tile, initial, 0, float(count))
    while is_busy(tile):
        advance(tile, impacts, steps)
        for i in np.flatnonzero(tile['number'] != EMPTY):
            number = tile['number'][i]
            pieces[number].append(impacts[i, :tile['count'][i]].copy())
            if tile['left'][i] == 0.0 or tile['cycle'][i] > longest:
                assert ends[number] == -1
                ends[number] = tile['end'][i]
                release(tile, i)
        following = refill(tile, initial, following, float(count))
    assert following == len(initial)
    return [np.concatenate(p) if p else np.empty(0, IMPACT) for p in pieces], ends


def test_first_impacts_in_50_digits() -> None:
    """At the time found the gear is at the wall, at that velocity, and was at no wall before."""
    initial = mixed(60, 2)
    impacts, _ = follow(initial, 1)
    checked = 0
    for state, found in zip(initial, impacts, strict=True):
        fields = [float(state[name]) for name in (
            'phase', 'displacement', 'velocity', 'alpha', 'beta', 'gamma')]
        into = (state['displacement'], state['velocity'] > 0) in ((0.0, True), (-1.0, False))
        if len(found) == 0 or into or state['velocity'] == 0.0:
            continue
        flight = Flight(*fields)
        with mp.workdps(DIGITS):
            d = (int(found['cycle'][0]) * 2 * mp.pi + mp.mpf(float(found['phase'][0]))
                 - fields[0])
            velocity = flight.velocity_at(d)
            wall = 0 if found['velocity'][0] > 0 else -1
            size = 1 + fields[3] + float(d) / 10
            assert abs(flight.displacement_at(d) - wall) < 4e-15 * size * (1 + abs(velocity))
            assert abs(velocity - float(found['velocity'][0])) < 2e-14 * size * (1 + fields[3])
            assert all(-1 < flight.displacement_at(d * k / 200) < 0 for k in range(1, 200))
        checked += 1
    assert checked > 30


@pytest.mark.parametrize('alpha, beta, gamma, restitution', [
    (0.48, 0.1, 0.4, 0.3), (0.5, 0.0, -0.4, 0.3), (1.5, 2.0, 0.2, 0.2), (0.6, 0.1, 0.5, 0.0)])
def test_chatter_sticking_and_release_as_the_simulation(
        alpha: float, beta: float, gamma: float, restitution: float) -> None:
    """Through sticking and release, impact by impact, for as long as the two stay together."""
    initial = same_parameters(LANES, 3, alpha, beta, gamma, restitution)
    count, sticks = 60, 0
    impacts, ends = follow(initial, count)
    for state, found, end in zip(initial, impacts, ends, strict=True):
        simulation = Simulation(
            Parameters(alpha, beta, gamma, restitution),
            State(0, state['phase'], state['displacement'], state['velocity']))
        events = simulation.advance(10**4, 0.0, 4 * count)
        hits = events[(events['kind'] == EventKind.IMPACT) | (events['kind'] == EventKind.STICK)]
        rests = simulation.is_permanently_at_rest and len(hits) < count
        assert end == (RESTS if rests else RUNS)
        assert len(found) == min(count, len(hits))
        hits = hits[:len(found)]
        late = (found['cycle'] - hits['cycle']) * TWO_PI + found['phase'] - hits['phase']
        assert np.abs(late).max() < 1e-5
        assert np.abs(found['velocity'] - hits['velocity']).max() < 1e-5
        sticks += np.count_nonzero(hits['kind'] == EventKind.STICK)
    assert sticks > LANES // 2


def test_what_never_meets_a_wall_again_ends() -> None:
    """A drive smaller than the backlash, no load: the gear may never meet a wall."""
    random = np.random.default_rng(4)
    initial = same_parameters(4 * LANES, 4, 0.2, 0.1, 0.0)
    initial['displacement'] = -random.random(len(initial))
    # The free motion comes to rest so far from where it begins.
    initial['velocity'] = 0.2 * np.cos(initial['phase']) + 0.1 * random.uniform(
        -1.0, 1.0, len(initial))
    impacts, ends = follow(initial, 1)
    rest = initial['displacement'] - 0.2 * np.sin(initial['phase']) + (
        initial['velocity'] - 0.2 * np.cos(initial['phase'])) / 0.1
    inside = (rest > -0.8) & (rest < -0.2)
    assert np.array_equal(ends == FLOATS, [len(found) == 0 for found in impacts])
    assert np.all(inside[ends == FLOATS])
    assert LANES // 2 < np.count_nonzero(ends == FLOATS)
    for state in initial[ends == FLOATS][:20]:
        simulation = Simulation(
            Parameters(0.2, 0.1, 0.0, 0.9),
            State(0, state['phase'], state['displacement'], state['velocity']))
        simulation.advance(1000, 0.0, 10)
        assert simulation.impacts == 0


def place(tile: Any, i: Any) -> tuple[float, ...]:
    """Evaluate the flight of a lane, or a slot, where it is known to be free."""
    sine, cosine = sine_cosine(tile['phase'][i])
    return displace(tile['duration'][i], sine, cosine, tile['velocity'][i], model_in(tile, i))


def test_never_outside_the_walls() -> None:
    """Where a flight is known to be free, at every step of every lane."""
    tile = new_tiles(1)[0]
    refill(tile, mixed(LANES, 5), 0, math.inf)
    for _ in range(600):
        advance(tile, NO_IMPACTS, 1)
        for i in np.flatnonzero(tile['left'][:LANES] > 0):
            s = tile['displacement'][i] + place(tile, i)[0]
            size = 4e-15 * (1.0 + tile['alpha'][i] * (1.0 + tile['duration'][i]))
            assert -1.0 - size < s < size


def test_flights_are_evaluated_as_by_the_scalar_kernel() -> None:
    """Bit for bit, at every step of the search in every slot."""
    tile = new_tiles(1)[0]
    initial = mixed(LANES, 11)
    initial['restitution'] = 1.0
    refill(tile, initial, 0, math.inf)
    # As where no lane can take the short way.
    tile['search'] = 1.0
    tile['use'] = 0.0
    for _ in range(60):
        advance(tile, NO_IMPACTS, 1)
        for i in range(LANES):
            assert place(tile, i) == tuple(
                tile[name][i] for name in ('moved', 'velocity_now', 'sine_now', 'cosine_now'))


def test_no_search_takes_long() -> None:
    """Grazing and the weakest impacts too: no flight of many takes 100 steps."""
    tile = new_tiles(1)[0]
    initial = mixed(LANES, 12)
    initial['velocity'] *= 1e-4
    refill(tile, initial, 0, math.inf)
    steps = np.zeros(LANES)
    for _ in range(5000):
        before = tile['duration'][:LANES].copy()
        advance(tile, NO_IMPACTS, 1)
        goes_on = (tile['duration'][:LANES] > before) & (tile['left'][:LANES] > 0.0)
        steps = np.where(goes_on, steps + 1, 0)
        assert steps.max() < 100


def test_statistics_of_chaos_equal_the_scalar_ones() -> None:
    """At alpha = 1.1, mean flight time, share of the upper wall and mean speed."""
    count, skipped = 1500, 100

    def means(times: npt.NDArray[np.float64], velocities: npt.NDArray[np.float64]) -> list[float]:
        return [float((times[-1] - times[skipped]) / (len(times) - 1 - skipped)),
                float(np.mean(velocities[skipped:] > 0)),
                float(np.mean(np.abs(velocities[skipped:])))]

    impacts, _ = follow(same_parameters(LANES, 6, 1.1), count)
    lanes = np.array([means(f['cycle'] * TWO_PI + f['phase'], f['velocity']) for f in impacts])
    scalar = []
    for state in same_parameters(LANES, 7, 1.1):
        simulation = Simulation(
            Parameters(1.1, 0.1, 0.1, 0.9),
            State(0, state['phase'], state['displacement'], state['velocity']))
        events = simulation.advance(10**7, 0.0, count)[1:]
        scalar.append(means(events['cycle'] * TWO_PI + events['phase'], events['velocity']))
    difference = lanes.mean(0) - np.mean(scalar, 0)
    error = np.sqrt((lanes.var(0) + np.var(scalar, 0)) / (LANES - 1))
    assert np.all(error < 0.02)
    assert np.all(np.abs(difference) < 4 * error)


def test_every_initial_condition_once_and_whatever_the_cuts() -> None:
    """Order, number of steps in a call and neighbours change no bit; nothing is lost."""
    initial = mixed(5 * LANES + 3, 8)
    whole, ends = follow(initial, 12)
    assert np.all(ends != -1)
    assert all(len(w) == 12 or end != RUNS for w, end in zip(whole, ends, strict=True))
    shuffled = np.random.default_rng(9).permutation(len(initial))
    again, ends_again = follow(initial[shuffled], 12, steps=3)
    assert np.array_equal(ends[shuffled], ends_again)
    for one, other in zip((whole[k] for k in shuffled), again, strict=True):
        assert one.tobytes() == other.tobytes()


def test_parked_lanes_go_on() -> None:
    """A lane parks just after its last impact and, begun again there, makes the same impacts."""
    initial = mixed(LANES, 10)
    initial['restitution'][:8] = 0.0
    whole, _ = follow(initial, 20)
    tile, impacts = new_tiles(1)[0], new_impacts(STEPS)
    refill(tile, initial, 0, 0.0)
    pieces: list[list[RecordArray]] = [[] for _ in initial]
    for part in (7, 13):
        for i in range(LANES):
            if tile['end'][i] == RUNS:
                begin(tile, i, tile['cycle'][i], tile['phase'][i], tile['displacement'][i],
                      tile['velocity'][i], float(part))
        while np.any(tile['left'] > 0):
            advance(tile, impacts, STEPS)
            for i in range(LANES):
                pieces[i].append(impacts[i, :tile['count'][i]].copy())
    for one, other in zip(whole, pieces, strict=True):
        assert one.tobytes() == np.concatenate(other).tobytes()


def test_refuses_too_little_room() -> None:
    """An impact is never written past the end."""
    with pytest.raises(ValueError, match='no room'):
        advance(new_tiles(1)[0], new_impacts(STEPS), STEPS + 1)


@pytest.mark.skipif('NUMBA_CPU_FEATURES' in os.environ, reason='another processor is asked for')
@pytest.mark.skipif(llvm.get_process_triple().split('-')[0] != 'x86_64', reason='x86 assembly')
def test_every_loop_is_vectorised() -> None:
    """Square roots and products are packed, in the widest registers the processor has."""
    record = numba.typeof(new_tiles(1)[0])
    codes = []
    kernels: tuple[tuple[Any, Any], ...] = (
        (lanes_step.step, ()), (lanes_stride.stride, (numba.int64,)))
    for function, others in kernels:
        fresh = numba.njit(error_model='numpy', nogil=True)(function.py_func)
        fresh.compile((record, *others))
        codes.append('\n'.join(fresh.inspect_asm().values()))
    features = llvm.get_host_cpu_features()
    register = '%zmm' if features.get('avx512f') else '%ymm' if features.get('avx') else '%xmm'
    code = '\n'.join(codes)
    packed = [line for line in code.splitlines() if 'sqrtpd' in line and register in line]
    assert len(packed) >= 3
    assert 'sqrtsd' not in code
    # The phase after an impact, twice in each.
    assert all('cvttsd2si' not in code for code in codes)
