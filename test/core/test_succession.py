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

"""A stream follows from its own records, and a wrong bit anywhere in it is found."""

import numpy as np
import pytest

from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EVENT, EventArray, EventKind, Parameters, State
from gear_rattle_ros.core.stream.succession import Succession

FLOATS = [name for name in EVENT.names or () if EVENT[name] == np.float64]


def story(noise: float = 0.0, start: State | None = None) -> list[EventArray]:
    """Return a steered run in batches: retunes, a ramp, resets, sticking, flights of many legs."""
    s = Simulation(Parameters(0.57), start or State(velocity=-0.5), noise=noise, seed=7)
    batches = [s.advance(2**40, 0.0, 500)]
    for number in range(40):
        cycle, phase = s.moment
        batches.append(s.advance(cycle + number % 3, min(phase + 0.7 * number % 5.0, 6.28), 100))
        batches.append(s.retune(Parameters(0.5 + 0.02 * number, 0.1, 0.1, 0.9)))
    # A ramp: a retune at the end of every drive period.
    for number in range(60):
        cycle = s.moment[0] + 1
        batches.append(s.advance(cycle, 0.0, 1000))
        batches.append(s.retune(Parameters(1.3 - 0.01 * number)))
    # Set into the wall and retuned at the same moment.
    batches.append(s.reset(0.3, 0.0, 0.4))
    batches.append(s.retune(Parameters(0.9, 0.3, -0.2, 0.4)))
    batches.append(s.advance(s.moment[0] + 500, 1.0, 10**5))
    # No impacts for more than a leg of 64 periods; then at rest; then plastic walls.
    batches.append(s.retune(Parameters(0.2, 0.2, 0.0, 0.9)))
    batches.append(s.advance(s.moment[0] + 200, 1.0, 10**4))
    batches.append(s.reset(2.0, -0.5, 0.0))
    batches.append(s.advance(s.moment[0] + 200, 1.0, 10**4))
    batches.append(s.retune(Parameters(0.2, 0.2, 0.01, 0.9)))
    batches.append(s.advance(s.moment[0] + 300, 1.0, 10**4))
    batches.append(s.retune(Parameters(2.0, 0.1, 0.5, 0.0)))
    batches.append(s.advance(s.moment[0] + 100, 1.0, 10**4))
    return [batch for batch in batches if len(batch)]


def joined(check: Succession, batches: list[EventArray]) -> object:
    """Feed batches up to a contradiction."""
    for batch in batches:
        found = check.take(batch)
        if found is not None:
            return found
    return None


@pytest.mark.parametrize('noise', [0.0, 1e-3, 0.3])
@pytest.mark.parametrize('start', [
    State(velocity=-0.5), State(cycle=2**32 - 100, phase=1.0, velocity=-0.3)])
def test_a_run_follows_however_it_is_cut(noise: float, start: State) -> None:
    """Every kind of record, noise and the wrap of the cycle numbers; all flights are rebuilt."""
    batches = story(noise, start)
    whole = np.concatenate(batches)
    # A gear that is kicked at every impact never sticks.
    assert set(whole['kind']) >= set(EventKind) - ({EventKind.STICK, EventKind.RELEASE} if noise
                                                   else set())
    for pieces in (batches, [whole], [whole[i:i + 1] for i in range(len(whole))]):
        check = Succession()
        assert joined(check, pieces) is None
        assert not check.holes
        assert (check.events, check.flights) == (len(whole), len(whole) - 1)
        assert check.epochs == 1 + int(whole['epoch'][-1])
        assert check.impacts == np.count_nonzero(whole['kind'] <= EventKind.STICK)
    assert (check.kicked > 0.9 * check.impacts) if noise else not check.kicked


def test_the_wrap_of_the_index_is_no_hole() -> None:
    """Numbers run on through 2^32."""
    s = Simulation(Parameters(0.57), State(velocity=-0.5))
    events = s.advance(10**9, 0.0, 400)
    events['index'] -= np.uint32(200)
    check = Succession()
    assert check.take(events) is None
    assert not check.holes


@pytest.mark.parametrize('noise', [0.0, 1e-3])
def test_a_flip_of_the_lowest_bit_of_any_number_is_found(noise: float) -> None:
    """One flipped bit in any field of a record is found there, in the field, by its number."""
    whole = np.concatenate(story(noise))
    rng = np.random.default_rng(1)
    places = rng.integers(1, len(whole) - 2, 5)
    for place in places:
        for name in EVENT.names or ():
            events = whole.copy()
            size = EVENT[name].itemsize
            bits = events[name][place:place + 1].view(f'u{size}')
            bits ^= np.array(1, bits.dtype)
            if name == 'kind' and events['kind'][place] > EventKind.RESET:
                continue
            found = joined(Succession(), [events])
            if noise and name == 'velocity_after' and found is None:
                # Such a kick may be, if nothing that follows depends on its last bit.
                continue
            assert found is not None, (place, name)
            kind = whole['kind'][place]
            if kind == EventKind.RETUNE and name in ('alpha', 'beta', 'gamma', 'restitution'):
                # Any parameters may be set: what comes next does not follow from these.
                assert found.place > place
            elif kind == EventKind.RESET or (kind == EventKind.RETUNE and name in (
                    'cycle', 'phase')):
                assert found.place >= place
            elif noise and name == 'velocity_after':
                assert found.place in (place, place + 1)
            else:
                assert found.place == place, (place, name, found)
                named = name in found.what
                assert named or name in ('kind', 'cycle'), (name, found)


def test_a_flip_of_a_high_bit_of_a_cycle_is_found_in_a_run_without_impacts() -> None:
    """The flight of 2^30 periods that it would be is followed to its end."""
    s = Simulation(Parameters(0.2, 0.1, 0.0), State(velocity=0.2, displacement=-0.6))
    batches = [s.advance(100, 1.0, 10), s.retune(Parameters(0.21, 0.1, 0.0)),
               s.advance(200, 2.0, 10), s.retune(Parameters(0.2, 0.1, 0.0))]
    events = np.concatenate(batches)
    assert list(events['kind']) == [EventKind.RESET, EventKind.RETUNE, EventKind.RETUNE]
    assert joined(Succession(), [events]) is None
    events['cycle'][1] ^= np.uint32(2**30)
    assert joined(Succession(), [events]) is not None


def test_missing_batches_are_holes_with_their_numbers() -> None:
    """What is lost is named by index and epoch, and is no contradiction."""
    batches = story()
    check = Succession()
    assert joined(check, batches[:3] + batches[5:]) is None
    (hole,) = check.holes
    lost = int(batches[5]['index'][0]) - int(batches[2]['index'][-1]) - int(
        batches[5]['kind'][0] <= EventKind.STICK)
    last, first = batches[2][-1], batches[5][0]
    assert hole.after == (last['index'], last['epoch'])
    assert hole.before == (first['index'], first['epoch'])
    assert hole.lost == lost
    # A second run in the same bag begins anew; the same in the middle of a run is a hole.
    check = Succession()
    assert joined(check, [*batches[:4], *batches]) is None
    assert (check.runs, check.holes) == (2, [])
    check = Succession()
    assert joined(check, [*batches[:4], *batches[2:]]) is None
    assert (len(check.holes), len(check.anew)) == (0, 1)


def test_a_record_lost_out_of_a_batch_is_a_contradiction() -> None:
    """Transport loses whole batches only."""
    events = np.concatenate(story())
    found = joined(Succession(), [np.delete(events, 100)])
    assert found is not None
    assert found.place == 100
