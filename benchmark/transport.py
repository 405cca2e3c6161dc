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
Impacts per second from the simulator over DDS into the exponents, and nothing lost.

To one reader and to five, as in a suite; to five also with the shared memory that Fast DDS has by
default. The peer, in the same run, is stock rclpy: one small message per impact, reliable and
keep_all on both sides so that nothing is lost there either.
Run: make bench, or python benchmark/transport.py
"""

import array
import os
import subprocess
import sys
import tempfile
import time

from diagnostic_msgs.msg import DiagnosticArray
import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float64MultiArray

from gear_rattle_ros.nodes.base.dds_room import PROFILES

SECONDS = 10.0
READERS = 5
# With these it takes a while until messages are sent again that were overwritten.
LONGER = 30.0
KEEP_ALL = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)


def node(*words: str, environment: dict[str, str] | None = None) -> subprocess.Popen[bytes]:
    """Start a node of the package, in a session of its own, as the suite does and terminals do."""
    return subprocess.Popen(
        [sys.executable, '-m', 'gear_rattle_ros.start', *words], stderr=subprocess.DEVNULL,
        env={**os.environ, **(environment or {})}, start_new_session=True)


def suite_rate(readers: int, seconds: float = SECONDS,
               environment: dict[str, str] | None = None) -> tuple[float, int]:
    """Return impacts per second that each of the readers takes in, and how many were lost."""
    listener = rclpy.create_node('listener')
    found: list[tuple[float, int]] = []
    lost: dict[str, int] = {}

    def take(message: DiagnosticArray) -> None:
        status = message.status[0]
        values = {item.key: item.value for item in status.values}
        if status.name.startswith('reader') and int(values['events']):
            lost[status.name] = int(values['lost_impacts'])
            if status.name.startswith('reader_0'):
                found.append((time.monotonic(), int(values['events'])))

    listener.create_subscription(DiagnosticArray, '/diagnostics', take, 100)
    processes = [
        *(node('lyapunov', '--ros-args', '-r', f'__node:=reader_{number}')
          for number in range(readers)),
        node('simulator', '--ros-args', '-p', 'rate:=0.0', '-p', 'alpha:=1.244', '-p',
             f'wait_for_readers:={readers}', environment=environment),
    ]
    try:
        while len(found) < 2 or found[-1][0] - found[1][0] < seconds:
            rclpy.spin_once(listener, timeout_sec=0.1)
            if any(process.poll() is not None for process in processes):
                raise SystemExit('a node has ended')
    finally:
        for process in reversed(processes):
            process.terminate()
            process.wait()
        listener.destroy_node()
    # The first second is start-up.
    (t0, n0), (t1, n1) = found[1], found[-1]
    return (n1 - n0) / (t1 - t0), sum(lost.values())


def count_messages() -> None:
    """Subscribe to single impacts for a while and print rate and losses."""
    rclpy.init()
    subscriber = rclpy.create_node('subscriber')
    seen: list[float] = []
    times: list[float] = []

    def take(message: Float64MultiArray) -> None:
        seen.append(message.data[0])
        times.append(time.monotonic())

    subscriber.create_subscription(Float64MultiArray, 'impact', take, KEEP_ALL)
    while not times or times[-1] - times[0] < SECONDS:
        rclpy.spin_once(subscriber, timeout_sec=1.0)
    lost = seen[-1] - seen[0] + 1 - len(seen)
    print((len(seen) - 1) / (times[-1] - times[0]), int(lost), flush=True)


def stock_rate() -> tuple[float, int]:
    """Return impacts per second of one message per impact, and how many were lost."""
    publisher_node = rclpy.create_node('publisher')
    publisher = publisher_node.create_publisher(Float64MultiArray, 'impact', KEEP_ALL)
    child = subprocess.Popen([sys.executable, __file__, 'subscriber'], stdout=subprocess.PIPE)
    while not publisher.get_subscription_count():
        time.sleep(0.02)
    index = 0
    message = Float64MultiArray()
    while child.poll() is None:
        message.data = array.array('d', [float(index)] + 9 * [0.5])
        try:
            publisher.publish(message)
            index += 1
        except RCLError:
            # The queue is full: this is how keep_all holds its publisher back.
            time.sleep(0.001)
    publisher_node.destroy_node()
    rate, lost = child.communicate()[0].split()
    return float(rate), int(lost)


def main() -> None:
    """Measure all and print the ratios."""
    rclpy.init()
    with tempfile.NamedTemporaryFile('w', suffix='.xml') as file:
        file.write('<dds xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles"/>')
        file.flush()
        rows = [
            ('simulator -> DDS -> lyapunov', *suite_rate(1)),
            (f'simulator -> DDS -> {READERS} times lyapunov', *suite_rate(READERS, LONGER)),
            ("the same with Fast DDS's own 512 KB",
             *suite_rate(READERS, LONGER, dict.fromkeys(PROFILES, file.name))),
            ('stock rclpy, one message per impact', *stock_rate()),
        ]
    rclpy.try_shutdown()
    print(f'{"":40} {"impacts/s":>12} {"lost":>6}')
    for name, rate, lost in rows:
        print(f'{name:40} {rate:12,.0f} {lost:6}')
    one, many, default, stock = (rate for _, rate, _ in rows)
    print(f'ratios: one reader to stock {one / stock:.0f}, {READERS} readers to those with '
          f'512 KB {many / default:.1f}')


if __name__ == '__main__':
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    os.environ.setdefault('ROS_DOMAIN_ID', '77')
    count_messages() if sys.argv[1:] == ['subscriber'] else main()
