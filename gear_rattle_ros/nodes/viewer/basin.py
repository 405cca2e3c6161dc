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

"""Pictures of the basins as they arrive: three messages that belong together."""

import dataclasses
import io
import math
from typing import Any, Final, TypeAlias

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
import numpy.typing as npt
import PIL.Image
from sensor_msgs.msg import Image, PointCloud2, PointField
from visualization_msgs.msg import MarkerArray

from ...core.arrays import FloatArray
from ...palette import LAYERS

EDGE: Final = 'edge_state'
KICK: Final = 'smallest_kick'
LINES: Final = ('unstable_manifold', 'stable_manifold', KICK)
# Phase and velocity by layer, shape (n, 2); of lines those of both ends, shape (n, 2, 2).
Layers: TypeAlias = dict[str, FloatArray]
PARTS: Final = {'basin': Image, 'attractors': PointCloud2, 'basin_state': DiagnosticArray}


@dataclasses.dataclass(frozen=True)
class BasinPicture:
    """A picture of the plane with its window of velocities, and the points of the attractors."""

    png: bytes
    width: int
    height: int
    low: float
    high: float
    # Phase and velocity of shape (n, 2), and RGBA colours.
    points: npt.NDArray[np.float32]
    colours: npt.NDArray[np.uint32]
    words: tuple[str, ...]


class BasinInput:
    """Puts image, attractors and state together, in whatever order they arrive."""

    def __init__(self) -> None:
        self._parts: dict[str, Any] = {}

    def take(self, name: str, message: Any) -> BasinPicture | None:
        """Take one of PARTS; return the picture if it completes one."""
        self._parts[name] = message
        image, cloud, state = map(self._parts.get, PARTS)
        if image is None or cloud is None or state is None or not state.status:
            return None
        values = {item.key: item.value for item in state.status[0].values}
        if not (image.header.stamp == cloud.header.stamp == state.header.stamp
                and values.get('size') == str(image.width)):
            return None
        # Each message belongs to one picture only.
        self._parts = {}
        # Its axes are not those of the impacts.
        if values.get('plane') in ('section', 'strobe'):
            return None
        points, colours = points_of(cloud)
        low, high = float(values['velocity_low']), float(values['velocity_high'])
        if image.encoding != 'rgb8' or not -math.inf < low < high < math.inf:
            raise ValueError(f'{image.encoding} image of velocities from {low!r} to {high!r}')
        pixels = np.frombuffer(bytes(image.data), np.uint8).reshape(image.height, image.width, 3)
        png = io.BytesIO()
        # A quick compression: few colours make it small anyway.
        PIL.Image.fromarray(pixels).save(png, 'PNG', compress_level=2)
        return BasinPicture(png.getvalue(), image.width, image.height, low, high, points, colours,
                            tuple(status.message for status in state.status))


def points_of(cloud: PointCloud2) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.uint32]]:
    """Return phase and velocity of a cloud's points, and their colours as RGBA."""
    names = ('x', 'y', 'rgb')
    offsets = {field.name: field.offset for field in cloud.fields
               if field.datatype == PointField.FLOAT32 and field.count == 1}
    if cloud.is_bigendian or not all(name in offsets for name in names):
        raise ValueError('attractors are not a cloud of little-endian float32 x, y and rgb')
    records = np.frombuffer(bytes(cloud.data), np.dtype({
        'names': names, 'formats': ['<f4', '<f4', '<u4'],
        'offsets': [offsets[name] for name in names], 'itemsize': cloud.point_step}))
    return (np.stack([records['x'], records['y']], axis=1),
            np.asarray(records['rgb'] << np.uint32(8) | np.uint32(0xFF)))


def layers_of(message: MarkerArray) -> Layers:
    """Return the places of every layer that is named; of one that is deleted, none."""
    found: Layers = {}
    for marker in message.markers:
        if marker.ns not in LAYERS:
            raise ValueError(f'{marker.ns!r:.40} is none of {", ".join(LAYERS)}')
        places = np.array([(point.x, point.y) for point in marker.points])
        # Not so where one is no number, either.
        if not (np.abs(places) < 1e9).all():
            raise ValueError(f'{marker.ns} has places that are out of all range')
        found[marker.ns] = places.reshape((-1, 2, 2) if marker.ns in LINES else (-1, 2))
    return found
