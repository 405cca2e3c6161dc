"""
Finding every attractor at given parameters from many random starts.

Starts are followed in stages. After each, impacts of those that have not settled are searched for
recurrences; Newton's method refines them to orbits, and stable ones enter the table by which the
next stage recognises them. What has not settled after `hold` impacts is on a chaotic attractor
only if its largest exponent is positive by `SIGNIFICANT` errors and if, of all starts that stay in
its boxes for so many impacts, not one is seen to settle elsewhere; else it is unresolved. (Up to
`FOLLOWED` starts are watched for all of `hold`: a mean lifetime of a tenth of the impacts watched
would have shown with near certainty.)
"""

from collections.abc import Callable
import dataclasses
import functools
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from .engine import run_tiles
from ..core.chaos import box_sets, BoxSet
from ..core.classify import (
    BOXES,
    classify,
    RecordArray,
    RESULT,
    STEPS,
    Table,
    UNRESOLVED,
    WATCH,
)
from ..core.lanes import EMPTY, new_impacts, new_tiles
from ..core.lanes_step import LANES
from ..core.model import Parameters
from ..core.periodic import find_orbit, Orbit, shortest_recurrence
from ..core.recorded import record_impacts
from ..core.table import dilated, make_table

TOLERANCE: Final = 1e-3
STARTS: Final = 1000
HOLD: Final = 100_000
# Impacts after which the starts that are left are looked at, impacts that are then looked at, and
# longest period.
STAGES: Final = ((300, 200, 64), (2_000, 200, 64), (10_000, 200, 64), (30_000, 1_600, 512))
# Starts that are followed for all of `hold`: the first that have not settled before.
FOLLOWED: Final = 256
# Starts of one call of the kernel, fewer where they take so many impacts: it cannot be stopped.
BATCH: Final = 250
BATCH_IMPACTS: Final = 2_000_000
# A largest exponent is positive if it is so many standard errors from zero.
SIGNIFICANT: Final = 5.0
# Impacts in the boxes after which a start is taken to be on a chaotic attractor: as few as are
# certain to be enough, from the first of these.
STAYS: Final = (128, 256, 512, 1024, 2048, 4096)
# Sets of boxes that are told apart by their numbers in one byte.
SETS_MOST: Final = 60

Trace: TypeAlias = Callable[[Parameters, RecordArray], tuple[list[BoxSet], float]]
Check: TypeAlias = Callable[[], None]


def go_on() -> None:
    """Give nothing up."""


@dataclasses.dataclass(frozen=True)
class Catalogue:
    """
    The attractors at given parameters.

    Attributes
    ----------
    parameters : Parameters
        Of the model.
    tolerance : float
        Largest distance of a trajectory that is on its orbit [1].
    hold : int
        Impacts for which starts were followed.
    orbits : tuple of Orbit
        Periodic ones, in the order of their keys; their labels are 0, 1, ...
    chaotic : tuple of BoxSet
        Chaotic ones, in the order of their keys; their labels come next.
    box_speed : float
        Greatest speed of the boxes [1].
    stay : int
        Impacts in the boxes after which a start has settled.
    labels : ndarray of int, shape (n,)
        Label of every random start, below zero as in `classify`.

    """

    parameters: Parameters
    tolerance: float
    hold: int
    orbits: tuple[Orbit, ...]
    chaotic: tuple[BoxSet, ...]
    box_speed: float
    stay: int
    labels: npt.NDArray[np.int64]

    def table(self, late: tuple[Orbit, ...] = ()) -> Table:
        """
        Make the table by which starts are recognised.

        Parameters
        ----------
        late : tuple of Orbit
            Orbits that the search had missed, in the order of their keys; their labels are the
            last.

        Returns
        -------
        Table
            For `classify`.

        """
        known = len(self.orbits)
        after = known + len(self.chaotic)
        numbers = [*range(known), *range(after, after + len(late))]
        return _table((*self.orbits, *late), self.tolerance, numbers, self.chaotic,
                      self.box_speed, self.stay, known)


def find_attractors(parameters: Parameters, starts: RecordArray, *, tolerance: float = TOLERANCE,
                    hold: int = HOLD, chaotic: bool = True,
                    threads: int | None = None, cluster: str | None = None,
                    trace: Trace = box_sets, check: Check = go_on) -> Catalogue:
    """
    Find all attractors that some of the starts reach.

    Parameters
    ----------
    parameters : Parameters
        Of the model.
    starts : ndarray of START, shape (n,)
        Random starts; the result does not depend on where they are followed.
    tolerance : float
        Largest distance of a trajectory that is on its orbit [1].
    hold : int
        Impacts for which a start is followed at the most.
    chaotic : bool
        Whether what is left is looked at for chaotic attractors.
    threads : int, optional
        How many; by default one for each processor.
    cluster : str, optional
        Address of a Dask scheduler that follows the starts instead.
    trace : callable
        Finds the sets on which trajectories move, as `box_sets` does.
    check : callable
        Called every few tenths of a second at least; raises to give up.

    Returns
    -------
    Catalogue
        What was found.

    """
    labels = np.full(len(starts), UNRESOLVED, np.int64)
    states = starts.copy()
    left = np.arange(len(starts))
    orbits: dict[str, Orbit] = {}
    homes = np.full(len(starts), '', object)
    followed = 0
    stages = [stage for stage in STAGES if stage[0] < hold]
    for until, count, longest in [*stages, (hold, *STAGES[-1][1:])]:
        keys = list(orbits)
        if until == hold:
            left = left[:FOLLOWED]
        results = settle(states[left], until - followed,
                         make_table(list(orbits.values()), tolerance), threads, cluster, check)
        followed = until
        labels[left] = results['label']
        for start, label in zip(left, results['label'], strict=True):
            homes[start] = keys[label] if label >= 0 else ''
        is_left = results['label'] == UNRESOLVED
        for name in ('phase', 'displacement', 'velocity'):
            states[name][left] = results[name]
        left = left[is_left]
        if not len(left):
            break
        found = orbits_among(parameters, states[left], count, longest, tolerance, check)
        orbits.update((orbit.key, orbit) for orbit in found if orbit.key not in orbits)
    ordered = tuple(orbits[key] for key in sorted(orbits))
    # Those which the last stage has found, and a start that was too far from its own.
    results = settle(states[left], STAGES[0][0], make_table(ordered, tolerance), threads, cluster,
                     check)
    numbers = {orbit.key: number for number, orbit in enumerate(ordered)}
    labels = np.array([numbers.get(home, label) for home, label in zip(
        homes, labels, strict=True)], np.int64)
    labels[left] = results['label']
    plain = Catalogue(parameters, tolerance, hold, ordered, (), 0.0, 0, labels)
    left = np.flatnonzero(labels == UNRESOLVED)
    if not chaotic or not len(left):
        return plain
    follow = functools.partial(settle, starts, hold, threads=threads, cluster=cluster, check=check)
    return _with_chaos(plain, states[left], follow, trace, check)


def settle(starts: RecordArray, cap: int, table: Table, threads: int | None = None,
           cluster: str | None = None, check: Check = go_on) -> RecordArray:
    """
    Follow starts until they settle.

    Parameters
    ----------
    starts : ndarray of START, shape (n,)
        The starts.
    cap : int
        Impacts after which a start is given up.
    table : Table
        Known attractors.
    threads : int, optional
        How many; by default one for each processor.
    cluster : str, optional
        Address of a Dask scheduler that follows them instead.
    check : callable
        Called after each batch; raises to give up.

    Returns
    -------
    ndarray of RESULT, shape (n,)
        What became of them.

    """
    results = np.zeros(len(starts), RESULT)
    # At least two batches, for as many threads.
    size = min(max(min(BATCH_IMPACTS // cap, -(-len(starts) // 2)), LANES), BATCH)

    def keep(batch: int, settled: RecordArray) -> None:
        results[batch * size:(batch + 1) * size] = settled
        check()

    run_tiles(functools.partial(_settle_batch, starts, size, cap, table),
              range(-(-len(starts) // size)), keep, cluster=cluster, threads=threads)
    return results


def _settle_batch(starts: RecordArray, size: int, cap: int, table: Table, batch: int
                  ) -> RecordArray:
    part = starts[batch * size:(batch + 1) * size]
    results = np.zeros(len(part), RESULT)
    settle_here(part, cap, table, results)
    return results


def settle_here(starts: RecordArray, cap: int, table: Table, results: RecordArray) -> int:
    """
    Follow starts until they settle, in this thread.

    Parameters
    ----------
    starts : ndarray of START, shape (n,)
        The starts.
    cap : int
        Impacts after which a start is given up.
    table : Table
        Known attractors.
    results : ndarray of RESULT, shape (n,)
        Receives what became of them.

    Returns
    -------
    int
        Impacts made.

    """
    return int(classify(new_tiles(1)[0], new_impacts(STEPS), np.zeros(LANES, WATCH), starts, cap,
                        table, results))


def orbits_among(parameters: Parameters, states: RecordArray, count: int, longest: int,
                 tolerance: float, check: Check = go_on) -> list[Orbit]:
    """
    Find the stable periodic orbits that trajectories approach.

    Parameters
    ----------
    parameters : Parameters
        Of the model.
    states : ndarray of START, shape (n,)
        States of the trajectories.
    count : int
        Impacts that are looked at.
    longest : int
        Longest period [impacts].
    tolerance : float
        Largest difference of recurring impacts [1].
    check : callable
        Called for every batch of trajectories; raises to give up.

    Returns
    -------
    list of Orbit
        In the order of their keys.

    """
    found: dict[str, Orbit] = {}
    tried: list[tuple[int, npt.NDArray[np.float64]]] = []
    for first in range(0, len(states), BATCH):
        check()
        rows, counts = record_impacts(states[first:first + BATCH], 0, count)
        for row, made in zip(rows, counts, strict=True):
            if made < count:
                continue
            q = int(shortest_recurrence(row, longest, tolerance))
            here = np.array([row[-1]['phase'], row[-1]['velocity']])
            # The same again as another trajectory has shown.
            if any(q == other and np.max(np.abs(here - there)) < 2.0 * tolerance
                   for other, there in tried if q):
                continue
            orbit = find_orbit(parameters, row, longest, tolerance)
            if orbit is not None:
                found.setdefault(orbit.key, orbit)
            if q and orbit is not None:
                tried.extend((q, np.array(point)) for point in zip(
                    orbit.phases, orbit.velocities, strict=True))
    return [found[key] for key in sorted(found)]


def _with_chaos(plain: Catalogue, survivors: RecordArray, follow: Callable[[Table], RecordArray],
                trace: Trace, check: Check) -> Catalogue:
    """Add the sets on which survivors move; `follow` tells what becomes of all starts."""
    sets, speed = trace(plain.parameters, survivors)
    check()
    sets = sorted(
        (found for found in sets if found.exponents.lambda_1
         > SIGNIFICANT * found.exponents.lambda_1_error), key=lambda found: found.key)[:SETS_MOST]
    known = len(plain.orbits)
    settled = plain.labels != UNRESOLVED
    for stay in STAYS:
        if not sets:
            break
        tried = dataclasses.replace(plain, chaotic=tuple(sets), box_speed=speed, stay=stay)
        labels = follow(tried.table())['label']
        leaks = {int(label) for label in labels[settled] if label >= known}
        if not leaks:
            return dataclasses.replace(tried, labels=labels)
        if stay == STAYS[-1]:
            # What trajectories leave is a transient, however long.
            sets = [found for number, found in enumerate(sets) if known + number not in leaks]
            if sets:
                tried = dataclasses.replace(tried, chaotic=tuple(sets))
                return dataclasses.replace(tried, labels=follow(tried.table())['label'])
    return plain


def _table(orbits: tuple[Orbit, ...], tolerance: float, numbers: list[int],
           sets: tuple[BoxSet, ...], speed: float, stay: int, first: int) -> Table:
    if not sets:
        return make_table(orbits, tolerance, numbers=numbers)
    boxes = np.full((2, BOXES, BOXES), EMPTY, np.int8)
    for number, found in enumerate(sets):
        # Where two sets meet, a box is of neither.
        grown = dilated(found.boxes)
        boxes = np.where(grown & (boxes == EMPTY), first + number, np.where(
            grown, EMPTY, boxes)).astype(np.int8)
    return make_table(orbits, tolerance, numbers=numbers, boxes=boxes, box_speed=speed, stay=stay)
