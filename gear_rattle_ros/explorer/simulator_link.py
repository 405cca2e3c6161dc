"""The way from the page to a running simulator; ROS is looked for only when it is asked for."""

import threading
from typing import TYPE_CHECKING

from ..core.model import Parameters, State

if TYPE_CHECKING:
    from ..nodes.steering import Steering


class SimulatorLink:
    """One node for all pages, made when a state is sent for the first time."""

    def __init__(self) -> None:
        self._steering: Steering | None = None
        self._lock = threading.Lock()

    def send(self, state: State, parameters: Parameters) -> tuple[str, bool]:
        """Make a state the simulator's next initial state; returns what came of it and whether."""
        try:
            from ..nodes.steering import Steering, SteeringError
        except ImportError as error:
            return f'no ROS here ({error}): source a ROS 2 installation and start me again', False
        with self._lock:
            try:
                if self._steering is None:
                    self._steering = Steering(name='explorer')
                theirs = self._steering.send(state.phase, state.displacement, state.velocity)
            except SteeringError as error:
                return str(error), False
        message = (f'the simulator goes on from phase {state.phase:.6g}, s = '
                   f'{state.displacement:.6g}, velocity {state.velocity:.6g}')
        differ = [f'{name} = {value:g}' for name, value in theirs.items()
                  if value != getattr(parameters, name)]
        return message + (f'; it runs with {", ".join(differ)}' if differ else ''), True

    def close(self) -> None:
        """Leave the ROS graph, if it was joined."""
        with self._lock:
            if self._steering is not None:
                self._steering.close()
                self._steering = None
