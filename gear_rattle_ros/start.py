"""
The table of executables, and how each starts.

Importing rclpy and numba takes a second, in which a signal would leave a traceback: everything
is imported only when Ctrl-C and SIGTERM are taken care of. Only the standard library here.
"""

from collections.abc import Callable
import functools
import importlib
import signal
import sys
from types import FrameType

# Every executable of `ros2 run gear_rattle_ros`, and the module whose `main` it calls.
EXECUTABLES = {
    'lyapunov': 'nodes.lyapunov',
    'recorder': 'nodes.recorder',
    'replay': 'nodes.replay',
    'simulator': 'nodes.simulator',
    'suite': 'nodes.suite',
    'summary': 'offline.summary',
    'transients': 'nodes.transients',
    'viewer': 'nodes.viewer',
}


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def start(name: str) -> int:
    """Run an executable with the arguments of this process; returns its exit status."""
    try:
        signal.signal(signal.SIGINT, _interrupt)
        signal.signal(signal.SIGTERM, _interrupt)
        return int(importlib.import_module(f'.{EXECUTABLES[name]}', __package__).main() or 0)
    except KeyboardInterrupt:
        return 0


def __getattr__(name: str) -> Callable[[], int]:
    """Return the entry point of an executable, `start:NAME`."""
    if name not in EXECUTABLES:
        raise AttributeError(f'no executable {name!r}')
    return functools.partial(start, name)


if __name__ == '__main__':
    sys.exit(start(sys.argv.pop(1)))
