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
Impacts per second that the recorder writes, end to end over DDS in two processes, nothing lost.

A publisher sends simulated impacts faster than a million a second for a minute, as fast as they
are acknowledged at the most. The peer, in the same run, is mcap's own Writer with one message per
impact and no DDS in front of it. Run: make bench, or python benchmark/recorder.py [seconds]
"""

import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys
import tempfile
import time

from builtin_interfaces.msg import Time
from mcap.writer import Writer
import numpy as np
import rclpy
from rclpy.duration import Duration
from rclpy.serialization import serialize_message
from sensor_msgs.msg import PointCloud2

from gear_rattle_ros.bags import Bag, CloudDecoder
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EventArray, Parameters, State
from gear_rattle_ros.core.stream.event_points import POINT
from gear_rattle_ros.core.stream.guard import StreamGuard
from gear_rattle_ros.messages import cloud_from_events
from gear_rattle_ros.qos import STREAM

BATCH = 1024
RATE = 1.1e6
WINDOW = 64


def chaotic(count: int) -> EventArray:
    """Return impacts that a little noise keeps chaotic: a periodic orbit compresses away."""
    simulation = Simulation(Parameters(0.57), State(0, 0.0, 0.0, -0.5), noise=1e-3)
    events = simulation.advance(10**9, 0.0, count + 1000)
    return events[events['kind'] == 0][:count]


def publish(seconds: float) -> None:
    """Send the same million impacts again and again, numbered on."""
    events = chaotic(1000 * BATCH)
    clouds = [
        bytearray(serialize_message(cloud_from_events(events[start:start + BATCH], Time())))
        for start in range(0, len(events), BATCH)]
    points = [np.frombuffer(CloudDecoder().parse(cloud).data, POINT) for cloud in clouds]
    numbers = np.arange(1, BATCH + 1, dtype=np.uint32)
    rclpy.init()
    node = rclpy.create_node('impacts_source')
    publisher = node.create_publisher(PointCloud2, 'impacts', STREAM)
    while not publisher.get_subscription_count():
        time.sleep(0.02)
    begin = time.monotonic()
    sent = 0
    while (passed := time.monotonic() - begin) < seconds:
        ahead = sent * BATCH / RATE - passed
        if ahead > 0:
            time.sleep(ahead)
        place = sent % len(clouds)
        points[place]['index'] = numbers + np.uint32(sent * BATCH % 2**32)
        publisher.publish(bytes(clouds[place]))
        sent += 1
        if sent % WINDOW == 0:
            while not publisher.wait_for_all_acked(Duration(nanoseconds=20_000_000)):
                pass
    print(sent * BATCH, begin, begin + passed, flush=True)
    publisher.wait_for_all_acked(Duration(seconds=10))
    rclpy.shutdown()


def peer(path: Path) -> tuple[float, float]:
    """Return impacts per second and bytes per impact of one message per impact."""
    events = chaotic(300_000)
    messages = [event.tobytes() for event in events]
    begin = time.monotonic()
    with path.open('wb') as stream:
        writer = Writer(stream)
        writer.start()
        channel = writer.register_channel('impacts', 'raw', 0)
        for number, message in enumerate(messages):
            writer.add_message(channel, number, message, number)
        writer.finish()
    return len(messages) / (time.monotonic() - begin), path.stat().st_size / len(messages)


def measure(seconds: float, directory: Path) -> None:
    """Record from another process, check the bag and print what it took."""
    bag = directory / 'bag'
    recorder = subprocess.Popen(
        [sys.executable, '-m', 'gear_rattle_ros.start', 'recorder', '--ros-args', '-p',
         f'output:={bag}'], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    source = None
    try:
        while not bag.exists():
            time.sleep(0.05)
        source = subprocess.Popen([sys.executable, __file__, 'publish', str(seconds)],
                                  stdout=subprocess.PIPE, text=True)
        sent, begin, end = map(float, source.communicate()[0].split())
        recorder.send_signal(signal.SIGINT)
        line = recorder.stdout.read().strip()
        later = time.monotonic() - end
        _, _, usage = os.wait4(recorder.pid, 0)
    finally:
        for process in (source, recorder):
            if process is not None and process.poll() is None:
                process.kill()
                process.wait()
    guard, found = StreamGuard(), 0
    for events in Bag(bag).events():
        guard.split(events)
        found += len(events)
    size = (bag / 'bag_0.mcap').stat().st_size
    print(line)
    took = end - begin
    speed = sent * POINT.itemsize / took / 1e6
    print(f'recorder    {sent / took:.3g} impacts/s ({speed:.0f} MB/s) for {took:.1f} s, '
          f'bag closed {later:.1f} s later; {int(sent) - found} of {int(sent)} missing, '
          f'{guard.gaps} gaps when read back; '
          f'{size / found:.1f} bytes per impact; '
          f'{(usage.ru_utime + usage.ru_stime) / took:.2f} cores, {usage.ru_maxrss / 1e3:.0f} MB')


def main() -> None:
    """Print both rates."""
    if sys.argv[1:2] == ['publish']:
        publish(float(sys.argv[2]))
        return
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    directory = Path(tempfile.mkdtemp(prefix='recorder_'))
    try:
        measure(seconds, directory)
        rate, size = peer(directory / 'peer.mcap')
        print(f'mcap.Writer {rate:.3g} impacts/s, one message each, without DDS; '
              f'{size:.1f} bytes per impact')
    finally:
        shutil.rmtree(directory)


if __name__ == '__main__':
    main()
