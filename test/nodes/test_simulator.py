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

"""The simulator as a real process on real DDS."""

import contextlib
import math
import signal
import time

from builtin_interfaces.msg import Time
import numpy as np
import pytest
from rcl_interfaces.srv import DescribeParameters, GetParameters, SetParametersAtomically
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
import rclpy.time
from sensor_msgs.msg import JointState, PointCloud2
from std_srvs.srv import SetBool, Trigger

from gear_rattle_ros.core.flight.law import Acts
from gear_rattle_ros.core.flight.noise import gaussian
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EVENT, EventKind, Parameters, State
from gear_rattle_ros.core.orbits.control import law_of
from gear_rattle_ros.core.orbits.orbit import close_orbit
from gear_rattle_ros.core.orbits.section import distances
from gear_rattle_ros.core.stream.guard import StreamGuard
from gear_rattle_ros.core.stream.succession import Succession
from gear_rattle_ros.messages import cloud_from_events, events_from_cloud
from gear_rattle_ros.nodes.simulator import LARGEST_BATCH
from gear_rattle_ros.qos import STREAM_INPUT


def test_the_largest_batch_travels_whole() -> None:
    """Beyond 65,500 bytes Fast DDS would send it in fragments; RTPS adds less than 500."""
    cloud = cloud_from_events(np.zeros(LARGEST_BATCH, EVENT), Time())
    assert len(serialize_message(cloud)) < 65_000


class Reader:
    """Everything a subscriber gets."""

    def __init__(self, node, spin):
        """Subscribe."""
        self.batches = []
        self.stamps = []
        self.spin = spin
        self.node = node
        node.create_subscription(
            PointCloud2, 'impacts', lambda cloud: self.take(cloud), STREAM_INPUT)

    def take(self, cloud):
        """Keep a batch."""
        self.batches.append(events_from_cloud(cloud))
        self.stamps.append(rclpy.time.Time.from_msg(cloud.header.stamp).nanoseconds)

    def events(self):
        """Return all events so far."""
        return np.concatenate(self.batches) if self.batches else np.zeros(0, EVENT)

    def until(self, count):
        """Wait for a number of events."""
        self.spin(lambda: sum(map(len, self.batches)) >= count)
        return self.events()


class Steering:
    """The simulator's parameters and services."""

    def __init__(self, node, spin):
        """Connect."""
        self.node, self.spin = node, spin
        self.clients = {}

    def call(self, kind, name, request):
        """Call a service and return its response."""
        client = self.clients.setdefault(name, self.node.create_client(kind, f'/simulator/{name}'))
        self.spin(client.service_is_ready)
        future = client.call_async(request)
        if kind is not Trigger:
            # rmw_fastrtps drops a reply whose reader it has not met within 0.1 s; asked again,
            # all of these answer and do the same.
            with contextlib.suppress(AssertionError):
                self.spin(future.done, 5.0)
            if not future.done():
                future = client.call_async(request)
        self.spin(future.done, 15.0)
        return future.result()

    def put(self, **values):
        """Set parameters, all or none."""
        return self.call(
            SetParametersAtomically, 'set_parameters_atomically',
            SetParametersAtomically.Request(parameters=[
                Parameter(name, value=value).to_parameter_msg()
                for name, value in values.items()])).result

    def get(self, *names):
        """Return doubles."""
        return [value.double_value for value in self._values(*names)]

    def text(self, name):
        """Return a string."""
        return self._values(name)[0].string_value

    def _values(self, *names):
        return self.call(
            GetParameters, 'get_parameters', GetParameters.Request(names=list(names))).values


@pytest.fixture
def reader(rclpy_node, spin):
    """Return a lossless subscriber."""
    return Reader(rclpy_node, spin)


@pytest.fixture
def steering(rclpy_node, spin):
    """Return a way to steer."""
    return Steering(rclpy_node, spin)


def reference(count, **initial):
    """Return the same trajectory, computed here in one piece."""
    return Simulation(Parameters(), State(**{'velocity': -0.5, **initial})).advance(
        10**8, 0.0, count)


def test_stream_is_that_of_the_core_to_the_bit(start, reader):
    """What arrives over DDS is what the core computes, from the first record on."""
    start('simulator', '--ros-args', '-p', 'wait_for_readers:=1', '-p', 'rate:=300.0')
    events = reader.until(1500)
    assert events.tobytes() == reference(len(events)).tobytes()


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_ends_quietly(start, number):
    """A signal ends the node with status 0 and without a trace."""
    node = start('simulator')
    node.wait_for('ready')
    assert node.stop(number) == 0
    assert 'Traceback' not in node.text()


def test_a_wait_for_readers_is_logged_and_ends(start, reader):
    """Who is there is named; a reader that never comes does not hold the run up."""
    node = start('simulator', '--ros-args', '-p', 'wait_for_readers:=2', '-p',
                 'wait_at_most:=3.0', '-p', 'rate:=300.0')
    assert len(reader.until(50)) >= 50
    assert f'1 of 2 readers of impacts are there ({reader.node.get_name()})' in node.text()
    assert 'begins without the others' in node.text()


@pytest.mark.parametrize('words', [
    ('alpha:=-1.0', 'alpha = -1.0 is outside'),
    ('alpha:=.nan', 'alpha = nan'),
    ('beta:=high', "beta = 'high' is not of type double"),
    ('initial_displacement:=0.5', 'initial_displacement = 0.5 is outside'),
    ('seed:=1.5', 'seed = 1.5 is not of type integer'),
    ('gears:=/none.yaml', '/none.yaml: No such file or directory; name a YAML file of a gear'),
    ('backlash_m:=1e-4', 'gear pair: inertia_kg_m2 is missing: moment of inertia'),
])
def test_bad_start_is_one_line_and_status_2(start, words):
    """A bad start-up parameter is named in one line."""
    node = start('simulator', '--ros-args', '-p', words[0])
    assert node.process.wait(60) == 2
    assert words[1] in node.text()
    assert len(node.text().strip().splitlines()) == 1


def test_integer_for_a_double_is_taken_at_start_and_live(start, reader, steering):
    """`alpha 1` means 1.0."""
    start('simulator', '--ros-args', '-p', 'alpha:=1', '-p', 'rate:=100')
    assert reader.until(10)['alpha'][-1] == 1.0
    assert steering.put(alpha=2).successful
    reader.spin(lambda: reader.events()['alpha'][-1] == 2.0)
    assert steering.get('alpha') == [2.0]


def test_live_retune_is_continuous_and_raises_the_epoch(start, reader, steering):
    """Displacement and velocity go on; everything after the retune has the new value."""
    start('simulator', '--ros-args', '-p', 'wait_for_readers:=1', '-p', 'rate:=200.0')
    reader.until(100)
    assert steering.put(alpha=0.57, gamma=0.2).successful
    reader.spin(lambda: EventKind.RETUNE in reader.events()['kind'])
    events = reader.until(len(reader.events()) + 50)
    at = int(np.flatnonzero(events['kind'] == EventKind.RETUNE)[0])
    retune = events[at]
    assert np.flatnonzero(np.diff(events['epoch'].astype(int))).tolist() == [at - 1]
    assert (events['alpha'][:at] == 0.48).all() and (events['alpha'][at:] == 0.57).all()
    assert retune['velocity'] == retune['velocity_after']
    again = Simulation(Parameters(), State(velocity=-0.5))
    head = again.advance(int(retune['cycle']), float(retune['phase']), 10**6)
    tail = again.retune(Parameters(alpha=0.57, gamma=0.2))
    rest = again.advance(10**8, 0.0, len(events) - at - 1)
    assert np.concatenate([head, tail, rest]).tobytes() == events.tobytes()


def test_refused_value_changes_nothing(start, steering):
    """The answer has a reason, and everything is as it was."""
    start('simulator')
    for values in (
            {'alpha': -0.1}, {'alpha': math.nan}, {'restitution': 1.5}, {'beta': 'x'},
            {'alpha': 0.5, 'gamma': math.inf}, {'omega': 3.0}, {'initial_displacement': 1.0}):
        result = steering.put(**values)
        assert not result.successful and result.reason, values
        assert steering.get('alpha', 'gamma', 'beta') == [0.48, 0.1, 0.1], values


def test_reset_sets_the_state_and_never_goes_back_in_time(start, reader, steering):
    """The RESET record has the initial state of the parameters, at their phase."""
    start('simulator', '--ros-args', '-p', 'rate:=100.0')
    reader.until(50)
    assert steering.put(initial_phase=1.25, initial_displacement=-0.5).successful
    assert steering.put(initial_velocity=0.75).successful
    assert steering.call(Trigger, 'reset', Trigger.Request()).success
    reader.spin(lambda: EventKind.RESET in reader.events()['kind'][1:])
    events = reader.until(len(reader.events()) + 20)
    reset = events[1:][events['kind'][1:] == EventKind.RESET][0]
    assert (reset['phase'], reset['displacement'], reset['velocity_after']) == (1.25, -0.5, 0.75)
    time_of = events['cycle'] * 2.0 * np.pi + events['phase']
    assert (np.diff(time_of) >= 0.0).all()
    assert StreamGuard().split(events)[1:] == []


def test_pause_stops_time(start, reader, steering):
    """While paused nothing happens; then it goes on where it was."""
    start('simulator', '--ros-args', '-p', 'rate:=200.0', '-p', 'wait_for_readers:=1')
    reader.until(100)
    steering.call(SetBool, 'pause', SetBool.Request(data=True))
    # What was under way when the answer came still arrives.
    arrived = time.monotonic() + 2.0
    reader.spin(lambda: time.monotonic() > arrived)
    before = len(reader.events())
    deadline = time.monotonic() + 0.5
    reader.spin(lambda: time.monotonic() > deadline)
    assert len(reader.events()) == before
    steering.call(SetBool, 'pause', SetBool.Request(data=False))
    events = reader.until(before + 100)
    assert events.tobytes() == reference(len(events)).tobytes()


def test_ramp_steps_exactly_once_a_drive_period(start, reader, steering):
    """Alpha climbs by alpha_rate at the end of every period, and stops at its target."""
    start('simulator', '--ros-args', '-p', 'rate:=100.0', '-p', 'wait_for_readers:=1')
    reader.until(10)
    assert steering.put(alpha_target=0.5, alpha_rate=0.0005).successful
    reader.spin(lambda: reader.events()['alpha'][-1] == 0.5)
    events = reader.until(len(reader.events()) + 10)
    steps = events[events['kind'] == EventKind.RETUNE]
    assert (steps['phase'] == 0.0).all() and (np.diff(steps['cycle'].astype(int)) == 1).all()
    np.testing.assert_allclose(steps['alpha'], 0.48 + 0.0005 * np.arange(1, 41), rtol=1e-12)
    reader.spin(lambda: steering.get('alpha', 'alpha_rate') == [0.5, 0.0])


@pytest.mark.long
def test_full_speed_loses_nothing_to_a_slow_reader(start, reader):
    """With rate = 0 the simulator waits for whoever is slow."""
    start('simulator', '--ros-args', '-p', 'rate:=0.0', '-p', 'wait_for_readers:=1')
    take = reader.take

    def slowly(cloud):
        time.sleep(0.01)
        take(cloud)

    reader.take = slowly
    events = reader.until(80_000)
    assert events.tobytes() == reference(len(events)).tobytes()


def test_joint_states_obey_the_gears(start, rclpy_node, spin):
    """The backlash is the driven gear less the driver, in angle and speed."""
    got = []
    rclpy_node.create_subscription(JointState, 'joint_states', got.append, 10)
    start('simulator', '--ros-args', '-p', 'omega:=2.0')
    spin(lambda: len(got) > 20)
    for message in got:
        assert message.name == ['driver_gear', 'driven_gear', 'backlash']
        driver, driven, backlash = message.position
        assert -0.01 <= backlash <= 0.0
        assert driven - driver == pytest.approx(backlash, abs=1e-15)
        assert abs(driver) <= 0.48 * 0.01 * (1 + 1e-12)
        assert (driver / 0.0048)**2 + (message.velocity[0] / 0.0096)**2 == pytest.approx(1.0)
        assert list(message.effort) == []


def test_a_gear_pair_sets_parameters_and_the_scale_of_joint_states(
        start, rclpy_node, spin, steering, tmp_path):
    """Each gear turns by its own radius; what is given beside the file replaces its values."""
    path, got, omega = tmp_path / 'pair.yaml', [], 60.0 * math.pi
    path.write_text('{inertia_kg_m2: 2e-4, driver_radius_m: 0.04, driven_radius_m: 0.05, '
                    'backlash_m: 1e-4, drag_n_m_s_per_rad: 4e-3, torque_n_m: 0.001, '
                    'drive_rad: 0.002, frequency_hz: 30, restitution: 0.8}')
    rclpy_node.create_subscription(JointState, 'joint_states', got.append, 10)
    start('simulator', '--ros-args', '-p', f'gears:={path}', '-p', 'backlash_m:=2.0e-4', '-p',
          'gamma:=0.3')
    spin(lambda: len(got) > 20)
    names = ('alpha', 'beta', 'gamma', 'restitution', 'omega', 'backlash_angle', 'drive_rad')
    assert steering.get(*names) == pytest.approx(
        [0.002 * 0.04 / 2e-4, 4e-3 / (2e-4 * omega), 0.3, 0.8, omega, 2e-4 / 0.05, 0.002])
    for message in got:
        (driver, driven, backlash), rates = message.position, message.velocity
        assert 0.05 * driven - 0.04 * driver == pytest.approx(0.05 * backlash, abs=1e-15)
        assert 0.05 * rates[1] - 0.04 * rates[0] == pytest.approx(0.05 * rates[2], abs=1e-12)
        assert -2e-4 / 0.05 <= backlash <= 0.0
        assert (driver / 0.002)**2 + (rates[0] / (0.002 * omega))**2 == pytest.approx(1.0)


def test_stamps_are_ros_time(start, reader):
    """Tools that measure delays see none, whatever the speed of the simulation."""
    delays, take = [], reader.take

    def now(cloud):
        delays.append(time.time() - rclpy.time.Time.from_msg(cloud.header.stamp).nanoseconds / 1e9)
        take(cloud)

    reader.take = now
    start('simulator', '--ros-args', '-p', 'rate:=500.0')
    reader.until(2000)
    assert min(delays) >= 0.0 and np.median(delays) < 0.5


def test_stamps_are_drive_time_beside_a_clock(start, reader):
    """Stamps advance by tau/omega."""
    start('simulator', '--ros-args', '-p', 'rate:=50.0', '-p', 'omega:=4.0', '-p',
          'publish_clock:=true')
    reader.until(200)
    last = [batch[-1] for batch in reader.batches if len(batch)]
    tau = np.array([event['cycle'] * 2.0 * np.pi + event['phase'] for event in last])
    stamps = np.array(reader.stamps) / 1e9
    # A batch is stamped at the end of its tick: after its last event, before the next batch's.
    assert ((stamps[1:] - stamps[0]) - (tau[1:] - tau[0]) / 4.0 < 3.0).all()
    assert (np.diff(stamps) > 0.0).all()


def test_every_parameter_is_described(start, steering):
    """Description, unit and range of the live parameters."""
    start('simulator')
    names = ['alpha', 'beta', 'gamma', 'restitution', 'noise', 'rate']
    descriptors = steering.call(
        DescribeParameters, 'describe_parameters',
        DescribeParameters.Request(names=names)).descriptors
    assert [descriptor.name for descriptor in descriptors] == names
    for descriptor in descriptors:
        assert '[' in descriptor.description and descriptor.floating_point_range
        assert not descriptor.read_only


def test_noise_is_reproducible(start, reader):
    """Same seed, same bytes; the kick is in the record."""
    start('simulator', '--ros-args', '-p', 'noise:=0.01', '-p', 'seed:=7', '-p',
          'wait_for_readers:=1', '-p', 'rate:=500.0')
    events = reader.until(1000)
    again = Simulation(Parameters(), State(velocity=-0.5), noise=0.01, seed=7)
    assert events.tobytes() == again.advance(10**8, 0.0, len(events)).tobytes()
    impacts = events[events['kind'] == EventKind.IMPACT]
    kicks = impacts['velocity_after'] + 0.9 * impacts['velocity']
    assert 0.008 < np.std(kicks) < 0.012


def test_control_holds_ends_with_a_change_of_the_model_and_is_refused(start, reader, steering):
    """The stream verifies; the parameter shows whether a law is in force."""
    node = start('simulator', '--ros-args', '-p', 'alpha:=0.57', '-p', 'wait_for_readers:=1',
                 '-p', 'rate:=2000.0', '-p', 'initial_velocity:=-1.0')
    orbit = close_orbit(np.array([0, 1]), np.array([[5.6316, 0.9679], [0.9051, -0.6372]]),
                        Parameters(alpha=0.57))
    text = law_of(orbit, Acts.DRIVE, 0.01).to_text()
    assert steering.put(control=text).successful
    reader.spin(lambda: len(reader.batches) > 20 and held(reader.batches[-1], orbit))
    for given, words in (({'control': text[:60]}, 'is not a control law'),
                         ({'control': text, 'noise_kind': 'jitter', 'noise': 0.001}, 'choose'),
                         ({'noise_kind': 'pink'}, 'is not one of')):
        answer = steering.put(**given)
        assert not answer.successful and words in answer.reason and '\n' not in answer.reason
    assert steering.text('control') == text
    assert steering.put(beta=0.1001).successful
    assert steering.text('control') == ''
    node.wait_for('control has ended')
    assert steering.put(beta=0.1, control=text).successful
    reader.spin(lambda: held(reader.batches[-1], orbit))
    # Kicks keep it where it is; letting go, alpha is as before.
    assert steering.put(noise=1e-5, noise_kind='uniform').successful
    size = len(reader.events())
    reader.until(size + 2000)
    assert held(reader.batches[-1], orbit, 1e-3)
    assert steering.put(control='').successful
    reader.until(len(reader.events()) + 4000)
    last = reader.batches[-1]
    assert np.all(last['alpha'] == 0.57) and not held(last, orbit)
    check = Succession()
    assert check.take(reader.events()) is None and check.kicked > 2000


def held(events, orbit, within=1e-9):
    """Whether the last impacts are on an orbit."""
    impacts = events[events['kind'] <= EventKind.STICK][-4:]
    return len(impacts) == 4 and np.max(np.min([
        distances(impacts['velocity'], impacts['phase'], velocity, phase)
        for phase, velocity in orbit.points], axis=0)) < within


def test_jitter_draws_alpha_for_each_drive_period_from_its_number(start, reader, steering):
    """As the lanes of `hopping` do: by the seed and the number of the period alone."""
    start('simulator', '--ros-args', '-p', 'alpha:=0.48', '-p', 'wait_for_readers:=1', '-p',
          'rate:=500.0', '-p', 'noise:=0.01', '-p', 'noise_kind:=jitter', '-p', 'seed:=5')
    events = reader.until(2000)
    retunes = events[events['kind'] == EventKind.RETUNE]
    assert np.array_equal(retunes['cycle'], np.arange(1, len(retunes) + 1))
    assert np.all(retunes['phase'] == 0.0)
    assert retunes['alpha'].tolist() == [
        0.48 + 0.01 * gaussian(5, int(cycle)) for cycle in retunes['cycle']]
    assert steering.get('alpha') == [0.48]
    assert Succession().take(events) is None
    assert steering.put(noise=0.0).successful
    reader.spin(lambda: np.all(reader.batches[-1]['alpha'] == 0.48))
