"""
Basins for somebody who watches: coarse at once, then finer and finer.

Starts are followed in slices of a few milliseconds, so that the work can be dropped at any moment,
in rounds, and in random order. A picture is shown when its time is over: what has not settled by
then, or was not looked at, is unresolved in it. The finer ones are shown again when all their
starts have been looked at, and the last one takes all the time it needs.

On a chaotic attractor nothing settles before it has stayed there for so many impacts that it
cannot be a transient. Where that is the least number of a search, the pictures before the last one
try fewer, of which no start is seen to leave that has settled elsewhere in the first picture.
"""

from collections.abc import Callable, Iterator, Sequence
import dataclasses
import itertools
import time
from typing import Final

import numpy as np
import numpy.typing as npt

from .catalogue import Catalogue, follow_here, moved, TOLERANCE
from .engine import run_tiles
from .grid import make_starts, Plane
from .search import Check, find_attractors, orbits_among, STAYS
from ..core.chaos import BRIEF
from ..core.classify import RecordArray, RESULT, Table, UNRESOLVED
from ..core.lanes import START
from ..core.model import Parameters
from ..core.recorded import record_impacts

# The first look for attractors: random starts, impacts passed over, impacts looked at, and the
# longest period.
GLANCE: Final = (48, 300, 200, 64)
# The second: random starts, and impacts for which nothing may leave a chaotic attractor.
STARTS: Final = 256
HOLD: Final = 2_000
# What takes longer to be told from a transient is left unresolved [impacts].
STAY_MOST: Final = 256
# Shorter stays that are tried [impacts].
STAYS_TRIED: Final = (16, 32, 64)
# Unresolved starts of a picture that are looked at for orbits that were missed.
LOOKED_AT: Final = 32
SEED: Final = 1
# Time for a picture, by the length of its edge at the most, after which it is shown [s].
TIMES: Final = ((50, 0.04), (100, 0.08), (200, 0.12), (400, 0.5))
# From this edge on a picture is shown again when all its starts have been looked at [cells].
WHOLE_FROM: Final = 400
# A round of no more impacts is made however late it is.
CHEAP: Final = 6_000_000
# Impacts for which what has not settled is followed, again and again.
ROUNDS: Final = (100, 300, 1_000, 3_000)
# Impacts of a slice: some milliseconds; and the fewest starts, two for each lane.
SLICE: Final = 100_000
STARTS_LEAST: Final = 192
# Impacts that a start takes to settle, until it is known.
GUESS: Final = 100.0
# The last picture is shown again when so much of it has been resolved meanwhile.
NEWS: Final = 0.002

LabelArray = npt.NDArray[np.int16]


class Dropped(Exception):
    """The picture is no longer wanted."""


@dataclasses.dataclass(frozen=True)
class Glance:
    """
    What is seen at once at some parameters.

    Attributes
    ----------
    catalogue : Catalogue
        Periodic attractors.
    fastest : float
        Greatest speed of an impact after the transients [1].

    """

    catalogue: Catalogue
    fastest: float


@dataclasses.dataclass(frozen=True)
class Basins:
    """
    One picture.

    Attributes
    ----------
    plane : Plane
        Its cells.
    labels : ndarray of int, shape (velocities, phases)
        Attractor of every start, or one of the labels below zero of `classify`.
    catalogue : Catalogue
        The attractors.
    is_complete : bool
        Whether chaotic attractors have been searched for.

    """

    plane: Plane
    labels: LabelArray
    catalogue: Catalogue
    is_complete: bool

    def share(self, label: int) -> float:
        """
        Tell how much of the plane is of a label.

        Parameters
        ----------
        label : int
            The label.

        Returns
        -------
        float
            From 0 to 1 [1].

        """
        return float(np.mean(self.labels == label))


def sizes_up_to(largest: int) -> tuple[int, ...]:
    """
    List the edges of the pictures.

    Parameters
    ----------
    largest : int
        Edge of the last one [cells].

    Returns
    -------
    tuple of int
        From 50 on, each twice the one before.

    """
    sizes = [TIMES[0][0]]
    while 2 * sizes[-1] < largest:
        sizes.append(2 * sizes[-1])
    return (*sizes, largest) if largest > sizes[-1] else (largest,)


def glance(parameters: Parameters, hints: npt.NDArray[np.float64]) -> Glance:
    """
    Find the periodic attractors that are seen at once.

    Parameters
    ----------
    parameters : Parameters
        Of the model.
    hints : ndarray of float, shape (n, 3)
        Wall (0 upper, 1 lower), phase [rad] and velocity [1] of impacts near which attractors
        may be.

    Returns
    -------
    Glance
        What was seen.

    """
    count, skip, look, longest = GLANCE
    drawn = Plane().random_starts(parameters, count, SEED)
    hinted = make_starts(parameters, hints[:, 1], -hints[:, 0], hints[:, 2])
    starts = np.concatenate([hinted, drawn])
    results = np.zeros(len(starts), RESULT)
    follow_here(starts, skip, Catalogue(parameters).table, results)
    states = moved(starts, results)[results['label'] == UNRESOLVED]
    orbits = tuple(orbits_among(parameters, states, look, longest, TOLERANCE))
    rows, _ = record_impacts(states, 0, 64)
    return Glance(
        Catalogue(parameters, hold=skip, orbits=orbits, labels=results['label']),
        float(np.max(np.abs(rows['velocity']), initial=0.0)))


def refine(seen: Glance, planes: Sequence[Plane], *, on_walls: bool, cap: int, threads: int,
           is_dropped: Callable[[], bool]) -> Iterator[Basins]:
    """
    Compute pictures, each finer than the one before.

    Parameters
    ----------
    seen : Glance
        What was seen at these parameters.
    planes : sequence of Plane
        Their cells.
    on_walls : bool
        Start at the wall that is moved into, so that the plane is the section of impacts; if
        not, at the displacement of the plane.
    cap : int
        Impacts after which a start of the last picture is given up.
    threads : int
        How many.
    is_dropped : callable
        Tells, from any thread, that no more is wanted.

    Yields
    ------
    Basins
        The next picture; the last one again as more of it is resolved.

    Raises
    ------
    Dropped
        As soon as no more is wanted.

    """
    def check() -> None:
        if is_dropped():
            raise Dropped

    certain = catalogue = seen.catalogue
    parameters = catalogue.parameters
    settled = np.zeros(0, START)
    mean = GUESS
    for level, plane in enumerate(planes):
        is_last = level == len(planes) - 1
        if level == 1:
            certain = _without_slow_chaos(find_attractors(
                parameters, plane.random_starts(parameters, STARTS, SEED), hold=HOLD,
                threads=threads, effort=BRIEF, check=check))
            certain = certain.with_orbits(seen.catalogue.orbits)
            catalogue = _hastened(certain, settled, threads, check)
        if is_last and level > 0:
            catalogue = dataclasses.replace(certain, late=catalogue.late)
        work = _Level(plane, parameters, on_walls)
        until = time.monotonic() + _time_for(plane)
        shown, total, is_late = 1.0, 0, False
        limits = [*_rounds(catalogue, cap if is_last else ROUNDS[-1])]
        for limit, following in itertools.pairwise([*limits, np.inf]):
            mean, has_unseen = work.follow(
                int(limit), catalogue.table, mean, threads,
                np.inf if is_late or level == 0 else until, check)
            total += int(limit)
            if level > 0 and len(work.left):
                catalogue = catalogue.with_orbits(tuple(orbits_among(
                    parameters, work.starts[work.left[:LOOKED_AT]], *GLANCE[2:], TOLERANCE)))
            is_late = time.monotonic() > until
            goes_on = is_last or (has_unseen and _edge(plane) >= WHOLE_FROM)
            is_cheap = level > 0 and len(work.left) * following <= CHEAP
            if not len(work.left) or (is_late and not goes_on and not is_cheap):
                break
            if (level > 0 and goes_on and shown - work.unresolved > NEWS
                    and (is_late or total >= ROUNDS[1])):
                shown = work.unresolved
                yield work.picture(catalogue, level > 0)
        settled = work.settled
        yield work.picture(catalogue, level > 0)


class _Level:
    """
    One picture under way.

    Attributes
    ----------
    starts : ndarray of START, shape (n,)
        Mixed, so that what is not looked at in time is spread over the picture; those that have
        not settled where they are now.
    left : ndarray of int
        Numbers of those that have not settled.

    """

    def __init__(self, plane: Plane, parameters: Parameters, on_walls: bool) -> None:
        self._plane = plane
        size = plane.phases * plane.velocities
        self._order = np.random.default_rng(SEED).permutation(size)
        starts = plane.starts(parameters, slice(0, plane.velocities), slice(0, plane.phases))
        if on_walls:
            starts['displacement'] = np.where(starts['velocity'] < 0.0, -1.0, 0.0)
        self.starts = starts[self._order]
        self.left = np.arange(size)
        self._labels = np.full(size, UNRESOLVED, np.int16)

    @property
    def unresolved(self) -> float:
        """Return the share of the starts that have not settled [1]."""
        return len(self.left) / len(self.starts)

    @property
    def settled(self) -> RecordArray:
        """Return the starts that have settled on an attractor."""
        return self.starts[self._labels[self._order] >= 0]

    def follow(self, limit: int, table: Table, mean: float, threads: int, until: float,
               check: Check) -> tuple[float, bool]:
        """Follow what is left; return the mean of impacts, and whether some were not looked at."""
        left = self.left
        results, mean = _follow(self.starts[left], limit, table, mean, threads, until, check)
        self._labels[self._order[left]] = results['label']
        is_left = results['label'] == UNRESOLVED
        self.left = left[is_left]
        self.starts[self.left] = moved(self.starts[self.left], results[is_left])
        return mean, bool(np.any(results['impacts'][is_left] == 0))

    def picture(self, catalogue: Catalogue, is_complete: bool) -> Basins:
        """Show how far it is."""
        plane = self._plane
        labels = self._labels.reshape(plane.velocities, plane.phases).copy()
        return Basins(plane, labels, catalogue, is_complete)


def _edge(plane: Plane) -> int:
    return max(plane.phases, plane.velocities)


def _time_for(plane: Plane) -> float:
    return next((time for most, time in TIMES if _edge(plane) <= most), np.inf)


def _rounds(catalogue: Catalogue, cap: int) -> Iterator[int]:
    """Yield impacts of one round after the other until they are `cap` in all."""
    # On a chaotic attractor nothing settles in less.
    least = 2 * catalogue.stay if catalogue.chaotic else 0
    total, number = 0, 0
    while total < cap:
        limit = min(max(ROUNDS[min(number, len(ROUNDS) - 1)], least), max(cap - total, least))
        yield limit
        total += limit
        number += 1


def _follow(starts: RecordArray, cap: int, table: Table, mean: float, threads: int, until: float,
            check: Check) -> tuple[RecordArray, float]:
    results = np.zeros(len(starts), RESULT)
    results['label'] = UNRESOLVED
    for name in ('phase', 'displacement', 'velocity'):
        results[name] = starts[name]
    batch = max(int(SLICE / min(mean, cap)), STARTS_LEAST)

    def work(number: int) -> int:
        check()
        if time.monotonic() > until:
            return 0
        part = slice(number * batch, (number + 1) * batch)
        return follow_here(starts[part], cap, table, results[part])

    made: list[int] = []
    run_tiles(work, range(-(-len(starts) // batch)), lambda _, impacts: made.append(impacts),
              threads=threads)
    followed = int(np.count_nonzero(results['impacts']))
    return results, max(sum(made) / followed, 1.0) if followed else mean


def _without_slow_chaos(catalogue: Catalogue) -> Catalogue:
    if catalogue.stay <= STAY_MOST:
        return catalogue
    labels = np.where(catalogue.labels < len(catalogue.orbits), catalogue.labels, UNRESOLVED)
    return dataclasses.replace(catalogue, chaotic=(), stay=0, labels=labels)


def _hastened(catalogue: Catalogue, settled: RecordArray, threads: int, check: Check
              ) -> Catalogue:
    """Let starts settle on chaotic attractors as soon as none of those settled elsewhere would."""
    # What leaves after more impacts leaves after fewer, too.
    if catalogue.chaotic and catalogue.stay == STAYS[0]:
        for stay in STAYS_TRIED:
            tried = dataclasses.replace(catalogue, stay=stay)
            labels = tried.label(settled, ROUNDS[-1], threads=threads, check=check)['label']
            first = len(catalogue.orbits)
            if not np.any((labels >= first) & (labels < first + len(catalogue.chaotic))):
                return tried
    return catalogue
