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

"""Qualities of service, frames and scenes by parameters; the last impact at the display rate."""

from collections.abc import Callable
import math
from pathlib import Path
import re
from xml.etree import ElementTree

import numpy as np
import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState, PointCloud2

from gear_rattle_ros.core.gears import Gears
from gear_rattle_ros.core.model import EventKind
from gear_rattle_ros.messages import events_from_cloud
from gear_rattle_ros.nodes.base.node import BaseNode
from gear_rattle_ros.nodes.base.pacing import AcknowledgedPace
from gear_rattle_ros.nodes.lyapunov import Lyapunov
from gear_rattle_ros.nodes.simulator import Simulator
from gear_rattle_ros.nodes.transients import Transients
from gear_rattle_ros.nodes.viewer.node import Viewer
from gear_rattle_ros.places import config_folder
from gear_rattle_ros.qos import check_overrides, OVERRIDABLE, STREAM, STREAM_INPUT
from gear_rattle_ros.scenes import find_scene

IMPACTS = 'qos_overrides./left/impacts'


def test_a_publisher_has_the_quality_that_is_given(rclpy_node: Node) -> None:
    """Seen by others; read-only; other publishers and the shared profiles keep their own."""
    node = Simulator(context=rclpy_node.context, namespace='left', parameter_overrides=[
        Parameter(f'{IMPACTS}.publisher.{name}', value=value) for name, value in (
            ('depth', 7), ('reliability', 'best_effort'), ('durability', 'transient_local'))])
    qos, = (each.qos_profile for each in node.get_publishers_info_by_topic('/left/impacts'))
    assert qos.reliability is ReliabilityPolicy.BEST_EFFORT
    assert qos.durability is DurabilityPolicy.TRANSIENT_LOCAL
    joints, = (each.qos_profile for each in node.get_publishers_info_by_topic(
        '/left/joint_states'))
    assert joints.reliability is STREAM.reliability is ReliabilityPolicy.RELIABLE
    assert node.get_parameter(f'{IMPACTS}.publisher.depth').value == 7
    answer, = node.set_parameters([Parameter(f'{IMPACTS}.publisher.depth', value=8)])
    assert not answer.successful
    assert STREAM.depth == 1000 and STREAM.durability is DurabilityPolicy.VOLATILE
    node.destroy_node()


def test_a_subscription_has_the_quality_that_is_given(rclpy_node: Node) -> None:
    """A reader of all that is made one of the last few."""
    node = Lyapunov(context=rclpy_node.context, namespace='left', parameter_overrides=[
        Parameter(f'{IMPACTS}.subscription.{name}', value=value)
        for name, value in (('history', 'keep_last'), ('depth', 3))])
    qos, = (each.qos_profile for each in node.subscriptions if each.topic_name == '/left/impacts')
    assert (qos.history, qos.depth) == (HistoryPolicy.KEEP_LAST, 3)
    assert STREAM_INPUT.history is HistoryPolicy.KEEP_ALL
    node.destroy_node()


@pytest.mark.parametrize('name, value, words', [
    ('qos_overrides./impacts.publisher.deadline', 5, 'cannot be overridden in this node; '
     'overridable are history, depth, reliability and durability of /impacts.publisher'),
    ('qos_overrides./impacts.subscription.depth', 5, 'cannot be overridden'),
    ('qos_overrides./parameter_events.publisher.depth', 5, 'cannot be overridden'),
    ('qos_overrides', 5, 'cannot be overridden'), ('qos_overrides.depth', 5, 'cannot be over'),
    ('qos_overrides./impacts.publisher.depth', 0, '= 0 is not a number of messages from 1 on'),
    ('qos_overrides./impacts.publisher.depth', True, '= True is not a number of messages'),
    ('qos_overrides./impacts.publisher.history', 'some', "= 'some' is not one of .*keep_last"),
    ('qos_overrides./impacts.publisher.reliability', 1, '= 1 is not one of .*best_effort')])
def test_what_has_no_effect_is_refused(name: str, value: object, words: str) -> None:
    """One line that names the parameter, and what could be overridden."""
    with pytest.raises(ValueError, match=f'^{re.escape(name)} {words}'):
        check_overrides({name: value}, {'publisher': ['/impacts']})


def test_a_node_refuses_before_it_does_anything(rclpy_node: Node) -> None:
    """Also one without topics of its own; names are those of its namespace."""
    for kind, name in (('teleop', f'{IMPACTS}.publisher.depth'),
                       ('simulator', 'qos_overrides./impacts.publisher.depth')):
        with pytest.raises(ValueError, match='cannot be overridden'):
            BaseNode(kind, context=rclpy_node.context, namespace='left',
                     parameter_overrides=[Parameter(name, value=5)])


def test_topics_that_can_be_overridden_are_those_of_the_nodes() -> None:
    """Nothing else is in the policy of their security, but what all nodes have."""
    root = ElementTree.parse(config_folder('sros2') / 'gear_rattle_ros.policy.xml')
    for profile in root.iter('profile'):
        name = profile.get('node')
        for place, word in (('publisher', 'publish'), ('subscription', 'subscribe')):
            allowed = {topic.text.lstrip('/') for topics in profile.findall(f'topics[@{word}]')
                       for topic in topics} - {'rosout', 'parameter_events', 'diagnostics'}
            given = {each.lstrip('/') for each in OVERRIDABLE.get(name, {}).get(place, ())}
            assert given <= allowed
            if name in OVERRIDABLE and (name, place) not in (
                    ('basin', 'subscription'), ('teleop', 'subscription')):
                assert allowed - given <= {'clock'}


def test_pace_never_has_more_open_than_the_publisher_keeps(rclpy_node: Node) -> None:
    """Else messages could be dropped before they are acknowledged."""
    output = rclpy_node.create_publisher(PointCloud2, 'few', QoSProfile(depth=2))
    assert AcknowledgedPace(output)._window == 2
    many = rclpy_node.create_publisher(PointCloud2, 'many', STREAM)
    assert AcknowledgedPace(many)._window == 400


def test_a_scene_is_played_and_its_values_can_be_overridden(rclpy_node: Node) -> None:
    """Its first step replaces defaults; the second, after 8 s, resets to another velocity."""
    scene = find_scene('two-attractors')
    node = Simulator(context=rclpy_node.context, parameter_overrides=[
        Parameter('scene', value='two-attractors'), Parameter('rate', value=50.0)])
    assert node.number('alpha') == 0.48 and node.number('initial_velocity') == -0.5
    assert node.number('rate') == 50.0 != scene.steps[0].parameters['rate']
    node._played = scene.steps[0].seconds - 0.1
    node._play()
    epoch = node._simulation.epoch
    node._paused = True
    node._looked -= 1.0
    node._play()
    assert node.get_parameter('initial_velocity').value == -0.5
    node._paused = False
    node._looked -= 1.0
    node._play()
    assert node.get_parameter('initial_velocity').value == -1.0
    assert node._simulation.epoch == epoch + 1
    node.destroy_node()
    with pytest.raises(ValueError, match="no scene 'nix'"):
        Simulator(context=rclpy_node.context, parameter_overrides=[
            Parameter('scene', value='nix')])


def heard(listener: Node, spin: Callable, topic: str, nodes: list[BaseNode],
          is_enough: Callable[[list[dict[str, float]]], bool]
          ) -> tuple[list[dict[str, float]], np.ndarray]:
    """Run nodes until enough has come on a topic; return that with the events so far."""
    shown: list[dict[str, float]] = []
    events: list[np.ndarray] = []
    listener.create_subscription(JointState, topic, lambda message: shown.append(
        dict(zip(message.name, message.position, strict=True))), STREAM)
    listener.create_subscription(PointCloud2, 'impacts', lambda cloud: events.append(
        events_from_cloud(cloud)), STREAM_INPUT)
    executor = SingleThreadedExecutor(context=listener.context)
    for each in nodes:
        executor.add_node(each)

    def is_there() -> bool:
        executor.spin_once(timeout_sec=0.01)
        return is_enough(shown)

    spin(is_there)
    for each in nodes:
        each.destroy_node()
    return shown, np.concatenate(events)


def test_rattle_is_published_in_the_units_of_the_gear_pair(
        rclpy_node: Node, spin: Callable) -> None:
    """The backlash is 0.1 mm, so 1 is 0.1 mm times omega; a stretch ends where the next begins."""
    pair = {'inertia_kg_m2': 1.4e-3, 'driver_radius_m': 0.04, 'driven_radius_m': 0.05,
            'backlash_m': 1e-4, 'drag_n_m_s_per_rad': 0.02, 'torque_n_m': 0.05,
            'drive_rad': 0.0017, 'frequency_hz': 50.0}
    given = [Parameter(name, value=value) for name, value in pair.items()]
    simulator = Simulator(context=rclpy_node.context, parameter_overrides=[
        *given, Parameter('rate', value=400.0), Parameter('wait_for_readers', value=2),
        Parameter('restitution', value=0.8)])
    node = Transients(context=rclpy_node.context, parameter_overrides=[
        *given, Parameter('rattle_rate', value=20.0)])
    shown, stream = heard(rclpy_node, spin, 'rattle', [node, simulator],
                          lambda shown: len(shown) > 9)
    times = (stream['cycle'] + stream['phase'] / (2.0 * math.pi)) / 50.0
    velocity = 1e-4 * 2.0 * math.pi * 50.0
    begin, end = times[0], 0.0
    for one in shown[:9]:
        end = begin + one['duration_s']
        mine = (times > begin + 1e-9) & (times < end + 1e-9) & (stream['kind'] <= 1)
        speeds = velocity * np.abs(stream['velocity'][mine])
        assert one['speed_peak_m_per_s'] == pytest.approx(np.max(speeds))
        assert one['rate_upper_per_s'] + one['rate_lower_per_s'] == pytest.approx(
            len(speeds) / one['duration_s'])
        begin = end


def test_the_speed_of_a_gear_pair_changes_live(
        rclpy_node: Node, spin: Callable, tmp_path: Path) -> None:
    """The model follows in the same state, what shows SI units, too; others are refused."""
    pair = {'inertia_kg_m2': 1.4e-3, 'driver_radius_m': 0.04, 'driven_radius_m': 0.05,
            'backlash_m': 1e-4, 'drag_n_m_s_per_rad': 0.02, 'torque_n_m': 0.05,
            'drive_rad': 0.0017, 'order': 2.0, 'speed_rpm': 1500.0}
    given = [Parameter(name, value=value) for name, value in pair.items()]
    simulator = Simulator(context=rclpy_node.context, parameter_overrides=[
        *given, Parameter('restitution', value=0.8)])
    node = Transients(context=rclpy_node.context, parameter_overrides=given)
    events: list[np.ndarray] = []
    rclpy_node.create_subscription(PointCloud2, 'impacts', lambda cloud: events.append(
        events_from_cloud(cloud)), STREAM_INPUT)
    executor = SingleThreadedExecutor(context=rclpy_node.context)
    for each in (node, simulator):
        executor.add_node(each)
    # What was changed before stays changed, in the units of the gear pair.
    for name, value in (('alpha', 0.9), ('speed_rpm', 3000)):
        (answer,) = simulator.set_parameters([Parameter(name, value=value)])
        assert answer.successful, answer.reason
    expected = Gears(**pair, restitution=0.8).at(speed_rpm=3000.0)

    def has_followed() -> bool:
        executor.spin_once(timeout_sec=0.01)
        return node.gears == expected.at(restitution=0.9) and any(
            batch['kind'].max() >= EventKind.RETUNE for batch in events)

    spin(has_followed)
    last = np.concatenate(events)[-1]
    assert (last['alpha'], last['beta'], last['gamma']) == pytest.approx(
        (0.9, expected.parameters.beta, expected.parameters.gamma), rel=1e-14)
    assert simulator.get_parameter('gamma').value == last['gamma']
    assert simulator._omega == expected.omega
    for name, value, words in (('frequency_hz', 60.0, 'is not what the speed of a gear pair'),
                               ('speed_rpm', 1.0, 'gamma = .* is outside')):
        (answer,) = simulator.set_parameters([Parameter(name, value=value)])
        assert not answer.successful and re.search(words, answer.reason)
    viewer = Viewer(context=rclpy_node.context, parameter_overrides=[
        *given, Parameter('mode', value='none'), Parameter('save', value=str(
            tmp_path / 'a.rrd'))])
    viewer._take(np.concatenate(events))
    assert f'velocity 1 is {1e3 * Gears(**pair, restitution=0.8).scales.velocity_m_per_s:.4g} ' \
        'mm/s, the backlash 100 μm, a drive period 20 ms' in viewer._document()
    for each in (node, simulator, viewer):
        each.destroy_node()


def test_the_last_impact_comes_at_the_display_rate(
        rclpy_node: Node, spin: Callable) -> None:
    """Its values are those of the record; on attractor A of the paper the attractor is 1."""
    node = Transients(context=rclpy_node.context, parameter_overrides=[
        Parameter('display_rate', value=200.0)])
    simulator = Simulator(context=rclpy_node.context, parameter_overrides=[
        Parameter('rate', value=400.0), Parameter('wait_for_readers', value=2)])
    shown, stream = heard(rclpy_node, spin, 'last_impact', [node, simulator], lambda shown: (
        len(shown) > 9 and shown[-1]['attractor'] == 1.0))
    records = {int(each['index']): each for each in stream if each['kind'] == 0}
    # The batches decide how many are shown before the orbit is reached, which takes 35 impacts.
    numbers = [each['attractor'] for each in shown]
    assert set(numbers) <= {0.0, 1.0} and numbers == sorted(numbers)
    assert all(each['index'] >= 35 for each in shown if each['attractor'])
    known = [each for each in shown if int(each['index']) in records]
    assert len(known) > 3
    for each in known:
        record = records[int(each['index'])]
        assert all(each[name] == record[name] for name in each if name != 'attractor')
