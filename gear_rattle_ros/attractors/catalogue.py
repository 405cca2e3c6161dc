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

"""The attractors at given parameters: what is known of each, and how states are labelled."""

from collections.abc import Callable, Mapping
import dataclasses
import enum
import functools
import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from .engine import run_tiles
from .listing import listed, named
from .plane import STATE
from ..core.arrays import FloatArray
from ..core.defaults import HOLD, TOLERANCE
from ..core.flight.elementary import TWO_PI
from ..core.flight.lanes import EMPTY, INITIAL, new_tiles
from ..core.flight.lanes_step import LANES
from ..core.many.chaotic_sets import ChaoticSet
from ..core.many.orbit_table import dilated, make_table
from ..core.many.settling import (
    BOXES,
    classify,
    FLOATING,
    RecordArray,
    RESTS_LOWER,
    RESTS_UPPER,
    RESULT,
    Table,
    UNSETTLED,
)
from ..core.model import Parameters
from ..core.orbits.orbit import Orbit

# Initial conditions and impacts of one call of the kernel at most: it cannot be stopped.
BATCH: Final = 250
BATCH_IMPACTS: Final = 2_000_000


class Kind(enum.Enum):
    """What trajectories settle on; on nothing at all while they are unsettled."""

    PERIODIC = 'periodic'
    CHAOTIC = 'chaotic'
    RESTING = 'resting'
    FLOATING = 'floating'
    UNSETTLED = 'unsettled'


# Labels that are not the number of an attractor, with their key and kind.
OTHERS: Final = {
    RESTS_UPPER: ('rest-upper', Kind.RESTING), RESTS_LOWER: ('rest-lower', Kind.RESTING),
    FLOATING: ('floating', Kind.FLOATING), UNSETTLED: ('unsettled', Kind.UNSETTLED)}


def go_on() -> None:
    """Do not give up."""


@dataclasses.dataclass(frozen=True)
class Attractor:
    """
    One attractor, or what has settled on none.

    `key` is the same in every run: that of a periodic orbit is made of its period and its first
    point, that of a chaotic one of the shortest periodic orbit in it.
    """

    key: str
    kind: Kind
    label: int
    orbit: Orbit | None = None
    chaos: ChaoticSet | None = None
    settled: int = 0  #: Random initial conditions that have settled on it.
    share: float = 0.0  #: Their part of all [1].
    share_error: float = 0.0  #: Standard error of a binomial share [1].
    letter: str = ''  #: In the paper, at its parameters.

    @property
    def title(self) -> str:
        """Letter and key."""
        return f'{self.letter} {self.key}'.lstrip()

    @property
    def impacts(self) -> int:
        """Impacts in a period; 0 off an orbit."""
        return self.orbit.impacts if self.orbit else 0

    @property
    def drive_periods(self) -> int:
        """Drive periods in a period; 0 off an orbit."""
        return self.orbit.drive_periods if self.orbit else 0

    @property
    def pieces(self) -> int:
        """Parts visited in turn, on the upper wall if it is touched, else on the lower."""
        if self.orbit:
            upper = int(np.count_nonzero(self.orbit.walls == 0))
            return upper or self.orbit.impacts
        return self.chaos.pieces if self.chaos else 0

    @property
    def multipliers(self) -> npt.NDArray[np.complex128]:
        """Eigenvalues of the tangent over a period; nan off an orbit."""
        return self.orbit.multipliers if self.orbit else np.full(2, complex(math.nan))

    @property
    def exponents(self) -> tuple[float, float]:
        """Lyapunov exponents per impact [1]; nan at rest."""
        if self.chaos:
            return self.chaos.exponents.lambda_1, self.chaos.exponents.lambda_2
        return self.orbit.exponents if self.orbit else (math.nan, math.nan)

    @property
    def errors(self) -> tuple[float, float]:
        """Return standard errors of the exponents [1]; those of an orbit are exact."""
        if self.chaos:
            return self.chaos.exponents.lambda_1_error, self.chaos.exponents.lambda_2_error
        return (0.0, 0.0) if self.orbit else (math.nan, math.nan)

    @property
    def exact_sum(self) -> float:
        """Return what the exponents must add up to [1]."""
        if self.chaos:
            return self.chaos.exponents.exact_sum
        return self.orbit.exact_sum if self.orbit else math.nan

    def with_share(self, settled: int, total: int) -> 'Attractor':
        """Return it with its share of random initial conditions, and the error of that."""
        # As if two more had settled on it and two elsewhere: shares of 0 and 1 have an error, too.
        share = (settled + 2.0) / (total + 4.0)
        return dataclasses.replace(
            self, settled=settled, share=settled / max(total, 1),
            share_error=math.sqrt(share * (1.0 - share) / (total + 4.0)))

    def points(self, box_limit: int | None = None) -> FloatArray:
        """
        List where it hits the walls: wall, phase [rad] and velocity before the impact [1] by row.

        Of an orbit the impacts of one period, of a chaotic attractor the centres of its boxes,
        about `box_limit` of them at the most.
        """
        if self.orbit:
            return np.column_stack([self.orbit.walls, self.orbit.points])
        if self.chaos is None:
            return np.zeros((0, 3))
        wall, row, column = (axis[::-(-len(axis) // box_limit) if box_limit else 1]
                             for axis in np.nonzero(self.chaos.boxes))
        speed = (row + 0.5) * self.chaos.speed / BOXES
        return np.column_stack([wall, (column + 0.5) * TWO_PI / BOXES,
                                np.where(wall == 0, speed, -speed)])


def others_where(is_there: Callable[[int], bool]) -> list[Attractor]:
    """Return what is not an attractor, rest for one, where it is there by its label."""
    return [Attractor(key, kind, label) for label, (key, kind) in OTHERS.items()
            if is_there(label)]


TableOfArrays = dict[str, tuple[tuple[str, ...], npt.ArrayLike, Mapping[str, Any]]]


@dataclasses.dataclass(frozen=True, repr=False)
class Catalogue:
    """
    The attractors at given parameters.

    `tolerance` is the largest distance of a trajectory that is on its orbit [1]. For `hold`
    impacts nothing that is called an attractor was left, and after them what has not settled is
    unsettled; a trajectory has settled on a chaotic attractor after `stay` impacts in its boxes.
    `orbits` and then `chaotic` attractors, in the order of their keys, have the labels 0, 1, ...;
    the last are those of `late`, orbits found after the search in the order in which they were
    found. `labels` and `states` are those of the random initial conditions of the search: where
    each was when it had settled, or was given up. `letters` are those of the paper, by label.
    """

    parameters: Parameters
    tolerance: float = TOLERANCE
    hold: int = HOLD
    orbits: tuple[Orbit, ...] = ()
    chaotic: tuple[ChaoticSet, ...] = ()
    stay: int = 0
    labels: npt.NDArray[np.int64] = dataclasses.field(
        default_factory=lambda: np.zeros(0, np.int64))
    states: RecordArray = dataclasses.field(default_factory=lambda: np.zeros(0, INITIAL))
    late: tuple[Orbit, ...] = ()
    letters: Mapping[int, str] = dataclasses.field(default_factory=dict)

    @functools.cached_property
    def attractors(self) -> tuple[Attractor, ...]:
        """
        Attractors in the order of their labels, then what else initial conditions ended in.

        The last is what has not settled, if there is any.
        """
        found = [Attractor(each.key, Kind.PERIODIC, label, each) if isinstance(each, Orbit)
                 else Attractor(each.key, Kind.CHAOTIC, label, chaos=each)
                 for label, each in enumerate(self._known)]
        found += others_where(lambda label: bool(np.any(self.labels == label)))
        return tuple(dataclasses.replace(
            each.with_share(int(np.sum(self.labels == each.label)), len(self.labels)),
            letter=self.letters.get(each.label, '')) for each in found)

    @property
    def _known(self) -> tuple[Orbit | ChaoticSet, ...]:
        # In the order of their labels.
        return (*self.orbits, *self.chaotic, *self.late)

    def __repr__(self) -> str:
        """List the attractors as a table."""
        return listed({name: np.asarray(values) for name, (_, values, _) in table_of(
            self.attractors).items()}, self.hold)

    def with_orbits(self, orbits: tuple[Orbit, ...]) -> 'Catalogue':
        """Add the orbits that are not known yet; the labels of the others stay."""
        known = {each.key for each in self._known}
        new = {orbit.key: orbit for orbit in orbits if orbit.key not in known}
        return dataclasses.replace(self, late=(*self.late, *new.values())) if new else self

    @functools.cached_property
    def table(self) -> Table:
        """Return the table by which `classify` recognises the attractors."""
        numbers = [n for n, each in enumerate(self._known) if isinstance(each, Orbit)]
        orbits = (*self.orbits, *self.late)
        if not self.chaotic:
            return make_table(orbits, self.tolerance, numbers=numbers)
        boxes = np.full((2, BOXES, BOXES), EMPTY, np.int8)
        for number, chaos in enumerate(self.chaotic, len(self.orbits)):
            # Where two sets meet, a box is of neither.
            grown = dilated(chaos.boxes)
            boxes[grown] = np.where(boxes[grown] == EMPTY, number, EMPTY)
        return make_table(orbits, self.tolerance, numbers=numbers, boxes=boxes,
                          box_speed=self.chaotic[0].speed, stay=self.stay)

    def label(self, initial: RecordArray, cap: int | None = None, *, threads: int | None = None,
              cluster: str | None = None, check: Any = go_on) -> RecordArray:
        """
        Follow initial conditions until they settle, for at most `cap` impacts, `hold` by default.

        Returns their RESULT: labels, lifetimes [impacts], and the states of those that are
        unsettled. `check` is called after each batch and raises to give up.
        """
        results = np.zeros(len(initial), RESULT)
        cap = cap or self.hold
        # At least two batches, for as many threads.
        size = min(max(min(BATCH_IMPACTS // cap, -(-len(initial) // 2)), LANES), BATCH)

        def keep(batch: int, settled: RecordArray) -> None:
            results[batch * size:(batch + 1) * size] = settled
            check()

        run_tiles(functools.partial(_follow_batch, initial, size, cap, self.table),
                  range(-(-len(initial) // size)), keep, cluster=cluster, threads=threads)
        return results


def table_of(attractors: tuple[Attractor, ...]) -> TableOfArrays:
    """Lay attractors out as the arrays of a dataset: dimensions, values, attributes by name."""
    multipliers, exponents, errors = (
        np.array([getattr(each, name) for each in attractors]).reshape(-1, 2)
        for name in ('multipliers', 'exponents', 'errors'))
    points = [(each.label, np.column_stack([each.points(), each.orbit.flight_times]))
              for each in attractors if each.orbit]
    boxes = [(each.label, each.points()) for each in attractors if each.chaos]
    owners, boxes_of = (np.repeat(np.array([label for label, _ in found], np.int64),
                                  [len(rows) for _, rows in found]) for found in (points, boxes))
    point, box = (np.concatenate([np.zeros((0, width)), *(rows for _, rows in found)]).T
                  for found, width in ((points, 4), (boxes, 3)))
    # The name begins with the dimension.
    return {name: ((name.split('_')[0], 'pair')[:np.ndim(values)], values, named(words, units))
            for name, values, words, units in (
        *((f'attractor_{name}', np.array([getattr(each, name) for each in attractors]), words, '1')
          for name, words in (
            ('label', 'number in the grid'), ('impacts', 'impacts of a period'),
            ('drive_periods', 'drive periods of a period'),
            ('pieces', 'parts visited in turn on one wall'),
            ('exact_sum', 'exact sum of the exponents'),
            ('settled', 'random initial conditions settled on it'),
            ('share', 'share of the random initial conditions'),
            ('share_error', 'standard error of the share'))),
        ('attractor_key', np.array([each.key for each in attractors]), 'name of the attractor',
         ''),
        ('attractor_letter', np.array([each.letter for each in attractors]),
         'letter of the attractor in the paper, empty for none', ''),
        ('attractor_kind', np.array([each.kind.value for each in attractors]),
         'periodic, chaotic, resting, floating or unsettled', ''),
        ('attractor_multiplier_real', multipliers.real, 'multipliers of a period, real part', '1'),
        ('attractor_multiplier_imaginary', multipliers.imag,
         'multipliers of a period, imaginary part', '1'),
        ('attractor_exponent', exponents, 'Lyapunov exponents per impact', '1'),
        ('attractor_exponent_error', errors, 'standard errors of the exponents', '1'),
        ('point_wall', point[0], 'wall: 0 upper, 1 lower', '1'),
        ('point_phase', point[1], 'drive phase of the impact', 'rad'),
        ('point_velocity', point[2], 'velocity before the impact', '1'),
        ('point_flight_time', point[3], 'time since the impact before', '1'),
        ('point_label', owners, 'attractor of the point', '1'),
        ('box_wall', box[0], 'wall: 0 upper, 1 lower', '1'),
        ('box_phase', box[1], 'drive phase of the centre', 'rad'),
        ('box_velocity', box[2], 'velocity before the impact, of the centre', '1'),
        ('box_label', boxes_of, 'chaotic attractor that visits the box', '1'))}


def _follow_batch(initial: RecordArray, size: int, cap: int, table: Table, batch: int
                  ) -> RecordArray:
    return results_here(initial[batch * size:(batch + 1) * size], cap, table)


def results_here(initial: RecordArray, cap: int, table: Table) -> RecordArray:
    """Follow initial conditions in this thread; return their RESULT."""
    results = np.zeros(len(initial), RESULT)
    follow_here(initial, cap, table, results)
    return results


def follow_here(initial: RecordArray, cap: int, table: Table, results: RecordArray) -> int:
    """Follow initial conditions in this thread into `results`; return the impacts made."""
    return int(classify(new_tiles(1)[0], initial, cap, table, results))


def moved(initial: RecordArray, results: RecordArray) -> RecordArray:
    """Return initial conditions where they were when they were given up as unsettled."""
    states = initial.copy()
    states[list(STATE)] = results[list(STATE)]
    return states
