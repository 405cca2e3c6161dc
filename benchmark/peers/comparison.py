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

"""The labels of a grid by this package, by peers, and in 50 digits."""

import os
from pathlib import Path
import subprocess
import sys
import time
from typing import NamedTuple

import numpy as np

from gear_rattle_ros.attractors.finding import find_attractors
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.core.model import Parameters

from .arbiter import label_of

FOLLOW = Path(__file__).with_name('follow.py')
PARAMETERS = Parameters(alpha=0.48)
# Distance within which the last impact of a peer is on an orbit [1].
NEAR = 1e-4
CAP = 20_000
# From exactly on a wall heyoka 7.13 can miss a return to it within its first step.
INSIDE = -1e-300
MOVED = ('phase', 'velocity')


class Labels(NamedTuple):
    """A grid of labels, negative for none, and the seconds of one core; of ours lifetimes, too."""

    labels: np.ndarray
    seconds: float
    lifetimes: np.ndarray | None = None


class Grid:
    """Initial conditions on the upper wall, and whose labels they have."""

    def __init__(self, size: int) -> None:
        """Find the attractors at 0.48."""
        self.plane = Plane(phases=size, velocities=size)
        self.initial = self.plane.cells(PARAMETERS, slice(0, size), slice(0, size))
        self.catalogue = find_attractors(PARAMETERS, self.plane.draw(PARAMETERS, 1000, 1))

    def ours(self, moved: str | None = None, by: float = 0.0) -> Labels:
        """Follow all by the lanes; `moved` is larger `by` that, or by one unit in the last."""
        initial = self.initial.copy()
        if moved:
            initial[moved] = initial[moved] + by if by else np.nextafter(initial[moved], np.inf)
        begin = time.process_time()
        found = self.catalogue.label(initial, CAP, threads=1)
        return Labels(found['label'], time.process_time() - begin, found['lifetime'])

    def theirs(self, peer: str, python: str, folder: Path, displacement: float) -> Labels:
        """Follow all by a peer."""
        np.save(folder / 'initial.npy', np.stack([
            self.initial['phase'], np.full(len(self.initial), displacement),
            self.initial['velocity']], axis=1))
        done = subprocess.run(
            [python, str(FOLLOW), peer, str(folder / 'initial.npy'), str(folder / 'last.npy')],
            check=True, stdout=subprocess.PIPE, text=True)
        last = np.load(folder / 'last.npy')
        labels = np.full(len(last), -1)
        for number, orbit in enumerate(self.catalogue.orbits):
            for phase, velocity in zip(orbit.phases, orbit.velocities, strict=True):
                near = (np.abs(np.sin(0.5 * (last[:, 0] - phase))) < 0.5 * NEAR) & (
                    np.abs(last[:, 1] - velocity) < NEAR)
                labels[near] = number
        return Labels(labels, float(done.stdout))

    def exact(self) -> Labels:
        """Follow all in 50 digits."""
        orbits = [list(zip(orbit.phases.tolist(), orbit.velocities.tolist(), strict=True))
                  for orbit in self.catalogue.orbits]
        begin = time.process_time()
        labels = [label_of(phase, velocity, orbits)
                  for phase, velocity in self.initial[['phase', 'velocity']].tolist()]
        return Labels(np.array(labels), time.process_time() - begin)


def python_of(peer: str) -> str:
    """Return the interpreter that has the peer, or an empty string."""
    python = (os.environ.get('HEYOKA_PYTHON') if peer == 'heyoka' else None) or sys.executable
    missing = subprocess.run([python, '-c', f'import {peer}'], capture_output=True).returncode
    return '' if missing else python
