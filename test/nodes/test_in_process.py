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

"""Several nodes of a kind in one process: each has its own parameters, topics and numbers."""

import math
import os
import time

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState, PointCloud2

from gear_rattle_ros.messages import events_from_cloud
from gear_rattle_ros.nodes.lyapunov import Lyapunov
from gear_rattle_ros.nodes.simulator import Simulator
from gear_rattle_ros.qos import STREAM, STREAM_INPUT

# A chaotic attractor and a periodic one.
ALPHAS = {'left': 1.23, 'right': 0.48}
# The number of impacts after which the signs of the exponents are clear.
ENOUGH = 3000


def test_two_simulators_and_two_analyses_in_one_process(domain: int) -> None:
    """Namespaces keep them apart; each exponent belongs to the parameters of its own stream."""
    environment = dict(os.environ)
    context = Context()
    rclpy.init(context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    executor = SingleThreadedExecutor(context=context)
    listener = rclpy.create_node('listener', context=context)
    estimates: dict[str, dict[str, float]] = {name: {} for name in ALPHAS}
    alphas: dict[str, set[float]] = {name: set() for name in ALPHAS}
    reporting: set[str] = set()
    frames: set[str] = set()
    nodes: list[Lyapunov | Simulator] = []
    for place, alpha in ALPHAS.items():
        listener.create_subscription(
            JointState, f'{place}/lyapunov', lambda message, place=place: estimates[place].update(
                zip(message.name, message.position, strict=True)), STREAM)
        listener.create_subscription(
            PointCloud2, f'{place}/impacts', lambda cloud, place=place: (
                frames.add(cloud.header.frame_id), alphas[place].update(
                    np.unique(events_from_cloud(cloud)['alpha']).tolist())), STREAM_INPUT)
        nodes.append(Lyapunov(context=context, namespace=place,
                              cli_args=['--ros-args', '-p', 'window:=500']))
        assert nodes[-1].values['window'] == 500
        nodes.append(Simulator(context=context, namespace=place, parameter_overrides=[
            Parameter('alpha', value=alpha), Parameter('rate', value=2000.0),
            Parameter('wait_for_readers', value=2)]))
    listener.create_subscription(
        DiagnosticArray, '/diagnostics',
        lambda message: reporting.add(message.status[0].hardware_id), 10)
    for node in (listener, *nodes):
        executor.add_node(node)
    deadline = time.monotonic() + 60.0
    while len(reporting) < 4 or any(
            each.get('impacts', 0.0) < ENOUGH for each in estimates.values()):
        assert time.monotonic() < deadline, (reporting, estimates)
        executor.spin_once(timeout_sec=0.05)
    for node in nodes:
        node.close()
        node.destroy_node()
        assert node.exit_status == 0
    listener.destroy_node()
    context.try_shutdown()
    assert dict(os.environ) == environment
    assert frames == {'left/section', 'right/section'}
    assert reporting == {f'/{place}/{name}' for place in ALPHAS
                         for name in ('lyapunov', 'simulator')}
    assert alphas == {place: {alpha} for place, alpha in ALPHAS.items()}
    assert estimates['left']['lambda_1'] > 0.1 and estimates['right']['lambda_1'] < -0.01
    for each in estimates.values():
        # Area shrinks by r^2 at an impact and by exp(-beta t) in flight, whatever the orbit.
        identity = 2.0 * math.log(0.9) - 0.1 * each['mean_flight_time']
        assert each['sum'] == pytest.approx(identity, abs=1e-9)
