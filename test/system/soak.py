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
The whole suite for a long time: memory flat, nothing lost, diagnostics right, the bag whole.

    python test/system/soak.py --minutes 20 --rate 10 --change 1    # parameters every second
    python test/system/soak.py --minutes 20 --rate 0                # as fast as the nodes keep up

Runs `suite`, changes its parameters at random, samples the memory of every process, and at the
end pauses the simulator and compares the reports of the nodes with each other and with the bag.
Exit status 1, and a line for each, where a promise is broken. The run ends early when the bag has
reached --bag-limit.
"""

import argparse
from collections.abc import Iterator, Mapping
import os
from pathlib import Path
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from mcap.reader import make_reader
import numpy as np
from rcl_interfaces.srv import SetParametersAtomically
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool

from gear_rattle_ros.bags import Bag
from gear_rattle_ros.core.stream.guard import StreamGuard
from gear_rattle_ros.start import EXECUTABLES

NODES = ('simulator', 'lyapunov', 'transients', 'recorder', 'viewer')
# DDS keeps the largest backlog it ever had as a pool: memory climbs in a few steps, then stays.
WARM_UP = 0.5
BLOCKS = 10
# The recorder keeps so much of every chunk of a file of the bag until it begins the next [kB].
INDEX_OF_A_CHUNK = 1.2
# After a pause everything under way has arrived within this time [s].
SETTLED_WITHIN = 120.0
# Diagnostics are due once a second; longer silence than this is a fault [s].
LONGEST_SILENCE = 15.0
RANGES = {
    'alpha': (0.0, 2.0), 'beta': (0.0, 0.3), 'gamma': (-0.3, 0.3), 'restitution': (0.3, 1.0),
    'noise': (0.0, 0.01)}


class Watch(Node):
    """Listens to the diagnostics and steers the simulator."""

    def __init__(self) -> None:
        """Subscribe."""
        super().__init__('soak')
        self.said: dict[str, dict[str, str]] = {}
        self.heard: dict[str, float] = {}
        self.silence: dict[str, float] = {}
        self.warnings: dict[str, int] = {}
        self.create_subscription(DiagnosticArray, '/diagnostics', self._take, 100)
        self.setter = self.create_client(
            SetParametersAtomically, 'simulator/set_parameters_atomically')
        self.pauser = self.create_client(SetBool, 'simulator/pause')

    def _take(self, message: DiagnosticArray) -> None:
        now = time.monotonic()
        for status in message.status:
            name = status.name.split(':')[0]
            self.said[name] = {item.key: item.value for item in status.values}
            self.silence[name] = max(
                self.silence.get(name, 0.0), now - self.heard.get(name, now))
            self.heard[name] = now
            if status.level != DiagnosticStatus.OK:
                words = f'{name}: {"".join(c for c in status.message if not c.isdigit())}'
                self.warnings[words] = self.warnings.get(words, 0) + 1


def processes(suite: int) -> dict[str, int]:
    """Return the process numbers of the suite and its nodes by name."""
    found = {'suite': suite}
    for child in Path(f'/proc/{suite}/task/{suite}/children').read_text().split():
        words = Path(f'/proc/{child}/cmdline').read_text().split('\0')
        name = next((word for word in words if word in NODES), None)
        if name is not None:
            found[name] = int(child)
    return found


def anonymous_memory(process: int) -> int:
    """Return the memory that a process holds for itself [kB]."""
    status = Path(f'/proc/{process}/status').read_text()
    return int(status.split('RssAnon:')[1].split()[0])


def slope(samples: list[tuple[float, int]]) -> tuple[float, float]:
    """Return the slope of memory after the warm-up and its standard error [kB/min]."""
    times, sizes = np.array(samples, float).T
    kept = times >= times[0] + WARM_UP * (times[-1] - times[0])
    # Memory moves in steps that last: means of blocks stand for as many independent values.
    x = np.array([part.mean() for part in np.array_split(times[kept] / 60.0, BLOCKS)])
    y = np.array([part.mean() for part in np.array_split(sizes[kept], BLOCKS)])
    x -= x.mean()
    estimate = float(x @ y / (x @ x))
    rest = y - y.mean() - estimate * x
    return estimate, float(np.sqrt(rest @ rest / (BLOCKS - 2) / (x @ x)))


class Soak:
    """One run of the suite."""

    def __init__(self, options: argparse.Namespace, folder: Path) -> None:
        """Start the suite."""
        self.options = options
        self.bag = folder / 'run' / 'bag'
        self.memory: dict[str, list[tuple[float, int]]] = {}
        self.changes = 0
        self.values: dict[str, float] = {}
        self.faults: list[str] = []
        self.random = random.Random(options.seed)
        self.suite = subprocess.Popen(
            [sys.executable, '-m', 'gear_rattle_ros.start', 'suite', '--duration', '0',
             '--alpha', '0.57', '--noise', '0.001', '--viewer', 'none', '--rate',
             str(options.rate), '--output', str(folder / 'run')],
            stdin=subprocess.DEVNULL, stdout=open(folder / 'suite.log', 'wb'),
            stderr=subprocess.STDOUT, start_new_session=True)
        self.watch = Watch()
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.watch)

    def expect(self, holds: bool, words: str) -> None:
        """Take down what does not hold."""
        if not holds:
            self.faults.append(words)

    def run(self) -> None:
        """Run for the time asked for, and stop."""
        self.until(lambda: all(name in self.watch.said for name in NODES)
                   and int(self.watch.said['recorder']['impacts']) > 0, 180.0, 'no impacts')
        self.watch.silence.clear()
        end = time.monotonic() + 60.0 * self.options.minutes
        sampled = changed = time.monotonic()
        while time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.1)
            if self.suite.poll() is not None:
                raise SystemExit(f'the suite has ended with status {self.suite.returncode}')
            now = time.monotonic()
            if now - sampled >= 1.0:
                sampled = now
                for name, process in processes(self.suite.pid).items():
                    self.memory.setdefault(name, []).append((now, anonymous_memory(process)))
                if self.bag_size() > 1e9 * self.options.bag_limit:
                    print(f'the bag has reached {self.options.bag_limit:g} GB', flush=True)
                    break
            if self.options.change and now - changed >= self.options.change:
                changed = now
                self.change()
        self.settle()
        self.suite.send_signal(signal.SIGINT)
        status = self.suite.wait(300)
        self.expect(status == 0, f'the suite ended with status {status}')

    def bag_size(self) -> int:
        """Return the size of the bag so far."""
        return sum(path.stat().st_size for path in self.bag.glob('*.mcap'))

    def chunks(self) -> int:
        """Return how many chunks the bag has."""
        count = 0
        for path in self.bag.glob('*.mcap'):
            with open(path, 'rb') as stream:
                summary = make_reader(stream).get_summary()
                count += summary.statistics.chunk_count if summary else 0
        return count

    def until(self, condition, within: float, words: str) -> None:
        """Spin until something holds, or take down that it does not."""
        deadline = time.monotonic() + within
        while not condition():
            if time.monotonic() > deadline:
                self.faults.append(f'{words} within {within:g} s')
                return
            self.executor.spin_once(timeout_sec=0.1)

    def call(self, client, request):
        """Call a service of the simulator."""
        future = client.call_async(request)
        self.until(future.done, 60.0, f'{client.srv_name} did not answer')
        return future.result()

    def change(self) -> None:
        """Set one to three parameters to random values."""
        names = self.random.sample(sorted(RANGES), self.random.randint(1, 3))
        values = {name: self.random.uniform(*RANGES[name]) for name in names}
        answer = self.call(self.watch.setter, SetParametersAtomically.Request(parameters=[
            Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]))
        self.expect(answer.result.successful, f'{values} refused: {answer.result.reason}')
        self.changes += set(names) != {'noise'}
        self.values.update(values)

    def settle(self) -> None:
        """Pause, and wait until every node has reported that it has everything."""
        self.call(self.watch.pauser, SetBool.Request(data=True))
        since = time.monotonic()
        self.until(lambda: min(self.watch.heard.values()) > since + 1.5 and not any(
            self.disagreements()), SETTLED_WITHIN, 'the nodes did not agree')
        self.faults.extend(self.disagreements())

    def disagreements(self) -> Iterator[str]:
        """Return where the diagnostics of the nodes contradict each other or this run."""
        said = self.watch.said
        simulator, viewer = said['simulator'], said['viewer']
        impacts = int(simulator['impacts'])
        for name, found in (
            ('lyapunov', int(said['lyapunov']['index'])),
            ('recorder', int(said['recorder']['impacts'])),
            ('viewer', int(viewer['impacts_drawn']) + int(viewer['impacts_thinned_out'])),
        ):
            if found != impacts:
                yield f'{name} reports {found} impacts, the simulator {impacts}'
        for name in ('lyapunov', 'simulator'):
            if int(said[name]['epoch']) != self.changes:
                yield f'{name} reports epoch {said[name]["epoch"]} after {self.changes} changes'
        for name, value in self.values.items():
            if float(simulator[name]) != value:
                yield f'the simulator reports {name} = {simulator[name]} instead of {value!r}'
        for name in NODES[1:]:
            for key in ('gaps', 'lost_impacts', 'restarts', 'refused_batches', 'messages_lost'):
                if int(said[name].get(key, 0)):
                    yield f'{name} reports {key} = {said[name][key]}'

    def check_bag(self) -> None:
        """Compare the bag with what was reported."""
        guard, impacts, pieces = StreamGuard(), 0, 0
        for events in Bag(self.bag).events():
            pieces += sum(not piece.follows for piece in guard.split(events))
            impacts += int(np.count_nonzero(events['kind'] <= 1))
        said = int(self.watch.said['simulator']['impacts'])
        self.expect(pieces == 1 and guard.first_index == 0,
                    f'the bag has {guard.gaps} gaps, {guard.lost} impacts lost')
        self.expect(impacts == said,
                    f'the bag has {impacts} impacts, the simulator reported {said}')
        print(f'bag: {impacts} impacts, {self.bag_size() / max(impacts, 1):.1f} bytes each, '
              f'{guard.gaps} gaps', flush=True)
        if 'verify' in EXECUTABLES:
            command = [sys.executable, '-m', 'gear_rattle_ros.start', 'verify', str(self.bag)]
            status = subprocess.run(command).returncode
            self.expect(status == 0, f'verify ended with status {status}')

    def print_memory(self) -> None:
        """Print and judge the memory of every process."""
        for name, samples in self.memory.items():
            np.savetxt(self.bag.parent / f'memory_{name}.txt', samples, '%.1f')
            rate, error = slope(samples)
            sizes = [size for _, size in samples]
            begin = sizes[int(WARM_UP * len(sizes))]
            print(f'{name:10} {begin / 1e3:7.1f} MB after warm-up, {sizes[-1] / 1e3:7.1f} MB at '
                  f'the end, {max(sizes) / 1e3:7.1f} MB at most; {rate:+.1f} +- {error:.1f} '
                  'kB/min', flush=True)
            limit = self.options.slope_limit
            if name == 'recorder':
                limit += INDEX_OF_A_CHUNK * self.chunks() * 60.0 / len(samples)
            self.expect(rate - 2.0 * error < limit,
                        f'memory of {name} grows by {rate:.1f} +- {error:.1f} kB/min')

    def report(self) -> int:
        """Print what was found; the exit status is 1 where something does not hold."""
        self.print_memory()
        for name, seconds in self.watch.silence.items():
            self.expect(seconds < LONGEST_SILENCE, f'no diagnostics of {name} for {seconds:.0f} s')
        print(f'{self.changes} retunes; longest silence of a node '
              f'{max(self.watch.silence.values()):.1f} s', flush=True)
        warnings: Mapping[str, int] = self.watch.warnings
        for words, count in warnings.items():
            print(f'warned {count} times: {words}')
        self.check_bag()
        for fault in dict.fromkeys(self.faults):
            print(f'NOT KEPT: {fault}')
        return 1 if self.faults else 0


def main() -> int:
    """Run a soak; exit status 0 if every promise is kept."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    add = parser.add_argument
    add('--minutes', type=float, default=20.0, help='length (%(default)s)')
    add('--rate', type=float, default=10.0, help='drive periods per second; 0 = full rate')
    add('--change', type=float, default=0.0, help='seconds between changes; 0 = none')
    add('--seed', type=int, default=0, help='of the changes (%(default)s)')
    add('--slope-limit', type=float, default=300.0, help='kB/min (%(default)s)')
    add('--bag-limit', type=float, default=20.0, help='GB (%(default)s)')
    add('--folder', type=Path, help='keep everything here')
    options = parser.parse_args()
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    folder = options.folder or Path(tempfile.mkdtemp(prefix='soak_'))
    folder.mkdir(exist_ok=True)
    rclpy.init()
    soak = Soak(options, folder)
    try:
        soak.run()
        return soak.report()
    finally:
        if soak.suite.poll() is None:
            soak.suite.terminate()
            soak.suite.wait(60)
        if options.folder is None:
            shutil.rmtree(folder)


if __name__ == '__main__':
    sys.exit(main())
