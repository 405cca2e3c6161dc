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

"""The gear-rattling model: its parameters, its state and the EVENT record."""

import dataclasses
import enum
import math
import numbers
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

# After an impact on a pressed wall, slower than this the driven gear sticks [1].
STICKING_SPEED: Final = 1e-10

# Largest magnitudes accepted [1]; far beyond any gear, well inside float64.
ALPHA_MAXIMUM: Final = 1000.0
BETA_MAXIMUM: Final = 100.0
GAMMA_MAXIMUM: Final = 1000.0
RANGES: Final = {
    'alpha': (0.0, ALPHA_MAXIMUM), 'beta': (0.0, BETA_MAXIMUM),
    'gamma': (-GAMMA_MAXIMUM, GAMMA_MAXIMUM), 'restitution': (0.0, 1.0)}
VELOCITY_MAXIMUM: Final = 1e4


class Wall(enum.IntEnum):
    """A wall of the backlash: the one encoding in kernels, stores and reports."""

    UPPER = 0
    LOWER = 1

    @property
    def displacement(self) -> float:
        """Return the displacement of an impact there, 0 or -1 [1]."""
        return -float(self)

    @property
    def label(self) -> str:
        """Return its name in words."""
        return self.name.lower()


class EventKind(enum.IntEnum):
    """What happened at an event."""

    IMPACT = 0
    STICK = 1
    RELEASE = 2
    RETUNE = 3
    RESET = 4


#: One record of the stream: `EventKind`; impacts, epochs (retunes and resets) and completed drive
#: periods so far, all modulo 2^32; drive phase [rad]; displacement [1]; velocity [1] just before
#: and just after the event; the parameters in force after it.
EVENT: Final = np.dtype([
    ('kind', np.uint32), ('index', np.uint32), ('epoch', np.uint32), ('cycle', np.uint32),
    ('phase', np.float64), ('displacement', np.float64),
    ('velocity', np.float64), ('velocity_after', np.float64),
    ('alpha', np.float64), ('beta', np.float64), ('gamma', np.float64),
    ('restitution', np.float64),
], align=True)

EventArray: TypeAlias = npt.NDArray[np.void]


def require_finite(name: str, value: float, low: float, high: float) -> float:
    """Return a number as a float; ValueError, with its name, if it is not one in [low, high]."""
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f'{name} = {value!r} is not a number') from error
    if not math.isfinite(number) or not low <= number <= high:
        raise ValueError(f'{name} = {number!r} is outside [{low:g}, {high:g}]')
    return number


class Model(NamedTuple):
    """Parameters as kernels take them: numbers, not checked."""

    alpha: float
    beta: float
    gamma: float
    restitution: float


@dataclasses.dataclass(frozen=True)
class Parameters:
    """
    Dimensionless parameters of de Souza & Caldas, eqs. (3) and (6).

    ValueError if a value is no number, not finite, or outside its range.
    """

    alpha: float = 0.48  #: Amplitude of the drive [1], 0 to 1000.
    beta: float = 0.1  #: Damping [1], 0 to 100.
    #: Constant load [1], -1000 to 1000; positive presses towards the upper wall.
    gamma: float = 0.1
    restitution: float = 0.9  #: Coefficient of restitution r [1], 0 to 1.

    def __post_init__(self) -> None:
        for name, (low, high) in RANGES.items():
            object.__setattr__(self, name, require_finite(name, getattr(self, name), low, high))

    @property
    def model(self) -> Model:
        """Return the same numbers for kernels."""
        return Model(self.alpha, self.beta, self.gamma, self.restitution)

    @classmethod
    def of(cls, record: Any) -> 'Parameters':
        """Return those in a record or mapping that has their names, such as an event."""
        return cls(*(float(record[name]) for name in Model._fields))


@dataclasses.dataclass(frozen=True)
class State:
    """
    A point of the trajectory.

    ValueError if a value is out of range; a displacement outside the walls is never clipped.
    """

    cycle: int = 0  #: Completed drive periods.
    phase: float = 0.0  #: Drive phase tau mod 2 pi [rad], in [0, 2 pi).
    displacement: float = 0.0  #: Displacement s in units of the backlash [1], in [-1, 0].
    velocity: float = 0.0  #: ds/dtau [1].

    def __post_init__(self) -> None:
        if not isinstance(self.cycle, numbers.Integral) or self.cycle < 0:
            raise ValueError(f'cycle = {self.cycle!r} is not a whole number from 0 on')
        below_two_pi = math.nextafter(2.0 * math.pi, 0.0)
        for name, low, high in (
            ('phase', 0.0, below_two_pi), ('displacement', -1.0, 0.0),
            ('velocity', -math.inf, math.inf),
        ):
            object.__setattr__(self, name, require_finite(name, getattr(self, name), low, high))


def impact_count(events: EventArray) -> int:
    """Count the impacts in an array of EVENT; one that sticks is an impact too."""
    return int(np.count_nonzero(events['kind'] <= EventKind.STICK))
