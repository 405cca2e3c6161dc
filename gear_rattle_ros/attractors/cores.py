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
from typing import NamedTuple

import numpy as np

from .catalogue import Attractor, Catalogue
from ..core.arrays import FloatArray, IntArray
from ..core.flight.elementary import TWO_PI
from ..core.flight.lanes import EMPTY
from ..core.many.hopping import Cores, cores_along, make_cores
from ..core.many.recorded import initial_after
from ..core.many.settling import BOXES
from ..core.orbits.cores import BALL, SETTLES, widest
from ..core.orbits.orbit import Orbit
from ..core.words import in_columns


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
    cores = cores_of(catalogue)
    core = cores_along(cores, np.ascontiguousarray(phases), np.ascontiguousarray(velocities))
    visits = core[core != EMPTY]
    jumped = visits[1:] != visits[:-1]
    jumps = zip(visits[:-1][jumped].tolist(), visits[1:][jumped].tolist(), strict=True)
    before = np.maximum.accumulate(np.where(core == EMPTY, EMPTY, np.arange(len(core))))
    return Jumps(np.where(before == EMPTY, EMPTY, core[before]),
                 len(visits) / max(len(core), 1), radii_of(cores), Counter(jumps))


def cores_of(catalogue: Catalogue) -> Cores:
    """Find the cores of all attractors: balls round points of orbits, boxes of chaotic sets."""
    balls = [(*point, core_radius(catalogue, each, each.orbit), each.label)
             for each in catalogue.attractors if each.orbit for point in each.orbit.points]
    boxes = np.full((2, BOXES, BOXES) if catalogue.chaotic else 0, EMPTY, np.int8)
    for each in catalogue.attractors:
        if each.chaos:
            boxes[each.chaos.boxes] = each.label
    return make_cores(np.array(balls, BALL), boxes,
                      catalogue.chaotic[0].speed if catalogue.chaotic else 0.0)


def radii_of(cores: Cores) -> dict[int, float]:
    """Return the radii of the balls of orbits, by label [1]."""
    return dict(zip(cores.balls['label'].tolist(), cores.balls['radius'].tolist(), strict=True))


def core_radius(catalogue: Catalogue, attractor: Attractor, orbit: Orbit) -> float:
    """Return the radius of the balls round the points of an orbit [1]."""
    def is_core(shifts: FloatArray) -> bool:
        tried = np.concatenate([point + shifts for point in orbit.points])
        tried = tried[np.signbit(tried[:, 1]) == np.repeat(orbit.walls, len(shifts))]
        initial = initial_after(orbit.parameters, tried[:, 0] % TWO_PI, tried[:, 1])
        labels = catalogue.label(initial, threads=1)['label']
        return bool(np.mean(labels == attractor.label) >= SETTLES)

    return widest(is_core, catalogue.tolerance)


def _counted(count: int) -> str:
    # The largest mean that is compatible with no event at 95 %.
    return f'{count:,} +- {math.sqrt(count):.1f}' if count else '0, mean < 3.0'
