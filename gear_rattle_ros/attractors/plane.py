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

"""The plane of initial conditions: windows and cells."""

import dataclasses
import math
from typing import Final

import numpy as np

from ..core.arrays import FloatArray, RecordArray
from ..core.flight.lanes import make_initial_conditions
from ..core.model import Parameters, require_finite, VELOCITY_MAXIMUM

TWO_PI: Final = 2.0 * math.pi
# Largest number of cells along an edge.
EDGE_MAXIMUM: Final = 1_000_000

# The fields of INITIAL, or of RESULT, that change along a trajectory.
STATE: Final = ('phase', 'displacement', 'velocity')


@dataclasses.dataclass(frozen=True)
class Plane:
    """
    A window of a plane of constant displacement, cut into cells.

    All initial conditions have the `displacement` [1], in [-1, 0]. The windows of the drive
    `phase` [rad], at most 2 pi wide, and of the `velocity` [1] are cut into `phases` and
    `velocities` cells. ValueError where a value is out of range or a window empty or reversed.
    """

    displacement: float = 0.0
    phase: tuple[float, float] = (0.0, TWO_PI)
    velocity: tuple[float, float] = (-2.0, 2.0)
    phases: int = 400
    velocities: int = 400

    def __post_init__(self) -> None:
        object.__setattr__(self, 'displacement', require_finite(
            'displacement', self.displacement, -1.0, 0.0))
        for name, most in (('phase', 1e3), ('velocity', VELOCITY_MAXIMUM)):
            low, high = getattr(self, name)
            low, high = (require_finite(name, value, -most, most) for value in (low, high))
            if not low < high:
                raise ValueError(f'{name} window {low:g} to {high:g} is empty or reversed; '
                                 'give the lower end first')
            object.__setattr__(self, name, (low, high))
        if self.phase[1] - self.phase[0] > TWO_PI * (1.0 + 1e-9):
            raise ValueError(f'phase window {self.phase[0]:g} to {self.phase[1]:g} is wider than '
                             '2 pi')
        for name in ('phases', 'velocities'):
            if not 1 <= getattr(self, name) <= EDGE_MAXIMUM:
                raise ValueError(f'size {getattr(self, name)} is not between 1 and {EDGE_MAXIMUM}')

    def phase_values(self, first: int = 0, last: int | None = None) -> FloatArray:
        """Return the centres of some cells in phase [rad], of all by default."""
        return _centres(self.phase, self.phases, first, last)

    def velocity_values(self, first: int = 0, last: int | None = None) -> FloatArray:
        """Return the centres of some cells in velocity [1], of all by default."""
        return _centres(self.velocity, self.velocities, first, last)

    def cells(self, parameters: Parameters, velocities: slice, phases: slice) -> RecordArray:
        """Return the initial conditions of some cells as INITIAL, row by row, velocity first."""
        v = self.velocity_values(velocities.start, velocities.stop)
        p = self.phase_values(phases.start, phases.stop)
        return make_initial_conditions(parameters, np.tile(p, len(v)), self.displacement,
                                       np.repeat(v, len(p)))

    def draw(self, parameters: Parameters, count: int, seed: int) -> RecordArray:
        """Draw INITIAL uniformly from the window; the first do not depend on the `count`."""
        drawn = np.random.default_rng(seed).random((count, 2))
        (p0, p1), (v0, v1) = self.phase, self.velocity
        return make_initial_conditions(parameters, p0 + (p1 - p0) * drawn[:, 0], self.displacement,
                                       v0 + (v1 - v0) * drawn[:, 1])

    def magnified(self, phase: float, velocity: float, factor: float) -> 'Plane':
        """Magnify the window about a point, which stays where it is in the picture."""
        windows = [
            (at - (at - low) / factor, at + (high - at) / factor)
            for at, (low, high) in ((phase, self.phase), (velocity, self.velocity))]
        return dataclasses.replace(self, phase=windows[0], velocity=windows[1])


class Section(Plane):
    """The same window with every initial condition on the wall that it moves towards."""

    def cells(self, parameters: Parameters, velocities: slice, phases: slice) -> RecordArray:
        cells = super().cells(parameters, velocities, phases)
        cells['displacement'] = np.where(cells['velocity'] < 0.0, -1.0, 0.0)
        return cells


def initial_condition(parameters: Parameters, phase: float, velocity: float,
                      displacement: float) -> RecordArray:
    """Return one initial condition, validated, as START."""
    for name, value, low, high in (
        ('phase', phase, -1e3, 1e3), ('displacement', displacement, -1.0, 0.0),
        ('velocity', velocity, -VELOCITY_MAXIMUM, VELOCITY_MAXIMUM),
    ):
        require_finite(name, value, low, high)
    return make_initial_conditions(parameters, np.array([phase]), displacement, velocity)


def at_parameters(parameters: Parameters, states: RecordArray) -> RecordArray:
    """Return the initial conditions of states, at parameters of their own or at others."""
    return make_initial_conditions(parameters, *(states[name] for name in STATE))


def _centres(window: tuple[float, float], count: int, first: int = 0,
             last: int | None = None) -> FloatArray:
    low, high = window
    numbers = np.arange(first or 0, count if last is None else last, dtype=np.float64)
    # From both ends, so that a symmetric window has symmetric cells to the bit.
    share = (2.0 * numbers + 1.0) / (2.0 * count)
    return np.asarray(low * (1.0 - share) + high * share, np.float64)
