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


"""Control: the choice of an orbit, refusals, and the node at work on a real simulator."""

import dataclasses
import math
import re
import signal
import time

import numpy as np
import pytest
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from gear_rattle_ros.attractors.skeleton.holding import Planner, TRIALS
from gear_rattle_ros.cli.bags.verify import main as verify
from gear_rattle_ros.core.flight.law import Acts
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import Parameters, State
from gear_rattle_ros.core.stream.hold import RunningHold
from gear_rattle_ros.qos import STREAM

CHAOS = Parameters(alpha=0.57)
ON_B, ON_A = State(velocity=-1.0), State(velocity=-0.5)


@pytest.fixture(scope='module')
def planner():
    return Planner()


def test_an_orbit_is_chosen_near_the_trajectory_and_the_law_is_tried(planner):
    """Of three unstable orbits of two impacts it is that of B, whose attractor contains it."""
    plans = [planner.plan(CHAOS, ON_B, wanted, Acts.DRIVE, 0.002) for wanted in (
        '2', 'B', '<3', 'orbit-2-1-U5.6316+0.9679')]
    assert {plan.orbit.key for plan in plans} == {'orbit-2-1-U5.6316+0.9679'}
    assert plans[0].caught == TRIALS and plans[0].impacts < 500
    # All that is left is the stable direction.
    assert plans[0].exponent == pytest.approx(
        math.log(np.min(np.abs(plans[0].orbit.multipliers))) / 2, rel=1e-6)
    assert planner.plan(CHAOS, ON_B, '<9', Acts.DRIVE, 0.002).orbit.impacts == 8
    # Where rounding keeps it on an orbit of four impacts, others are as near as on the attractor.
    orbit = planner.plan(CHAOS, ON_B, '4', Acts.DRIVE, 0.002).orbit
    phase, velocity = orbit.points[0]
    kept = State(0, phase, -float(orbit.walls[0]), -0.9 * velocity)
    assert planner.plan(CHAOS, kept, '<9', Acts.DRIVE, 0.002).orbit.impacts == 8
    # From attractor A the trajectory never comes near it.
    assert planner.plan(CHAOS, ON_A, 'B', Acts.DRIVE, 0.002).caught == 0


@pytest.mark.parametrize(('wanted', 'acts', 'limit', 'words'), [
    ('A', Acts.DRIVE, 0.01, 'is stable'), ('Q', Acts.DRIVE, 0.01, 'is no letter'),
    ('1', Acts.DRIVE, 0.01, 'no unstable orbit 1 at alpha = 0.57'),
    ('orbit-2-1-U5.0692+0.8785', Acts.DELAYED, 0.01, 'odd number'),
    ('2', Acts.DELAYED, 0.05, 'limit = 0.05 is too large: at alpha = 0.572. the gear goes'),
])
def test_what_cannot_be_held_is_refused_in_one_line(planner, wanted, acts, limit, words):
    with pytest.raises(ValueError, match=words) as refusal:
        planner.plan(CHAOS, ON_B, wanted, acts, limit)
    assert '\n' not in str(refusal.value)


@pytest.mark.parametrize(('alpha', 'wanted', 'state', 'words', 'change'), [
    # The crisis in which B is lost, and the doubling in which its orbit becomes stable.
    (0.57, '2', ON_B, 'from B chaotic-2-1-U5.6316.* to A orbit-3-1-U4.1609', 0.57229),
    (0.57, 'B', ON_A, 'from B chaotic-2-1-U5.6316.* to A orbit-3-1-U4.1609', 0.57229),
    (0.531, 'B', ON_B, 'the orbit has its doubling at alpha = 0.529151', 0.5291506)])
def test_a_limit_ends_where_the_attractor_or_the_orbit_changes(
        planner, alpha, wanted, state, words, change):
    """The largest that is fine is named, and reaches to a change that is known otherwise."""
    parameters = Parameters(alpha=alpha)
    with pytest.raises(ValueError, match=words) as refusal:
        planner.plan(parameters, state, wanted, Acts.DRIVE, 0.01)
    most = float(re.search('at most ([0-9.]+) is fine$', str(refusal.value))[1])
    assert most == pytest.approx(abs(change - alpha), rel=0.1)
    assert planner.plan(parameters, state, wanted, Acts.DRIVE, most).law.limit == most


@pytest.mark.long
def test_a_limit_beyond_the_crisis_of_a_long_transient_is_refused(planner):
    """At 1.23 chaos lasts for 140,000 impacts, beyond the crisis at 1.2347 for far fewer."""
    parameters = Parameters(alpha=1.23)
    with pytest.raises(ValueError, match='from a long transient to orbit-4-1-U4.2736') as refusal:
        planner.plan(parameters, ON_B, '4', Acts.DRIVE, 0.02)
    most = float(re.search('at most ([0-9.]+) is fine$', str(refusal.value))[1])
    # Just beyond the crisis few are lost.
    assert 0.0047 < most < 0.015


@pytest.mark.parametrize('acts', [Acts.DRIVE, Acts.PULSES])
def test_a_hold_counts_the_corrections_in_the_stream(planner, acts):
    """They are the retunes less alpha, or the kicks, that the simulator recorded."""
    law = dataclasses.replace(planner.plan(CHAOS, ON_B, '2', acts, 0.002).law, limit=0.01)
    simulation, cuts, whole = Simulation(CHAOS, ON_B), RunningHold(law, 0.57), RunningHold(
        law, 0.57)
    simulation.control(law)
    parts = [simulation.advance(cycle, 0.0, 50_000) for cycle in range(1, 600, 7)]
    events = np.concatenate(parts)
    for part in parts:
        cuts.update(part)
    whole.update(events)
    report = whole.report
    assert report == cuts.report and report.is_caught
    impacts = events[events['kind'] <= 1]
    changes = (np.append(impacts['alpha'][1:], events['alpha'][-1]) - 0.57
               if acts is Acts.DRIVE else impacts['velocity_after'] + 0.9 * impacts['velocity'])
    assert report.impacts == len(impacts) and 0.1 < report.share < 1.0
    assert report.mean_correction * report.share * len(impacts) == pytest.approx(
        np.sum(np.abs(changes)), abs=1e-12)


@pytest.mark.long
def test_a_node_holds_one_orbit_after_another_and_the_bag_verifies(
        start, rclpy_node, spin, tmp_path):
    """Two impacts, then four, through a change of alpha, and let go; every record is proved."""
    heard = []
    rclpy_node.create_subscription(
        JointState, 'control', lambda message: heard.append(
            dict(zip(message.name, message.position, strict=True))), STREAM)

    def call(kind, name, request):
        client = rclpy_node.create_client(kind, name)
        spin(client.service_is_ready)
        future = client.call_async(request)
        spin(future.done)
        return future.result()

    def put(node, **values):
        return call(SetParametersAtomically, f'/{node}/set_parameters_atomically',
                    SetParametersAtomically.Request(parameters=[
                        Parameter(name, value=value).to_parameter_msg()
                        for name, value in values.items()])).result

    def held(impacts):
        # What is under way belongs to the law before.
        begun = time.monotonic()
        spin(lambda: time.monotonic() > begun + 0.5)
        heard.clear()
        spin(lambda: heard and heard[-1]['orbit_impacts'] == impacts and heard[-1]['is_caught'],
             120.0)
        return heard[-1]

    recorder = start('recorder', '--ros-args', '-p', f'output:={tmp_path}/bag')
    control = start('control', '--ros-args', '-p', 'orbit:=2')
    start('simulator', '--ros-args', '-p', 'alpha:=0.57', '-p', 'initial_velocity:=-1.0', '-p',
          'rate:=500.0', '-p', 'noise:=1e-6', '-p', 'wait_for_readers:=2')
    values = held(2)
    assert values['exponent'] < 0.0 < values['exponent_free'] and values['catch_impacts'] < 2000
    assert put('control', orbit=4).successful
    held(4)
    assert put('simulator', alpha=0.5695).successful
    control.wait_for('control has ended with a change of parameters')
    held(4)
    answer = put('control', limit=-1.0)
    assert not answer.successful and 'limit' in answer.reason
    assert put('control', orbit='2', acts='delayed', limit=0.05).successful
    control.wait_for('limit = 0.05 is too large')
    assert call(Trigger, '/control/let_go', Trigger.Request()).success
    assert put('control', acts='pulses', limit=0.01).successful
    assert call(Trigger, '/control/shorter', Trigger.Request()).message == 'looking for <9'
    held(8)
    assert call(Trigger, '/control/shorter', Trigger.Request()).message == 'looking for <8'
    assert control.stop(signal.SIGINT) == recorder.stop(signal.SIGINT) == 0
    assert verify([str(tmp_path / 'bag')]) == 0


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_node_that_ends_lets_go_of_its_own_law(start, rclpy_node, spin, number):
    """The law of another stays."""
    client = rclpy_node.create_client(GetParameters, '/simulator/get_parameters')

    def law():
        future = client.call_async(GetParameters.Request(names=['control']))
        spin(future.done)
        return future.result().values[0].string_value

    simulator = start('simulator', '--ros-args', '-p', 'alpha:=0.57', '-p',
                      'initial_velocity:=-1.0', '-p', 'rate:=200.0', '-p', 'wait_for_readers:=1')
    control = start('control', '--ros-args', '-p', 'orbit:=B')
    simulator.wait_for('control of an orbit of 2 impacts')
    if number == signal.SIGINT:
        assert control.stop(number) == 0
        assert law() == ''
        return
    other = law().replace('0.002', '0.001')
    control.process.send_signal(signal.SIGSTOP)
    put = rclpy_node.create_client(
        SetParametersAtomically, '/simulator/set_parameters_atomically')
    spin(put.service_is_ready)
    spin(put.call_async(SetParametersAtomically.Request(parameters=[
        Parameter('control', value=other).to_parameter_msg()])).done)
    control.process.send_signal(number)
    assert control.stop(signal.SIGCONT) == 0
    assert law() == other
