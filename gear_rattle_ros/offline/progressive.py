"""
Basins for somebody who watches: coarse at once, then finer and finer.

Starts are followed in slices of a few milliseconds, so that the work can be dropped at any moment,
and in rounds: after the first a picture may be shown. There are more of them while there is time,
and what has not settled then stays unresolved in it. The last picture takes all the time it needs.
"""

from collections.abc import Callable, Iterator, Sequence
import dataclasses
import time
from typing import Final

import numpy as np
import numpy.typing as npt

from .engine import run_tiles
from .grid import make_starts, Plane
from .search import Catalogue, find_attractors, orbits_among, settle_here, TOLERANCE
from .sketch import sketched_sets
from ..core.classify import RecordArray, RESULT, Table, UNRESOLVED
from ..core.model import Parameters
from ..core.periodic import Orbit
from ..core.recorded import record_impacts
from ..core.table import make_table

# The first look for attractors: random starts, impacts passed over, impacts looked at, and the
# longest period.
GLANCE: Final = (48, 300, 200, 64)
# The second: random starts, and impacts for which nothing may leave a chaotic attractor.
STARTS: Final = 256
HOLD: Final = 2_000
# What takes longer to be told from a transient is left unresolved [impacts].
STAY_MOST: Final = 256
# Unresolved starts of a picture that are looked at for orbits that were missed.
LOOKED_AT: Final = 32
SEED: Final = 1
# Time for a picture, by the length of its edge at the most, after which no further round begins
# and the present one ends [s].
TIMES: Final = ((50, 0.04), (100, 0.1), (200, 0.15), (400, 0.5))
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
        Attractors with the first labels.
    late : tuple of Orbit
        Those with the labels after them.
    is_complete : bool
        Whether chaotic attractors have been searched for.

    """

    plane: Plane
    labels: LabelArray
    catalogue: Catalogue
    late: tuple[Orbit, ...]
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
    settle_here(starts, skip, make_table((), TOLERANCE), results)
    states = _moved(starts, results)[results['label'] == UNRESOLVED]
    orbits = tuple(orbits_among(parameters, states, look, longest, TOLERANCE))
    rows, _ = record_impacts(states, 0, 64)
    return Glance(
        Catalogue(parameters, TOLERANCE, skip, orbits, (), 0.0, 0, results['label']),
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
    catalogue, late = seen.catalogue, tuple[Orbit, ...]()
    parameters = catalogue.parameters
    mean = GUESS
    for level, plane in enumerate(planes):
        if level == 1:
            catalogue = _without_slow_chaos(find_attractors(
                parameters, plane.random_starts(parameters, STARTS, SEED), hold=HOLD,
                threads=threads, trace=sketched_sets))
            late = _missed(catalogue, seen.catalogue.orbits)
        size = plane.phases * plane.velocities
        # Mixed, so that what is not looked at in time is spread over the picture.
        order = np.random.default_rng(SEED).permutation(size)
        starts = plane.starts(parameters, slice(0, plane.velocities), slice(0, plane.phases))
        if on_walls:
            starts['displacement'] = np.where(starts['velocity'] < 0.0, -1.0, 0.0)
        starts = starts[order]
        labels = np.full(size, UNRESOLVED, np.int16)
        left = np.arange(size)
        is_last = level == len(planes) - 1
        until = time.monotonic() + _time_for(plane) if not is_last or level == 0 else np.inf
        shown, total = 1.0, 0
        for limit in _rounds(catalogue, cap if is_last else ROUNDS[-1]):
            results, mean = _follow(
                starts[left], limit, catalogue.table(late), mean, threads,
                until if total else np.inf, is_dropped)
            labels[order[left]] = results['label']
            starts[left] = _moved(starts[left], results)
            left = left[results['label'] == UNRESOLVED]
            total += limit
            if level > 0 and len(left):
                late = _with_missed(catalogue, late, starts[left[:LOOKED_AT]])
            if not len(left) or time.monotonic() > until:
                break
            unresolved = len(left) / size
            if is_last and level > 0 and total >= ROUNDS[1] and shown - unresolved > NEWS:
                shown = unresolved
                yield _picture(plane, labels, catalogue, late, level)
        yield _picture(plane, labels, catalogue, late, level)


def _picture(plane: Plane, labels: LabelArray, catalogue: Catalogue, late: tuple[Orbit, ...],
             level: int) -> Basins:
    return Basins(plane, labels.reshape(plane.velocities, plane.phases).copy(), catalogue, late,
                  level > 0)


def _time_for(plane: Plane) -> float:
    edge = max(plane.phases, plane.velocities)
    return next((time for most, time in TIMES if edge <= most), np.inf)


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
            is_dropped: Callable[[], bool]) -> tuple[RecordArray, float]:
    results = np.zeros(len(starts), RESULT)
    results['label'] = UNRESOLVED
    for name in ('phase', 'displacement', 'velocity'):
        results[name] = starts[name]
    batch = max(int(SLICE / min(mean, cap)), STARTS_LEAST)

    def work(number: int) -> int:
        if is_dropped():
            raise Dropped
        if time.monotonic() > until:
            return 0
        part = slice(number * batch, (number + 1) * batch)
        return settle_here(starts[part], cap, table, results[part])

    made: list[int] = []
    run_tiles(work, range(-(-len(starts) // batch)), lambda _, impacts: made.append(impacts),
              threads=threads)
    followed = int(np.count_nonzero(results['impacts']))
    return results, max(sum(made) / followed, 1.0) if followed else mean


def _moved(starts: RecordArray, results: RecordArray) -> RecordArray:
    moved = starts.copy()
    for name in ('phase', 'displacement', 'velocity'):
        moved[name] = results[name]
    return moved


def _without_slow_chaos(catalogue: Catalogue) -> Catalogue:
    if catalogue.stay <= STAY_MOST:
        return catalogue
    labels = np.where(catalogue.labels < len(catalogue.orbits), catalogue.labels, UNRESOLVED)
    return dataclasses.replace(catalogue, chaotic=(), stay=0, labels=labels)


def _missed(catalogue: Catalogue, orbits: Sequence[Orbit]) -> tuple[Orbit, ...]:
    known = {orbit.key for orbit in catalogue.orbits}
    return tuple(orbit for orbit in orbits if orbit.key not in known)


def _with_missed(catalogue: Catalogue, late: tuple[Orbit, ...], states: RecordArray
                 ) -> tuple[Orbit, ...]:
    found = orbits_among(catalogue.parameters, states, *GLANCE[2:], TOLERANCE)
    known = {orbit.key for orbit in late}
    return (*late, *(orbit for orbit in _missed(catalogue, found) if orbit.key not in known))
