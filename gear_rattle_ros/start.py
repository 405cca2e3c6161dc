"""
The table of executables, and how each starts.

Importing rclpy and numba takes a second, in which a signal would leave a traceback: everything
is imported only when Ctrl-C and SIGTERM are handled. Here only the standard library is imported.
"""

from collections.abc import Callable
import functools
import importlib
import os
import signal
import sys
from types import FrameType
from typing import NoReturn

# Every executable of `ros2 run gear_rattle_ros`, and the module whose `main` it calls.
EXECUTABLES = {
    'explorer': 'explorer.server',
    **{name: f'nodes.{name}' for name in ('basin', 'lyapunov', 'simulator', 'transients')},
    **{name: f'nodes.{name}.node' for name in ('recorder', 'replay', 'suite', 'teleop', 'viewer')},
    **{name: f'cli.{name}' for name in (
        'attractors', 'basins', 'continuation', 'crisis', 'draw', 'exponents', 'figures',
        'lifetimes', 'motion', 'orbit_diagram', 'recover', 'section', 'summary',
        'transitions', 'verify')}}

# Variables that libraries read while they are imported. Rerun would warn of a file without an
# index, which the viewer adds at the end.
ENVIRONMENT = {'viewer': {'RUST_LOG': 'warn,re_log_encoding::rrd::file_sink=error'}}


_signals: list[int] = []


def _interrupt(number: int, frame: FrameType | None) -> None:
    _signals.append(number)
    raise KeyboardInterrupt


def start(name: str) -> NoReturn:
    """Run an executable with the arguments of this process, and exit with its status."""
    try:
        signal.signal(signal.SIGINT, _interrupt)
        signal.signal(signal.SIGTERM, _interrupt)
        for variable, value in ENVIRONMENT.get(name, {}).items():
            os.environ.setdefault(variable, value)
        if sys.argv[1:2] == ['--version']:
            from importlib.metadata import version
            print(name, version(str(__package__)))
            status = 0
        else:
            module = importlib.import_module(f'.{EXECUTABLES[name]}', __package__)
            if _signals:
                # Libraries may swallow any exception while they are imported.
                raise KeyboardInterrupt
            status = int(module.main() or 0)
    except KeyboardInterrupt:
        status = 0
    except ModuleNotFoundError as error:
        missing = (error.name or '').split('.')[0]
        if missing == __package__:
            raise
        print(f'{name}: the Python package {missing} is not installed; see doc/install.md',
              file=sys.stderr)
        status = 2
    # Everything that was open is closed; taking LLVM and DDS down too would cost half a second.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


def __getattr__(name: str) -> Callable[[], NoReturn]:
    """Return the entry point of an executable, `start:NAME`."""
    if name not in EXECUTABLES:
        raise AttributeError(f'no executable {name!r}')
    return functools.partial(start, name)


if __name__ == '__main__':
    start(sys.argv.pop(1))
