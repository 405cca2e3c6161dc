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

"""Where transients end: periodic orbits and rest, found in the stream."""

from collections.abc import Mapping
import functools
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
from sensor_msgs.msg import JointState

from .base.dds_room import bound_backlog
from .base.event_input import EventInput
from .base.in_si import NodeInSi
from .base.process import run_node
from ..core.flight.simulation import Simulation
from ..core.model import EventArray, EventKind, Parameters, State
from ..core.orbits.letters import LETTERS
from ..core.stream.rattle import rattle_of, RunningRattle
from ..core.stream.report_values import hop_values, transient_values
from ..core.stream.transients import Regime, TransientDetector, TransientReport
from ..messages import diagnostic_array, named_values
from ..qos import LATCHED, STREAM

# What last_impact has of the record of an impact.
SHOWN: Final = ('velocity', 'velocity_after', 'phase', 'displacement', 'alpha', 'epoch', 'index')


class Transients(NodeInSi):
    """Feeds the stream to a TransientDetector and publishes every change; and the rattle."""

    def __init__(self, **options: Any) -> None:
        super().__init__('transients', **options)
        self._tolerance = self.number('tolerance')
        self._rattle = RunningRattle()
        # Compile the kernels before the first batch.
        some = Simulation(Parameters(), State(), noise=0.01).advance(100, 0.0, 400)
        TransientDetector(self._tolerance).update(some)
        rattle_of(some)
        self._detector = TransientDetector(self._tolerance)
        self._attractor = _number_of(self._detector.report)
        self._last: Any = None
        self._publisher = self.create_publisher(DiagnosticArray, 'transient', LATCHED)
        self._display = self.create_publisher(JointState, 'last_impact', STREAM)
        self._hops = self.create_publisher(JointState, 'hops', STREAM)
        self._counted: Any = None
        if self.number('display_rate') > 0.0:
            self.every(1.0 / self.number('display_rate'), self._show)
        self._rattling = self.create_publisher(JointState, 'rattle', STREAM)
        if self.number('rattle_rate') > 0.0:
            self.every(1.0 / self.number('rattle_rate'), self._publish_rattle)
        self.every(1.0, self._count)
        self._input = EventInput(
            self, self._detector.guard, self._take, 'the search for an orbit begins again')
        self.get_logger().info('ready')

    def report(self) -> tuple[str, str, Mapping[str, object]]:
        return self._input.report(
            regime=self._detector.report.describe(), impacts=self._detector.impacts)

    def close(self) -> None:
        self._input.drain()

    def _take(self, events: EventArray) -> None:
        changes = self._detector.update(events)
        if self.number('rattle_rate') > 0.0:
            unit = self.gears.scales.velocity_m_per_s if self.gears else 1.0
            self._rattle.update(events, self.number('rattle_above') / unit)
        # A hole is logged before what follows from it.
        self._input.health.log()
        for change in changes:
            words, values = change.describe_attractor(), transient_values(change)
            if change.letter:
                values['letter'] = change.letter
            self._publisher.publish(diagnostic_array(
                f'{self.get_name()}: trajectory', self.get_fully_qualified_name(), 'ok', words,
                values | {'tolerance': self._tolerance}, self._input.stamp))
            self.get_logger().info(words)
            self._attractor = _number_of(change)
        impacts = np.flatnonzero(events['kind'] == EventKind.IMPACT)
        if len(impacts):
            self._last = events[impacts[-1]]

    def _count(self) -> None:
        hops, index = self._detector.hops, self._detector.index
        if not hops.known or self._counted == (hops, index):
            return
        self._counted = hops, index
        self._hops.publish(named_values(hop_values(hops, index), self._input.stamp))

    def _show(self) -> None:
        if self._last is not None:
            values = {name: float(self._last[name]) for name in SHOWN}
            self._display.publish(named_values(
                values | {'attractor': self._attractor}, self._input.stamp))
            self._last = None

    def _publish_rattle(self) -> None:
        now = self._rattle.take()
        if now.duration > 0.0:
            self._rattling.publish(named_values(
                now.in_si(self.gears.scales) if self.gears else vars(now), self._input.stamp))


def _number_of(report: TransientReport) -> float:
    """Return 0 for a transient, 1 for attractor A, 2 for B ..., -1 for one without a letter."""
    if report.regime is Regime.TRANSIENT:
        return 0.0
    return LETTERS.index(report.letter) + 1.0 if report.letter else -1.0


main = functools.partial(run_node, 'transients', Transients, room=bound_backlog)
