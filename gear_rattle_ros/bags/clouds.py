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

"""EVENT records in the bytes of a sensor_msgs/PointCloud2."""

from collections.abc import Sequence
import dataclasses
from typing import Final

import numpy as np

from .cdr import Reader
from .topics import Topic
from ..core.model import EventArray
from ..core.stream.event_points import decode_points, Field, view_points

POINT_CLOUD: Final = 'sensor_msgs/msg/PointCloud2'


def has_events(topic: Topic) -> bool:
    """Return whether EVENT records are to be expected on a topic, by its name and type."""
    return (topic.type_name in (POINT_CLOUD, '') and topic.serialization == 'cdr'
            and topic.name.split('/')[-1] == 'impacts')


@dataclasses.dataclass(frozen=True)
class Cloud:
    """The parts of a PointCloud2 that matter; `data` is a view of its points, `stamp` in ns."""

    stamp: int
    fields: Sequence[Field]
    count: int
    step: int
    is_bigendian: bool
    data: memoryview

    def events(self) -> EventArray:
        """Return a copy of its EVENT records, checked, shape (n,)."""
        return decode_points(self.fields, self.count, self.step, self.is_bigendian, self.data)


class CloudDecoder:
    """Reads serialized PointCloud2 in plain CDR, of either order of bytes, else ValueError."""

    def __init__(self) -> None:
        # The bytes of the fields, with the order of bytes in front: the same again are not parsed.
        self._block = b''
        self._fields: list[Field] = []

    def parse(self, cdr: bytes) -> Cloud:
        """Take a serialized cloud apart without copying its points."""
        reader = Reader(cdr)
        try:
            stamp = reader.header()
            height, width, number = reader.take('I', 3)
            self._take_fields(cdr, reader, number)
            is_bigendian, = reader.take('B')
            step, row_step, size = reader.take('I', 3)
            start = reader.skip(size)
            # Whether the cloud is dense: nothing depends on it, but it must be there.
            reader.skip(1)
            if height > 1 and row_step != width * step:
                raise ValueError
        except ValueError:
            raise ValueError(f'message of {len(cdr)} bytes is not a PointCloud2') from None
        return Cloud(stamp, self._fields, height * width, step, is_bigendian != 0,
                     memoryview(cdr)[start:start + size])

    def events(self, cdr: bytes) -> EventArray:
        """Return a copy of the EVENT records of a serialized cloud, checked, shape (n,)."""
        return self.parse(cdr).events()

    def columns(self, cdr: bytes, names: Sequence[str]) -> EventArray:
        """Return a packed copy of some fields of the EVENT records, unchecked, shape (n,)."""
        cloud = self.parse(cdr)
        view = view_points(
            cloud.fields, cloud.count, cloud.step, cloud.is_bigendian, cloud.data, names)
        packed = np.empty(
            cloud.count, [(name, view.dtype[name].newbyteorder('=')) for name in names])
        for name in names:
            packed[name] = view[name]
        return packed

    def _take_fields(self, cdr: bytes, reader: Reader, number: int) -> None:
        start = reader.place
        end = start + len(self._block) - 1
        if number == len(self._fields) and cdr[1:2] + cdr[start:end] == self._block:
            reader.skip(end - start)
            return
        fields = []
        for _ in range(number):
            name, offset = reader.text(), reader.length()
            datatype, = reader.take('B')
            fields.append((name, offset, datatype, reader.length()))
        self._fields, self._block = fields, cdr[1:2] + cdr[start:reader.place]
