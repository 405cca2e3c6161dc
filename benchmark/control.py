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
What control costs the stream: events per second, losses and time at 1,000 drive periods a second.

The simulator holds the orbit of two impacts at 0.57, or does not, by kicks of 1e-6 disturbed, so
that there is a correction at every impact. Run: make bench, or python benchmark/control.py
"""

import os
import time

from diagnostic_msgs.msg import DiagnosticArray
import rclpy
from transport import node

from gear_rattle_ros.attractors.skeleton.holding import Planner
from gear_rattle_ros.core.flight.law import Acts
from gear_rattle_ros.core.model import Parameters, State
from gear_rattle_ros.nodes.base.arguments import overrides

RATE = 1000.0
SECONDS = 15.0


def measure(control: str) -> tuple[float, float, int, float]:
    """Return drive periods and events per second, impacts lost, and the simulator's cores."""
    listener = rclpy.create_node('listener')
    found: dict[str, list[tuple[float, dict[str, str]]]] = {'simulator': [], 'lyapunov': []}

    def take(message: DiagnosticArray) -> None:
        status = message.status[0]
        found.setdefault(status.name.split(':')[0], []).append(
            (time.monotonic(), {item.key: item.value for item in status.values}))

    listener.create_subscription(DiagnosticArray, '/diagnostics', take, 100)
    reader = node('lyapunov')
    simulator = node('simulator', '--ros-args', *overrides({
        'alpha': 0.57, 'initial_velocity': -1.0, 'noise': 1e-6, 'rate': RATE, 'control': control,
        'wait_for_readers': 1}))
    ticks: list[tuple[float, float]] = []
    try:
        while len(ticks) < 2 or ticks[-1][0] - ticks[0][0] < SECONDS:
            rclpy.spin_once(listener, timeout_sec=0.5)
            if found['lyapunov'] and int(found['lyapunov'][-1][1]['events']) > 2 * RATE:
                words = open(f'/proc/{simulator.pid}/stat').read().rsplit(')', 1)[1].split()
                ticks.append((time.monotonic(), (int(words[11]) + int(words[12]))
                              / os.sysconf('SC_CLK_TCK')))
            if reader.poll() is not None or simulator.poll() is not None:
                raise SystemExit('a node has ended')
    finally:
        for process in (simulator, reader):
            process.terminate()
            process.wait()
        listener.destroy_node()
    rates = []
    for name, key in (('simulator', 'cycle'), ('lyapunov', 'events')):
        (t0, first), *_, (t1, last) = (
            (when, int(values[key])) for when, values in found[name] if when >= ticks[0][0])
        rates.append((last - first) / (t1 - t0))
    (t0, c0), (t1, c1) = ticks[0], ticks[-1]
    return rates[0], rates[1], int(found['lyapunov'][-1][1]['lost_impacts']), (c1 - c0) / (t1 - t0)


def main() -> None:
    """Measure without control, with it, and without once more."""
    rclpy.init()
    law = Planner().plan(Parameters(alpha=0.57), State(velocity=-1.0), 'B', Acts.DRIVE, 0.002).law
    print(f'{"":10} {"periods/s":>10} {"events/s":>10} {"lost":>6} {"core":>7}')
    for name, text in (('without', ''), ('with', law.to_text()), ('without', '')):
        periods, events, lost, share = measure(text)
        print(f'{name:10} {periods:10,.1f} {events:10,.0f} {lost:6} {share:7.1%}', flush=True)
    rclpy.try_shutdown()


if __name__ == '__main__':
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    os.environ.setdefault('ROS_DOMAIN_ID', '78')
    main()
