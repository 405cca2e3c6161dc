"""
The table of executables, and how each starts.

Importing rclpy and numba takes a second, in which a signal would leave a traceback: everything
is imported only when Ctrl-C and SIGTERM are handled. Here only the standard library is imported.
"""

from collections.abc import Callable
import contextlib
import functools
import importlib
import io
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


def _prepare() -> None:
    """Let libraries find what they take for granted: UTF-8, open streams, a home, no window."""
    if sys.getfilesystemencoding() != 'utf-8':
        # A locale's encoding is that of every file, and is replaced only where Python begins.
        os.environ['PYTHONUTF8'] = '1'
        os.execv(sys.executable, [sys.executable, '-X', 'utf8', *sys.orig_argv[1:]])
    for name in ('stdout', 'stderr'):
        if getattr(sys, name) is None:
            # It was closed, and a bag would take its place.
            setattr(sys, name, open(os.devnull, 'w'))
        stream = getattr(sys, name)
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors='replace')
    # A notebook's would want the notebook's packages.
    os.environ['MPLBACKEND'] = 'agg'
    home = os.path.expanduser('~')
    if not os.access(home, os.W_OK | os.X_OK):
        from .core.private import private_folder
        folder = str(private_folder())
        for variable in ('ROS_HOME', 'XDG_CACHE_HOME', 'XDG_CONFIG_HOME'):
            os.environ.setdefault(variable, folder)
        home = home if os.path.isdir(home) else folder
    # ROS asks no further than this variable.
    os.environ['HOME'] = home


def start(name: str) -> NoReturn:
    """Run an executable with the arguments of this process, and exit with its status."""
    try:
        signal.signal(signal.SIGINT, _interrupt)
        signal.signal(signal.SIGTERM, _interrupt)
        _prepare()
        for variable, value in ENVIRONMENT.get(name, {}).items():
            os.environ.setdefault(variable, value)
        if sys.argv[1:2] == ['--version']:
            from importlib.metadata import version
            print(name, version(str(__package__)))
            status = 0
        else:
            if EXECUTABLES[name].startswith('nodes.'):
                from .nodes.base.dds_room import require_pages
                require_pages()
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
    except OSError as error:
        # Of the environment: no folder for temporary files, no room, too many open files.
        print(f'{name}: {error}', file=sys.stderr)
        status = 2
    # Everything that was open is closed; taking LLVM and DDS down too would cost half a second.
    for stream in (sys.stdout, sys.stderr):
        # Who reads it may be gone.
        with contextlib.suppress(OSError):
            stream.flush()
    os._exit(status)


def __getattr__(name: str) -> Callable[[], NoReturn]:
    """Return the entry point of an executable, `start:NAME`."""
    if name not in EXECUTABLES:
        raise AttributeError(f'no executable {name!r}')
    return functools.partial(start, name)


if __name__ == '__main__':
    start(sys.argv.pop(1))
