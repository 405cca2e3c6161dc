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

"""The analysis nodes as real processes on real DDS."""

import signal

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
import pytest
from rclpy.duration import Duration
from sensor_msgs.msg import JointState, PointCloud2

from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import Parameters, State
from gear_rattle_ros.core.stream.lyapunov import RunningLyapunov
from gear_rattle_ros.core.stream.report_values import hop_values
from gear_rattle_ros.core.stream.transients import TransientDetector
from gear_rattle_ros.messages import cloud_from_events, stamp_from_nanoseconds
from gear_rattle_ros.qos import LATCHED, STREAM

NAMES = ('lambda_1', 'lambda_2', 'lambda_1_error', 'lambda_2_error', 'sum', 'exact_sum',
         'lambda_1_finite', 'finite_retunes', 'mean_flight_time', 'impulse_balance',
         'exact_impulse_balance', 'epoch', 'sticks', 'impacts', 'index')


@pytest.fixture(scope='module')
def events():
    """Return a stretch of the stream with a retune in it."""
    simulation = Simulation(Parameters(alpha=1.23), State(velocity=-1.04))
    first = simulation.advance(10**8, 0.0, 5000)
    return np.concatenate([
        first, simulation.retune(Parameters(alpha=0.48)),
        simulation.advance(10**8, 0.0, 5000)])


class Bench:
    """Publishes events to a node and listens to its reports."""

    def __init__(self, node, spin, start, name):
        """Start the node and wait for it."""
        self.spin = spin
        self.publisher = node.create_publisher(PointCloud2, 'impacts', STREAM)
        self.said, self.health = [], []
        if name == 'lyapunov':
            node.create_subscription(
                JointState, 'lyapunov',
                lambda m: self.said.append(dict(zip(m.name, m.position, strict=True))), STREAM)
        else:
            node.create_subscription(
                DiagnosticArray, 'transient',
                lambda m: self.said.append(
                    {'words': m.status[0].message}
                    | {item.key: item.value for item in m.status[0].values}), LATCHED)
        node.create_subscription(
            DiagnosticArray, '/diagnostics',
            lambda m: self.health.append(
                {'message': m.status[0].message}
                | {item.key: item.value for item in m.status[0].values}), 10)
        self.process = start(name)
        self.process.wait_for('ready')
        spin(lambda: self.publisher.get_subscription_count() == 1)

    def send(self, events, size=700):
        """Publish events in batches."""
        for first in range(0, len(events), size):
            self.publisher.publish(
                cloud_from_events(events[first:first + size], stamp_from_nanoseconds(first)))
        assert self.publisher.wait_for_all_acked(Duration(seconds=10))


@pytest.fixture
def bench(rclpy_node, spin, start):
    """Return a bench for a node by name."""
    return lambda name: Bench(rclpy_node, spin, start, name)


def expected(*pieces):
    """Return what a RunningLyapunov in this process makes of the same events."""
    running = RunningLyapunov()
    for piece in pieces:
        running.update(piece)
    report = running.report
    return {
        name: getattr(report, 'exponent_sum' if name == 'sum' else name) for name in NAMES}


def same(said, wanted):
    """Compare bit for bit, nan with nan."""
    return all(np.float64(said[name]).tobytes() == np.float64(wanted[name]).tobytes()
               or np.isnan(said[name]) and np.isnan(wanted[name]) for name in NAMES)


def test_exponents_over_dds_are_those_of_the_core(bench, events):
    """The last estimate equals that of the events in one piece, to the bit."""
    lyapunov = bench('lyapunov')
    lyapunov.send(events[:5001])
    lyapunov.spin(lambda: lyapunov.said and lyapunov.said[-1]['index'] == 5000 - 1)
    assert same(lyapunov.said[-1], expected(events[:5001]))
    lyapunov.send(events[5001:])
    lyapunov.spin(lambda: lyapunov.said[-1]['index'] == events['index'][-1])
    assert same(lyapunov.said[-1], expected(events))
    assert lyapunov.said[-1]['epoch'] == 1.0
    assert lyapunov.said[-1]['impulse_balance'] == pytest.approx(0.1, abs=1e-2)
    assert lyapunov.said[-1]['impulse_balance'] == pytest.approx(
        lyapunov.said[-1]['exact_impulse_balance'], abs=1e-13)


def test_late_joiner_begins_where_it_comes_in(bench, events):
    """A new average, and a line that reports it."""
    lyapunov = bench('lyapunov')
    lyapunov.send(events[3000:5000])
    lyapunov.spin(lambda: lyapunov.said and lyapunov.said[-1]['index'] == 4999)
    assert same(lyapunov.said[-1], expected(events[3000:5000]))
    assert lyapunov.said[-1]['impacts'] == 1999
    assert f'joined the stream at impact {events["index"][3000]}' in lyapunov.process.text()


def test_hops_over_dds_are_those_of_the_core(bench, rclpy_node):
    """Each is a report; occupation and rates have the letters of the paper."""
    node, counts = bench('transients'), []
    rclpy_node.create_subscription(JointState, 'hops', lambda message: counts.append(
        dict(zip(message.name, message.position, strict=True))), STREAM)
    noisy = Simulation(Parameters(alpha=0.48), State(velocity=-1.0), noise=0.02, seed=1).advance(
        10**8, 0.0, 20_000)
    node.send(noisy)
    node.spin(lambda: counts and counts[-1]['index'] == noisy['index'][-1])
    detector = TransientDetector()
    changes = detector.update(noisy)
    assert counts[-1] == hop_values(detector.hops, int(noisy['index'][-1]))
    assert counts[-1]['occupation A'] + counts[-1]['occupation B'] == pytest.approx(1.0)
    last = changes[-1]
    node.spin(lambda: node.said and node.said[-1]['index'] == str(last.index))
    assert node.said[-1]['previous'] == last.previous != ''
    assert node.said[-1]['residence'] == str(last.residence)
    assert node.process.stop(signal.SIGINT) == 0, node.process.text()


@pytest.mark.parametrize('name', ['lyapunov', 'transients'])
def test_hole_is_counted_and_nothing_is_computed_across_it(bench, events, name):
    """The number of lost impacts is reported, and the average starts afresh."""
    node = bench(name)
    node.send(events[:2000])
    node.send(events[2345:4000])
    node.process.wait_for('lost: 345 impacts, 2000 to 2344 (epoch 0)')
    node.spin(lambda: any(
        health.get('lost_impacts') == '345'
        and health.get('last_hole') == '345 impacts, 2000 to 2344 (epoch 0)'
        for health in node.health))
    if name == 'lyapunov':
        node.spin(lambda: node.said and node.said[-1]['index'] == 3999)
        assert same(node.said[-1], expected(events[2345:4000]))


def test_restarted_simulator_is_noticed(bench, events):
    """A stream that begins anew is no gap."""
    lyapunov = bench('lyapunov')
    lyapunov.send(events[:3000])
    lyapunov.send(events[:1000])
    lyapunov.process.wait_for('the stream has restarted')
    lyapunov.spin(lambda: lyapunov.said and lyapunov.said[-1]['index'] == 999)
    assert same(lyapunov.said[-1], expected(events[:1000]))


@pytest.mark.long
def test_killed_simulator_and_its_successor(start, rclpy_node, spin):
    """The analysis outlives a killed simulator and follows the next one."""
    said = []
    rclpy_node.create_subscription(JointState, 'lyapunov', said.append, STREAM)
    lyapunov = start('lyapunov')
    lyapunov.wait_for('ready')
    first = start('simulator', '--ros-args', '-p', 'rate:=500.0')
    spin(lambda: said and said[-1].position[-1] > 200)
    first.process.send_signal(signal.SIGKILL)
    first.process.wait()
    start('simulator', '--ros-args', '-p', 'rate:=500.0', '-p', 'wait_for_readers:=1')
    lyapunov.wait_for('the stream has restarted')
    assert lyapunov.stop(signal.SIGTERM) == 0


def test_transients_are_reported_as_they_change(bench, events):
    """Every change of the core's detector is published, latched, in words and numbers."""
    transients = bench('transients')
    transients.send(events)
    detector = TransientDetector()
    changes = detector.update(events)
    transients.spin(lambda: transients.said and transients.said[-1]['state'] == 'orbit')
    # Two impacts in a drive period at 0.48 are attractor B of the paper.
    assert changes[-1].key.startswith('orbit-2-1-') and transients.said[-1]['letter'] == 'B'
    assert transients.said[-1]['words'] == f'attractor B: {changes[-1].describe()}'
    assert transients.said[-1]['lifetime'] == str(changes[-1].lifetime)
    assert float(transients.said[-1]['multiplier']) == changes[-1].multiplier
    assert transients.said[-1]['epoch'] == '1'
    assert transients.said[-1]['orbit'] == changes[-1].key


@pytest.fixture(scope='module')
def chatter():
    """Return a run that sticks once in every 68 impacts."""
    return Simulation(Parameters(5.0, 0.0159, 2.533, 0.7), State(velocity=-1.0)).advance(
        10**8, 0.0, 3000)


def test_chatter_is_an_orbit_and_its_exponents_are_explained(bench, chatter):
    """Periodic with 68 impacts; -inf in words, in the log and in the diagnostics."""
    transients = bench('transients')
    transients.send(chatter)
    transients.spin(lambda: transients.said and transients.said[-1]['state'] == 'orbit')
    assert transients.said[-1]['orbit'].startswith('orbit-68-1-')
    assert float(transients.said[-1]['multiplier']) == 0.0
    assert transients.process.stop() == 0
    lyapunov = bench('lyapunov')
    lyapunov.send(chatter)
    lyapunov.spin(lambda: lyapunov.said and lyapunov.said[-1]['index'] == chatter['index'][-1])
    assert lyapunov.said[-1]['lambda_1'] == -np.inf and lyapunov.said[-1]['sticks'] == 43.0
    lyapunov.process.wait_for('the gear stuck at ')
    lyapunov.spin(lambda: any('superstable' in h.get('infinite', '') for h in lyapunov.health))


def test_chaos_is_reported_with_its_exponent(bench, events):
    """A report whenever the number of impacts has doubled; its words are in the log."""
    transients = bench('transients')
    transients.send(events[:5000])
    transients.spin(lambda: transients.said and transients.said[-1].get('impacts') == '4000')
    last = transients.said[-1]
    assert last['state'] == 'transient' and last['words'].startswith('no orbit in 4,000 impacts')
    assert float(last['exponent']) == pytest.approx(0.49, abs=0.1)
    assert 0.0 < float(last['exponent_error']) < 0.05
    transients.process.wait_for('no orbit in 4,000 impacts (chaos or a long transient)')


def test_what_is_no_batch_is_refused_in_one_line(bench, events):
    """A cloud of another layout is named and passed over."""
    lyapunov = bench('lyapunov')
    foreign = cloud_from_events(events[:10], stamp_from_nanoseconds(0))
    foreign.fields = [field for field in foreign.fields if field.name != 'gamma']
    for _ in range(3):
        lyapunov.publisher.publish(foreign)
    broken = events[:10].copy()
    broken['velocity'][3] = np.nan
    lyapunov.publisher.publish(cloud_from_events(broken, stamp_from_nanoseconds(0)))
    lyapunov.send(events[:1000])
    lyapunov.spin(lambda: lyapunov.said and lyapunov.said[-1]['index'] == 999)
    assert same(lyapunov.said[-1], expected(events[:1000]))
    text = lyapunov.process.text()
    assert text.count("no field 'gamma'") == 1 and text.count('velocity = nan') == 1
    lyapunov.spin(lambda: any(h.get('refused_batches') == '4' for h in lyapunov.health))
