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

"""Verify a bag from itself: rebuild every flight and reproduce each record, bit for bit."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
import contextlib
import dataclasses
import itertools
from pathlib import Path
import time
from typing import Final

import numpy as np

from . import Bag, CloudDecoder
from .cdr import Named, read_diagnostics, read_joint_state
from .recomputed import Exponents, Transients
from ..core.flight.fingerprint import fingerprint
from ..core.model import EVENT, EventArray
from ..core.stream.guard import Hole, StreamGuard
from ..core.stream.succession import Succession
from ..core.words import counted

# Batches looked at together.
_GROUP: Final = 64


@dataclasses.dataclass(frozen=True)
class Verdict:
    """
    Whether a bag is verified, and what was found in it; its text is a report.

    `flights` were rebuilt from one record to the next; `exponents`, `transients` and `hops` were
    reproduced bit for bit, but for those `beyond` that rest on events which are not in the bag.
    `imbalance` is the largest difference of the mean force of the walls from what it must be, at
    the ends of batches [1]. `anew` is where the numbers begin anew in mid-run, `fault` the first
    record or report that does not follow from the events before it, `kernels` the fingerprints
    that the simulators reported. `set_back` is how far log times of the events went back [ns].
    """

    events: int
    impacts: int
    kicked: int
    flights: int
    epochs: int
    runs: int
    exponents: int
    transients: int
    hops: int
    beyond: int
    imbalance: float
    holes: tuple[Hole, ...]
    anew: tuple[Hole, ...]
    fault: str
    kernels: frozenset[str]
    is_whole: bool
    set_back: int
    seconds: float

    @property
    def is_verified(self) -> bool:
        """Whether there are events, all follow, and none is missing between them."""
        return bool(self.events) and not (self.fault or self.holes or self.anew)

    def __str__(self) -> str:
        seen = (f'{counted(self.events, "event")} ({counted(self.impacts, "impact")}, '
                f'{self.kicked:,} of them kicked by noise), {counted(self.flights, "flight")} '
                f'rebuilt, {counted(self.epochs, "epoch")} in {counted(self.runs, "run")}')
        hops = f' and {counted(self.hops, "count")} of hops' if self.hops else ''
        again = (f'{counted(self.exponents, "estimate")}{"," if hops else " and"} '
                 f'{counted(self.transients, "transient report")}{hops} reproduced, '
                 f'impulse balance within {self.imbalance:.1e}')
        notes = f', {self.beyond} more rest on what is not in the bag' if self.beyond else ''
        notes += '' if self.is_whole else '; the bag was not closed properly'
        if self.set_back:
            notes += f'; log times go back by up to {self.set_back / 1e9:,.9g} s'
        found = (f'{seen}, {again}{notes}; {self.seconds:.2f} s '
                 f'({self.events / max(self.seconds, 1e-9):.2g} events/s)')
        if self.is_verified:
            return f'verified: {found}'
        if self.fault:
            return f'not verified: {self.fault}{self._other_kernels()}'
        if not self.events:
            return 'not verified: there are no events'
        number = len(self.holes) + len(self.anew)
        lines = [f'not verified: {counted(number, "hole")}, what is between them follows: {found}']
        lines += [f'  missing: {hole.describe()}' for hole in self.holes]
        lines += [f'  the numbers begin anew at impact {hole.before[0]}, epoch {hole.before[1]}, '
                  f'after impact {hole.after[0]}, epoch {hole.after[1]}' for hole in self.anew]
        return '\n'.join(lines)

    __repr__ = __str__

    def _other_kernels(self) -> str:
        here = fingerprint()
        others = sorted(self.kernels - {here})
        if others:
            return (f'; it was recorded with other kernels ({", ".join(others)}) than these '
                    f'({here}): verify it with the version that recorded it')
        return '' if self.kernels else (
            f'; the bag does not name the kernels that recorded it (these are {here})')


def verify(path: str | Path, topic: str = '') -> Verdict:
    """
    Verify a bag; BagError if it cannot be read or has no such topic.

    Without `topic`, the events are on the one whose last part is ``impacts``; the exponents and
    transients are those beside it.
    """
    began = time.monotonic()
    bag = Bag(path)
    impacts = bag.find_impacts(topic)
    beside = impacts.rpartition('/')[0]
    estimates, counts, reports, statuses = _read(bag, {
        f'{beside}/lyapunov': lambda data: [read_joint_state(data)],
        f'{beside}/hops': lambda data: [read_joint_state(data)],
        f'{beside}/transient': read_diagnostics,
        '/diagnostics': read_diagnostics,
    })
    exponents, transients = Exponents(estimates), Transients(reports, counts)
    kernels = {status.values['kernels'] for status in statuses if 'kernels' in status.values}
    succession, guard = Succession(), StreamGuard()
    source, fault = _batches(bag, impacts), ''
    # Both release the interpreter's lock where the time is spent.
    with ThreadPoolExecutor(1) as pool:
        while batches := list(itertools.islice(source, _GROUP)):
            checking = pool.submit(_first_fault, succession, impacts, batches)
            _recompute(exponents, transients, guard, batches)
            fault = checking.result()
            if fault or exponents.fault or transients.fault:
                break
    exponents.finish()
    transients.finish()
    return Verdict(
        succession.events, succession.impacts, succession.kicked, succession.flights,
        succession.epochs, succession.runs, exponents.found, transients.found, transients.hops,
        exponents.beyond + transients.beyond, exponents.imbalance, tuple(succession.holes),
        tuple(succession.anew), fault or exponents.fault or transients.fault,
        frozenset(kernels), bag.is_whole, bag.set_back.get(impacts, 0), time.monotonic() - began)


@dataclasses.dataclass(frozen=True)
class _Batch:
    """The events of a message, or the reason why it has none."""

    number: int
    stamp: int
    events: EventArray
    fault: str


def _first_fault(succession: Succession, topic: str, batches: Sequence[_Batch]) -> str:
    """Rebuild the flights from one record to the next, and report the first that fails."""
    for batch in batches:
        where = f'message {batch.number} of {topic}'
        if batch.fault:
            return f'{where}: {batch.fault}'
        wrong = succession.take(batch.events)
        if wrong is not None:
            place = f'record {wrong.place} of' if wrong.place >= 0 else 'the last record before'
            return f'{place} {where}, impact {wrong.index}, epoch {wrong.epoch}: {wrong.what}'
    return ''


def _recompute(exponents: Exponents, transients: Transients, guard: StreamGuard,
               batches: Sequence[_Batch]) -> None:
    """Recompute the exponents and transients, anew after every hole, up to the first fault."""
    for batch in batches:
        if batch.fault or exponents.fault or transients.fault:
            return
        if len(batch.events):
            is_first = not guard.split(batch.events)[0].follows
            exponents.take(batch.events, batch.stamp, is_first)
            transients.take(batch.events, batch.stamp, is_first)


def _batches(bag: Bag, topic: str) -> Iterator[_Batch]:
    decoder = CloudDecoder()
    for number, message in enumerate(bag.messages([topic])):
        try:
            cloud = decoder.parse(message.data)
            yield _Batch(number, cloud.stamp, cloud.events(), '')
        except ValueError as error:
            yield _Batch(number, 0, np.empty(0, EVENT), str(error))


def _read(bag: Bag, decoders: Mapping[str, Callable[[bytes], list[Named]]]) -> list[list[Named]]:
    found: dict[str, list[Named]] = {name: [] for name in decoders}
    for message in bag.messages([name for name in decoders if name in bag.topics]):
        # A message of another type under the same name cannot be recomputed.
        with contextlib.suppress(ValueError):
            found[message.topic] += decoders[message.topic](message.data)
    return list(found.values())
