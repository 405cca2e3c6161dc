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

"""The attractors at one alpha of an orbit diagram, and what is drawn of each."""

import dataclasses
import math

import numpy as np

from .catalogue import Attractor, Catalogue, Kind
from .finding import find_attractors
from .skeleton.kicks import smallest_kick
from ..core.arrays import FloatArray
from ..core.many.chaotic_sets import SWEEP
from ..core.many.settling import RecordArray
from ..core.many.velocity_counts import BLOCKS, count_velocities
from ..core.model import Parameters
from ..core.orbits.orbit import Orbit


@dataclasses.dataclass(frozen=True)
class Window:
    """What is followed and counted at each alpha."""

    keep: int = 2048  # impacts of each trajectory that are counted
    low: float = -3.0  # the velocities between which they are [1]
    high: float = 3.0
    bins: int = 1200
    # Impacts after which all is unsettled, and for which nothing may leave a chaotic attractor.
    hold: int = 10_000
    kicks: bool = False  # whether the smallest kick of each attractor is sought

    def __post_init__(self) -> None:
        if self.keep < BLOCKS:
            raise ValueError(f'impacts to keep {self.keep} must be at least {BLOCKS}')
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise ValueError(f'velocity window {self.low:g} to {self.high:g} is empty or '
                             'reversed; give the lower end first')
        if not 1 <= self.bins <= 100_000:
            raise ValueError(f'{self.bins} bins are not between 1 and 100000')


@dataclasses.dataclass(frozen=True)
class Branch:
    """An attractor at one alpha, or what has not settled there."""

    attractor: Attractor
    states: RecordArray  # of the trajectories that are on it
    counts: FloatArray  # their impact velocities, by bin
    # The largest per impact [1]: of an orbit from its multipliers, else the mean of all blocks.
    exponent: float
    exponent_error: float
    exact_sum: float  # what both exponents add up to [1]
    kick: float = math.nan  # the smallest at an impact that changes the attractor [1]


def find_branches(parameters: Parameters, initial: RecordArray, window: Window,
                  known: tuple[Orbit, ...] = ()) -> tuple[Catalogue, list[Branch]]:
    """Find the attractors at one alpha, knowing the orbits at a neighbouring one."""
    # The branch with most trajectories comes first; known orbits that none reaches come last.
    catalogue = find_attractors(parameters, initial, hold=window.hold, known=known, effort=SWEEP,
                                threads=1)
    found = sorted(catalogue.attractors, key=lambda each: (-each.settled, each.key))
    branches = [_branch(each, catalogue, window) for each in found]
    if window.kicks:
        kicks = [smallest_kick(catalogue, each, cap=window.hold, threads=1) for each in found]
        branches = [dataclasses.replace(branch, kick=kick.size) if kick else branch
                    for branch, kick in zip(branches, kicks, strict=True)]
    return catalogue, branches


def _branch(attractor: Attractor, catalogue: Catalogue, window: Window) -> Branch:
    states = catalogue.states[catalogue.labels == attractor.label]
    counts = np.zeros(window.bins)
    if attractor.orbit:
        # Exact, and free of what is left of the transient.
        q, impacts = attractor.impacts, window.keep * max(len(states), 1)
        counts, _ = np.histogram(
            attractor.orbit.velocities, window.bins, (window.low, window.high),
            weights=impacts // q + (np.arange(q) < impacts % q))
        return Branch(attractor, states, counts, attractor.exponents[0], 0.0, attractor.exact_sum)
    if attractor.kind in (Kind.RESTING, Kind.FLOATING) or not len(states):
        return Branch(attractor, states, counts, -math.inf, math.nan, math.nan)
    counted = count_velocities(states, window.keep, window.low, window.high, window.bins)
    mean, error = -math.inf, math.nan
    if np.isfinite(counted.growth).all():
        mean = float(np.mean(counted.growth))
        error = float(np.std(counted.growth, ddof=1) / math.sqrt(counted.growth.size))
    p = catalogue.parameters
    exact = -math.inf
    if p.restitution:
        exact = 2.0 * math.log(p.restitution) - p.beta * float(
            np.mean(counted.times)) / window.keep
    return Branch(attractor, states, counted.counts.sum(axis=0, dtype=np.float64), mean, error,
                  exact)
