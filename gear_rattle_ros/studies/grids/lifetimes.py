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

"""How long transients last before an orbit or rest ends them."""

from collections.abc import Iterable, Iterator
import dataclasses
import math
from typing import Final, Unpack

import numpy as np
import numpy.typing as npt

from .basins import compute_basins
from .grid import GRIDS
from ..attractors import describe as describe_attractors
from ..work import Arrays, Study, Work, WorkOptions
from ...attractors.catalogue import results_here
from ...attractors.listing import named
from ...attractors.plane import Plane
from ...core import defaults
from ...core.arrays import FloatArray, IntArray
from ...core.many.escape import escape_rate
from ...core.many.settling import RecordArray, RESULT, Table, UNSETTLED
from ...core.model import Parameters
from ...core.words import counted
from ...store.store import Store

NAME: Final = 'lifetimes'
TITLE: Final = 'Lifetimes of transients of the gear-rattling model'
# The exponential tail begins at this share of the cap, where no other place is given.
TAIL: Final = 0.1
# Bins of the distribution, even in the logarithm.
BINS: Final = 200
BRIEF: Final = 100  # impacts
# Caps for which trajectories that many initial conditions share are followed.
FAR: Final = 20


@dataclasses.dataclass(frozen=True)
class Merged:
    """Initial conditions from which the driven gear sticks; many go on as one trajectory."""

    # A row stands for all that stick after the same number of impacts and leave at the same phase.
    stick: IntArray  # impacts until the driven gear sticks
    after: IntArray  # impacts from there until it settles
    count: IntArray  # initial conditions
    censored: IntArray  # those of them that were given up at the cap
    trajectory: IntArray  # number of the trajectory that they share
    is_open: npt.NDArray[np.bool_]  # whether that was given up, far beyond the cap


NONE: Final = Merged(*np.zeros((6, 0), np.int64))


@dataclasses.dataclass(frozen=True)
class Escape:
    """Escape times of many initial conditions, censored at a cap."""

    cap: int  # impacts after which an initial condition was given up
    initial_conditions: int
    censored: int  # those that were given up
    begin: int  # lifetime from which on the tail is taken to be exponential [impacts]
    in_tail: int  # those that are independent and live longer
    escapes: int  # those of them that escape
    merged: int  # initial conditions from which the driven gear sticks
    trajectories: int  # that these share
    rate: float  # escapes per impact of independent trajectories in the tail
    rate_error: float
    mean: float  # lifetime [impacts], by the tail from `begin` on; inf where nothing escapes
    # The scatter when as many are drawn at random from the window; a grid scatters no more.
    mean_error: float

    def describe(self) -> str:
        lines = [
            f'{self.censored:,} of {counted(self.initial_conditions, "initial condition")} '
            f'({self.censored / self.initial_conditions:.2%}) live '
            f'{counted(self.cap, "impact")} or longer',
            f'tail from {counted(self.begin, "impact")}: ' + (
                f'{counted(self.escapes, "escape")}, rate {self.rate:.4e} +- '
                f'{self.rate_error:.1e} per impact' if self.in_tail else 'nothing lives longer'),
            f'mean lifetime: {self.mean:,.1f} +- {self.mean_error:,.1f} impacts']
        if self.merged:
            shared = counted(self.trajectories, 'shared trajectory')
            lines.insert(1, f'from {self.merged:,} of them the driven gear sticks and goes on '
                         f'along {shared}, followed once and left out of the rate')
        return '\n'.join(lines)


def estimate_escape(counts: IntArray, censored: int, begin: int, merged: Merged = NONE) -> Escape:
    """Estimate the mean lifetime of censored transients."""
    # `counts`, shape (cap + 1,), are independent initial conditions that were seen to escape, by
    # their lifetime, `censored` those that were given up at the cap; the tail begins after `begin`
    # impacts. The rate is that of these, which go on at it beyond the cap. The few trajectories
    # that many initial conditions share do not need it: they are followed to their ends.
    cap = len(counts) - 1
    lived, numbers = np.append(np.arange(cap + 1), cap), np.append(counts, censored)
    n = int(np.sum(numbers) + np.sum(merged.count))
    if not n or not 0 <= begin < cap:
        raise ValueError(f'tail = {begin} does not lie below the cap of {counted(cap, "impact")}')
    late = lived > begin
    in_tail = int(np.sum(numbers[late]))
    rate = escape_rate(lived, np.arange(cap + 2) > cap, begin, numbers)
    # A mean tail for those that get there; what is shared is known, or goes on as long again.
    each = np.concatenate([
        np.where(late, begin + rate.mean, lived),
        merged.stick + merged.after + np.where(merged.is_open, rate.mean, 0.0)])
    weights = np.concatenate([numbers, merged.count])
    each, weights = each[weights > 0], weights[weights > 0]
    mean = float(np.average(each, weights=weights))
    spread = mean if math.isinf(mean) else math.sqrt(float(
        np.average((each - mean)**2, weights=weights)))
    together = np.bincount(merged.trajectory, merged.count * merged.is_open)
    errors = [size * rate.mean for size in together if size]
    if in_tail:
        errors.append(in_tail * rate.mean_error)
    return Escape(
        cap, n, censored + int(np.sum(merged.censored)), begin, in_tail, rate.escapes,
        int(np.sum(merged.count)), len(set(merged.trajectory)), rate.rate, rate.error, mean,
        math.hypot(spread * math.sqrt(n), *errors) / n)


def distribution(counts: IntArray, censored: int) -> tuple[FloatArray, IntArray, FloatArray]:
    """Count escapes in bins that are even in the logarithm."""
    # Returns the edges of the bins [impacts], the escapes in (edge, next edge], and the share
    # whose lifetime is longer than each edge.
    cap = len(counts) - 1
    edges = np.concatenate([[0.0], np.unique(np.round(np.geomspace(1, max(cap, 2), BINS)))])
    below = np.cumsum(counts)[np.minimum(edges, cap).astype(np.int64)]
    below[0] = 0
    return edges, np.diff(below), 1.0 - below / max(int(np.sum(counts)) + censored, 1)


@Study
def lifetimes(parameters: Parameters, plane: Plane | None = None, *,
              cap: int = defaults.LIFETIMES_CAP, tail: int | None = None,
              tolerance: float = defaults.TOLERANCE,
              initial_conditions: int = defaults.LIFETIMES_INITIAL_CONDITIONS,
              seed: int = defaults.SEED, hold: int = defaults.LIFETIMES_HOLD,
              tile: int | None = None, **options: Unpack[WorkOptions]) -> Store:
    """
    Find how long every cell of a plane is transient; only an orbit or rest ends a transient.

    The dataset has what `basins` has, the distribution of the lifetimes, and their mean.

    Parameters
    ----------
    parameters, plane
        The model and the cells.
    cap : int
        Impacts after which a cell is given up.
    tail : int, optional
        Where the exponential tail begins [impacts]; a tenth of the cap by default.
    tolerance, initial_conditions, seed, hold, tile
        As `basins` takes them.

    """
    begin = int(TAIL * cap) if tail is None else tail
    if not 0 <= begin < cap:
        raise ValueError(f'--tail {begin} does not lie below the cap of {counted(cap, "impact")}')
    plane = plane or Plane()
    store, catalogue = compute_basins(
        parameters, plane, Work(**options), cap=cap, tolerance=tolerance, seed=seed, hold=hold,
        initial_conditions=initial_conditions, chaotic=False, tile=tile, name=NAME, title=TITLE)
    escaped, censored, merged = tally(parts_of(store, parameters, plane), catalogue.table, cap)
    escape = estimate_escape(escaped[0], int(censored[0]), begin, merged)
    ended = np.sum(escaped, axis=0)
    edges, counts, survival = distribution(ended, int(np.sum(censored)))
    brief, together = brief_cells(store)
    store.write_table({
        'edge': (('edge',), edges, named('edge of a bin', 'impacts')),
        'escapes': (('bin',), counts, named('escapes after edge and up to the next')),
        'survival': (('edge',), survival, named('share of the cells with a longer lifetime')),
    })
    store.set_attributes({f'escape_{name}': value if math.isfinite(value) else str(value)
                          for name, value in dataclasses.asdict(escape).items()} | {
        'brief': brief, 'brief_neighbours': together,
        'longest': int(np.max(np.flatnonzero(ended), initial=0))})
    return store


def escape_of(dataset: Arrays) -> Escape:
    values = {field.name: dataset.attrs[f'escape_{field.name}']
              for field in dataclasses.fields(Escape)}
    # JSON has no infinity.
    return Escape(**values | {name: float(value) for name, value in values.items()
                              if isinstance(value, str)})


def describe(dataset: Arrays) -> str:
    """Put lifetimes in words: the attractors, and how transients end."""
    a, escape = dataset.attrs, escape_of(dataset)
    return describe_attractors(dataset, beside=(
        f'{a["brief"] / escape.initial_conditions:.2%} live less than '
        f'{counted(BRIEF, "impact")}, and so do {a["brief_neighbours"]:.1%} of their neighbours; '
        f'the longest that is seen to end is {a["longest"]:,}\n'
        f'{escape.describe()}'))


def parts_of(store: Store, parameters: Parameters, plane: Plane
             ) -> Iterator[tuple[RecordArray, RecordArray]]:
    """Read the initial conditions of a grid and what is stored of their RESULT, tile by tile."""
    for tile, place in enumerate(store.tiles):
        initial = plane.cells(parameters, place['velocity'], place[plane.across])
        results = np.zeros(len(initial), RESULT)
        for name in GRIDS:
            results[name] = store.read(tile, name).ravel()
        yield initial, results


def brief_cells(store: Store) -> tuple[int, float]:
    """Count the cells of brief lifetimes; return the share of their neighbours that are, too."""
    count, ends, both = 0, 0, 0
    for tile in range(len(store.tiles)):
        brief = (store.read(tile, 'lifetime') < BRIEF) & (store.read(tile, 'label') != UNSETTLED)
        count += int(np.sum(brief))
        for a, b in ((brief[1:], brief[:-1]), (brief[:, 1:], brief[:, :-1])):
            ends += int(np.sum(a) + np.sum(b))
            both += 2 * int(np.sum(a & b))
    return count, both / max(ends, 1)


def tally(parts: Iterable[tuple[RecordArray, RecordArray]], table: Table, cap: int
          ) -> tuple[IntArray, IntArray, Merged]:
    """Count lifetimes up to the cap and what was given up there, and gather what is shared."""
    # The first row of both counts is of those that are independent, the second of those from which
    # the driven gear sticks; each trajectory that these share is followed once.
    counts, censored = np.zeros((2, cap + 1), np.int64), np.zeros(2, np.int64)
    rows: dict[tuple[float, int], list[int]] = {}
    first: dict[float, RecordArray] = {}
    for initial, results in parts:
        given_up = results['label'] == UNSETTLED
        is_merged = np.isfinite(results['release'])
        for k, these in enumerate((~is_merged, is_merged)):
            censored[k] += int(np.sum(given_up & these))
            counts[k] += np.bincount(results['lifetime'][these & ~given_up], minlength=cap + 1)
        for cell in np.flatnonzero(is_merged):
            release = float(results['release'][cell])
            first.setdefault(release, initial[cell:cell + 1])
            row = rows.setdefault((release, int(results['stick'][cell])), [0, 0])
            row[0] += 1
            row[1] += int(given_up[cell])
    if not rows:
        return counts, censored, NONE
    followed = results_here(np.concatenate(list(first.values())), FAR * cap, table)
    places = {release: place for place, release in enumerate(first)}
    releases, sticks = zip(*rows, strict=True)
    trajectory = np.array([places[release] for release in releases])
    shared = followed[trajectory]
    count, late = np.array([*rows.values()]).T
    return counts, censored, Merged(
        np.array(sticks), shared['lifetime'] - shared['stick'], count, late, trajectory,
        shared['label'] == UNSETTLED)
