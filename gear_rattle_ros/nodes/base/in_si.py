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

"""The gear pair in whose SI units a node shows what it hears."""

from collections.abc import Mapping
from typing import Any

from rcl_interfaces.msg import ParameterEvent
from rclpy.qos import qos_profile_parameter_events

from .node import ReportingNode
from .services import listen
from ...core.gears import Gears
from ...gear_pairs import pair_of
from ...parameters import SPEEDS, Value


class NodeInSi(ReportingNode):
    """A node with the parameters of a gear pair, whose speed follows that of the simulator."""

    gears: Gears | None = None

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        listen(self, ParameterEvent, '/parameter_events', self._heed,
               qos_profile_parameter_events)

    def defaults(self, given: Mapping[str, Any]) -> Mapping[str, Value]:
        self.gears = pair_of(given)
        return self.gears.given if self.gears else {}

    def _heed(self, event: ParameterEvent) -> None:
        beside = f'{self.get_namespace().rstrip("/")}/simulator'
        if self.gears and event.node == beside:
            given = self.gears.given
            speeds = {each.name: each.value.double_value for each in event.changed_parameters
                      if each.name in SPEEDS and each.name in given}
            if speeds:
                self.gears = self.gears.at(**speeds)
