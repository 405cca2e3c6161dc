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

"""Whether each record of a stream follows from the one before it, bit for bit."""

import dataclasses
import math
from typing import Any, Final

import numpy as np

from .guard import Hole
from ..arrays import FloatArray, IntArray, Record, RecordArray
from ..compiled import kernel
from ..flight.closed_form import elapsed
from ..flight.simulation import run, settle, state_at, TRAJECTORY, write_event
from ..model import EVENT, EventArray, EventKind

IMPACT, STICK, RELEASE, RETUNE, RESET = (int(kind) for kind in EventKind)
FOLLOWS, DIFFERS, NUMBERING, BACKWARDS, OVERDUE, NOTHING = range(6)
# Counts of impacts, of kicked ones and of epochs; whether the last record, or impact, was kicked.
IMPACTS, KICKED, EPOCHS, WAS_KICKED, IN_NOISE, COUNTS = range(6)
# Noise has not just begun with a kick so small, relative to the velocity.
SMALLEST_KICK: Final = 4 * 2.0**-52


@dataclasses.dataclass(frozen=True)
class Contradiction:
    """A record that does not follow from the one before it."""

    place: int  # in the batch; -1 for the last record of the batch before
    index: int
    epoch: int
    what: str  # what it reports and what follows, in words


@kernel
def same(a: float, b: float) -> bool:
    """Whether two finite numbers have the same bits, the sign of a zero included."""
    return a == b and math.copysign(1.0, a) == math.copysign(1.0, b)


@kernel
def depart(trajectory: Record, event: Record) -> None:
    """Put a trajectory where a record leaves it, without noise."""
    t = trajectory
    t.index, t.epoch, t.cycle, t.phase = event.index, event.epoch, event.cycle, event.phase
    t.displacement, t.velocity, t.noise = event.displacement, event.velocity_after, 0.0
    t.alpha, t.beta, t.gamma, t.restitution = (
        event.alpha, event.beta, event.gamma, event.restitution)
    settle(t)
    if event.kind == RELEASE:
        t.rests = False


@kernel
def compare_step(before: Record, event: Record, trajectory: Record, room: RecordArray,
                 kicks: IntArray) -> int:
    """Rebuild in `room` the record that comes after `before`, and compare `event` with it."""
    # Returns FOLLOWS, DIFFERS (from `room`), NUMBERING (of impacts or epochs), BACKWARDS (in
    # time), OVERDUE (an event was due before it, in `room`) or NOTHING (was due that soon).
    # `kicks` notes whether noise has changed the velocity after an impact.
    p, q, t = before, event, trajectory
    kicks[WAS_KICKED] = 0
    counted = 1 if q.kind <= STICK else 0
    begins = 1 if q.kind >= RETUNE else 0
    is_numbered = (np.uint32(q.index - p.index) == counted
                   and np.uint32(q.epoch - p.epoch) == begins)
    cycles = np.int64(np.uint32(q.cycle - p.cycle))
    if cycles >= 2**31 or elapsed(cycles, p.phase, q.phase) < 0.0:
        return BACKWARDS if is_numbered else NUMBERING
    depart(t, p)
    e = room[0]
    if q.kind >= RETUNE:
        if not is_numbered:
            return NUMBERING
        # A reset takes place less than a period after the moment up to which all was reported.
        until = t.cycle + cycles - (1 if q.kind == RESET else 0)
        if elapsed(until - t.cycle, p.phase, q.phase) > 0.0 and run(t, room, until, q.phase):
            return OVERDUE
        if q.kind == RESET:
            t.displacement, velocity = q.displacement, q.velocity
        else:
            t.displacement, velocity = state_at(t, np.int64(p.cycle) + cycles, q.phase)
            t.alpha, t.beta, t.gamma, t.restitution = q.alpha, q.beta, q.gamma, q.restitution
        t.velocity = velocity
        t.epoch += 1
        t.cycle, t.phase = q.cycle, q.phase
        write_event(e, q.kind, t, velocity)
    elif not run(t, room, t.cycle + cycles + 1, q.phase):
        return NOTHING if is_numbered else NUMBERING
    is_same = (
        e.cycle == q.cycle and same(e.phase, q.phase) and same(e.displacement, q.displacement)
        and same(e.velocity, q.velocity) and same(e.alpha, q.alpha) and same(e.beta, q.beta)
        and same(e.gamma, q.gamma) and same(e.restitution, q.restitution))
    if not is_numbered:
        # Where all else follows, it is the numbers that are wrong, not records that are missing.
        return DIFFERS if is_same else NUMBERING
    if not is_same:
        return DIFFERS
    if e.kind == q.kind and same(e.velocity_after, q.velocity_after):
        if counted:
            kicks[IN_NOISE] = 0
        return FOLLOWS
    towards = 1.0 if q.displacement == 0.0 else -1.0
    if q.kind != IMPACT or e.kind > STICK or towards * q.velocity_after > 0.0:
        return DIFFERS
    kick = abs(q.velocity_after - e.velocity_after)
    if not kicks[IN_NOISE] and kick <= SMALLEST_KICK * abs(e.velocity_after):
        return DIFFERS
    kicks[WAS_KICKED] = 1
    kicks[IN_NOISE] = 1
    return FOLLOWS


@kernel
def follow_steps(last: RecordArray, events: RecordArray, trajectory: Record, room: RecordArray,
                 counts: IntArray, unkicked: FloatArray) -> tuple[int, int]:
    """Compare records with those before them; return how many follow, and why not the next."""
    # `last` becomes the last that follows, `room` the record expected, and `unkicked` receives the
    # velocity after the last impact without noise [1].
    for i in range(len(events)):
        kicked = counts[WAS_KICKED]
        what = compare_step(last[0], events[i], trajectory, room, counts)
        if what != FOLLOWS:
            counts[WAS_KICKED] = kicked
            return i, what
        kind = events[i].kind
        counts[IMPACTS] += 1 if kind <= STICK else 0
        counts[EPOCHS] += 1 if kind >= RETUNE else 0
        counts[KICKED] += counts[WAS_KICKED]
        unkicked[0] = room[0].velocity_after
        last[0] = events[i]
    return len(events), FOLLOWS


class Succession:
    """Rebuild every flight of a stream, given in batches, and reproduce its records."""

    # After a kick by noise, the velocity is taken as it is, and what comes next must follow.
    def __init__(self) -> None:
        self.holes: list[Hole] = []
        # Where the numbers begin anew in mid-run, so that it is not known what is missing.
        self.anew: list[Hole] = []
        # Runs seen, each from its first reset on; records seen; steps between them rebuilt.
        self.runs = self.events = self.flights = 0
        self._counts = np.zeros(COUNTS, np.int64)
        self._last: EventArray | None = None
        self._room = np.zeros(1, EVENT)
        self._unkicked = np.zeros(1)
        self._trajectory: Any = np.zeros(1, TRAJECTORY)[0]

    @property
    def impacts(self) -> int:
        return int(self._counts[IMPACTS])

    @property
    def kicked(self) -> int:
        return int(self._counts[KICKED])

    @property
    def epochs(self) -> int:
        """Return the epochs seen, each from its retune or reset on."""
        return int(self._counts[EPOCHS])

    def take(self, events: EventArray) -> Contradiction | None:
        """Take the next batch; return the first record that does not follow, then give no more."""
        done = 0
        if self._last is None and len(events):
            done = self._begin(events[:1])
        while done < len(events):
            assert self._last is not None
            count, what = follow_steps(
                self._last, events[done:], self._trajectory, self._room, self._counts,
                self._unkicked)
            self.flights += count
            self.events += count
            done += count
            if what == FOLLOWS:
                break
            record = events[done:done + 1]
            # Batches get lost, not records out of their middle.
            if done or not self._is_hole(record[0], what):
                return self._contradiction(done, record, what)
            done += self._begin(record)
        return None

    def _begin(self, record: EventArray) -> int:
        first = record[0]
        last = self._last
        is_new = (first['kind'] == RESET and first['index'] == 0 and first['epoch'] == 0)
        if last is not None and not is_new:
            before = last[0]
            counted = int(first['kind'] <= STICK)
            jump = (int(first['index']) - int(before['index']) - counted) % 2**32
            ends = ((int(before['index']), int(before['epoch'])),
                    (int(first['index']), int(first['epoch'])))
            if jump < 2**31:
                self.holes.append(Hole(*ends, jump))
            else:
                self.anew.append(Hole(*ends, 0))
        self.runs += int(is_new or last is None)
        self.events += 1
        self._counts[IMPACTS] += int(first['kind'] <= STICK)
        self._counts[EPOCHS] += 1
        self._counts[WAS_KICKED] = self._counts[IN_NOISE] = 0
        self._last = record.copy()
        return 1

    def _is_hole(self, record: Any, what: int) -> bool:
        assert self._last is not None
        before = self._last[0]
        # A batch with nothing but a release leaves no gap in the numbers.
        without_release = before['kind'] == STICK and record['kind'] <= STICK
        is_new = record['kind'] == RESET and record['index'] == 0 and record['epoch'] == 0
        return bool(what == NUMBERING or without_release or is_new)

    def _contradiction(self, place: int, record: EventArray, what: int) -> Contradiction:
        assert self._last is not None
        before, found, expected = self._last, record[0], self._room[0].copy()
        if self._counts[WAS_KICKED]:
            # Not the record is wrong but the kick before it, if all is well without that.
            mended = before.copy()
            mended['velocity_after'] = self._unkicked[0]
            scratch = np.zeros(COUNTS, np.int64)
            if compare_step(mended[0], found, self._trajectory, self._room, scratch) == FOLLOWS:
                wrong = before[0]
                return Contradiction(
                    place - 1, int(wrong['index']), int(wrong['epoch']),
                    _sentence('velocity_after', wrong, mended[0]))
        return Contradiction(place, int(found['index']), int(found['epoch']),
                             _words(what, before[0], found, expected))


def _words(what: int, before: Any, found: Any, expected: Any) -> str:
    if what == DIFFERS:
        names = ['index', 'epoch', 'cycle', 'phase', 'displacement', 'velocity', 'alpha', 'beta',
                 'gamma', 'restitution', 'kind', 'velocity_after']
        if (found['kind'] <= STICK) != (expected['kind'] <= STICK):
            names.insert(0, 'kind')
        # What noise may have changed comes last.
        for name in names:
            if found[name].tobytes() != expected[name].tobytes():
                return _sentence(name, found, expected)
    moment = f'drive period {found["cycle"]}, phase {found["phase"].item()!r}'
    if what == OVERDUE:
        return (f'{_kind(expected)} in drive period {expected["cycle"]}, phase '
                f'{expected["phase"].item()!r} is due before it, {moment}')
    if what == BACKWARDS:
        return (f'it is at {moment}, earlier than the record before it, drive period '
                f'{before["cycle"]}, phase {before["phase"].item()!r}')
    if what == NOTHING:
        return f'{_kind(found)} is recorded at {moment}, where nothing is due'
    begins = int(found['kind'] >= RETUNE)
    counted = int(found['kind'] <= STICK)
    return (f'index is {found["index"]} and epoch {found["epoch"]}, expected '
            f'{(int(before["index"]) + counted) % 2**32} and '
            f'{(int(before["epoch"]) + begins) % 2**32}')


def _kind(record: Any) -> str:
    return f'a {EventKind(int(record["kind"])).name.lower()}'


def _sentence(name: str, found: Any, expected: Any) -> str:
    if name == 'kind':
        return f'kind is {_kind(found)[2:]}, expected {_kind(expected)[2:]}'
    return f'{name} is {found[name].item()!r}, expected {expected[name].item()!r}'
