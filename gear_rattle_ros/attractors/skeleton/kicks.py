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
The smallest change that makes a trajectory settle elsewhere: a kick, or of the section's point.

A basin has dents: a change of one size may lead elsewhere where a larger one does not. So every
direction is scanned from the attractor outwards before the place is bisected, and again up to the
smallest change found, as finely in proportion, until a scan finds none that is smaller. Dents
narrower than a step of the last scan may remain.
"""

from collections.abc import Callable
import dataclasses
import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from ..catalogue import Attractor, Catalogue, go_on, Kind
from ..finding import Check
from ...core.arrays import FloatArray, IntArray
from ...core.flight.elementary import TWO_PI
from ...core.flight.lanes import make_initial_conditions
from ...core.many.recorded import record_impacts
from ...core.many.settling import RESTS_UPPER, UNSETTLED

# Steps of a scan; half as many more crowd up to its end, by which dents gather; scans before are
# coarser.
STEPS: Final = 512
COARSER: Final = 16
CROWDED: Final = 1e-4
HALVED: Final = 0.5
# Rays of the fine scans: those on which coarse ones find the smallest changes.
FINEST: Final = 64
# A change is located to this part of it: a trajectory near its attractor is led elsewhere, too.
LOCATED: Final = 1e-6
# Largest change that is tried [1], and impacts after which a trajectory is unsettled.
REACH: Final = 2.0
CAP: Final = 20_000
# Impacts of a chaotic attractor, or phases of one at rest, that are tried, and how many impacts
# these may take to settle again.
SAMPLED: Final = 128
SAMPLED_LEAST: Final = 16
EFFORT: Final = 20_000_000
# Directions in which a point of the section is displaced.
DIRECTIONS: Final = 32


class Change(NamedTuple):
    """The smallest change along some rays."""

    ray: int
    distance: float  # with which it leads elsewhere; somewhat less does not
    label: int  # where it leads
    resolution: float  # step of the last scan: dents may be narrower
    unsettled: float  # share of all points tried that settled nowhere [1]


@dataclasses.dataclass(frozen=True)
class Kick:
    """The smallest change at an impact that makes a trajectory leave its attractor."""

    wall: int
    phase: float  # of the impact [rad], and velocity just before and just after it [1]
    velocity: float
    velocity_after: float
    # What is added [rad, 1]: a kick to `velocity_after`, a displacement to `phase` and `velocity`.
    phase_change: float
    change: float
    size: float
    target: int  # label of the attractor it leads to
    resolution: float  # as of `Change`
    unsettled: float


def smallest_change(label: Callable[[FloatArray], IntArray], own: int, origins: FloatArray,
                    directions: FloatArray, limits: FloatArray, *, steps: int = STEPS
                    ) -> Change | None:
    """
    Find the smallest distance along rays at which points have another label.

    `label` takes points, shape (n, d), and returns a label for each; that of the `origins`, shape
    (rays, d), is their `own`. `UNSETTLED` counts as unknown, and is passed over. `limits` are the
    largest distances that are tried, in at least that many `steps`.
    """
    best, unknown, tried, scans = None, 0, 0, [max(steps // COARSER, 8), steps]

    def follow(rays: IntArray, distances: FloatArray) -> tuple[IntArray, npt.NDArray[np.bool_]]:
        nonlocal unknown, tried
        found = label(origins[rays] + distances[:, None] * directions[rays])
        unknown, tried = unknown + int(np.sum(found == UNSETTLED)), tried + len(found)
        return found, (found != own) & (found != UNSETTLED)

    first, rays, scanned = np.full(len(origins), math.inf), np.flatnonzero(limits > 0.0), limits
    due = rays
    while scans:
        shares = np.unique(np.append(np.arange(1, scans[0] + 1) / scans[0],
                                     1.0 - np.geomspace(CROWDED, 0.5, scans[0] // 2)))
        scanned = scanned.copy()
        scanned[due] = limits[due]
        distances = limits[due, None] * shares
        found, away = (each.reshape(distances.shape) for each in follow(
            np.repeat(due, len(shares)), distances.ravel()))
        some = np.flatnonzero(away.any(axis=1))
        if not len(some):
            del scans[0]
            due = rays = rays[np.argsort(first[rays], kind='stable')[:FINEST]]
            continue
        seen, places = due[some], away.argmax(axis=1)[some]
        outside, labels = distances[some, places], found[some, places]
        inside = np.where(places > 0, distances[some, places - 1], 0.0)
        while len(left := np.flatnonzero(outside - inside > LOCATED * outside)):
            middle = 0.5 * (inside[left] + outside[left])
            there, is_away = follow(seen[left], middle)
            inside[left[~is_away]] = middle[~is_away]
            outside[left[is_away]], labels[left[is_away]] = middle[is_away], there[is_away]
        first[seen] = outside
        least = int(np.argmin(outside))
        best = int(seen[least]), float(outside[least]), int(labels[least])
        # What is within the accuracy of the best is not smaller.
        limits = np.minimum(limits, (1.0 - LOCATED) * best[1])
        # The others again only where that is much finer than before.
        due = np.union1d(rays[limits[rays] < HALVED * scanned[rays]], best[0])
    return best and Change(*best, float(np.max(scanned[rays])) / steps, unknown / tried)


def smallest_kick(catalogue: Catalogue, attractor: Attractor, *, reach: float = REACH,
                  steps: int = STEPS, cap: int = CAP, threads: int | None = None,
                  check: Check = go_on) -> Kick | None:
    """
    Find the smallest change of the velocity after an impact that changes the attractor.

    It is what the noise of the simulator adds to `velocity_after` at an impact. Of a chaotic
    attractor some impacts are tried, so the kick is an upper bound; at rest a kick is tried at
    some phases. None where no kick up to `reach` leads elsewhere.
    """
    impacts = impacts_of(catalogue, attractor, steps)
    # Away from the wall first: a kick never sends the gear through it.
    away = 2.0 * impacts[:, 0] - 1.0
    return _search(catalogue, attractor, np.tile(impacts, (2, 1)), np.outer(
        np.append(away, -away), (0.0, 1.0)), -catalogue.parameters.restitution, reach, steps, cap,
        threads, check)


def smallest_displacement(catalogue: Catalogue, attractor: Attractor, kick: Kick | None, *,
                          reach: float = REACH, steps: int = STEPS // 2, cap: int = CAP,
                          threads: int | None = None, check: Check = go_on) -> Kick | None:
    """
    Find the smallest change of (phase, velocity before the impact) that changes the attractor.

    Its size is the radius of the largest disc round an impact of the attractor in its basin. It is
    no larger than where a `kick` changes it, as that displaces the velocity before the impact.
    """
    if attractor.kind is Kind.RESTING:
        return None
    restitution, same = catalogue.parameters.restitution, None
    if kick and restitution:
        # A kick of the velocity after the impact is this displacement of that before it.
        same = dataclasses.replace(kick, change=-kick.change / restitution,
                                   size=kick.size / restitution)
        reach = min(reach, same.size)
    impacts = impacts_of(catalogue, attractor, DIRECTIONS * steps // 2)
    angles = np.arange(DIRECTIONS) * (TWO_PI / DIRECTIONS)
    found = _search(catalogue, attractor, np.repeat(impacts, DIRECTIONS, axis=0), np.tile(
        np.column_stack([np.cos(angles), np.sin(angles)]), (len(impacts), 1)), 1.0, reach, steps,
        cap, threads, check)
    return found or same


def _search(catalogue: Catalogue, attractor: Attractor, impacts: FloatArray,
            directions: FloatArray, scale: float, reach: float, steps: int, cap: int,
            threads: int | None, check: Check) -> Kick | None:
    """Search from impacts, of whose velocity `scale` times that before them is changed."""
    def label(points: FloatArray) -> IntArray:
        return catalogue.label(make_initial_conditions(
            catalogue.parameters, points[:, 0], -points[:, 2], points[:, 1]), cap,
            threads=threads, check=check)['label']

    # Points are phase, velocity and wall.
    origins = impacts[:, [1, 2, 0]] * (1.0, scale, 1.0)
    # No further than to a velocity of 0: beyond it is the other wall.
    slowing = directions[:, 1] * (2.0 * impacts[:, 0] - 1.0) * math.copysign(1.0, scale)
    limits = np.minimum(reach, np.where(slowing > 1e-9, np.abs(origins[:, 1]) / np.maximum(
        slowing, 1e-9), math.inf))
    found = smallest_change(label, attractor.label, origins, np.pad(directions, ((0, 0), (0, 1))),
                            limits, steps=steps)
    if not found:
        return None
    wall, phase, velocity = impacts[found.ray].tolist()
    turned, change = (found.distance * directions[found.ray] + 0.0).tolist()
    return Kick(int(wall), phase, velocity, -catalogue.parameters.restitution * velocity, turned,
                change, *found[1:])


def impacts_of(catalogue: Catalogue, attractor: Attractor, steps: int = STEPS) -> FloatArray:
    """List impacts on an attractor: wall, phase, velocity before; at rest phases, without any."""
    if attractor.orbit:
        return attractor.points()
    if attractor.kind is Kind.RESTING:
        phases = np.arange(SAMPLED) * (TWO_PI / SAMPLED)
        wall = 0.0 if attractor.label == RESTS_UPPER else 1.0
        return np.column_stack([np.full(SAMPLED, wall), phases, np.zeros(SAMPLED)])
    if attractor.chaos is None:
        return np.zeros((0, 3))
    count = min(max(EFFORT // (2 * steps * catalogue.stay), SAMPLED_LEAST), SAMPLED)
    states = attractor.chaos.states[:count]
    rows, _ = record_impacts(states, 0, -(-count // len(states)))
    impacts = rows.ravel()[:count]
    return np.column_stack([np.signbit(impacts['velocity']), impacts['phase'],
                            impacts['velocity']]).astype(np.float64)
