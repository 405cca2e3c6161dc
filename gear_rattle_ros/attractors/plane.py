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

from collections.abc import Mapping
import dataclasses
import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ..core.arrays import FloatArray, IntArray, RecordArray
from ..core.flight.lanes import make_initial_conditions
from ..core.model import Parameters, require_finite, VELOCITY_MAXIMUM

TWO_PI: Final = 2.0 * math.pi
# Largest number of cells along an edge.
EDGE_MAXIMUM: Final = 1_000_000
SECTION, IMPACT, DISPLACEMENT, STROBE = PLANES = ('section', 'impact', 'displacement', 'strobe')
# Those of impacts, on the wall that the sign of the velocity names.
ON_WALLS: Final = (SECTION, IMPACT)

# The fields of INITIAL, or of RESULT, that change along a trajectory.
STATE: Final = ('phase', 'displacement', 'velocity')
Window = tuple[float, float]


@dataclasses.dataclass(frozen=True)
class Plane:
    """
    A window of a plane of initial conditions, cut into cells.

    The `kind` is 'displacement', where all have the same displacement [1], in [-1, 0], 0 by
    default; 'section', where all come from an impact, each on the wall that it moves away from,
    with its velocity just after the impact; 'impact', where all are about to have one, on the
    wall that they move towards; or 'strobe', where all have the same drive phase [rad], 0 by
    default. The window of the other of the two, of `phase`, at most 2 pi wide, or on a strobe of
    `displacement`, is cut into `phases` cells, that of the `velocity` [1] into `velocities`.
    ValueError where a value is out of range or a window empty or reversed.
    """

    displacement: float | Window | None = None
    phase: float | Window | None = None
    velocity: Window = (-2.0, 2.0)
    phases: int = 400
    velocities: int = 400
    kind: str = DISPLACEMENT

    def __post_init__(self) -> None:
        if self.kind not in PLANES:
            raise ValueError(f'plane {self.kind!r} is not one of {", ".join(PLANES)}')
        is_strobe = self.kind == STROBE
        if self.kind in ON_WALLS and self.displacement is not None:
            raise ValueError(f'displacement {self.displacement}: impacts have that of their '
                             'walls; leave it out')
        for name, standard, is_window, low, high in (
            ('displacement', (-1.0, 0.0) if is_strobe else 0.0, is_strobe, -1.0, 0.0),
            ('phase', 0.0 if is_strobe else (0.0, TWO_PI), not is_strobe, -1e3, 1e3),
            ('velocity', None, True, -VELOCITY_MAXIMUM, VELOCITY_MAXIMUM),
        ):
            value = getattr(self, name)
            if value is None and (self.kind not in ON_WALLS or name != 'displacement'):
                value = standard
            if value is not None:
                value = _checked(name, value, is_window, low, high, self.kind)
            object.__setattr__(self, name, value)
        if not is_strobe and self.window[1] - self.window[0] > TWO_PI * (1.0 + 1e-9):
            raise ValueError('phase window {:g} to {:g} is wider than 2 pi'.format(*self.window))
        for name in ('phases', 'velocities'):
            if not 1 <= getattr(self, name) <= EDGE_MAXIMUM:
                raise ValueError(f'size {getattr(self, name)} is not between 1 and {EDGE_MAXIMUM}')

    @classmethod
    def of(cls, attributes: Mapping[str, Any]) -> 'Plane':
        """Return the window that `attributes` have described."""
        values: dict[str, Any] = {name: attributes.get(name) for name in STATE} | {
            name: tuple(attributes[f'{name}_window']) for name in STATE
            if f'{name}_window' in attributes}
        return cls(**values, kind=attributes.get('plane', DISPLACEMENT))

    def attributes(self) -> dict[str, Any]:
        """List plain values that say which window it is."""
        # Datasets of planes of one displacement do not name their kind.
        values: dict[str, Any] = {} if self.kind == DISPLACEMENT else {'plane': self.kind}
        for name in ('displacement', 'phase', 'velocity'):
            value = getattr(self, name)
            if value is not None:
                values |= {f'{name}_window': list(value)} if isinstance(value, tuple) else {
                    name: value}
        return values

    @property
    def across(self) -> str:
        """Return what changes beside the velocity: 'phase', or on a strobe 'displacement'."""
        return 'displacement' if self.kind == STROBE else 'phase'

    @property
    def window(self) -> Window:
        """Return its window."""
        window: Window = getattr(self, self.across)
        return window

    @property
    def _fixed(self) -> float:
        fixed: float = getattr(self, 'phase' if self.kind == STROBE else 'displacement')
        return fixed

    @property
    def words(self) -> str:
        if self.kind in ON_WALLS:
            return 'section' if self.kind == SECTION else 'before an impact'
        return f'{"strobe at phase" if self.kind == STROBE else "s ="} {self._fixed:g}'

    def across_values(self, first: int = 0, last: int | None = None) -> FloatArray:
        """Return the centres of some cells in phase [rad] or displacement [1], by default all."""
        return centres(self.window, self.phases, first, last)

    def velocity_values(self, first: int = 0, last: int | None = None) -> FloatArray:
        """Return the centres of some cells in velocity [1], of all by default."""
        return centres(self.velocity, self.velocities, first, last)

    def at(self, parameters: Parameters, across: npt.ArrayLike, velocities: npt.ArrayLike
           ) -> RecordArray:
        """Return the initial conditions of points as INITIAL."""
        if self.kind == STROBE:
            # What is beyond a wall is on it.
            return make_initial_conditions(parameters, self._fixed, np.clip(across, -1.0, 0.0),
                                           velocities)
        v = np.asarray(velocities)
        displacement = self._fixed if self.kind == DISPLACEMENT else np.where(
            v > 0.0 if self.kind == SECTION else v < 0.0, -1.0, 0.0)
        return make_initial_conditions(parameters, across, displacement, velocities)

    def holds(self, walls: IntArray) -> npt.NDArray[np.bool_]:
        """Return which impacts, by their walls, lie on it."""
        if self.kind == DISPLACEMENT:
            return np.asarray(walls == -self._fixed)
        return np.full(len(walls), self.kind in ON_WALLS)

    def factors(self, restitution: float) -> tuple[float, ...]:
        """Return the velocities at which an impact lies on it, in units of that before it."""
        return {SECTION: (-restitution,), IMPACT: (1.0,)}.get(self.kind, (1.0, -restitution))

    def cells(self, parameters: Parameters, velocities: slice, across: slice) -> RecordArray:
        """Return the initial conditions of some cells as INITIAL, row by row, velocity first."""
        v = self.velocity_values(velocities.start, velocities.stop)
        x = self.across_values(across.start, across.stop)
        return self.at(parameters, np.tile(x, len(v)), np.repeat(v, len(x)))

    def draw(self, parameters: Parameters, count: int, seed: int) -> RecordArray:
        """Draw INITIAL uniformly from the window; the first do not depend on the `count`."""
        drawn = np.random.default_rng(seed).random((count, 2))
        (x0, x1), (v0, v1) = self.window, self.velocity
        return self.at(parameters, x0 + (x1 - x0) * drawn[:, 0], v0 + (v1 - v0) * drawn[:, 1])

    def magnified(self, across: float, velocity: float, factor: float) -> 'Plane':
        """Magnify the window about a point, which stays where it is in the picture."""
        windows: dict[str, Any] = {
            name: (at - (at - low) / factor, at + (high - at) / factor)
            for name, at, (low, high) in ((self.across, across, self.window),
                                          ('velocity', velocity, self.velocity))}
        return dataclasses.replace(self, **windows)

    def whole(self) -> 'Plane':
        """Return the plane with the usual windows."""
        return Plane(self.displacement if self.kind == DISPLACEMENT else None,
                     self.phase if self.kind == STROBE else None, kind=self.kind)


def _checked(name: str, value: Any, is_window: bool, low: float, high: float, kind: str) -> Any:
    """Return a number, or a window of two."""
    if np.size(value) != 1 + is_window:
        raise ValueError(f'{name} {value} on the plane {kind!r}: give '
                         f'{"a window, two numbers" if is_window else "one number"}')
    if not is_window:
        return require_finite(name, value, low, high)
    first, last = (require_finite(name, each, low, high) for each in value)
    if not first < last:
        raise ValueError(f'{name} window {first:g} to {last:g} is empty or reversed; '
                         'give the lower end first')
    return first, last


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


def centres(window: Window, count: int, first: int = 0, last: int | None = None) -> FloatArray:
    """Return the centres of some of the cells into which a window is cut."""
    low, high = window
    numbers = np.arange(first or 0, count if last is None else last, dtype=np.float64)
    # From both ends, so that a symmetric window has symmetric cells to the bit.
    share = (2.0 * numbers + 1.0) / (2.0 * count)
    return np.asarray(low * (1.0 - share) + high * share, np.float64)
