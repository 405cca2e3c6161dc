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
Events per second that `verify` rebuilds and reproduces from a bag, with exponents and transients.

The peer, in the same run, is rosbags, which only reads the same bag and takes its messages apart.
Run: make bench, or python benchmark/verify.py [events]
"""

from pathlib import Path
import shutil
import sys
import tempfile
import time

from builtin_interfaces.msg import Time
import numpy as np
from rclpy.serialization import serialize_message
from rosbags.highlevel import AnyReader

from gear_rattle_ros.bags import BagWriter, message_definition, Topic
from gear_rattle_ros.bags.verify import verify
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import Parameters, State
from gear_rattle_ros.messages import cloud_from_events

BATCH = 1024
TYPE = 'sensor_msgs/msg/PointCloud2'


def make(path: Path, count: int) -> None:
    """Record a chaotic run, noise and all."""
    writer = BagWriter(path)
    definition = message_definition(TYPE, lambda package: f'{sys.prefix}/share/{package}')
    channel = writer.add_topic(Topic('/impacts', TYPE, definition, '', ()))
    simulation = Simulation(Parameters(0.57), State(velocity=-0.5), noise=1e-3)
    for number in range(count // BATCH):
        events = simulation.advance(10**12, 0.0, BATCH)
        writer.write(channel, number, number, number,
                     serialize_message(cloud_from_events(events, Time(sec=number))))
    writer.close()


def main() -> int:
    """Print both rates; exit status 1 if the bag does not verify."""
    count = int(float(sys.argv[1])) if len(sys.argv) > 1 else 3_000_000
    directory = Path(tempfile.mkdtemp(prefix='verify_'))
    try:
        make(directory / 'small', 2 * BATCH)
        verify(directory / 'small')
        make(directory / 'bag', count)
        busy = time.process_time()
        verdict = verify(directory / 'bag')
        busy = time.process_time() - busy
        print(f'{verdict}; {verdict.events / busy:.2g} events per second of CPU')
        begin = time.monotonic()
        with AnyReader([directory / 'bag']) as reader:
            points = sum(np.asarray(reader.deserialize(data, connection.msgtype).data).nbytes > 0
                         for connection, _, data in reader.messages())
        took = time.monotonic() - begin
        print(f'rosbags reads its {points} messages, and no more, in {took:.2f} s '
              f'({verdict.events / took:.2g} events/s)')
    finally:
        shutil.rmtree(directory)
    return 0 if verdict.is_verified else 1


if __name__ == '__main__':
    sys.exit(main())
