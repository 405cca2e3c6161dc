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

"""Conversions between numpy arrays and ROS messages, with stamps and frame ids."""

import array
from collections.abc import Iterable, Mapping
import math
from typing import Final

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
import numpy as np
import numpy.typing as npt
from sensor_msgs.msg import Image, JointState, PointCloud2, PointField
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from .core.arrays import FloatArray
from .core.model import EVENT, EventArray
from .core.stream.event_points import decode_points, POINT, point_fields
from .core.stream.report_values import texts
from .palette import LAYERS, rgb

# The plane (phase, velocity), in which points of the section are drawn.
SECTION_FRAME: Final = 'section'
# Diameter of a point, and widths of a line and of the head of an arrow [rad, 1].
_POINT: Final = 0.04
_LINE: Final = 0.008
_HEAD: Final = 0.05
_FIELDS: Final = [
    PointField(name=name, offset=offset, datatype=datatype, count=count)
    for name, offset, datatype, count in point_fields()]


def stamp_from_nanoseconds(nanoseconds: int) -> Time:
    """Return a ROS time from nanoseconds since the epoch; it wraps in 2038, as its seconds do."""
    seconds, rest = divmod(int(nanoseconds), 1_000_000_000)
    return Time(sec=seconds % 2**31, nanosec=rest)


def drive_time_nanoseconds(cycle: int, phase: float, omega: float) -> int:
    """Return tau/omega [ns] of a moment; whole periods are converted without rounding up."""
    period = 2.0 * math.pi / omega * 1e9
    return round(cycle * period) + round(phase / omega * 1e9)


def cloud_from_events(events: EventArray, stamp: Time,
                      frame: str = SECTION_FRAME) -> PointCloud2:
    """Return a PointCloud2 with an EVENT array of shape (n,) and float32 positions in front."""
    points = np.empty(len(events), POINT)
    points['x'] = events['phase']
    points['y'] = events['velocity']
    points['z'] = events['displacement']
    for name in EVENT.names or ():
        points[name] = events[name]
    return _cloud(points, _FIELDS, stamp, frame)


def cloud_from_records(records: npt.NDArray[np.void], stamp: Time,
                       frame: str = SECTION_FRAME) -> PointCloud2:
    """Return a PointCloud2 with the fields of a packed little-endian record array."""
    kinds = {'<f4': PointField.FLOAT32, '<f8': PointField.FLOAT64, '<i4': PointField.INT32,
             '<u4': PointField.UINT32}
    fields = [
        PointField(name=name, offset=offset, datatype=kinds[dtype.str], count=1)
        for name, (dtype, offset, *_) in (records.dtype.fields or {}).items()]
    return _cloud(records, fields, stamp, frame)


def _cloud(records: npt.NDArray[np.void], fields: list[PointField], stamp: Time,
           frame: str) -> PointCloud2:
    # An array of bytes is moved; a numpy array would be copied element by element.
    return PointCloud2(
        header=Header(stamp=stamp, frame_id=frame), height=1, width=len(records),
        fields=fields, is_bigendian=False, point_step=records.dtype.itemsize,
        row_step=records.nbytes, is_dense=True, data=array.array('B', records.tobytes()))


def image_from_pixels(pixels: npt.NDArray[np.uint8], stamp: Time,
                      frame: str = SECTION_FRAME) -> Image:
    """Return an rgb8 Image of pixels of shape (height, width, 3), top row first."""
    height, width, _ = pixels.shape
    return Image(
        header=Header(stamp=stamp, frame_id=frame), height=height, width=width,
        encoding='rgb8', step=3 * width, data=array.array('B', pixels.tobytes()))


def markers_from_layers(layers: Mapping[str, FloatArray], stamp: Time,
                        frame: str = SECTION_FRAME) -> MarkerArray:
    """Return a marker for each of `LAYERS`, one of a namespace; what is not known is deleted."""
    found = MarkerArray()
    for name, colour in LAYERS.items():
        places = layers.get(name, np.zeros((0, 2)))
        is_arrow = name == 'smallest_kick'
        kind, size = ((Marker.SPHERE_LIST, _POINT) if places.ndim == 2 else
                      (Marker.ARROW, 2.0 * _LINE) if is_arrow else (Marker.LINE_LIST, _LINE))
        red, green, blue = (part / 255.0 for part in rgb(colour))
        found.markers.append(Marker(
            header=Header(stamp=stamp, frame_id=frame), ns=name, type=kind,
            action=Marker.ADD if places.size else Marker.DELETE,
            pose=Pose(orientation=Quaternion(w=1.0)),
            scale=Vector3(x=size, y=_HEAD if is_arrow else size, z=0.0 if is_arrow else size),
            color=ColorRGBA(r=red, g=green, b=blue, a=1.0),
            # As the clouds: the lower wall is one backlash below the upper one.
            points=[Point(x=phase, y=velocity, z=-1.0 if velocity < 0.0 else 0.0)
                    for phase, velocity in places.reshape(-1, 2).tolist()]))
    return found


def events_from_cloud(cloud: PointCloud2) -> EventArray:
    """Return the EVENT array in a PointCloud2; ValueError names what does not fit."""
    if cloud.height > 1 and cloud.row_step != cloud.width * cloud.point_step:
        raise ValueError(
            f'cloud has row_step {cloud.row_step} for {cloud.width} points of {cloud.point_step}')
    return decode_points(
        [(field.name, field.offset, field.datatype, field.count) for field in cloud.fields],
        int(cloud.width) * int(cloud.height), int(cloud.point_step), bool(cloud.is_bigendian),
        memoryview(cloud.data))


def joint_state(values: Mapping[str, Iterable[float]], stamp: Time,
                frame_id: str = '') -> JointState:
    """Return a JointState of named (position, velocity) pairs; it has no efforts."""
    return JointState(
        header=Header(stamp=stamp, frame_id=frame_id), name=list(values),
        position=array.array('d', [float(position) for position, _ in values.values()]),
        velocity=array.array('d', [float(velocity) for _, velocity in values.values()]))


def named_values(values: Mapping[str, float], stamp: Time) -> JointState:
    """Return named float64 values with a stamp, as the positions of a JointState."""
    return JointState(header=Header(stamp=stamp), name=list(values),
                      position=array.array('d', [float(value) for value in values.values()]))


def diagnostic_array(name: str, hardware_id: str, level: str, message: str,
                     values: Mapping[str, object], stamp: Time) -> DiagnosticArray:
    """Return a DiagnosticArray with one status; floats are written with all their digits."""
    status = DiagnosticStatus(
        level=getattr(DiagnosticStatus, level.upper()), name=name, message=message,
        hardware_id=hardware_id,
        values=[KeyValue(key=key, value=text) for key, text in texts(values).items()])
    return DiagnosticArray(header=Header(stamp=stamp), status=[status])
