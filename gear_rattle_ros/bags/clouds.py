"""EVENT records in the bytes of a sensor_msgs/PointCloud2."""

from collections.abc import Sequence
import dataclasses
import struct
from typing import Final

import numpy as np

from ..core.model import EventArray
from ..core.stream.event_points import decode_points, Field, view_points

POINT_CLOUD: Final = 'sensor_msgs/msg/PointCloud2'
# Length of the encapsulation in front of a message; alignments count from its end.
_HEAD: Final = 4


@dataclasses.dataclass(frozen=True)
class Cloud:
    """The parts of a PointCloud2 that matter, where they lie."""

    stamp: int
    fields: Sequence[Field]
    count: int
    step: int
    is_bigendian: bool
    data: memoryview


class CloudDecoder:
    """Reads serialized PointCloud2; a cloud with the fields of the last one is read faster."""

    def __init__(self) -> None:
        # The bytes of the fields, with the order of bytes in front.
        self._block = b''
        self._fields: list[Field] = []

    def parse(self, cdr: bytes) -> Cloud:
        """
        Take a serialized cloud apart without copying its points.

        Parameters
        ----------
        cdr : bytes
            The message in plain CDR, of either order of bytes.

        Returns
        -------
        Cloud
            Its parts, with the stamp in nanoseconds.

        Raises
        ------
        ValueError
            If the bytes are no PointCloud2.

        """
        if len(cdr) < _HEAD or cdr[0] != 0 or cdr[1] > 1:
            raise ValueError('message is not in plain CDR')
        order = '<' if cdr[1] else '>'
        word = struct.Struct(f'{order}I')
        try:
            seconds, nanoseconds, length = struct.unpack_from(f'{order}iII', cdr, _HEAD)
            place = _aligned(_HEAD + 12 + length)
            height, width, number = struct.unpack_from(f'{order}III', cdr, place)
            place = self._find_fields(cdr, place + 12, number, word)
            is_bigendian = cdr[place] != 0
            step, row_step, size = struct.unpack_from(f'{order}III', cdr, _aligned(place + 1))
            place = _aligned(place + 1) + 12
        except (IndexError, struct.error):
            raise ValueError(f'message of {len(cdr)} bytes is no PointCloud2') from None
        if len(cdr) < place + size + 1 or (height > 1 and row_step != width * step):
            raise ValueError(f'message of {len(cdr)} bytes is no PointCloud2')
        return Cloud(seconds * 1_000_000_000 + nanoseconds, self._fields, height * width, step,
                     is_bigendian, memoryview(cdr)[place:place + size])

    def events(self, cdr: bytes) -> EventArray:
        """
        Return the EVENT records of a serialized cloud.

        Parameters
        ----------
        cdr : bytes
            The message.

        Returns
        -------
        ndarray of EVENT, shape (n,)
            A copy.

        Raises
        ------
        ValueError
            If the message is no cloud of EVENT.

        """
        cloud = self.parse(cdr)
        return decode_points(
            cloud.fields, cloud.count, cloud.step, cloud.is_bigendian, cloud.data)

    def columns(self, cdr: bytes, names: Sequence[str]) -> EventArray:
        """
        Return some fields of the EVENT records of a serialized cloud, unchecked.

        Parameters
        ----------
        cdr : bytes
            The message.
        names : sequence of str
            Fields of EVENT.

        Returns
        -------
        structured ndarray, shape (n,)
            A packed copy of these fields.

        Raises
        ------
        ValueError
            If the message is no cloud with these fields.

        """
        cloud = self.parse(cdr)
        view = view_points(
            cloud.fields, cloud.count, cloud.step, cloud.is_bigendian, cloud.data, names)
        packed = np.empty(cloud.count, [(name, view.dtype[name].newbyteorder('='))
                                        for name in names])
        for name in names:
            packed[name] = view[name]
        return packed

    def _find_fields(self, cdr: bytes, place: int, number: int, word: struct.Struct) -> int:
        end = place + len(self._block) - 1
        if number == len(self._fields) and cdr[1:2] + cdr[place:end] == self._block:
            return end
        fields = []
        start = place
        for _ in range(number):
            place = _aligned(place)
            length = word.unpack_from(cdr, place)[0]
            name = cdr[place + 4:place + 3 + length].decode('utf-8', 'replace')
            place = _aligned(place + 4 + length)
            offset = word.unpack_from(cdr, place)[0]
            datatype = cdr[place + 4]
            count = word.unpack_from(cdr, place + 8)[0]
            fields.append((name, offset, datatype, count))
            place += 12
        self._fields, self._block = fields, cdr[1:2] + cdr[start:place]
        return place


def _aligned(place: int) -> int:
    return (place + 3) & ~3
