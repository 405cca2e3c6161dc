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

"""The recorder as a real process on real DDS; what it leaves is read by rosbags."""

from collections.abc import Callable
import os
from pathlib import Path
import re
import resource
import signal
import time

from bag_maker import story, TYPES
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import numpy as np
import pytest
from rclpy.duration import Duration
from rosbags.highlevel import AnyReader
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, PointCloud2
import yaml

from gear_rattle_ros.bags import Bag
from gear_rattle_ros.core.model import EventArray
from gear_rattle_ros.messages import cloud_from_events, diagnostic_array, named_values
from gear_rattle_ros.nodes.simulator import LARGEST_BATCH
from gear_rattle_ros.qos import CLOCK, LATCHED, STREAM, STREAM_DEPTH

# A wait for acknowledgements that is far beyond what DDS takes for them.
ENOUGH = Duration(seconds=15)


@pytest.fixture
def record(start, tmp_path: Path) -> Callable[..., object]:
    """Start a recorder into tmp_path/bag."""
    def start_recorder(*more: str):
        process = start('recorder', '--ros-args', '-p', f'output:={tmp_path}/bag', *more)
        process.wait_for('recording into')
        return process

    return start_recorder


@pytest.fixture
def impacts(rclpy_node):
    """Return a publisher of the stream."""
    return rclpy_node.create_publisher(PointCloud2, 'impacts', STREAM)


def send(publisher, events: EventArray, size: int = LARGEST_BATCH, pause: float = 0.0) -> None:
    """Publish events in batches, as fast as they are acknowledged or with a pause after each."""
    for number, begin in enumerate(range(0, len(events), size)):
        publisher.publish(cloud_from_events(events[begin:begin + size], Time(sec=begin)))
        if pause:
            time.sleep(pause)
        elif number % 32 == 31:
            assert publisher.wait_for_all_acked(ENOUGH)
    assert publisher.wait_for_all_acked(ENOUGH)


def closing_line(process) -> str:
    """Return the line that reports what was recorded."""
    lines = [line for line in process.text().splitlines() if line.startswith('recorded')]
    assert len(lines) == 1, process.text()
    return lines[0]


def matched(spin, *publishers) -> None:
    """Wait until somebody reads all of these."""
    spin(lambda: all(publisher.get_subscription_count() for publisher in publishers))


@pytest.mark.parametrize('stop', [
    signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.long)])
def test_everything_is_recorded_under_load(
        record, impacts, rclpy_node, spin, tmp_path: Path, stop: int) -> None:
    """Half a million events, a latched topic, a clock: rosbags finds all, hashes and all."""
    events = np.tile(story(20_000), 25)[:500_000]
    events['kind'] = 0
    events['index'] = np.arange(1, len(events) + 1)
    events['epoch'] = 0
    latched = rclpy_node.create_publisher(DiagnosticArray, 'transient', LATCHED)
    latched.publish(diagnostic_array('old', '', 'ok', 'chaos', {'period': 3}, Time(sec=1)))
    states = rclpy_node.create_publisher(JointState, 'joint_states', STREAM)
    clock = rclpy_node.create_publisher(Clock, '/clock', CLOCK)
    process = record()
    matched(spin, impacts, latched, states, clock)
    for number in range(40):
        states.publish(named_values({'driver': 0.1 * number}, Time(sec=number)))
        clock.publish(Clock(clock=Time(sec=number)))
        time.sleep(0.01)
    send(impacts, events)
    assert states.wait_for_all_acked(ENOUGH)
    assert process.stop(stop) == 0
    line = closing_line(process)
    found = re.fullmatch(
        r'recorded ([\d,]+) impacts in ([\d,]+) messages, 0 lost \(0 gaps\), ([\d.]+) MB '
        r'\(([\d.]+) bytes per impact\) in (.*)', line)
    assert found, line
    size = (tmp_path / 'bag' / 'bag_0.mcap').stat().st_size
    assert found[1] == f'{len(events):,}'
    assert float(found[3]) == pytest.approx(size / 1e6, abs=0.06)
    assert found[5] == str(tmp_path / 'bag')
    # Without types of its own: those in the bag, checked against the hashes that DDS announced.
    with AnyReader([tmp_path / 'bag']) as reader:
        counts = {c.topic: c.msgcount for c in reader.connections}
        offers = {c.topic: c.ext.offered_qos_profiles[0] for c in reader.connections}
        clouds = [reader.deserialize(data, connection.msgtype)
                  for connection, _, data in reader.messages() if connection.topic == '/impacts']
        assert reader.message_count == int(found[2].replace(',', ''))
    begins = list(range(0, len(events), LARGEST_BATCH))
    assert counts['/impacts'] == len(begins)
    assert counts['/joint_states'] == 40
    assert counts['/transient'] == 1
    # Best effort and one deep: how many come through beside half a million events is chance.
    assert 1 <= counts['/clock'] <= 40
    assert counts['/diagnostics'] >= 1
    assert [cloud.header.stamp.sec for cloud in clouds] == begins
    offset = {field.name: field.offset for field in clouds[0].fields}['velocity']
    velocities = np.concatenate([
        np.asarray(cloud.data).reshape(-1, cloud.point_step)[:, offset:offset + 8].copy().view(
            np.float64)[:, 0] for cloud in clouds])
    assert velocities.tobytes() == events['velocity'].tobytes()
    assert offers['/transient'].durability.name == 'TRANSIENT_LOCAL'
    assert offers['/impacts'].durability.name == 'VOLATILE'
    assert offers['/clock'].reliability.name == 'BEST_EFFORT'
    text = (tmp_path / 'bag' / 'metadata.yaml').read_text()
    information = yaml.safe_load(text)['rosbag2_bagfile_information']
    assert information['message_count'] == int(found[2].replace(',', ''))
    for entry in information['topics_with_message_count']:
        about = entry['topic_metadata']
        assert about['type_description_hash'] == TYPES.hash_rihs01(about['type'])


def test_killed_it_has_lost_less_than_a_second(
        record, impacts, spin, tmp_path: Path) -> None:
    """After SIGKILL at a low rate, everything older than one second is readable."""
    process = record()
    matched(spin, impacts)
    events = story(3000)
    sent = []
    for begin in range(0, 1500, 10):
        impacts.publish(cloud_from_events(events[begin:begin + 10], Time(sec=begin)))
        sent.append(time.monotonic())
        time.sleep(0.02)
    killed = time.monotonic()
    os.killpg(process.process.pid, signal.SIGKILL)
    process.process.wait()
    bag = Bag(tmp_path / 'bag')
    assert not bag.is_whole
    found = np.concatenate(list(bag.events()))
    old = sum(moment < killed - 1.0 for moment in sent)
    assert old > 50
    assert len(found) >= 10 * old
    assert found.tobytes() == events[:len(found)].tobytes()
    text = (tmp_path / 'bag' / 'metadata.yaml').read_text()
    assert 0 < yaml.safe_load(text)['rosbag2_bagfile_information']['message_count'] <= sum(
        bag.counts.values())


def test_gaps_and_late_publishers_are_reported(
        record, rclpy_node, spin, tmp_path: Path) -> None:
    """A publisher that comes later is recorded; what it leaves out is counted as lost."""
    process = record()
    time.sleep(0.3)
    impacts = rclpy_node.create_publisher(PointCloud2, 'impacts', STREAM)
    matched(spin, impacts)
    events = story(3000)
    events = events[events['kind'] == 0][:2000]
    events['epoch'] = 0
    # A cloud without events is kept and reported; what is not a message is only reported.
    impacts.publish(PointCloud2(width=3))
    impacts.publish(b'\x07' + bytes(99))
    send(impacts, np.concatenate([events[:500], events[620:1000], events[1001:]]), 100)
    assert process.stop() == 0
    line = closing_line(process)
    assert line.startswith(f'recorded {len(events) - 121:,} impacts in '), line
    assert ', 121 lost (2 gaps), 1 garbled, 1 batch unreadable, ' in line, line
    with AnyReader([tmp_path / 'bag']) as reader:
        widths = [reader.deserialize(data, connection.msgtype).width
                  for connection, _, data in reader.messages() if connection.topic == '/impacts']
    assert widths[0] == 3
    assert sum(widths[1:]) == len(events) - 121


def test_two_publishers_of_a_topic_are_counted_apart(record, rclpy_node, spin) -> None:
    """Both number their messages; none is lost, whenever the second one begins."""
    first = rclpy_node.create_publisher(JointState, 'joint_states', STREAM)
    process = record()
    matched(spin, first)
    for number in range(50):
        first.publish(named_values({}, Time(sec=number)))
    second = rclpy_node.create_publisher(JointState, 'joint_states', STREAM)
    matched(spin, second)
    for number in range(200):
        (first if number % 3 else second).publish(named_values({}, Time(sec=number)))
    assert first.wait_for_all_acked(ENOUGH) and second.wait_for_all_acked(ENOUGH)
    assert process.stop() == 0
    assert ' lost on the way' not in closing_line(process)


@pytest.mark.long
def test_what_was_lost_is_reported_and_what_was_superseded_is_not_lost(
        record, rclpy_node, spin, tmp_path: Path) -> None:
    """Of what is latched the newest is enough; of the other topics every message counts."""
    latched = rclpy_node.create_publisher(DiagnosticArray, 'transient', LATCHED)
    states = rclpy_node.create_publisher(JointState, 'joint_states', STREAM)
    said: list[DiagnosticArray] = []
    rclpy_node.create_subscription(DiagnosticArray, '/diagnostics', said.append, 10)
    process = record()
    matched(spin, latched, states)
    sent = {latched: 50, states: 3 * STREAM_DEPTH}

    def publish(publisher, number: int) -> None:
        publisher.publish(diagnostic_array('state', '', 'ok', '', {}, Time(sec=number))
                          if publisher is latched else named_values({}, Time(sec=number)))

    for publisher in sent:
        publish(publisher, 0)
        assert publisher.wait_for_all_acked(ENOUGH)
    os.kill(process.process.pid, signal.SIGSTOP)
    for publisher, count in sent.items():
        for number in range(1, count):
            publish(publisher, number)
    os.kill(process.process.pid, signal.SIGCONT)
    assert latched.wait_for_all_acked(ENOUGH)
    assert states.wait_for_all_acked(ENOUGH)

    def warned() -> list[str]:
        return [status.message for message in said for status in message.status
                if status.name.startswith('recorder') and status.level != DiagnosticStatus.OK]

    spin(warned)
    assert process.stop() == 0
    with AnyReader([tmp_path / 'bag']) as reader:
        stamps = {
            topic: [reader.deserialize(data, connection.msgtype).header.stamp.sec
                    for connection, _, data in reader.messages() if connection.topic == topic]
            for topic in ('/transient', '/joint_states')}
    lost = 3 * STREAM_DEPTH - len(stamps['/joint_states'])
    superseded = 50 - len(stamps['/transient'])
    assert 0 < lost < 3 * STREAM_DEPTH - 1
    assert superseded > 0
    assert stamps['/transient'][-1] == 49
    words = 'messages of /joint_states lost on the way'
    assert re.fullmatch(rf'[\d,]+ {words}', warned()[-1])
    assert f', {lost:,} {words}, {superseded} superseded, ' in closing_line(process)


@pytest.mark.long
def test_a_full_disk_ends_the_bag_and_not_the_node(record, impacts, spin, tmp_path: Path) -> None:
    """One line reports it, no publisher is held up, what was written before stays readable."""
    process = record()
    matched(spin, impacts)
    events = story(60_000)
    send(impacts, events[:20_000])
    time.sleep(1.0)
    size = (tmp_path / 'bag' / 'bag_0.mcap').stat().st_size
    assert size > 100_000
    resource.prlimit(process.process.pid, resource.RLIMIT_FSIZE, (size + 5000, size + 5000))
    send(impacts, events[20_000:])
    process.wait_for('recording has stopped')
    send(impacts, events[:1000])
    assert process.process.poll() is None
    assert process.stop() == 1
    assert len([line for line in process.text().splitlines() if 'cannot be written' in line]) == 1
    found = np.concatenate(list(Bag(tmp_path / 'bag').events()))
    assert len(found) >= 20_000
    assert found.tobytes() == events[:len(found)].tobytes()


def test_bad_parameters_are_refused_in_one_line(start, tmp_path: Path) -> None:
    """Exit status 2, and nothing is made."""
    (tmp_path / 'file').write_text('')
    expected = [
        ([f'output:={tmp_path}'], 'exists already'),
        ([f'output:={tmp_path}/file/bag'], 'cannot be made'),
        ([f'output:={tmp_path}/new', 'compression:=zip'], "'zip' is not one of zstd, lz4, none"),
        (['output:=/proc/bag'], 'cannot be made: No such file or directory'),
    ]
    processes = [
        start('recorder', '--ros-args', *(part for text in settings for part in ('-p', text)))
        for settings, _ in expected]
    for process, (_, words) in zip(processes, expected, strict=True):
        assert process.process.wait(20) == 2
        lines = process.text().splitlines()
        assert len(lines) == 1, lines
        assert lines[0].startswith('recorder: ')
        assert words in lines[0]
    assert not (tmp_path / 'new').exists()


def test_without_an_output_the_bag_is_named_by_the_time(
        start, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As rosbag2 names it, in the directory it was started in."""
    monkeypatch.setenv('PYTHONPATH', os.pathsep.join(
        [str(Path(__file__).parents[2]), os.environ.get('PYTHONPATH', '')]))
    monkeypatch.chdir(tmp_path)
    process = start('recorder')
    process.wait_for('recording into')
    assert process.stop() == 0
    names = [path.name for path in tmp_path.iterdir() if path.is_dir()]
    assert len(names) == 1
    assert re.fullmatch(r'rosbag2_\d{4}(_\d\d){2}-\d\d(_\d\d){2}', names[0])
    assert Bag(tmp_path / names[0]).is_whole
