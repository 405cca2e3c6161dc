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

"""A state is sent to a real simulator on real DDS, or the reason why not comes back."""

from collections.abc import Callable
import math

import pytest

from gear_rattle_ros.core.model import Parameters, State
from gear_rattle_ros.explorer.simulator_link import SimulatorLink
from gear_rattle_ros.places import typed

pytest.importorskip('rclpy')


def test_simulator_goes_on_from_the_state(
        start: Callable[..., object], rclpy_node, spin: Callable[..., None]) -> None:
    """Its stream has a reset with the very numbers; a difference of parameters is reported."""
    from sensor_msgs.msg import PointCloud2

    from gear_rattle_ros.messages import events_from_cloud
    from gear_rattle_ros.qos import STREAM_INPUT
    resets: list[tuple[float, float, float]] = []

    def take(cloud: PointCloud2) -> None:
        for event in events_from_cloud(cloud):
            if event['kind'] == 4:
                resets.append((float(event['phase']), float(event['displacement']),
                               float(event['velocity_after'])))

    rclpy_node.create_subscription(PointCloud2, 'impacts', take, STREAM_INPUT)
    # The stream is volatile: its first record is for those who are there.
    simulator = start(
        'simulator', '--ros-args', '-p', 'alpha:=0.57', '-p', 'wait_for_readers:=1')
    simulator.wait_for('ready', within=180.0)
    spin(lambda: resets)
    link = SimulatorLink()
    state = State(0, math.nextafter(2.0 * math.pi, 0.0), -0.3, 1.2345678901234567)
    said, is_good = link.send(state, Parameters(alpha=0.48))
    assert is_good, said
    assert said.endswith('it runs with alpha = 0.57')
    spin(lambda: resets[-1] == (state.phase, state.displacement, state.velocity))
    link.close()


@pytest.mark.long
def test_without_a_simulator_it_explains_what_to_do(domain: int) -> None:
    """Within seconds, in one line."""
    link = SimulatorLink()
    said, is_good = link.send(State(0, 1.0, 0.0, 0.5), Parameters())
    link.close()
    assert not is_good
    assert said == ('no simulator answers as /simulator; start one with: '
                    + ' '.join(typed('simulator')))
