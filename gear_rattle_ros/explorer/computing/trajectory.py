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

"""The trajectory from a point of the plane, as it is drawn."""

import dataclasses
from typing import Final

import numpy as np

from ...core.arrays import FloatArray
from ...core.flight.elementary import TWO_PI
from ...core.flight.simulation import Simulation
from ...core.model import EventKind, Parameters, State
from ...core.stream.reconstruction import drive_phases, rebuild

IMPACTS: Final = 400
# Most drive periods of a trajectory with few impacts, and those whose motion is drawn.
LONGEST: Final = 2_000
PERIODS: Final = 12
STEP: Final = 0.04


@dataclasses.dataclass(frozen=True)
class Trajectory:
    """The trajectory from an initial condition."""

    state: State
    periods: FloatArray  # of the drive, counted from phase 0 of the first one
    displacement: FloatArray  # over these [1]
    phases: FloatArray  # of the impacts [rad]
    velocities: FloatArray  # just before them [1]
    sticks: int  # impacts that stick
    rests: bool


def follow(parameters: Parameters, phase: float, displacement: float, velocity: float
           ) -> Trajectory:
    """Follow an initial condition for a few hundred impacts."""
    turned = phase % TWO_PI
    state = State(0, turned if turned < TWO_PI else 0.0, displacement, velocity)
    simulation = Simulation(parameters, state)
    events = simulation.advance(LONGEST, 0.0, IMPACTS + 1)
    tau = drive_phases(events) - drive_phases(events)[0] + state.phase
    drawn = events[:max(2, int(np.searchsorted(tau, TWO_PI * PERIODS + state.phase)) + 1)]
    motion = rebuild(drawn, STEP)
    since = (motion.tau - motion.tau[0] + state.phase) / TWO_PI if len(motion.tau) else motion.tau
    impacts = events[events['kind'] <= EventKind.STICK]
    return Trajectory(
        state, np.asarray(since), motion.displacement, impacts['phase'].astype(np.float64),
        impacts['velocity'].astype(np.float64), int(np.sum(impacts['kind'] == EventKind.STICK)),
        simulation.is_permanently_at_rest)
