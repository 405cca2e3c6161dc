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

"""The recorder: writes what the suite publishes into an MCAP bag, byte for byte."""

from collections.abc import Callable, Mapping
import functools
import os
from pathlib import Path
import sys
import time
from typing import Any, Final

from ament_index_python.packages import get_package_share_directory
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import ParameterEvent
from rclpy.duration import Duration
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image, JointState, PointCloud2
from visualization_msgs.msg import MarkerArray

from .recording import Received, Recording
from ..base.dds_room import bound_backlog
from ..base.errors import UserError
from ..base.event_input import arrived, StreamHealth
from ..base.node import ReportingNode
from ..base.process import run_node, say
from ...bags import BagError, BagWriter, message_definition, Topic
from ...core.words import counted
from ...qos import profile, STREAM_INPUT

# Like STREAM_INPUT, but receives the present state of the latched topics first.
_LATCHED_INPUT: Final = profile(0, is_latched=True)
# The types are known, so a subscription waits for its publisher and misses no first message.
_TOPICS: Final = (
    ('impacts', PointCloud2, STREAM_INPUT),
    ('joint_states', JointState, STREAM_INPUT),
    ('lyapunov', JointState, STREAM_INPUT),
    ('transient', DiagnosticArray, _LATCHED_INPUT),
    ('last_impact', JointState, STREAM_INPUT),
    ('control', JointState, STREAM_INPUT),
    ('rattle', JointState, STREAM_INPUT),
    ('hops', JointState, STREAM_INPUT),
    ('basin', Image, _LATCHED_INPUT),
    ('attractors', PointCloud2, _LATCHED_INPUT),
    ('basin_state', DiagnosticArray, _LATCHED_INPUT),
    ('smallest_kick', DiagnosticArray, _LATCHED_INPUT),
    ('skeleton', MarkerArray, _LATCHED_INPUT),
    ('/diagnostics', DiagnosticArray, STREAM_INPUT),
    ('/parameter_events', ParameterEvent, STREAM_INPUT),
    ('/clock', Clock, profile(1000, is_reliable=False)),
)
_UNCOUNTED: Final = ('/diagnostics', '/parameter_events', '/clock')
# Messages taken in one callback.
_MOST: Final = 64


class _Source:
    """A subscription, and the messages missing in its publisher's count."""

    def __init__(self, node: ReportingNode, name: str, kind: Any, qos: QoSProfile,
                 take: Callable[['_Source', bytes, Mapping[str, Any]], None]) -> None:
        self.lost = self.superseded = 0
        self._node = node
        self._take = take
        self._type_name = f'{kind.__module__.split(".")[0]}/msg/{kind.__name__}'
        try:
            self._definition = message_definition(self._type_name, _share)
        except OSError as error:
            raise UserError(f'the definition of {self._type_name} is not found ({error}); '
                            'set AMENT_PREFIX_PATH') from None
        # The last number of each publisher: which one has sent a message is not said.
        self._last: list[int] = []
        receive: Any = self._receive
        self._subscription = node.create_subscription(kind, name, receive, qos, raw=True)
        # Where messages may be dropped, gaps mean nothing.
        self._is_counted = name not in _UNCOUNTED
        # A latched message that is replaced before it was fetched is no longer needed.
        self._is_latched = qos is _LATCHED_INPUT
        self.name = self._subscription.topic_name

    @functools.cached_property
    def topic(self) -> Topic:
        """Describe the topic; its publisher is known once the first message has arrived."""
        publishers = [each for each in self._node.get_publishers_info_by_topic(self.name)
                      if each.topic_type == self._type_name]
        return Topic(
            self.name, self._type_name, self._definition,
            str(publishers[-1].topic_type_hash) if publishers else 'INVALID',
            tuple(_qos_words(each.qos_profile) for each in publishers)
            or (_qos_words(self._subscription.qos_profile),))

    def take(self, most: int, until: int = 2**63 - 1) -> bool:
        """Take messages that have arrived, up to a moment; return whether there may be more."""
        for data, info in arrived(self._subscription, most):
            self._count(data, info)
            if info['received_timestamp'] > until:
                return False
            most -= 1
        return most == 0

    def _receive(self, data: bytes, info: Mapping[str, Any]) -> None:
        self._count(data, info)
        self.take(_MOST)

    def _count(self, data: bytes, info: Mapping[str, Any]) -> None:
        number = info.get('publication_sequence_number')
        if number is not None:
            missing = self._missing(number)
            if self._is_latched:
                self.superseded += missing
            elif self._is_counted:
                self.lost += missing
        self._take(self, data, info)

    def _missing(self, number: int) -> int:
        """Return how many messages are missing before one, of the publisher it must be of."""
        before = max((last for last in self._last if last < number), default=None)
        if before is None or (number - before > 1 and len(self._last) < max(
                1, self._node.count_publishers(self.name))):
            # Its first here.
            self._last.append(number)
            return 0
        self._last[self._last.index(before)] = number
        return number - before - 1


class Recorder(ReportingNode):
    """Records the topics of the suite in its namespace, and the global ones such as /clock."""

    def __init__(self, **options: Any) -> None:
        super().__init__('recorder', **options)
        self._garbled = 0
        self._sources = [_Source(self, *topic, self._record) for topic in _TOPICS]
        writer = self._make_writer()
        self._directory = writer.directory
        self._recording = Recording(writer, self._sources[0].name)
        self._health = StreamHealth(self, self._recording.guard, 'they are not in the bag')
        self.every(0.2, self._watch)
        self.get_logger().info(f'recording into {self._directory}')

    def report(self) -> tuple[str, str, Mapping[str, object]]:
        recording = self._recording
        level, message, losses = self._health.report()
        values = {
            'messages': recording.messages, 'impacts': recording.impacts, **losses,
            'messages_lost': sum(source.lost for source in self._sources),
            'messages_superseded': sum(source.superseded for source in self._sources),
            'messages_garbled': self._garbled, 'bytes': recording.size,
            'backlog_bytes': recording.backlog, 'unwritten_age': recording.age,
            'output': str(self._directory)}
        if recording.failure:
            return 'error', f'stopped: {recording.failure}', values
        if level == 'ok':
            odd = self._lost() + [f'{counted(self._garbled, "message")} garbled'] * bool(
                self._garbled)
            level, message = 'warn' if odd else 'ok', ', '.join(odd) or 'recording'
        return level, message, values

    def close(self) -> None:
        # What has arrived was acknowledged: nobody else keeps it.
        now = time.time_ns()
        while sum(source.take(_MOST, now) for source in self._sources):
            pass
        recording = self._recording
        recording.close()
        self._watch()
        each = f' ({recording.size / recording.impacts:.1f} bytes per impact)' \
            if recording.impacts else ''
        superseded = sum(source.superseded for source in self._sources)
        odd = ''.join(f', {words}' for words in self._lost() + [words for count, words in (
            (superseded, f'{superseded} superseded'), (self._garbled, f'{self._garbled} garbled'),
            (recording.unreadable, f'{counted(recording.unreadable, "batch")} unreadable'))
            if count])
        say(f'recorded {counted(recording.impacts, "impact")} in '
            f'{counted(recording.messages, "message")}, {recording.guard.lost} lost '
            f'({counted(recording.guard.gaps, "gap")}){odd}, '
            f'{recording.size / 1e6:.1f} MB{each} in {self._directory}')

    def _lost(self) -> list[str]:
        return [f'{counted(source.lost, "message")} of {source.name} lost on the way'
                for source in self._sources if source.lost]

    def _make_writer(self) -> BagWriter:
        name = str(self.values['output']) or time.strftime('rosbag2_%Y_%m_%d-%H_%M_%S')
        try:
            return BagWriter(Path(name).expanduser(), str(self.values['compression']),
                             largest=int(self.values['max_bag_size']),
                             longest=int(self.values['max_bag_duration']) * 1_000_000_000)
        except BagError as error:
            raise UserError(f'output = {error}') from None

    def _record(self, source: _Source, data: bytes, info: Mapping[str, Any]) -> None:
        # Seen under load: DDS delivers bytes that are not a message, at an invalid time. In the
        # bag they would come first, and no reader would get past them.
        if data[:1] != b'\0':
            self._garbled += 1
            self.get_logger().error(
                f'{source.name}: DDS delivered {len(data)} bytes that are not a message '
                f'({data[:8].hex()} ..., received at {info["received_timestamp"]} ns); left out',
                throttle_duration_sec=1.0)
            return
        received = info['received_timestamp'] or time.time_ns()
        self._recording.put(Received(
            source.topic, data, received, info['source_timestamp'] or received,
            info.get('publication_sequence_number') or 0))

    def _watch(self) -> None:
        self._health.log()
        if self._recording.failure and not self.exit_status:
            self.exit_status = 1
            self.get_logger().error(
                f'{self._recording.failure}; recording has stopped, '
                f'{counted(self._recording.messages, "message")} kept')


def _share(package: str) -> str:
    try:
        return str(get_package_share_directory(package))
    except (LookupError, OSError):
        # The wheels of ROS are in python's own prefix, which need not be in AMENT_PREFIX_PATH.
        return os.path.join(sys.prefix, 'share', package)


def _qos_words(qos: QoSProfile) -> dict[str, object]:
    """Return a quality of service as rosbag2 writes it."""
    return {name: _word(getattr(qos, name)) for name in (
        'history', 'depth', 'reliability', 'durability', 'deadline', 'lifespan', 'liveliness',
        'liveliness_lease_duration', 'avoid_ros_namespace_conventions')}


def _word(value: Any) -> object:
    if isinstance(value, Duration):
        return dict(zip(('sec', 'nsec'), divmod(value.nanoseconds, 10**9), strict=True))
    return getattr(value, 'short_key', value)


main = functools.partial(run_node, 'recorder', Recorder, room=bound_backlog)
