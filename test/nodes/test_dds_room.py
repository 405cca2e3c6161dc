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

"""Room for the stream: in shared memory where there is some, and a bounded one in its readers."""

from collections.abc import Callable
import contextlib
import fcntl
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import types
import xml.etree.ElementTree

import pytest
from rclpy.duration import Duration
from std_msgs.msg import UInt32

from gear_rattle_ros.core.stream.event_points import POINT
from gear_rattle_ros.nodes.base import dds_room
from gear_rattle_ros.nodes.base.dds_room import (
    avoid_memory,
    bound_backlog,
    make_room,
    MEMORY,
    PROFILES,
    remove_abandoned,
    SEGMENT,
    SPARE,
    TRANSPORTS,
)
from gear_rattle_ros.nodes.base.errors import UserError
from gear_rattle_ros.nodes.base.pacing import WINDOW
from gear_rattle_ros.nodes.simulator import LARGEST_BATCH
from gear_rattle_ros.places import config_folder
from gear_rattle_ros.qos import STREAM, STREAM_DEPTH

# Reads with the profile of the package's nodes, nothing until asked, then prints what has come.
READER = """
import sys
import time
import rclpy
from std_msgs.msg import UInt32
from gear_rattle_ros.nodes.base.dds_room import bound_backlog
from gear_rattle_ros.qos import STREAM_INPUT
bound_backlog()
rclpy.init()
node = rclpy.create_node('slow')
found = []
take = lambda message: found.append(message.data)
node.create_subscription(UInt32, 'numbers', take, STREAM_INPUT)
count = int(sys.argv[1])
if not sys.stdin.readline():
    sys.exit('the test has given up')
deadline = time.monotonic() + 45.0
while found[-1:] != [count] and time.monotonic() < deadline:
    rclpy.spin_once(node, timeout_sec=0.1)
print(found == list(range(1, count + 1)), flush=True)
"""


@pytest.fixture(autouse=True)
def no_profile(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the environment as it was, and start without a profile."""
    for name in (*PROFILES, TRANSPORTS, 'RMW_IMPLEMENTATION'):
        monkeypatch.setenv(name, '')
        monkeypatch.delenv(name)


def with_free(monkeypatch: pytest.MonkeyPatch, megabytes: int) -> None:
    """Let the shared memory have some megabytes free."""
    monkeypatch.setattr(dds_room.os, 'statvfs', lambda path: types.SimpleNamespace(
        f_bavail=megabytes << 8, f_frsize=4096))


def test_a_window_of_batches_fits_in() -> None:
    """What is sent before the simulator waits is never overwritten; the profile agrees."""
    root = xml.etree.ElementTree.parse(config_folder('fastdds') / 'stream.xml').getroot()
    (size,) = (each.text for each in root.iter() if each.tag.endswith('segment_size'))
    assert int(size) == SEGMENT
    assert WINDOW * (LARGEST_BATCH * POINT.itemsize + 1024) < SEGMENT


def test_a_small_memory_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """DDS would die of a page that is not there; one line names what is free."""
    with_free(monkeypatch, 40)
    assert '/dev/shm has 40 MB free and the stream needs 32 MB' in make_room()
    assert not any(name in os.environ for name in PROFILES)


def test_the_users_profile_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    """Who has configured DDS has done so."""
    with_free(monkeypatch, 1000)
    monkeypatch.setenv(PROFILES[0], 'mine.xml')
    assert make_room() == ''
    assert os.environ[PROFILES[0]] == 'mine.xml' and PROFILES[1] not in os.environ


@pytest.mark.parametrize(('name', 'value'), [
    (TRANSPORTS, 'UDPv4'), ('RMW_IMPLEMENTATION', 'rmw_cyclonedds_cpp')])
def test_other_transports_stay(monkeypatch: pytest.MonkeyPatch, name: str, value: str) -> None:
    """Nothing is asked for, and nothing reported of a memory that is not used."""
    with_free(monkeypatch, 1)
    monkeypatch.setenv(name, value)
    assert make_room() == ''
    assert not any(profile in os.environ for profile in PROFILES)


def test_another_user_in_the_domain_is_noticed(
        monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """As long as the nodes live: a lock that nobody holds, or of another domain, is nothing."""
    monkeypatch.setattr(dds_room, 'MEMORY', tmp_path)
    with_free(monkeypatch, 1000)
    monkeypatch.setenv('ROS_DOMAIN_ID', '7')
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    lock = tmp_path / 'fastrtps_port9161_el'
    lock.touch()
    with lock.open() as held:
        monkeypatch.setattr(dds_room.os, 'getuid', lambda: lock.stat().st_uid + 1)
        assert avoid_memory() == ''
        fcntl.flock(held, fcntl.LOCK_EX)
        with pytest.raises(UserError, match='another user has nodes in this domain; set ROS_'):
            avoid_memory()
        assert TRANSPORTS not in os.environ
        monkeypatch.setenv('ROS_DOMAIN_ID', '6')
        assert avoid_memory() == ''
        monkeypatch.setenv('ROS_DOMAIN_ID', '7')
        monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'SUBNET')
        assert 'messages go over UDP' in avoid_memory()
    assert os.environ[TRANSPORTS] == 'UDPv4'


@pytest.mark.long
def test_a_reader_that_is_full_refuses_and_loses_nothing(rclpy_node, spin: Callable) -> None:
    """Beyond the depth of the publisher it acknowledges no more until it has taken some."""
    root = xml.etree.ElementTree.parse(config_folder('fastdds') / 'readers.xml').getroot()
    (most,) = (each.text for each in root.iter() if each.tag.endswith('max_samples'))
    assert most is not None and int(most) == STREAM_DEPTH
    publisher = rclpy_node.create_publisher(UInt32, 'numbers', STREAM)
    count = STREAM_DEPTH + STREAM_DEPTH // 2
    with subprocess.Popen([sys.executable, '-c', READER, str(count)], stdin=subprocess.PIPE,
                          stdout=subprocess.PIPE, text=True) as reader:
        spin(publisher.get_subscription_count)
        for number in range(1, STREAM_DEPTH + 1):
            publisher.publish(UInt32(data=number))
            if number % WINDOW == 0:
                assert publisher.wait_for_all_acked(Duration(seconds=15))
        assert publisher.wait_for_all_acked(Duration(seconds=15))
        for number in range(STREAM_DEPTH + 1, count + 1):
            publisher.publish(UInt32(data=number))
        assert not publisher.wait_for_all_acked(Duration(seconds=2))
        out, _ = reader.communicate('go on\n', 60)
    assert out == 'True\n'


@pytest.mark.parametrize('user', [True, False])
def test_the_users_profile_stays_for_readers(monkeypatch: pytest.MonkeyPatch, user: bool) -> None:
    """Who has configured DDS has done so; who has named transports has not configured readers."""
    monkeypatch.setenv(TRANSPORTS, 'UDPv4')
    if user:
        monkeypatch.setenv(PROFILES[1], 'mine.xml')
    bound_backlog()
    assert [Path(os.environ.get(name, '')).name for name in PROFILES] == (
        ['', 'mine.xml'] if user else ['readers.xml', 'readers.xml'])


def test_a_start_that_fails_leaves_no_segment(start: Callable) -> None:
    """Memory that nobody uses would soon be all there is."""
    before = set(MEMORY.glob('fastrtps_*'))
    simulator = start('simulator', '--ros-args', '-p', 'alpha:=-5.0')
    assert simulator.process.wait(60) == 2
    left = {path for path in set(MEMORY.glob('fastrtps_*')) - before
            if path.exists() and path.stat().st_size > SEGMENT}
    # Tests beside this one have segments of their own, which somebody maps.
    assert not left - mapped()


def test_the_simulator_has_it(start: Callable) -> None:
    """Its process maps a segment of that size."""
    memory = os.statvfs(MEMORY)
    if memory.f_bavail * memory.f_frsize < SEGMENT + SPARE:
        pytest.skip(f'{MEMORY} is too small')
    simulator = start('simulator')
    simulator.wait_for('ready', 120.0)
    assert max(segments(simulator.process.pid)) >= SEGMENT
    assert simulator.stop(signal.SIGINT) == 0


def test_segments_of_killed_processes_are_removed(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a process holds stays, and what is so young that it may not be held yet."""
    monkeypatch.setattr(dds_room, 'MEMORY', tmp_path)
    names = [f'fastrtps_{16 * letter}' for letter in 'abc']
    for name in names:
        for suffix in ('', '_el'):
            (tmp_path / (name + suffix)).touch()
    for name in names[:2]:
        os.utime(tmp_path / f'{name}_el', (0.0, 0.0))
    with open(tmp_path / f'{names[1]}_el') as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        remove_abandoned()
    assert {path.name for path in tmp_path.iterdir()} == {
        name + suffix for name in names[1:] for suffix in ('', '_el')}


def mapped() -> set[Path]:
    """Return the segments that a process has."""
    found: set[Path] = set()
    for maps in Path('/proc').glob('[0-9]*/maps'):
        with contextlib.suppress(OSError):
            found |= {Path(line.split()[-1]) for line in maps.read_text().splitlines()
                      if '/dev/shm/fastrtps_' in line}
    return found


def segments(process: int) -> list[int]:
    """Return the sizes of the segments of Fast DDS that a process has [bytes]."""
    found = re.findall(r'^(\w+)-(\w+) .*/dev/shm/fastrtps_[0-9a-f]{16}$',
                       Path(f'/proc/{process}/maps').read_text(), re.MULTILINE)
    return [int(end, 16) - int(begin, 16) for begin, end in found]
