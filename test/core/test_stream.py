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

"""Holes in the stream: gaps, restarts, duplicates, wrap-around."""

from hypothesis import given, strategies as st
import numpy as np
import pytest

from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EventArray, EventKind, Parameters, State
from gear_rattle_ros.core.stream.guard import Hole, Piece, StreamGuard


def stream(first: int = 0) -> EventArray:
    """Return 400 records with a retune and a reset, impacts numbered from `first` on."""
    simulation = Simulation(Parameters(1.2), State(0, 0.3, -0.5, 0.4))
    simulation._trajectory[0]['index'] = first
    pieces = [simulation.advance(10**6, 0.0, 200), simulation.retune(Parameters(1.1)),
              simulation.advance(10**6, 0.0, 100), simulation.reset(1.0, -0.5, 0.5)]
    events = np.concatenate([*pieces, simulation.advance(10**6, 0.0, 98)])
    events['index'][0] = first % 2**32
    assert len(events) == 400
    return events


def reasons(pieces: list[Piece]) -> list[str]:
    """Return why pieces do not follow."""
    return [piece.reason for piece in pieces]


@given(st.lists(st.integers(0, 400), max_size=10), st.sampled_from([0, 2**32 - 150, 2**31 - 99]))
def test_a_whole_stream_is_in_one_piece(cuts: list[int], first: int) -> None:
    """However cut, across retunes and resets, and where the numbers wrap, nothing is missing."""
    events, guard = stream(first), StreamGuard()
    bounds = [0, *sorted(cuts), len(events)]
    pieces = [piece for start, stop in zip(bounds[:-1], bounds[1:], strict=True)
              for piece in guard.split(events[start:stop])]
    assert pieces[0].reason == 'start'
    assert all(piece.follows and piece.lost == 0 for piece in pieces[1:])
    assert (guard.lost, guard.gaps, guard.restarts) == (0, 0, 0)
    assert np.concatenate([piece.events for piece in pieces]).tobytes() == events.tobytes()


@given(st.lists(st.booleans(), min_size=400, max_size=400),
       st.lists(st.integers(0, 400), max_size=5), st.sampled_from([0, 2**32 - 150]))
def test_lost_impacts_are_counted(keep: list[bool], cuts: list[int], first: int) -> None:
    """Lost and seen impacts add up to all of them; kept records all come back, in order."""
    events, guard = stream(first), StreamGuard()
    mask = np.array(keep)
    mask[0] = True
    kept = events[mask]
    bounds = [0, *sorted(min(cut, len(kept)) for cut in cuts), len(kept)]
    pieces = [piece for start, stop in zip(bounds[:-1], bounds[1:], strict=True)
              for piece in guard.split(kept[start:stop])]
    assert np.concatenate([piece.events for piece in pieces]).tobytes() == kept.tobytes()
    last = int(np.flatnonzero(mask)[-1])
    seen = np.count_nonzero(kept['kind'] <= EventKind.STICK)
    assert guard.lost + seen == np.count_nonzero(events['kind'][:last + 1] <= EventKind.STICK)
    assert guard.lost == sum(piece.lost for piece in pieces)
    assert guard.gaps == reasons(pieces).count('gap')
    assert guard.restarts == 0
    # The holes name exactly the impacts that are missing, each one once, and their epochs.
    named = [(hole.after[0] + number) % 2**32
             for hole in guard.holes for number in range(1, hole.lost + 1)]
    hits = events['kind'] <= EventKind.STICK
    assert named == events['index'][:last + 1][(hits & ~mask)[:last + 1]].tolist()
    for hole in guard.holes:
        ahead = (events['index'].astype(np.int64) - hole.after[0] - 1) % 2**32
        inside = events[hits & (ahead < hole.lost)]
        assert ((hole.after[1] <= inside['epoch']) & (inside['epoch'] <= hole.before[1])).all()
    # Every piece is whole: its impacts are numbered one after the other.
    for piece in pieces:
        counted = (piece.events['kind'][1:] <= EventKind.STICK).astype(np.uint32)
        assert np.all(np.diff(piece.events['index']) == counted)


def test_a_lost_retune_or_reset_is_a_gap_without_impacts() -> None:
    """The epoch shows it, where no impact is missing."""
    events = stream()
    for kind in (EventKind.RETUNE, EventKind.RESET):
        k = int(np.flatnonzero(events['kind'] == kind)[-1])
        guard = StreamGuard()
        pieces = guard.split(np.delete(events, k))
        assert reasons(pieces) == ['start', 'gap']
        assert len(pieces[0].events) == k
        assert (guard.lost, guard.gaps) == (0, 1)


def test_a_lost_release_is_a_gap() -> None:
    """After a gear has stuck no impact can follow without one."""
    simulation = Simulation(Parameters(0.48), State(0, 5.0, 0.0, 0.02))
    events = simulation.advance(40, 0.0, 4000)
    release = int(np.argmax(events['kind'] == EventKind.RELEASE))
    guard = StreamGuard()
    assert reasons(guard.split(np.delete(events, release))) == ['start', 'gap']
    assert guard.lost == 0


def test_a_restarted_simulator_is_no_gap() -> None:
    """A stream that begins anew is a restart, and nothing counts as lost."""
    guard = StreamGuard()
    guard.split(stream())
    assert reasons(guard.split(stream())) == ['restart']
    assert reasons(guard.split(stream()[50:])) == ['restart']
    assert (guard.lost, guard.gaps, guard.restarts) == (0, 0, 2)


def test_a_restart_before_any_impact_is_seen_too() -> None:
    """Even where index and epoch are those of the run before."""
    events, guard = stream(), StreamGuard()
    guard.split(events[:1])
    assert reasons(guard.split(events[:5])) == ['restart']
    assert guard.restarts == 1


@pytest.mark.parametrize('start, stop', [(0, 100), (50, 100), (99, 100)])
def test_what_comes_twice_or_goes_back_does_not_follow(start: int, stop: int) -> None:
    """Nothing is computed across it, and nothing counts as lost."""
    events, guard = stream(), StreamGuard()
    guard.split(events[:100])
    pieces = guard.split(events[start:stop])
    assert not pieces[0].follows
    assert guard.lost == 0
    assert all(piece.follows for piece in guard.split(events[100:]))


def test_an_empty_batch_is_nothing() -> None:
    """Neither a beginning nor a gap."""
    guard = StreamGuard()
    assert guard.split(stream()[:0]) == []
    assert reasons(guard.split(stream()[:3])) == ['start']


def test_a_hole_names_what_is_missing() -> None:
    """By index and epoch, also where the numbers wrap and where no impact is missing."""
    assert Hole((9, 1), (30, 1), 20).describe() == '20 impacts, 10 to 29 (epoch 1)'
    assert Hole((2**32 - 2, 0), (1, 2), 2).describe() == (
        '2 impacts, 4294967295 to 0 (epochs 0 to 2)')
    assert Hole((4, 0), (6, 0), 1).describe() == 'impact 5 (epoch 0)'
    assert Hole((4, 0), (4, 2), 0).describe() == (
        'no impact, but another record after impact 4 (epochs 0 to 2)')


def test_an_epoch_that_goes_back_is_another_run() -> None:
    """A higher index does not make its impacts the ones that are missing."""
    events, guard = stream(), StreamGuard()
    guard.split(events[:250])
    assert reasons(guard.split(stream(1000)[1:100])) == ['restart']
    assert (guard.lost, guard.restarts) == (0, 1)
