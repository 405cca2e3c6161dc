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

"""The motion between events, rebuilt from their records alone."""

import dataclasses
import math

import numpy as np

from ..arrays import FloatArray, Record
from ..compiled import kernel
from ..flight.closed_form import displace, elapsed, model_of, rests
from ..flight.elementary import sine_cosine, TWO_PI
from ..model import EventArray, EventKind

RELEASE = int(EventKind.RELEASE)


@dataclasses.dataclass(frozen=True)
class Motion:
    """A stretch of the motion, sampled."""

    tau: FloatArray  #: Drive phase from the beginning of the last event's drive period [rad].
    displacement: FloatArray  #: s [1].
    velocity: FloatArray  #: s' [1]; an event stands twice, just before it and just after it.


@kernel
def rests_after(event: Record) -> bool:
    """Whether the gear sticks, or was set down on a wall against which it is pressed."""
    return event.kind != RELEASE and rests(
        event.displacement, event.velocity_after, event.phase, model_of(event))


@kernel
def state_after(event: Record, d: float) -> tuple[float, float]:
    """Return s and s' [1], eqs. (4)-(5), at a time d after an event and not after the next."""
    if rests_after(event):
        return event.displacement, 0.0
    sine, cosine = sine_cosine(event.phase)
    moved, velocity, _, _ = displace(d, sine, cosine, event.velocity_after, model_of(event))
    return event.displacement + moved, velocity


@kernel
def sample(events: EventArray, delays: FloatArray, step: float, tau: FloatArray,
           displacement: FloatArray, velocity: FloatArray) -> int:
    """Sample the motion between each event and the next; return the number of samples."""
    # They begin a time `delays` after each event, equally spaced by at most `step` [1]. Without
    # room for them they are only counted.
    count = 0
    last = events[-1]
    for i in range(len(events) - 1):
        event = events[i]
        after = events[i + 1]
        # Differences of the cycle numbers are taken modulo 2^32, as these are.
        cycles = np.int64(np.uint32(after.cycle - event.cycle))
        duration = max(elapsed(cycles, event.phase, after.phase), 0.0)
        begin = delays[i]
        if begin > duration:
            continue
        number = max(1, int(math.ceil((duration - begin) / step)))
        if len(tau):
            back = -np.int64(np.uint32(last.cycle - event.cycle)) * TWO_PI
            for j in range(number + 1):
                d = duration if j == number else begin + (duration - begin) * j / number
                s, v = state_after(event, d)
                tau[count + j] = back + (event.phase + d)
                displacement[count + j] = s
                velocity[count + j] = v
        count += number + 1
    return count


def drive_phases(events: EventArray) -> FloatArray:
    """Return tau of every event, from the beginning of the last event's drive period [rad]."""
    # The EVENT records are in order, at least one, over fewer than 2^32 drive periods.
    back = (events['cycle'][-1] - events['cycle']).astype(np.float64)
    return np.asarray(events['phase'] - TWO_PI * back, np.float64)


def rebuild(events: EventArray, step: float, periods: float = math.inf) -> Motion:
    """
    Rebuild the motion between the events of a stream without a hole.

    Parameters
    ----------
    events : ndarray of EVENT, shape (n,)
        Records in order, none missing between them.
    step : float
        Longest step between samples [1], positive, else ValueError; both ends of every flight
        are samples.
    periods : float
        Drive periods before the last event's own in which samples may begin [1].

    Returns
    -------
    Motion
        Samples; none for fewer than two events.

    """
    if not step > 0.0:
        raise ValueError(f'step = {step!r} must be positive')
    none = np.empty(0)
    if len(events) < 2:
        return Motion(none, none, none)
    delays = np.maximum(-TWO_PI * periods - drive_phases(events), 0.0)
    # Flights that end before the stretch are left out whole.
    events = np.ascontiguousarray(events)
    count = sample(events, delays, step, none, none, none)
    tau, displacement, velocity = np.empty((3, count))
    sample(events, delays, step, tau, displacement, velocity)
    return Motion(tau, displacement, velocity)
