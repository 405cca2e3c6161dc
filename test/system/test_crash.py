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

"""Recorders killed under load, and disks that are full or read-only."""

from collections.abc import Iterator
import os
from pathlib import Path
import subprocess
import sys
import time

from bag_maker import story
from builtin_interfaces.msg import Time
import numpy as np
import pytest
from rclpy.duration import Duration
from sensor_msgs.msg import PointCloud2

from gear_rattle_ros.bags import Bag
from gear_rattle_ros.bags.verify import verify
from gear_rattle_ros.messages import cloud_from_events
from gear_rattle_ros.qos import STREAM

pytestmark = pytest.mark.long
ROOT = Path(__file__).parents[2]


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """Return a file system of one megabyte, where this user may make one."""
    place = tmp_path / 'disk'
    place.mkdir()
    made = subprocess.run(['mount', '-t', 'tmpfs', '-o', 'size=1m', 'tmpfs', str(place)],
                          capture_output=True, check=False)
    if made.returncode:
        pytest.skip('no file system can be mounted here')
    yield place
    subprocess.run(['umount', '--lazy', str(place)], check=True)


def test_killed_recorders_have_lost_less_than_a_second(domain: int) -> None:
    """What the script measures with more kills and load."""
    done = subprocess.run(
        [sys.executable, str(ROOT / 'benchmark' / 'crash.py'), '3', '3000'], cwd=ROOT,
        env=os.environ | {'PYTHONPATH': os.pathsep.join([str(ROOT), *sys.path])},
        capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count('events whole') == 3


def test_a_full_disk(start, rclpy_node, spin, disk: Path) -> None:
    """One line; what was written is readable and follows; the publisher is not held up."""
    process = start('recorder', '--ros-args', '-p', f'output:={disk}/bag')
    process.wait_for('recording into')
    impacts = rclpy_node.create_publisher(PointCloud2, 'impacts', STREAM)
    spin(impacts.get_subscription_count)
    events = story(60_000)
    for number, begin in enumerate(range(0, len(events), 500)):
        impacts.publish(cloud_from_events(events[begin:begin + 500], Time(sec=begin)))
        if number % 30 == 29:
            assert impacts.wait_for_all_acked(Duration(seconds=15))
            time.sleep(0.5)
    process.wait_for('recording has stopped')
    assert process.process.poll() is None
    assert process.stop() == 1
    lines = [line for line in process.text().splitlines() if 'No space left on device' in line]
    assert len(lines) == 1, process.text()
    found = np.concatenate(list(Bag(disk / 'bag').events()))
    assert 10_000 < len(found) < len(events)
    assert found.tobytes() == events[:len(found)].tobytes()
    verdict = verify(disk / 'bag')
    assert verdict.is_verified
    assert not verdict.is_whole


def test_a_read_only_disk(start, disk: Path) -> None:
    """One line and status 2."""
    subprocess.run(['mount', '-o', 'remount,ro', str(disk)], check=True)
    process = start('recorder', '--ros-args', '-p', f'output:={disk}/bag')
    assert process.process.wait(30) == 2
    assert process.text().splitlines() == [
        f'recorder: output = {disk}/bag: cannot be made: Read-only file system']
