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

"""Axes on which a stream is drawn: impact numbers and drive times that never go back."""

import dataclasses

import numpy as np
import numpy.typing as npt

from .guard import Piece
from ..arrays import FloatArray
from ..flight.elementary import TWO_PI
from ..model import EventArray


@dataclasses.dataclass(frozen=True)
class Place:
    """Where a stream stands on its axes, which go on where a counter is full or begins anew."""

    impact: int  # number of the last impact
    cycle: int  # completed drive periods
    event: np.void  # the last EVENT

    @property
    def drive_time(self) -> float:
        """Drive periods [1]."""
        return self.cycle + float(self.event['phase']) / TWO_PI


def ahead(event: np.void, before: np.void, name: str) -> int:
    """Return how far a counter, 'index' or 'cycle' modulo 2^32, has gone since `before`."""
    return (int(event[name]) - int(before[name])) % 2**32


def advanced(place: Place | None, piece: Piece) -> Place:
    """Return the place at the end of the next piece; `place` is None at the beginning."""
    first, last = piece.events[0], piece.events[-1].copy()
    if place is None:
        impact, cycle, base = int(first['index']), int(first['cycle']), first
    elif piece.reason == 'restart':
        impact, cycle, base = place.impact + 1, place.cycle + 1, first
    else:
        impact, cycle, base = place.impact, place.cycle, place.event
    return Place(impact + ahead(last, base, 'index'), cycle + ahead(last, base, 'cycle'), last)


def impact_numbers(events: EventArray, place: Place) -> npt.NDArray[np.int64]:
    """Give events that lead up to a place without a restart the number of the last impact."""
    return np.asarray(
        place.impact - (place.event['index'] - events['index']).astype(np.int64), np.int64)


def drive_times(events: EventArray, place: Place) -> FloatArray:
    """Give events that lead up to a place without a restart their drive time [drive periods]."""
    cycles = place.cycle - (place.event['cycle'] - events['cycle']).astype(np.int64)
    return np.asarray(cycles + events['phase'] / TWO_PI, np.float64)
