"""The recorder: writes what the suite publishes into an MCAP bag, as it came."""

from collections.abc import Callable, Mapping
import os
from pathlib import Path
import sys
import time
from typing import Any, Final

from ament_index_python.packages import get_package_share_directory
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import ParameterEvent
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image, JointState, PointCloud2

from .recording import Received, Recording
from ..base.dds_room import ReadingNode
from ..base.node import HoleLog, run_node, ShellNode, StartError
from ...bags import BagError, BagWriter, COMPRESSIONS, message_definition, Topic
from ...core.words import counted
from ...parameters import RECORDER
from ...qos import STREAM_INPUT

# Like STREAM_INPUT, and given the present state of the latched topics at the start.
_LATCHED_INPUT: Final = QoSProfile(
    history=HistoryPolicy.KEEP_ALL,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
_CLOCK_INPUT: Final = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1000,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)
# The types are known, so a subscription waits for its publisher and misses no first message.
_TOPICS: Final = (
    ('impacts', PointCloud2, STREAM_INPUT),
    ('joint_states', JointState, STREAM_INPUT),
    ('lyapunov', JointState, STREAM_INPUT),
    ('transient', DiagnosticArray, _LATCHED_INPUT),
    ('basin', Image, _LATCHED_INPUT),
    ('attractors', PointCloud2, _LATCHED_INPUT),
    ('basin_state', DiagnosticArray, _LATCHED_INPUT),
    ('/diagnostics', DiagnosticArray, STREAM_INPUT),
    ('/parameter_events', ParameterEvent, STREAM_INPUT),
    ('/clock', Clock, _CLOCK_INPUT),
)
_UNCOUNTED: Final = ('/diagnostics', '/parameter_events', '/clock')
# Messages taken at one go, as going through the executor costs more than taking them.
_MOST: Final = 64


class _Source:
    """A subscription, and what its publisher has counted."""

    def __init__(self, node: ShellNode, name: str, kind: Any, qos: QoSProfile,
                 take: Callable[['_Source', bytes, Mapping[str, Any]], None]) -> None:
        self.lost = 0
        self.superseded = 0
        self._node = node
        self._take = take
        self._kind = kind
        self._type_name = f'{kind.__module__.split(".")[0]}/msg/{kind.__name__}'
        self._definition = _definition(self._type_name)
        self._last: int | None = None
        self._topic: Topic | None = None
        receive: Any = self._receive
        self._subscription = node.create_subscription(kind, name, receive, qos, raw=True)
        # Where many publish or messages may be dropped, gaps in the counting mean nothing.
        self._is_counted = name not in _UNCOUNTED
        # Latched, a message that is replaced before it was fetched has had its day.
        self._is_newest_enough = qos is _LATCHED_INPUT
        self.name = self._subscription.topic_name

    def topic(self) -> Topic:
        """Describe the topic; its publisher is there by the time of the first message."""
        if self._topic is None:
            offers = []
            type_hash = 'INVALID'
            for publisher in self._node.get_publishers_info_by_topic(self.name):
                if publisher.topic_type == self._type_name:
                    offers.append(_qos_words(publisher.qos_profile))
                    type_hash = str(publisher.topic_type_hash)
            self._topic = Topic(
                self.name, self._type_name, self._definition, type_hash,
                tuple(offers or [_qos_words(self._subscription.qos_profile)]))
        return self._topic

    def take(self, most: int, until: int = 2**63 - 1) -> bool:
        """Take what has arrived, up to a moment, from the reader; return whether there is more."""
        handle = self._subscription.handle
        for _ in range(most):
            with handle:
                message = handle.take_message(self._kind, True)
            if message is None:
                return False
            self._count(*message)
            if message[1]['received_timestamp'] > until:
                return False
        return True

    def _receive(self, data: bytes, info: Mapping[str, Any]) -> None:
        self._count(data, info)
        self.take(_MOST)

    def _count(self, data: bytes, info: Mapping[str, Any]) -> None:
        number = info.get('publication_sequence_number')
        if number is not None:
            jump = 0 if self._last is None else number - self._last - 1
            self._last = number
            if self._is_newest_enough:
                self.superseded += max(jump, 0)
            elif self._is_counted:
                self.lost += max(jump, 0)
        self._take(self, data, info)


class Recorder(ReadingNode):
    """Records the topics of the suite in its namespace, and /diagnostics and the like."""

    def __init__(self) -> None:
        super().__init__('recorder', RECORDER)
        self._is_failure_told = False
        self._garbled = 0
        self._sources = [_Source(self, *topic, self._record) for topic in _TOPICS]
        writer = self._make_writer()
        self._directory = writer.directory
        self._recording = Recording(writer, self._sources[0].name)
        self._holes = HoleLog(self, self._recording.guard, 'they are not in the bag')
        self.every(0.2, self._watch)
        self.get_logger().info(f'recording into {self._directory}')

    @property
    def has_failed(self) -> bool:
        """Whether something could not be written."""
        return bool(self._recording.failure)

    def report(self) -> tuple[str, str, Mapping[str, object]]:
        """Return what has been written, and whether all of it."""
        recording = self._recording
        values = {
            'messages': recording.messages,
            'impacts': recording.impacts,
            **self._holes.counts(),
            'messages_lost': sum(self._lost().values()),
            'messages_superseded': self._superseded(),
            'messages_garbled': self._garbled,
            'bytes': recording.size,
            'backlog_bytes': recording.backlog,
            'unwritten_age': recording.age,
            'output': str(self._directory),
        }
        if recording.failure:
            return 'error', f'stopped: {recording.failure}', values
        level, message = self._holes.status()
        if level == 'ok':
            odd = [f'{counted(number, "message")} of {name} lost on the way'
                   for name, number in self._lost().items()]
            odd += [f'{counted(self._garbled, "message")} garbled'] if self._garbled else []
            level, message = ('warn', ', '.join(odd)) if odd else ('ok', 'recording')
        return level, message, values

    def close(self) -> None:
        """Write what has arrived, end the bag and say what is in it."""
        # What has arrived has been acknowledged: nobody else keeps it.
        now = time.time_ns()
        while sum(source.take(_MOST, now) for source in self._sources):
            pass
        self._recording.close()
        recording = self._recording
        self._watch()
        each = f' ({recording.size / recording.impacts:.1f} bytes per impact)' \
            if recording.impacts else ''
        odd = ''.join(
            f', {counted(number, "message")} of {name} lost on the way'
            for name, number in self._lost().items())
        odd += f', {self._superseded()} superseded' if self._superseded() else ''
        odd += f', {self._garbled} garbled' if self._garbled else ''
        odd += f', {counted(recording.unreadable, "batch")} unreadable' if recording.unreadable \
            else ''
        print(f'recorded {counted(recording.impacts, "impact")} in '
              f'{counted(recording.messages, "message")}, {recording.guard.lost} lost '
              f'({counted(recording.guard.gaps, "gap")}){odd}, '
              f'{recording.size / 1e6:.1f} MB{each} in {self._directory}', flush=True)

    def _lost(self) -> dict[str, int]:
        return {source.name: source.lost for source in self._sources if source.lost}

    def _superseded(self) -> int:
        return sum(source.superseded for source in self._sources)

    def _make_writer(self) -> BagWriter:
        compression = str(self.values['compression'])
        if compression not in COMPRESSIONS:
            raise StartError(f'compression = {compression!r} is not one of '
                             f'{", ".join(COMPRESSIONS)}')
        name = str(self.values['output']) or time.strftime('rosbag2_%Y_%m_%d-%H_%M_%S')
        try:
            return BagWriter(
                Path(name).expanduser(), compression, largest=int(self.values['max_bag_size']),
                longest=int(self.values['max_bag_duration']) * 1_000_000_000)
        except BagError as error:
            raise StartError(f'output = {error}') from None

    def _record(self, source: _Source, data: bytes, info: Mapping[str, Any]) -> None:
        # Seen under load: DDS hands over bytes that are no message, with a time that is none. In
        # the bag they would stand first, and end every reading of it there.
        if data[:1] != b'\0':
            self._garbled += 1
            self.get_logger().error(
                f'{source.name}: DDS handed over {len(data)} bytes that are no message '
                f'({data[:8].hex()} ..., received at {info["received_timestamp"]} ns); left out',
                throttle_duration_sec=1.0)
            return
        received = info['received_timestamp'] or time.time_ns()
        self._recording.put(Received(
            source.topic(), data, received, info['source_timestamp'] or received,
            info.get('publication_sequence_number') or 0))

    def _watch(self) -> None:
        self._holes.speak()
        if self._recording.failure and not self._is_failure_told:
            self._is_failure_told = True
            self.get_logger().error(
                f'{self._recording.failure}; recording has stopped, '
                f'{counted(self._recording.messages, "message")} kept')


def _definition(type_name: str) -> str:
    try:
        return message_definition(type_name, _share)
    except OSError as error:
        raise StartError(f'the definition of {type_name} is not found ({error}); '
                         'set AMENT_PREFIX_PATH') from None


def _share(package: str) -> str:
    try:
        return str(get_package_share_directory(package))
    except (LookupError, OSError):
        # The wheels of ROS lie in python's own prefix, which need not be in AMENT_PREFIX_PATH.
        return os.path.join(sys.prefix, 'share', package)


def _qos_words(qos: QoSProfile) -> dict[str, object]:
    """Return a quality of service in the words of rosbag2."""
    return {
        'history': qos.history.short_key,
        'depth': qos.depth,
        'reliability': qos.reliability.short_key,
        'durability': qos.durability.short_key,
        'deadline': _time(qos.deadline),
        'lifespan': _time(qos.lifespan),
        'liveliness': qos.liveliness.short_key,
        'liveliness_lease_duration': _time(qos.liveliness_lease_duration),
        'avoid_ros_namespace_conventions': bool(qos.avoid_ros_namespace_conventions),
    }


def _time(duration: Duration) -> dict[str, int]:
    seconds, rest = divmod(duration.nanoseconds, 1_000_000_000)
    return {'sec': seconds, 'nsec': rest}


def main(arguments: list[str] | None = None) -> int:
    """Run the recorder; exit status 1 if it could not write everything."""
    made: list[Recorder] = []

    def make() -> Recorder:
        made.append(Recorder())
        return made[0]

    status = run_node('recorder', make, arguments)
    return status or int(any(node.has_failed for node in made))
