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

"""What was lost is named exactly, by every reader; at rate 0 nothing is, whichever dies."""

from pathlib import Path
import re
import signal
import subprocess
import sys
import time

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
import pytest
from rclpy.duration import Duration
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState, PointCloud2
from std_srvs.srv import SetBool

from gear_rattle_ros.bags import Bag
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import Parameters, State
from gear_rattle_ros.core.stream.guard import StreamGuard
from gear_rattle_ros.core.stream.lyapunov import RunningLyapunov
from gear_rattle_ros.messages import cloud_from_events, events_from_cloud, stamp_from_nanoseconds
from gear_rattle_ros.qos import STREAM, STREAM_INPUT

# DDS gives up a reader that is silent for 20 s; the rest is for a loaded machine [s].
GIVEN_UP_WITHIN = 40.0


class Health:
    """The latest diagnostics of every node."""

    def __init__(self, node):
        """Listen."""
        self.said = {}
        node.create_subscription(DiagnosticArray, '/diagnostics', self.take, 100)

    def take(self, message):
        """Keep the newest."""
        for status in message.status:
            self.said[status.name.split(':')[0]] = {
                item.key: item.value for item in status.values}

    def number(self, name, key):
        """Return a value as a whole number."""
        return int(self.said.get(name, {}).get(key, -1))


def named_holes(text):
    """Return first and last number and epochs of every hole in a log."""
    found = re.findall(r'(\d+) impacts, (\d+) to (\d+) \(epochs? (\d+)(?: to (\d+))?\)', text)
    assert 'more gaps' not in text
    holes = [(int(first), int(last), int(low), int(high or low))
             for _, first, last, low, high in found]
    holes += [(int(number), int(number), int(low), int(high or low)) for number, low, high
              in re.findall(r'lost: impact (\d+) \(epochs? (\d+)(?: to (\d+))?\)', text)]
    return sorted(holes)


@pytest.mark.long
def test_stopped_readers_name_exactly_what_they_did_not_get(start, rclpy_node, spin, tmp_path):
    """Stopped for a while, far beyond the depth of every queue, with a retune in the hole."""
    simulation = Simulation(Parameters(1.23), State(velocity=-1.0))
    events = np.concatenate([
        simulation.advance(10**8, 0.0, 9000), simulation.retune(Parameters(1.2)),
        simulation.advance(10**8, 0.0, 9000)])
    epoch_of = dict(zip(events['index'].tolist(), events['epoch'].tolist(), strict=True))
    publisher = rclpy_node.create_publisher(PointCloud2, 'impacts', STREAM)
    health, estimates = Health(rclpy_node), []
    rclpy_node.create_subscription(JointState, 'lyapunov', estimates.append, STREAM)
    nodes = {
        'lyapunov': start('lyapunov'),
        'transients': start('transients'),
        'recorder': start('recorder', '--ros-args', '-p', f'output:={tmp_path}/bag'),
        'viewer': start('viewer', '--ros-args', '-p', 'mode:=none', '-p',
                        f'save:={tmp_path}/run.rrd'),
    }
    spin(lambda: publisher.get_subscription_count() == len(nodes), 90.0)

    def send(batch):
        publisher.publish(cloud_from_events(batch, stamp_from_nanoseconds(0)))

    send(events[:1000])
    assert publisher.wait_for_all_acked(Duration(seconds=20))
    for node in nodes.values():
        node.process.send_signal(signal.SIGSTOP)
    for first in range(1000, 17_000, 4):
        send(events[first:first + 4])
    for node in nodes.values():
        node.process.send_signal(signal.SIGCONT)
    assert publisher.wait_for_all_acked(Duration(seconds=30))
    send(events[17_000:])
    last = int(events['index'][-1])
    spin(lambda: estimates and estimates[-1].position[-1] == last, 60.0)
    spin(lambda: all(health.number(name, 'gaps') > 0 for name in nodes), 30.0)
    for name, node in nodes.items():
        spin(lambda name=name: health.number(name, 'lost_impacts') == sum(
            hole[1] - hole[0] + 1 for hole in named_holes(nodes[name].text())), 20.0)
        assert named_holes(node.text()), name
        for first, upto, low, high in named_holes(node.text()):
            assert low <= epoch_of[first] <= epoch_of[upto] <= high
    for name in ('lyapunov', 'transients', 'viewer'):
        spin(lambda name=name: health.number(name, 'events') + health.number(name, 'lost_impacts')
             in (len(events), len(events) - 1), 20.0)
    # Nothing was computed across the hole: the average is that of what came after it.
    behind = named_holes(nodes['lyapunov'].text())[-1][1] + 1
    running = RunningLyapunov()
    running.update(events[np.flatnonzero(events['index'] == behind)[0]:])
    values = dict(zip(estimates[-1].name, estimates[-1].position, strict=True))
    assert values['impacts'] == running.report.impacts
    assert values['lambda_1'] == running.report.lambda_1
    for node in nodes.values():
        assert node.stop(within=30.0) == 0
    # The bag lacks what the recorder has named, and nothing else.
    recorded = np.concatenate(list(Bag(tmp_path / 'bag').events()))
    missing = sorted(set(events['index'].tolist()) - set(recorded['index'].tolist()))
    named = [number for first, upto, *_ in named_holes(nodes['recorder'].text())
             for number in range(first, upto + 1)]
    assert missing == named


@pytest.mark.long
def test_dead_and_stopped_readers_do_not_hold_the_simulator_up(start, rclpy_node, spin):
    """At rate 0 one is killed, one stopped: 20 s later it goes on, whole for the rest."""
    arrivals, guard = [], StreamGuard()

    def take(cloud):
        arrivals.append(time.monotonic())
        guard.split(events_from_cloud(cloud))

    rclpy_node.create_subscription(PointCloud2, 'impacts', take, STREAM_INPUT)
    # A reader of another make that never takes anything holds nobody up: it drops the oldest.
    idle = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=1,
                      reliability=ReliabilityPolicy.RELIABLE)
    health = Health(rclpy_node)
    stopped, killed = start('lyapunov'), start('transients')
    for node in (stopped, killed):
        node.wait_for('ready')
    simulator = start('simulator', '--ros-args', '-p', 'rate:=0.0', '-p', 'wait_for_readers:=3')
    spin(lambda: health.number('lyapunov', 'events') > 10_000, 90.0)
    lazy = rclpy_node.create_subscription(PointCloud2, 'impacts', lambda _: None, idle)
    lazy.callback_group.can_execute = lambda _: True
    stopped.process.send_signal(signal.SIGSTOP)
    killed.process.send_signal(signal.SIGKILL)
    killed.process.wait()
    since = time.monotonic()
    # It waits for both while they might come back, ...
    spin(lambda: time.monotonic() > since + 5.0)
    silent_from = arrivals[-1]
    assert silent_from < since + 4.0
    # ... and then no longer.
    spin(lambda: arrivals[-1] > silent_from, GIVEN_UP_WITHIN)
    print(f'held up for {arrivals[-1] - since:.1f} s')
    count = len(arrivals)
    spin(lambda: len(arrivals) > count + 300, 30.0)
    assert (guard.gaps, guard.lost, guard.restarts) == (0, 0, 0)
    stopped.process.send_signal(signal.SIGCONT)
    stopped.wait_for('lost: ', 60.0)
    spin(lambda: health.number('lyapunov', 'gaps') >= 1, 30.0)
    assert simulator.stop() == 0
    assert stopped.stop() == 0


@pytest.mark.long
def test_with_the_processors_taken_every_loss_is_reported(
        start, rclpy_node, spin, tmp_path: Path):
    """Four processes that do nothing but compute; got and lost add up to what was sent."""
    health = Health(rclpy_node)
    pauser = rclpy_node.create_client(SetBool, 'simulator/pause')
    readers = {'lyapunov': start('lyapunov'),
               'recorder': start('recorder', '--ros-args', '-p', f'output:={tmp_path}/bag')}
    start('simulator', '--ros-args', '-p', 'rate:=20000.0', '-p', 'wait_for_readers:=2')
    spin(lambda: health.number('lyapunov', 'events') > 0, 90.0)
    hogs = [subprocess.Popen([sys.executable, '-c', 'while True: pass']) for _ in range(4)]
    try:
        until = time.monotonic() + 6.0
        spin(lambda: time.monotonic() > until)
    finally:
        for hog in hogs:
            hog.kill()
            hog.wait()
    future = pauser.call_async(SetBool.Request(data=True))
    spin(future.done, 30.0)
    # One record more than impacts: the first one is the reset.
    for name, key, more in (('lyapunov', 'events', 1), ('recorder', 'impacts', 0)):
        spin(lambda name=name, key=key, more=more: health.number('simulator', 'impacts') > 10_000
             and health.number(name, key) + health.number(name, 'lost_impacts')
             == health.number('simulator', 'impacts') + more, 60.0)
    for node in readers.values():
        assert node.stop(within=30.0) == 0
