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

"""The replay as a real process on real DDS."""

import io
import json
from pathlib import Path
import signal
import time

from bag_maker import batches, make_bag, START, states, story, topic
from diagnostic_msgs.msg import DiagnosticArray
from mcap.reader import make_reader
import pytest
from rclpy.qos import QoSProfile
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, PointCloud2

from gear_rattle_ros.bags import BagWriter
from gear_rattle_ros.nodes.replay.node import ros_arguments
from gear_rattle_ros.qos import CLOCK, STREAM_INPUT

CLOUDS = batches(story(20_000))
STATES = states(150)
SECOND = 1_000_000_000


class Listener:
    """The bytes that come on the topics of the bag, with their moments."""

    def __init__(self, node, spin) -> None:
        """Subscribe."""
        self.clouds: list[bytes] = []
        self.states: list[bytes] = []
        self.moments: list[float] = []
        self.clock: list[int] = []
        self.spin = spin
        node.create_subscription(PointCloud2, 'impacts', self.take, STREAM_INPUT, raw=True)
        node.create_subscription(
            JointState, 'lyapunov', self.states.append, STREAM_INPUT, raw=True)
        node.create_subscription(
            Clock, '/clock', lambda clock: self.clock.append(
                Time.from_msg(clock.clock).nanoseconds),
            QoSProfile(depth=1000, reliability=CLOCK.reliability))

    def take(self, data: bytes) -> None:
        """Keep a cloud."""
        self.clouds.append(data)
        self.moments.append(time.monotonic())

    def until_end(self, process, within: float = 60.0) -> int:
        """Spin until the process has ended, and a little longer; return its exit status."""
        self.spin(lambda: process.process.poll() is not None, within)
        end = time.monotonic() + 0.3
        self.spin(lambda: time.monotonic() > end)
        return process.process.returncode


@pytest.fixture
def listener(rclpy_node, spin) -> Listener:
    """Return somebody who reads everything."""
    return Listener(rclpy_node, spin)


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return two seconds of 201 clouds, the first 150 of them each followed by a state."""
    path = tmp_path_factory.mktemp('bags') / '2026'
    make_bag(path, CLOUDS, STATES)
    return path


@pytest.mark.long
def test_every_byte_comes_again_as_fast_as_possible(start, listener: Listener, bag: Path) -> None:
    """Speed 0 loses nothing, keeps the order, ends by itself and reports it."""
    process = start('replay', str(bag), '--speed', '0')
    assert listener.until_end(process) == 0
    assert listener.clouds == CLOUDS
    assert listener.states == STATES
    assert process.text().startswith(
        f'replayed {len(CLOUDS) + len(STATES):,} messages on 2 topics, complete at 2.000 s '
        'of 2.000')


@pytest.mark.long
def test_it_waits_for_the_number_of_readers_given(
        start, listener: Listener, rclpy_node, bag: Path) -> None:
    """With one of two it does not begin, however long that has not changed."""
    process = start('replay', str(bag), '--speed', '0', '--wait-for-readers', '2')
    listener.spin(lambda: rclpy_node.get_publishers_info_by_topic('/impacts'))
    end = time.monotonic() + 3.0
    listener.spin(lambda: time.monotonic() > end)
    assert listener.clouds == [] and process.process.poll() is None
    late: list[bytes] = []
    rclpy_node.create_subscription(PointCloud2, 'impacts', late.append, STREAM_INPUT, raw=True)
    assert listener.until_end(process) == 0
    assert listener.clouds == CLOUDS
    assert late == CLOUDS


@pytest.mark.long
def test_it_keeps_the_recorded_time(start, listener: Listener, bag: Path) -> None:
    """From 0.5 s to 1.7 s at half the speed, one topic: 121 clouds, 20 ms apart; a clock runs."""
    process = start('replay', str(bag), '--speed', '0.5', '--start', '0.5', '--end', '1.7',
                    '--clock', '--topics', 'impacts')
    assert listener.until_end(process) == 0
    assert listener.clouds == CLOUDS[50:171]
    assert listener.states == []
    middle = listener.moments[10:-10]
    assert (middle[-1] - middle[0]) / (len(middle) - 1) == pytest.approx(0.02, rel=0.1)
    assert listener.clock == sorted(listener.clock)
    assert len(listener.clock) > 100
    assert START + SECOND // 2 <= listener.clock[0]
    assert listener.clock[-1] <= START + 1.7 * SECOND
    # Published in steps of 10 ms of wall time: 5 ms of recorded time.
    steps = [after - before for before, after in zip(
        listener.clock[:-1], listener.clock[1:], strict=True)]
    assert sorted(steps)[len(steps) // 2] == pytest.approx(5e6, rel=0.3)


@pytest.mark.long
def test_it_loops_until_it_is_stopped(
        start, listener: Listener, bag: Path, tmp_path: Path) -> None:
    """The stream begins again, whole, also from a bag that was cut; SIGTERM ends it quietly."""
    whole = (bag / '2026_0.mcap').read_bytes()
    cut = tmp_path / 'a cut bag.mcap'
    cut.write_bytes(whole[:len(whole) // 2])
    process = start('replay', '--ros-args', '-p', f'bag:={json.dumps(str(cut))}', '-p',
                    'speed:=0', '-p', 'loop:=true', '-p', 'topics:=/impacts', '-p', 'end:=0.495')
    listener.spin(lambda: len(listener.clouds) >= 175)
    assert process.stop(signal.SIGTERM) == 0
    for number, cloud in enumerate(listener.clouds):
        assert cloud == CLOUDS[number % 50], number
    lines = process.text().splitlines()
    assert len(lines) == 2
    assert f'{cut} was not closed properly' in lines[0]
    assert 'complete at' in lines[1]


def test_latched_topics_wait_for_their_readers(
        start, rclpy_node, spin, tmp_path: Path) -> None:
    """A topic with a history of one is replayed as such, and yet no message is overwritten."""
    text = 'diagnostic_msgs/msg/DiagnosticArray'
    writer = BagWriter(tmp_path / 'bag')
    channel = writer.add_topic(topic('/transient', text, 'transient_local'))
    hidden = writer.add_topic(topic('/diagnostics', text))
    empty = b'\0\1\0\0'
    messages = [empty + bytes([number]) + bytes(11) for number in range(100)]
    for number, data in enumerate(messages):
        writer.write(channel, START + number, START, number, data)
        writer.write(hidden, START + number, START, number, data)
    writer.close()
    found: list[bytes] = []
    others: list[bytes] = []
    rclpy_node.create_subscription(
        DiagnosticArray, 'transient', found.append, STREAM_INPUT, raw=True)
    rclpy_node.create_subscription(
        DiagnosticArray, '/diagnostics', others.append, STREAM_INPUT, raw=True)
    process = start('replay', str(tmp_path / 'bag'), '--speed', '0')
    spin(lambda: process.process.poll() is not None)
    spin(lambda: len(found) >= len(messages))
    assert process.process.returncode == 0
    assert found == messages
    assert not set(others) & set(messages), 'what others reported of themselves is not repeated'


def test_bad_input_is_refused_in_one_line(start, bag: Path) -> None:
    """Exit status 2, naming what is wrong."""
    expected = [
        ([], 'no bag is given'),
        (['/nowhere/bag'], '/nowhere/bag: does not exist'),
        ([str(bag), '--start', '3'], 'start = 3.0 is beyond the end'),
        ([str(bag), '--start', '1', '--end', '0.5'], 'end = 0.5 is before start = 1.0'),
        ([str(bag), '--speed', '-1'], 'speed = -1.0 is outside'),
        ([str(bag), '--topics', 'impact'], 'topics = /impact is not in'),
        ([__file__], 'is damaged or no MCAP file'),
    ]
    processes = [start('replay', *arguments) for arguments, _ in expected]
    for process, (_, words) in zip(processes, expected, strict=True):
        assert process.process.wait(30) == 2
        lines = process.text().splitlines()
        assert len(lines) == 1, lines
        assert lines[0].startswith('replay: ')
        assert words in lines[0]


def test_a_damaged_bag_is_played_up_to_the_damage(
        start, listener: Listener, bag: Path, tmp_path: Path) -> None:
    """Then one line names what is wrong, and the exit status is 1."""
    whole = bytearray((bag / '2026_0.mcap').read_bytes())
    # What is compressed, not the head of a chunk: without that there is nothing to play.
    chunks = make_reader(io.BytesIO(whole)).get_summary().chunk_indexes
    chunk = chunks[len(chunks) // 2]
    whole[chunk.chunk_start_offset + chunk.chunk_length // 2] ^= 0xFF
    (tmp_path / 'damaged.mcap').write_bytes(whole)
    process = start('replay', str(tmp_path / 'damaged.mcap'), '--speed', '0')
    assert listener.until_end(process) == 1, process.text()
    lines = process.text().splitlines()
    assert lines[0].startswith(f'replay: {tmp_path}/damaged.mcap: is damaged')
    assert ', stopped at' in lines[1]
    assert 20 < len(listener.clouds) < 180
    assert listener.clouds == CLOUDS[:len(listener.clouds)]


def test_plain_arguments_become_parameters(capsys: pytest.CaptureFixture[str]) -> None:
    """The ROS arguments stay as they are; what cannot be understood is refused."""
    given = ['2026', '--speed', '2', '--loop', '--ros-args', '-r', '__ns:=/a']
    assert ros_arguments(given) == [
        *given[-3:], '--ros-args', '-p', 'bag:="2026"', '-p', 'speed:=2.0', '-p', 'loop:=true']
    assert ros_arguments(['--ros-args', '-p', 'bag:=x', '--', '--topics', 'a', 'b'])[-1] == \
        'topics:="a b"'
    assert ros_arguments(['--ros-args', '-p', 'bag:=x']) == ['--ros-args', '-p', 'bag:=x']

    for wrong in (['--speed', 'fast'], ['--sped', '1'], ['a', 'b']):
        with pytest.raises(SystemExit) as caught:
            ros_arguments(wrong)
        assert caught.value.code == 2
        assert 'replay: error:' in capsys.readouterr().err
