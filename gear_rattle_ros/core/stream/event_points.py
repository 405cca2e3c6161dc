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

"""EVENT records as points of a cloud: the layout, and reading any cloud that has the fields."""

from collections.abc import Iterable, Sequence
import functools
import math
from typing import Final

import numpy as np

from ..model import ALPHA_MAXIMUM, BETA_MAXIMUM, EVENT, EventArray, EventKind, GAMMA_MAXIMUM

# A point of the cloud: what RViz draws (phase, velocity, displacement), then the EVENT.
POINT: Final = np.dtype(
    [('x', np.float32), ('y', np.float32), ('z', np.float32)]
    + [(name, EVENT[name]) for name in EVENT.names or ()],
    align=True,
)
# The numbers by which sensor_msgs/PointField calls the types.
_DATATYPES: Final = {np.dtype(np.uint32): 6, np.dtype(np.float32): 7, np.dtype(np.float64): 8}
# Name, offset, datatype and count of a field, as in sensor_msgs/PointField.
Field = tuple[str, int, int, int]


def point_fields() -> list[Field]:
    """Return name, offset [byte], datatype and count of each field of a POINT."""
    layout = ((name, POINT.fields[name]) for name in POINT.names or () if POINT.fields)
    return [(name, int(field[1]), _DATATYPES[field[0]], 1) for name, field in layout]


def view_points(fields: Iterable[Field], count: int, step: int, is_bigendian: bool,
                data: memoryview, names: Sequence[str]) -> EventArray:
    """View the EVENT fields `names` of a point cloud where they lie, without a copy."""
    # ValueError if a field is missing, there twice or of another type, or the data too short.
    layout = _layout(tuple(fields), step, is_bigendian, tuple(names))
    if data.nbytes < count * step:
        raise ValueError(f'cloud has {data.nbytes} bytes for {count} points of {step}')
    return np.frombuffer(data, layout, count)


# The clouds of a stream are all alike.
@functools.lru_cache(maxsize=16)
def _layout(fields: tuple[Field, ...], step: int, is_bigendian: bool, names: tuple[str, ...]
            ) -> np.dtype[np.void]:
    formats = {code: kind for kind, code in _DATATYPES.items()}
    found: dict[str, tuple[int, int, int]] = {}
    for name, *place in fields:
        if name in found and name in names:
            raise ValueError(f'cloud has field {name!r} more than once')
        found[name] = (place[0], place[1], place[2])
    offsets = []
    for name in names:
        if name not in found:
            raise ValueError(f'cloud has no field {name!r}')
        offset, datatype, number = found[name]
        # To numpy None is float64 too: an unknown datatype must not pass for it.
        if datatype not in formats or formats[datatype] != EVENT[name] or number != 1:
            raise ValueError(
                f'cloud field {name!r} has datatype {datatype} and count {number}, '
                f'not {_DATATYPES[EVENT[name]]} and 1')
        if offset + EVENT[name].itemsize > step:
            raise ValueError(f'cloud field {name!r} at {offset} lies outside a point of {step}')
        offsets.append(offset)
    return np.dtype({
        'names': list(names),
        'formats': [EVENT[name].newbyteorder('>' if is_bigendian else '<') for name in names],
        'offsets': offsets,
        'itemsize': step,
    })


def decode_points(fields: Iterable[Field], count: int, step: int, is_bigendian: bool,
                  data: memoryview) -> EventArray:
    """Copy EVENT records out of a point cloud, whatever its other fields are."""
    # ValueError if it does not fit, or holds values that no simulator writes.
    raw = view_points(fields, count, step, is_bigendian, data, EVENT.names or ())
    events = np.empty(count, EVENT)
    for name in EVENT.names or ():
        events[name] = raw[name]
    check_events(events)
    return events


def check_events(events: EventArray) -> None:
    """Raise a ValueError that names the first value that no simulator writes."""
    if not len(events):
        return
    for name, low, high in (
        ('kind', 0, max(EventKind)), ('phase', 0.0, 2.0 * math.pi), ('displacement', -1.0, 0.0),
        ('velocity', -math.inf, math.inf), ('velocity_after', -math.inf, math.inf),
        ('alpha', 0.0, ALPHA_MAXIMUM), ('beta', 0.0, BETA_MAXIMUM),
        ('gamma', -GAMMA_MAXIMUM, GAMMA_MAXIMUM), ('restitution', 0.0, 1.0),
    ):
        column = events[name]
        good = (column >= low) & (column <= high) & np.isfinite(column)
        if not good.all():
            bad = int(np.argmin(good))
            raise ValueError(f'event {bad} of the batch has {name} = {column[bad].item()!r}')
    place = events['displacement']
    off = (events['kind'] <= EventKind.RELEASE) & (place != 0.0) & (place != -1.0)
    if off.any():
        bad = int(np.argmax(off))
        raise ValueError(f'event {bad} of the batch is on a wall with displacement = '
                         f'{place[bad].item()!r}')
