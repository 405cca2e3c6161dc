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

"""Running Lyapunov exponents of the stream."""

from collections.abc import Mapping
import dataclasses
import functools
from typing import Any

from rclpy.duration import Duration
from sensor_msgs.msg import JointState

from .base.dds_room import bound_backlog
from .base.event_input import EventInput
from .base.node import ReportingNode
from .base.process import run_node
from ..core.flight.simulation import Simulation
from ..core.model import Parameters, State
from ..core.stream.lyapunov import LyapunovReport, RunningLyapunov
from ..core.stream.report_values import infinite_in_words, lyapunov_values
from ..messages import named_values
from ..qos import STREAM


class Lyapunov(ReportingNode):
    """Feeds the stream to a RunningLyapunov and publishes its estimate at a steady rate."""

    def __init__(self, **options: Any) -> None:
        super().__init__('lyapunov', **options)
        window = int(self.values['window'])
        # Compile the kernels before the first batch.
        RunningLyapunov(window).update(Simulation(Parameters(), State()).advance(10, 0.0, 100))
        self._running = RunningLyapunov(window)
        self._published: LyapunovReport | None = None
        self._was_infinite = False
        self._publisher = self.create_publisher(JointState, 'lyapunov', STREAM)
        self._input = EventInput(
            self, self._running.guard, self._running.update, 'a new average begins')
        self.every(1.0 / self.number('publish_rate'), self._publish)
        self.get_logger().info('ready')

    def report(self) -> tuple[str, str, Mapping[str, object]]:
        now = dataclasses.asdict(self._running.report)
        return self._input.report(**now, infinite=infinite_in_words(now) or 'none')

    def close(self) -> None:
        self._input.drain()
        self._publish()
        # How long the last estimate may take to arrive.
        self._publisher.wait_for_all_acked(Duration(seconds=0.2))

    def _publish(self) -> None:
        now = self._running.report
        if now.index == 0 and now.impacts == 0 or now == self._published:
            return
        self._published = now
        values = lyapunov_values(now)
        infinite = infinite_in_words(values)
        # Logged where it begins, not in every epoch of a ramp.
        if infinite and not self._was_infinite:
            self.get_logger().info(infinite)
        self._was_infinite = bool(infinite)
        self._publisher.publish(named_values(values, self._input.stamp))


main = functools.partial(run_node, 'lyapunov', Lyapunov, room=bound_backlog)
