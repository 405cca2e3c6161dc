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
Core sets, by which jumps of a trajectory with noise from one attractor to another are counted.

The core of an orbit is a ball round each of its points, from which without noise nearly all
trajectories settle on the orbit; that of a chaotic attractor is its boxes. A trajectory belongs to
the attractor whose core it has visited last: one that only crosses a boundary has not jumped yet.
"""

from collections import Counter
from collections.abc import Mapping
import math
from typing import Final, NamedTuple

import numpy as np

from .catalogue import Attractor, Catalogue
from ..core.arrays import FloatArray, IntArray
from ..core.flight.elementary import TWO_PI
from ..core.flight.lanes import EMPTY
from ..core.many.chaotic_sets import ChaoticSet
from ..core.many.recorded import initial_after
from ..core.many.settling import BOXES
from ..core.orbits.orbit import Orbit
from ..core.orbits.section import distances
from ..core.words import in_columns

# The widest ball [1], which is halved until at least this share of it settles on the orbit, and
# the points that are tried along an edge.
WIDEST: Final = 0.4
SETTLES: Final = 0.99
ACROSS: Final = 21


class Jumps(NamedTuple):
    """The attractors that a trajectory was on."""

    last: IntArray  # label of the attractor whose core was visited last; EMPTY before the first
    inside: float  # share of the impacts that are in a core [1]
    radius: Mapping[int, float]  # of the balls of an orbit, by its label [1]
    counts: Mapping[tuple[int, int], int]  # jumps, by the labels before and after

    def describe(self, names: Mapping[int, str]) -> str:
        """Put the jumps in words, with standard errors; `names` are by label."""
        rows = [[name, f'{self.radius[label]:g}' if label in self.radius else 'boxes',
                 f'{np.sum(self.last == label) / max(len(self.last), 1):.1%}', *(
                     _counted(self.counts.get((label, to), 0)) if to != label and np.any(
                         self.last == label) else '-' for to in names)]
                for label, name in names.items()]
        return in_columns(['attractor', ' core [1]', ' impacts on it', *(
            f' jumps to {name}' for name in names.values())], rows) + (
                f'\n{self.inside:.1%} of the impacts are in cores')


def find_jumps(catalogue: Catalogue, phases: FloatArray, velocities: FloatArray) -> Jumps:
    """Find the core that was visited last at each impact of a trajectory, in turn."""
    core, radius = np.full(len(phases), EMPTY), {}
    for each in catalogue.attractors:
        if each.chaos:
            core[_in_boxes(each.chaos, phases, velocities)] = each.label
        elif each.orbit:
            radius[each.label] = core_radius(catalogue, each, each.orbit)
            for phase, velocity in each.orbit.points:
                core[distances(velocities, phases, velocity, phase)
                     <= radius[each.label]] = each.label
    visits = core[core != EMPTY]
    jumped = visits[1:] != visits[:-1]
    jumps = zip(visits[:-1][jumped].tolist(), visits[1:][jumped].tolist(), strict=True)
    before = np.maximum.accumulate(np.where(core == EMPTY, EMPTY, np.arange(len(core))))
    return Jumps(np.where(before == EMPTY, EMPTY, core[before]),
                 len(visits) / max(len(core), 1), radius, Counter(jumps))


def core_radius(catalogue: Catalogue, attractor: Attractor, orbit: Orbit) -> float:
    """Return the radius of the balls round the points of an orbit [1]."""
    side = np.linspace(-1.0, 1.0, ACROSS)
    grid = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    radius = WIDEST
    while radius > catalogue.tolerance:
        tried = np.concatenate([point + radius * grid for point in orbit.points])
        walls = np.repeat(orbit.walls, len(grid))
        tried = tried[np.signbit(tried[:, 1]) == walls]
        initial = initial_after(orbit.parameters, tried[:, 0] % TWO_PI, tried[:, 1])
        labels = catalogue.label(initial, threads=1)['label']
        if np.mean(labels == attractor.label) >= SETTLES:
            break
        radius /= 2.0
    return radius


def _in_boxes(chaos: ChaoticSet, phases: FloatArray, velocities: FloatArray) -> IntArray:
    rows = (np.abs(velocities) * (BOXES / chaos.speed)).astype(np.int64)
    columns = np.minimum(phases * (BOXES / TWO_PI), BOXES - 1).astype(np.int64)
    slow = np.flatnonzero(rows < BOXES)
    return slow[chaos.boxes[np.signbit(velocities[slow]).astype(np.int64), rows[slow],
                            columns[slow]]]


def _counted(count: int) -> str:
    # The largest mean that is compatible with no event at 95 %.
    return f'{count:,} +- {math.sqrt(count):.1f}' if count else '0, mean < 3.0'
