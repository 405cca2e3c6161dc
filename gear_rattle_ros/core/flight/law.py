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

"""A control law that changes the drive, or the velocity after an impact, a little at impacts."""

import dataclasses
import enum
import json
import math
from typing import Any, Final

import numpy as np

from .elementary import TWO_PI
from ..arrays import FloatArray, Record
from ..compiled import kernel
from ..model import require_finite

# Points of the longest orbit that is held.
POINTS: Final = 64
# Smallest change of the velocity, relative to it.
SMALLEST_PULSE: Final = 2.0**-48
#: The law, a part of TRAJECTORY: points (0: no law), what is changed, alpha without it, limits,
#: whether a change of alpha is due after the latest impact and to what, the points with their
#: gains, and velocities a period ago (nan: not known).
LAW: Final = [
    ('points', np.int64), ('acts_on', np.int64), ('alpha_free', np.float64),
    ('limit', np.float64), ('reach', np.float64), ('waits', np.bool_), ('wanted', np.float64),
    ('law_phase', np.float64, POINTS), ('law_velocity', np.float64, POINTS),
    ('by_phase', np.float64, POINTS), ('by_velocity', np.float64, POINTS),
    ('before', np.float64, POINTS)]


class Acts(enum.IntEnum):
    """What a law changes at an impact, and from what it computes the change."""

    DRIVE = 0  #: alpha until the next impact, by the distance from the orbit (OGY)
    DELAYED = 1  #: alpha until the next impact, by the velocity a period ago (delayed feedback)
    PULSES = 2  #: the velocity after the impact, by the distance from the orbit (pulses)


DELAYED, PULSES = int(Acts.DELAYED), int(Acts.PULSES)


@dataclasses.dataclass(frozen=True)
class Law:
    """
    A law that holds a periodic orbit of q impacts.

    At an impact within `reach` of point k of the orbit, in phase and velocity, the change is
    ``-gains[k] . (phase - phase_k, velocity - velocity_k)``, or, delayed, ``gains[k, 1]`` times
    the velocity less that of q impacts before. It is made where it is at most `limit`, else none.
    ValueError where a number is out of range.
    """

    acts: Acts
    points: FloatArray  #: Phase and velocity before each impact [rad, 1], shape (q, 2).
    gains: FloatArray  #: Change by each of them [1/rad, 1], shape (q, 2).
    limit: float  #: Largest change of alpha, or of the velocity [1].
    reach: float = 0.5  #: Distance beyond which nothing is changed [1].

    def __post_init__(self) -> None:
        for name in ('points', 'gains'):
            array = np.asarray(getattr(self, name), np.float64)
            if array.ndim != 2 or array.shape[1] != 2 or not 1 <= len(array) <= POINTS or (
                    not np.all(np.isfinite(array))):
                raise ValueError(f'{name} of a law are 1 to {POINTS} pairs of finite numbers')
            object.__setattr__(self, name, array)
        if len(self.points) != len(self.gains):
            raise ValueError(f'a law has {len(self.points)} points and {len(self.gains)} gains; '
                             'give one for each')
        for name in ('limit', 'reach'):
            object.__setattr__(self, name, require_finite(name, getattr(self, name), 0.0, 10.0))

    def to_text(self) -> str:
        """Write it down with all digits, as JSON."""
        return json.dumps({'acts': self.acts.name.lower(), 'limit': self.limit,
                           'reach': self.reach, 'points': self.points.tolist(),
                           'gains': self.gains.tolist()})

    @classmethod
    def of_text(cls, text: str) -> 'Law | None':
        """Read what `to_text` has written; nothing is no law. ValueError where it is no law."""
        if not text:
            return None
        try:
            given: Any = json.loads(text)
            return cls(Acts[given['acts'].upper()], given['points'], given['gains'],
                       given['limit'], given['reach'])
        except (AttributeError, KeyError, TypeError, json.JSONDecodeError) as error:
            raise ValueError(f'{text[:40]!r} is not a control law: {error!r}') from error

    def write(self, trajectory: Any, alpha: float) -> None:
        """Put it in force on a trajectory whose alpha is this without it."""
        q = len(self.points)
        t = trajectory
        t['points'], t['acts_on'], t['alpha_free'] = q, self.acts, alpha
        t['limit'], t['reach'], t['waits'] = self.limit, self.reach, False
        t['before'] = math.nan
        for name, values in (('law_phase', self.points[:, 0]),
                             ('law_velocity', self.points[:, 1]),
                             ('by_phase', self.gains[:, 0]), ('by_velocity', self.gains[:, 1])):
            t[name][:q] = values


@kernel
def correction(trajectory: Record, phase: float, velocity: float) -> float:
    """Return the change that the law of a trajectory wants at an impact, 0 for none."""
    t = trajectory
    nearest, place, away = t.reach, -1, 0.0
    for k in range(t.points):
        if math.copysign(1.0, velocity) != math.copysign(1.0, t.law_velocity[k]):
            continue
        turned = phase - t.law_phase[k]
        turned -= TWO_PI * math.floor(turned / TWO_PI + 0.5)
        apart = max(abs(turned), abs(velocity - t.law_velocity[k]))
        if apart <= nearest:
            nearest, place, away = apart, k, turned
    if place < 0:
        # What was a period ago is not on the same orbit.
        t.before[:] = math.nan
        return 0.0
    if t.acts_on == DELAYED:
        change = t.by_velocity[place] * (velocity - t.before[place])
        t.before[place] = velocity
    else:
        change = -(t.by_phase[place] * away
                   + t.by_velocity[place] * (velocity - t.law_velocity[place]))
    # So small a pulse could not be told from rounding in a recording.
    smallest = SMALLEST_PULSE * abs(velocity) if t.acts_on == PULSES else 0.0
    return change if smallest <= abs(change) <= t.limit else 0.0
