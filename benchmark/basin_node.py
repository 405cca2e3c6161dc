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
How soon the basin node answers a change, and what it costs the simulator.

Prints the time from the call that changes alpha to the first and to the 400 x 400 picture at it,
while simulator, exponents and transients run; then impacts per second through all of them flat
out while alpha keeps changing, without and with the basin node in turn. A picture that did not
come in time is infinitely late. Last, the processor time of the skeleton at each alpha, and the
longest time for which it cannot be given up. The exit status is 1 where impacts were lost.
"""

from collections.abc import Iterator
import contextlib
import os
from pathlib import Path
import subprocess
import sys
import tempfile
import time

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
from rcl_interfaces.srv import SetParameters
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from gear_rattle_ros.attractors.finding import find_attractors
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.attractors.skeleton.skeleton import skeletons
from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.qos import LATCHED, STREAM

# Alphas of the paper's stories: two periodic attractors, one of them chaotic, chaos alone, before
# and after the crisis.
ALPHAS = (0.48, 0.57, 0.5, 1.0, 1.23, 1.244)
ROUNDS = 3
STAY = 3.0
FLAT_OUT = 10.0
OTHERS = ('lyapunov', 'transients')


class Watch:
    """Sets alpha, and notes when pictures come and how many impacts have gone by."""

    def __init__(self) -> None:
        self.node = rclpy.create_node('basin_benchmark')
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self.pictures: list[tuple[float, float, int]] = []
        self.impacts = self.lost = 0
        self._client = self.node.create_client(SetParameters, 'simulator/set_parameters')
        self.node.create_subscription(DiagnosticArray, 'basin_state', self._take_state, LATCHED)
        self.node.create_subscription(JointState, 'lyapunov', self._take_exponents, STREAM)
        self.node.create_subscription(DiagnosticArray, '/diagnostics', self._take_report, 10)

    def spin(self, seconds: float) -> None:
        """Listen for some time."""
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def set_alpha(self, alpha: float) -> float:
        """Return when alpha was asked for."""
        now = time.monotonic()
        future = self._client.call_async(SetParameters.Request(
            parameters=[Parameter('alpha', value=alpha).to_parameter_msg()]))
        self._executor.spin_until_future_complete(future, timeout_sec=20.0)
        return now

    def wait_for_impacts(self) -> None:
        """Wait until the whole chain runs."""
        while not self.impacts:
            self.spin(0.1)

    def _take_state(self, message: DiagnosticArray) -> None:
        values = {item.key: item.value for item in message.status[0].values}
        self.pictures.append((time.monotonic(), float(values['alpha']), int(values['size'])))

    def _take_exponents(self, message: JointState) -> None:
        self.impacts = int(message.position[message.name.index('index')])

    def _take_report(self, message: DiagnosticArray) -> None:
        for status in message.status:
            for item in status.values:
                if item.key == 'lost_impacts':
                    self.lost = max(self.lost, int(item.value))


@contextlib.contextmanager
def running(rate: float, names: tuple[str, ...], logs: Path) -> Iterator[Watch]:
    """Run a simulator and some nodes, and end them."""
    arguments = {'simulator': ['--ros-args', '-p', f'rate:={rate}', '-p',
                               f'wait_for_readers:={len(names)}']}
    processes = []
    rclpy.init()
    try:
        for name in (*names, 'simulator'):
            with open(logs / f'{name}.log', 'wb') as log:
                processes.append(subprocess.Popen(
                    [sys.executable, '-m', 'gear_rattle_ros.start', name,
                     *arguments.get(name, [])], stdout=log, stderr=log,
                    start_new_session=True))
        watch = Watch()
        watch.wait_for_impacts()
        yield watch
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            process.wait()
        rclpy.try_shutdown()


def quantiles(values: list[float]) -> str:
    """Return a distribution in words."""
    return 'median {:.0f} ms, 90 % {:.0f} ms, largest {:.0f} ms'.format(
        *(1e3 * np.quantile(values, (0.5, 0.9, 1.0), method='higher')))


def latencies(logs: Path) -> None:
    """Change alpha again and again while the suite runs at its usual speed."""
    first: list[float] = []
    fine: dict[float, list[float]] = {alpha: [] for alpha in ALPHAS}
    with running(1000.0, (*OTHERS, 'basin'), logs) as watch:
        watch.spin(STAY)
        for alpha in [alpha + 1e-4 * turn for turn in range(ROUNDS) for alpha in ALPHAS]:
            asked = watch.set_alpha(alpha)
            watch.spin(STAY)
            here = [(when - asked, size) for when, value, size in watch.pictures if value == alpha]
            first.append(min((after for after, _ in here), default=float('inf')))
            fine[min(ALPHAS, key=lambda one, alpha=alpha: abs(one - alpha))].append(
                min((after for after, size in here if size >= 400), default=float('inf')))
    print(f'first picture after a change of alpha ({len(first)} changes): {quantiles(first)}')
    for alpha, values in fine.items():
        print(f'400 x 400 at alpha {alpha:5g}: {quantiles(values)}')


def flat_out(title: str, names: tuple[str, ...], logs: Path, changes: bool) -> tuple[float, int]:
    """Return impacts per second with nobody left behind, and how many were lost."""
    with running(0.0, names, logs) as watch:
        watch.spin(1.0)
        began, before = time.monotonic(), watch.impacts
        alphas = iter(np.linspace(0.47, 0.6, 1000))
        while time.monotonic() - began < FLAT_OUT:
            if changes:
                watch.set_alpha(float(next(alphas)))
            watch.spin(0.5)
        rate = (watch.impacts - before) / (time.monotonic() - began)
        watch.spin(1.5)
        print(f'{title}: {rate:.3g} impacts/s, {watch.lost} lost')
        return rate, watch.lost


def skeleton(alpha: float) -> None:
    """Compute a skeleton in this process, and print what it costs."""
    parameters, plane = Parameters(alpha), Plane(velocity=(-1.5, 1.5))
    catalogue = find_attractors(parameters, plane.draw(parameters, 256, 1), hold=2000, threads=1)
    looks = [time.process_time()]
    parts = [time.process_time() for _ in skeletons(
        catalogue, {}, plane, lambda: looks.append(time.process_time()))]
    print(f'skeleton at alpha {alpha:5g}: orbits after {parts[0] - looks[0]:.1f} s, all after '
          f'{parts[-1] - looks[0]:.1f} s, longest slice {np.max(np.diff(looks)):.2f} s')


def main() -> int:
    """Measure; the exit status is 1 where impacts were lost."""
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    with tempfile.TemporaryDirectory() as folder:
        logs = Path(folder)
        latencies(logs)
        results = [
            flat_out('flat out, alpha changing, no basin node', OTHERS, logs, True),
            flat_out('flat out, alpha changing, basin node', (*OTHERS, 'basin'), logs, True),
            flat_out('flat out, alpha changing, no basin node', OTHERS, logs, True),
            flat_out('flat out, alpha changing, basin node', (*OTHERS, 'basin'), logs, True),
        ]
        for alpha in (ALPHAS[0], *ALPHAS):
            skeleton(alpha)
        return int(any(lost for _, lost in results))


if __name__ == '__main__':
    sys.exit(main())
