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

"""The way from the page to a running simulator; ROS is imported only when it is needed."""

import math
import threading
from typing import Final, TYPE_CHECKING

from ..core.model import Parameters, State

if TYPE_CHECKING:
    from ..nodes.base.client import Visitor

_BELOW_TWO_PI: Final = math.nextafter(2.0 * math.pi, 0.0)


class SimulatorLink:
    """One node for all pages, made when a state is sent for the first time."""

    def __init__(self) -> None:
        self._visitor: Visitor | None = None
        self._lock = threading.Lock()

    def join(self) -> 'Visitor':
        """Return the client of the simulator, with only the services it needs."""
        from ..nodes.base.client import GET, PUT, RESET, Visitor
        if self._visitor is None:
            self._visitor = Visitor('explorer', '/simulator', (GET, PUT, RESET))
        return self._visitor

    def send(self, state: State, parameters: Parameters) -> tuple[str, bool]:
        """Reset the simulator to a state; return what happened, and whether it worked."""
        try:
            from ..nodes.base.client import ClientError
        except ImportError as error:
            return f'no ROS here ({error}): source ROS 2 and restart the explorer', False
        theirs: dict[str, float] = {}
        with self._lock:
            simulator = self.join()
            simulator.put({'initial_phase': min(max(float(state.phase), 0.0), _BELOW_TWO_PI),
                           'initial_displacement': float(state.displacement),
                           'initial_velocity': float(state.velocity)})
            simulator.reset()
            simulator.get(('alpha', 'beta', 'gamma', 'restitution'), theirs.update)
            try:
                simulator.wait()
            except ClientError as error:
                return str(error), False
        message = (f'the simulator continues from phase {state.phase:.6g}, s = '
                   f'{state.displacement:.6g}, velocity {state.velocity:.6g}')
        differ = [f'{name} = {value:g}' for name, value in theirs.items()
                  if value != getattr(parameters, name)]
        return message + (f'; it runs with {", ".join(differ)}' if differ else ''), True

    def close(self) -> None:
        """Leave the ROS graph, if it was joined."""
        with self._lock:
            if self._visitor is not None:
                self._visitor.close()
                self._visitor = None
