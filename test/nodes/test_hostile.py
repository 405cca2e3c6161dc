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

"""Hostile input to live nodes: they refuse it in one line each, and go on with what is right."""

import array
import itertools
import math
import random
import re

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
import pytest
from rcl_interfaces.msg import Parameter as ParameterMessage, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
import rclpy
from rclpy.duration import Duration
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState, PointCloud2, PointField
from std_msgs.msg import String

from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EventKind, Parameters, State
from gear_rattle_ros.core.stream.lyapunov import RunningLyapunov
from gear_rattle_ros.messages import cloud_from_events, stamp_from_nanoseconds
from gear_rattle_ros.parameters import SIMULATOR, SPEEDS
from gear_rattle_ros.qos import STREAM

READERS = ('lyapunov', 'transients', 'control', 'recorder', 'viewer')
STAMP = stamp_from_nanoseconds(0)


def broken_clouds(events):
    """Return clouds that are none of ours: layout, sizes, types, byte order, values."""
    def cloud(change=None, values=None):
        batch = events[:20].copy()
        if values:
            batch[values[0]][7] = values[1]
        made = cloud_from_events(batch, STAMP)
        made.fields = [PointField(name=field.name, offset=field.offset, datatype=field.datatype,
                                  count=field.count) for field in made.fields]
        if change:
            change(made)
        return made

    def field(named, **to):
        def change(made):
            for each in made.fields:
                if each.name == named:
                    for key, value in to.items():
                        setattr(each, key, value)
        return cloud(change)

    def attribute(**to):
        return cloud(lambda made: [setattr(made, key, value) for key, value in to.items()])

    return [
        PointCloud2(),
        attribute(is_bigendian=True),
        attribute(point_step=0),
        attribute(point_step=2**32 - 1),
        attribute(width=2**32 - 1),
        attribute(width=2**32 - 1, height=2**32 - 1, point_step=2**32 - 1),
        attribute(data=array.array('B')),
        attribute(height=2, width=10, row_step=7),
        attribute(fields=[]),
        cloud(lambda made: made.fields.append(made.fields[5])),
        cloud(lambda made: setattr(made, 'data', made.data[:-1])),
        field('velocity', datatype=PointField.FLOAT32),
        field('velocity', datatype=0),
        field('index', datatype=PointField.FLOAT64),
        field('phase', count=2),
        field('phase', count=0),
        field('gamma', offset=2**32 - 1),
        field('kind', name='Kind'),
        *(cloud(values=(name, value)) for name, value in (
            ('kind', 5), ('kind', 2**32 - 1), ('phase', math.nan), ('phase', 6.5),
            ('phase', -1e-300), ('displacement', 1e-9), ('displacement', -0.5),
            ('velocity', math.inf), ('velocity', math.nan), ('velocity_after', -math.inf),
            ('alpha', -1.0), ('beta', math.nan), ('gamma', math.inf), ('restitution', 1.0001))),
    ]


def confused(events):
    """Return good records in orders that no simulator sends."""
    jumbled = events[:200].copy()
    random.Random(1).shuffle(jumbled)
    mixed = events[:200].copy()
    mixed['epoch'] = np.arange(200) % 3
    frozen = events[:200].copy()
    frozen['cycle'] = 5
    huge = events[:200].copy()
    huge['index'] += np.uint32(2**31 - 1)
    return [events[:200][::-1], jumbled, mixed, frozen, huge, np.repeat(events[:50], 4)]


@pytest.mark.long
def test_readers_refuse_what_is_no_stream_and_go_on(start, domain, rclpy_node, spin, tmp_path):
    """Every broken cloud is counted; what is computed at the end is that of the good part."""
    events = Simulation(Parameters(1.23), State(velocity=-1.0)).advance(10**8, 0.0, 3000)
    assert (events['kind'][1:] == EventKind.IMPACT).all()
    publisher = rclpy_node.create_publisher(PointCloud2, 'impacts', STREAM)
    said, health = [], {}
    rclpy_node.create_subscription(JointState, 'lyapunov', said.append, STREAM)

    def listen(message):
        status = message.status[0]
        health[status.name.split(':')[0]] = (
            status.message, {item.key: item.value for item in status.values})

    rclpy_node.create_subscription(DiagnosticArray, '/diagnostics', listen, 50)
    nodes = {
        'lyapunov': start('lyapunov'),
        'transients': start('transients'),
        'control': start('control'),
        'recorder': start('recorder', '--ros-args', '-p', f'output:={tmp_path}/bag'),
        'viewer': start('viewer', '--ros-args', '-p', 'mode:=none', '-p',
                        f'save:={tmp_path}/run.rrd'),
    }
    spin(lambda: publisher.get_subscription_count() == len(READERS), 90.0)
    broken = broken_clouds(events)
    for cloud in broken:
        publisher.publish(cloud)
    for batch in confused(events):
        publisher.publish(cloud_from_events(batch, STAMP))
    # The numbering begins anew: what follows is computed from here alone.
    publisher.publish(cloud_from_events(events[:1000], STAMP))
    publisher.publish(cloud_from_events(events[1000:], STAMP))
    assert publisher.wait_for_all_acked(Duration(seconds=20))
    last = int(events['index'][-1])
    spin(lambda: said and said[-1].position[-1] == last, 60.0)
    running = RunningLyapunov()
    running.update(events)
    values = dict(zip(said[-1].name, said[-1].position, strict=True))
    assert values['lambda_1'] == running.report.lambda_1
    assert values['impacts'] == running.report.impacts
    spin(lambda: all(health.get(name, ('', {}))[1].get('refused_batches') == str(len(broken))
                     for name in ('lyapunov', 'transients', 'control', 'viewer')), 30.0)
    # In a participant of its own, as within one DDS itself refuses it.
    context = rclpy.context.Context()
    rclpy.init(context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    foreign = rclpy.create_node('foreigner', context=context)
    foreign.create_publisher(String, 'impacts', 10).publish(String(data='x' * 10_000))
    spin(lambda: all('foreigner publishes impacts as std_msgs/msg/String' in health[name][0]
                     for name in READERS), 30.0)
    foreign.destroy_node()
    context.try_shutdown()
    for name, node in nodes.items():
        assert node.stop(within=30.0) == 0
        assert 'Traceback' not in node.text()
        if name != 'recorder':
            assert node.text().count('refused a batch') >= 20
    # It records what comes, and counts what it can.
    assert re.search(r' (1[5-9]|2\d) batches unreadable', nodes['recorder'].text())


def every_value():
    """Return a parameter value of every type, with the extremes of each."""
    big = 2**63 - 1
    numbers = (0.0, -0.0, 1e-300, -1e-300, 0.5, 1.0 + 1e-7, 1e308, math.inf, -math.inf, math.nan)
    return [
        ParameterValue(),
        ParameterValue(type=200),
        *(ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=value)
          for value in (True, False)),
        *(ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=value)
          for value in (0, 1, -1, big, -big - 1)),
        *(ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)
          for value in numbers),
        *(ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=value)
          for value in ('', '1', 'nan', 'x' * 100_000, 'größer', '\n{}')),
        ParameterValue(type=ParameterType.PARAMETER_BYTE_ARRAY, byte_array_value=[b'\x00']),
        ParameterValue(type=ParameterType.PARAMETER_BOOL_ARRAY, bool_array_value=[True]),
        ParameterValue(type=ParameterType.PARAMETER_INTEGER_ARRAY, integer_array_value=[1]),
        ParameterValue(type=ParameterType.PARAMETER_DOUBLE_ARRAY, double_array_value=[1.0]),
        ParameterValue(type=ParameterType.PARAMETER_STRING_ARRAY, string_array_value=['a']),
    ]


def is_good(specification, value):
    """Whether a value of the service fits: type and range, an integer for a double."""
    wanted = type(specification.default)
    if value.type == ParameterType.PARAMETER_BOOL:
        return wanted is bool
    if value.type == ParameterType.PARAMETER_STRING:
        # No text here is a control law but the empty one.
        return wanted is str and value.string_value in (specification.choices or ('',))
    if value.type == ParameterType.PARAMETER_INTEGER and wanted in (int, float):
        number = value.integer_value
    elif value.type == ParameterType.PARAMETER_DOUBLE and wanted is float:
        number = value.double_value
    else:
        return False
    # There is no gear pair here whose speed could change.
    return number == 0 if specification.name in SPEEDS else (
        specification.low <= number <= specification.high)


def test_parameters_of_every_type_and_extreme(start, rclpy_node, spin):
    """Over the real service: taken exactly where the table allows it, with a reason where not."""
    simulator = start('simulator', '--ros-args', '-p', 'rate:=10.0')
    setter = rclpy_node.create_client(SetParameters, '/simulator/set_parameters')
    getter = rclpy_node.create_client(GetParameters, '/simulator/get_parameters')
    spin(setter.service_is_ready, 60.0)

    def call(client, request):
        future = client.call_async(request)
        spin(future.done, 60.0)
        return future.result()

    live = [s for s in SIMULATOR if not s.read_only]
    names = ['', 'alhpa', 'use_sim_time', 'qos_overrides.x', 'a' * 10_000, 'ä', '/', 'alpha.']
    for specification, value in itertools.product(live, every_value()):
        # Speed as fast as possible is no extreme to be had in passing.
        if specification.name == 'rate' and value.type in (2, 3) and is_good(specification, value):
            continue
        result = call(setter, SetParameters.Request(parameters=[
            ParameterMessage(name=specification.name, value=value)])).results[0]
        words = (specification.name, value.type, result.reason)
        assert result.successful == is_good(specification, value), words
        assert result.successful or specification.name in result.reason, words
        assert len(result.reason) < 300
    for name, value in itertools.product(names, every_value()):
        result = call(setter, SetParameters.Request(
            parameters=[ParameterMessage(name=name, value=value)])).results[0]
        # To unset what is not there is no mistake.
        assert not result.successful or name == 'use_sim_time' or value.type == 0, name
    read_only = [s for s in SIMULATOR if s.read_only]
    for value in every_value():
        results = call(setter, SetParameters.Request(parameters=[
            ParameterMessage(name=s.name, value=value) for s in read_only])).results
        # Of a type that ROS does not have nothing is looked at, and the first one named.
        for specification, result in zip(read_only, results, strict=True):
            assert not result.successful
            assert specification.name in result.reason or value.type == 200
    values = call(getter, GetParameters.Request(names=[s.name for s in live])).values
    for specification, value in zip(live, values, strict=True):
        assert is_good(specification, value)
    # It still runs, and on wall time whatever use_sim_time was set to.
    impacts = []
    rclpy_node.create_subscription(PointCloud2, 'impacts', impacts.append, STREAM)
    assert call(setter, SetParameters.Request(parameters=[
        ParameterMessage(name=name, value=ParameterValue(
            type=ParameterType.PARAMETER_DOUBLE, double_value=value))
        for name, value in (('alpha', 0.57), ('gamma', 0.1), ('noise', 0.0), ('rate', 50.0),
                            ('alpha_rate', 0.0), ('beta', 0.1), ('restitution', 0.9))]))
    spin(lambda: len(impacts) > 5, 30.0)
    assert 'Traceback' not in simulator.text()
    assert simulator.stop() == 0
