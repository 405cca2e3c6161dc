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

"""
What DDS hands over when a publisher runs ahead of its queue: batches in fragments, and whole ones.

A publisher sends clouds without pause and without waiting for anybody, so that its queue overflows
all the time; three readers are killed and started again, and look at every message. A message is
torn if it lacks its head or contains bytes of another. Lost messages are not counted, as losses
are intended here. The exit status is 1 if a batch of the simulator's size was torn.
Run: make bench, or python benchmark/torn.py [seconds for each size]
"""

import array
from collections.abc import Mapping
import os
import random
import signal
import subprocess
import sys
import threading
import time
from typing import Any

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import PointCloud2

from gear_rattle_ros.bags import CloudDecoder
from gear_rattle_ros.core.stream.event_points import POINT
from gear_rattle_ros.nodes.simulator import LARGEST_BATCH
from gear_rattle_ros.qos import STREAM, STREAM_INPUT

# Records of a batch that travels in fragments.
FRAGMENTED = 1024
READERS = 3
# What a reader writes of a message; DDS writes on the same output.
WHOLE, TORN = '\x06', '\x15'


def publish(records: int) -> None:
    """Send clouds that are filled with one number each, without end."""
    rclpy.init()
    publisher = rclpy.create_node('publisher').create_publisher(PointCloud2, 'torn', STREAM)
    number = 0
    while True:
        number = (number + 1) % 256
        publisher.publish(PointCloud2(
            width=records, point_step=POINT.itemsize,
            data=array.array('B', bytes([number]) * (records * POINT.itemsize))))


def read(records: int) -> None:
    """Print whether each message is whole, in one character."""
    rclpy.init()
    node = rclpy.create_node(f'reader_{os.getpid()}')
    length = records * POINT.itemsize
    decoder = CloudDecoder()

    def take(message: bytes, info: Mapping[str, Any]) -> None:
        try:
            data = np.frombuffer(decoder.parse(message).data, np.uint8)
            is_whole = len(data) == length and bool(np.all(data == data[0]))
        except ValueError:
            is_whole = False
        sys.stdout.write(WHOLE if is_whole else TORN)
        sys.stdout.flush()

    receive: Any = take
    node.create_subscription(PointCloud2, 'torn', receive, STREAM_INPUT, raw=True)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    executor.spin()


def start(role: str, records: int) -> subprocess.Popen[str]:
    """Start one of the two."""
    return subprocess.Popen(
        [sys.executable, __file__, role, str(records)], stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL, text=True, start_new_session=True)


def kill(process: subprocess.Popen[str]) -> None:
    """Kill it at once."""
    os.killpg(process.pid, signal.SIGKILL)


def look(records: int, seconds: float) -> tuple[int, int, int]:
    """Return how many readers were killed, and messages, whole and torn."""
    until = time.monotonic() + seconds
    written: list[str] = []

    def serve() -> None:
        while time.monotonic() < until:
            reader = start('read', records)
            killer = threading.Timer(random.uniform(1.5, 4.0), kill, [reader])
            killer.start()
            written.append(reader.communicate()[0])
            killer.join()

    publisher = start('publish', records)
    try:
        threads = [threading.Thread(target=serve) for _ in range(READERS)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        kill(publisher)
        publisher.wait()
    letters = ''.join(written)
    return len(written), letters.count(WHOLE), letters.count(TORN)


def main() -> int:
    """Look at both sizes; exit status 1 if those of the simulator are torn."""
    if sys.argv[1:2] == ['publish']:
        publish(int(sys.argv[2]))
    if sys.argv[1:2] == ['read']:
        read(int(sys.argv[2]))
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    torn = 0
    for records in (FRAGMENTED, LARGEST_BATCH):
        readers, whole, torn = look(records, seconds)
        print(f'{records:5d} records, {records * POINT.itemsize / 1000:.0f} kB: {readers} readers '
              f'killed, {whole} messages whole, {torn} torn', flush=True)
    return int(torn > 0)


if __name__ == '__main__':
    sys.exit(main())
