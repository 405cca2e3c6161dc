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
What a killed recorder leaves behind: SIGKILL at random moments under load.

The simulator publishes without pause; a recorder is killed 0.2 to 4 s after its first impacts,
again and again. Every impact that was sent more than a second before the kill must be in the bag
it leaves, without a hole and bit for bit what follows from the one before, and `recover` must make
of it a bag with an index and the same impacts. Exit status 1 if not. A reader beside it that does
nothing shows whether the machine lets anybody read in time; if it does not, the age of the lost
impacts is reported, not judged.
Run: make bench, or python benchmark/crash.py [kills [drive periods per second]]
"""

from collections.abc import Mapping
import os
from pathlib import Path
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from typing import Any

from mcap.reader import make_reader
import rclpy
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import PointCloud2

from gear_rattle_ros.bags import Bag, CloudDecoder
from gear_rattle_ros.bags.recover import recover
from gear_rattle_ros.core.stream.succession import Succession
from gear_rattle_ros.qos import STREAM_INPUT

# What must be readable is older than this when the recorder is killed [s].
PROMISED = 1.0
# The reader beside it must not be later than this [s].
LATE = 0.25
# Size of a file in which there are impacts [byte].
BEGUN = 20_000
# Drive periods per second; 1.2 impacts in each.
RATE = 100_000.0


def start(name: str, *parameters: str) -> subprocess.Popen[bytes]:
    """Start a node."""
    given = [word for parameter in parameters for word in ('-p', parameter)]
    return subprocess.Popen(
        [sys.executable, '-m', 'gear_rattle_ros.start', name, '--ros-args', *given],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)


class Witness:
    """Another reader, which knows when the simulator sent each impact."""

    def __init__(self) -> None:
        self.sent: list[tuple[int, int]] = []
        self.late: list[tuple[int, float]] = []
        self._decoder = CloudDecoder()
        self._node = rclpy.create_node('witness')
        receive: Any = self._receive
        self._node.create_subscription(PointCloud2, 'impacts', receive, STREAM_INPUT, raw=True)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End its thread."""
        self._executor.shutdown()
        self._thread.join()

    def newest(self, before: int) -> int:
        """Return the number of the last impact that was sent before a moment [ns]."""
        return max(index for sent, index in list(self.sent) if sent < before)

    def sent_behind(self, index: int) -> int | None:
        """Return when the first impact after a number was sent [ns]."""
        return min((sent for sent, last in list(self.sent) if last > index), default=None)

    def _receive(self, data: bytes, info: Mapping[str, Any]) -> None:
        records = self._decoder.columns(data, ['index'])
        now, sent = time.time_ns(), info['source_timestamp']
        self.sent.append((sent, int(records['index'][-1])))
        self.late.append((now, (now - sent) / 1e9))

    def lateness(self, since: int) -> float:
        """Return how late it was at the most since a moment [s]."""
        return max((late for now, late in list(self.late) if now >= since), default=60.0)


def kill_one(witness: Witness, directory: Path, pause: float) -> tuple[str, str]:
    """Record, kill, read; return what came out, and how the promise was kept."""
    bag = directory / 'bag'
    recorder = start('recorder', f'output:={bag}')
    try:
        file = bag / 'bag_0.mcap'
        while not file.exists() or file.stat().st_size < BEGUN:
            time.sleep(0.02)
        time.sleep(pause)
    finally:
        killed = time.time_ns()
        os.killpg(recorder.pid, signal.SIGKILL)
        recorder.wait()
    succession = Succession()
    last, fault = -1, ''
    try:
        for events in Bag(bag).events():
            wrong = succession.take(events)
            fault = fault or (wrong.what if wrong else '')
            last = int(events['index'][-1])
    except ValueError as error:
        fault = str(error)
    needed = witness.newest(killed - round(PROMISED * 1e9))
    behind = witness.sent_behind(last)
    lost = 0.0 if behind is None or behind > killed else (killed - behind) / 1e9
    recover(bag, directory / 'recovered')
    with (directory / 'recovered' / 'recovered_0.mcap').open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True)
        again = sum(1 for _ in reader.iter_messages(['/impacts']))
    batches = sum(1 for _ in Bag(bag).messages(['/impacts']))
    is_whole = not fault and not succession.holes and again == batches
    late = witness.lateness(killed - 5_000_000_000)
    verdict = 'BROKEN'
    if is_whole and last >= needed:
        verdict = 'kept'
    elif is_whole and late > LATE:
        verdict = f'not judged, the reader beside it was {late:.2f} s late'
    return (f'{succession.events:8d} events whole, the oldest impact lost was sent {lost:.2f} s '
            f'before the kill{"; " + fault if fault else ""}'
            f'{f"; {len(succession.holes)} holes" if succession.holes else ""}'
            f'{f"; recovered {again} of {batches} batches" if again != batches else ""}', verdict)


def main() -> int:
    """Kill recorders again and again; exit status 1 if the promise was ever broken."""
    kills = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    directory = Path(tempfile.mkdtemp(prefix='crash_'))
    broken = kept = 0
    rate = float(sys.argv[2]) if len(sys.argv) > 2 else RATE
    # With noise it does not settle on an orbit, whose records would compress to nothing.
    simulator = start('simulator', 'alpha:=0.57', 'noise:=0.001', f'rate:={rate}')
    witness = None
    try:
        rclpy.init()
        witness = Witness()
        while not witness.sent:
            time.sleep(0.05)
        for number in range(kills):
            place = directory / str(number)
            place.mkdir()
            words, verdict = kill_one(witness, place, random.uniform(0.2, 4.0))
            print(f'kill {number + 1:2d}  {words}: {verdict}', flush=True)
            broken += verdict == 'BROKEN'
            kept += verdict == 'kept'
            shutil.rmtree(place)
    finally:
        os.killpg(simulator.pid, signal.SIGKILL)
        simulator.wait()
        if witness is not None:
            witness.close()
        rclpy.try_shutdown()
        shutil.rmtree(directory)
    print(f'{kills} kills: the promise was kept {kept} times and broken {broken} times')
    return 1 if broken else 0


if __name__ == '__main__':
    sys.exit(main())
