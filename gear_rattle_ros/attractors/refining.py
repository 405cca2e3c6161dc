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

"""
Grids of initial conditions, coarse to fine: what the basin node, the explorer and grids share.

A level is followed in rounds of impacts, in slices of a few milliseconds, so that the work can be
dropped at any moment. It is shown when its time is over, complete or not: what has not settled by
then, or was not followed, is unsettled in it. Orbits that no search has found are looked for
among what is left of a level, and all later levels know them.
"""

from collections.abc import Iterable, Iterator
import math
import time
from typing import Final

import numpy as np
import numpy.typing as npt

from .catalogue import Catalogue, follow_here, go_on, moved
from .engine import run_tiles, threads_here
from .finding import Check, conserves_areas, orbits_among
from ..core.many.chaotic_sets import GLANCE
from ..core.many.settling import RecordArray, RESULT, Table, UNSETTLED
from ..core.orbits.orbit import Orbit

# Impacts after which the first level is left: it has to be quick.
FIRST_CAP: Final = 400
# Impacts of a slice, and its fewest initial conditions: two for each lane.
SLICE: Final = 100_000
SLICE_LEAST: Final = 192
# Impacts that it takes to settle, until it is known.
GUESS: Final = 100.0
# A round of no more impacts is made however late it is, but for the first level.
CHEAP: Final = 6_000_000
# Initial conditions left of a level that are searched for orbits.
LOOKED_AT: Final = 64
SEED: Final = 1


class Level:
    """A grid of initial conditions under way, first shown as `begun` left it."""

    def __init__(self, initial: RecordArray, shape: tuple[int, int], cap: int, *,
                 seconds: float = math.inf, sure: float = math.inf, is_mixed: bool = False,
                 begun: 'Level | None' = None, slice_impacts: float = SLICE) -> None:
        self.cap, self.seconds, self.sure = cap, seconds, sure
        # Those that have not settled are where they are now.
        self.states = initial
        self.labels = np.full(shape, UNSETTLED, np.int16)
        # Impacts until they settled; of the unsettled ones impacts followed.
        self.lifetimes = np.zeros(shape, np.int32)
        if begun is not None:
            rows, columns = (np.arange(new) * old // new for new, old in zip(
                shape, begun.labels.shape, strict=True))
            self.labels = begun.labels[np.ix_(rows, columns)]
            self.lifetimes = begun.lifetimes[np.ix_(rows, columns)]
        # Those that have not settled, and those that this round has still to follow.
        self.left = (np.random.default_rng(SEED).permutation(len(initial)) if is_mixed
                     else np.arange(len(initial)))
        # Where areas are preserved nothing settles, and nothing is followed.
        self.due = self.left[~conserves_areas(initial.view(np.recarray))[self.left]]
        self.rounds = self.impacts = 0
        # Time that it took [s], and impacts of an initial condition in a round.
        self.spent, self.mean = 0.0, GUESS
        self._slice = slice_impacts
        self._followed = np.zeros(len(initial), np.int32)

    @property
    def unsettled(self) -> float:
        """Return the share of what has not settled [1]."""
        return len(self.left) / len(self.states)

    def follow(self, limit: float, table: Table, *, until: float = math.inf, check: Check = go_on,
               threads: int | None = None) -> tuple[npt.NDArray[np.int64], RecordArray]:
        """Follow what is due for `limit` impacts; what is not reached in time remains due."""
        # Returns the numbers of what was followed, and what became of it.
        begin, due = time.monotonic(), self.due
        initial, results = self.states[due], np.zeros(len(due), RESULT)
        results['label'] = UNSETTLED
        threads = threads or threads_here()
        size = max(int(min(self._slice / min(self.mean, limit), -(-len(due) // threads))),
                   SLICE_LEAST)

        def work(number: int) -> int:
            check()
            # Where others have the processor all the time, one slice is made nevertheless.
            if time.monotonic() > until and (number or begin > until):
                return 0
            part = slice(number * size, (number + 1) * size)
            return follow_here(initial[part], int(limit), table, results[part])

        made: list[int] = []
        run_tiles(work, range(-(-len(due) // size)), lambda _, impacts: made.append(impacts),
                  threads=threads)
        is_left = results['label'] == UNSETTLED
        is_seen = ~is_left | (results['impacts'] > 0)
        seen, found, goes_on = due[is_seen], results[is_seen], is_left & is_seen
        np.put(self.labels, seen, found['label'])
        np.put(self.lifetimes, seen, self._followed[seen] + found['lifetime'])
        self._followed[seen] += found['impacts'].astype(np.int32)
        self.states[due[goes_on]] = moved(initial[goes_on], results[goes_on])
        self.left = self.left[~np.isin(self.left, due[~is_left])]
        self.due = due[~is_seen]
        if not len(self.due):
            self.due = self.left
            self.rounds += 1
        self.impacts += sum(made)
        self.mean = max(sum(made) / len(seen), 1.0) if len(seen) else self.mean
        self.spent += time.monotonic() - begin
        return seen, found


def late_orbits(catalogue: Catalogue, level: Level, most: int = LOOKED_AT, check: Check = go_on
                ) -> Catalogue:
    """Look for orbits among what is left of a level."""
    chosen = level.due[::max(1, len(level.due) // most)][:most]
    return catalogue.with_orbits(tuple(orbits_among(
        catalogue.parameters, level.states[chosen], *GLANCE[1:], catalogue.tolerance, check)))


def refine(levels: Iterable[tuple[Level, Catalogue]], *, rounds: tuple[int, ...] = (),
           threads: int | None = None, check: Check = go_on
           ) -> Iterator[tuple[Level, Catalogue, bool]]:
    """Compute levels, each finer than the one before."""
    late: tuple[Orbit, ...] = ()
    mean = GUESS
    for number, (level, known) in enumerate(levels):
        catalogue, level.mean = known.with_orbits(late), mean
        limits = [*_limits(catalogue, level.cap, rounds), math.inf]
        until, is_late = time.monotonic() + level.seconds, False
        while level.rounds < len(limits) - 1 and len(level.due):
            before = level.rounds
            level.follow(limits[before], catalogue.table, until=until, check=check,
                         threads=threads)
            if number and level.rounds > before and len(level.left):
                catalogue = late_orbits(catalogue, level, check=check)
            if level.rounds == len(limits) - 1 or not len(level.left):
                break
            if time.monotonic() > until:
                until, is_late = time.monotonic() + level.seconds, True
            if level.rounds < level.sure:
                yield level, catalogue, False
            elif is_late and (not number or len(level.left) * limits[before + 1] > CHEAP):
                break
        late, mean = catalogue.late, level.mean
        yield level, catalogue, True


def _limits(catalogue: Catalogue, cap: int, rounds: tuple[int, ...]) -> list[int]:
    """List the impacts of one round after the other until they are `cap` in all."""
    if not rounds:
        return [cap]
    # On a chaotic attractor nothing settles in less.
    least = 2 * catalogue.stay if catalogue.chaotic else 0
    limits: list[int] = []
    total = 0
    while total < cap:
        usual = rounds[min(len(limits), len(rounds) - 1)]
        limits.append(max(min(usual, cap - total), least))
        total += limits[-1]
    return limits
