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

"""
The table of programs, and how each starts.

Importing rclpy and numba takes a second, in which a signal would leave a traceback: everything
is imported only when Ctrl-C and SIGTERM are handled. Here only the standard library is imported.
"""

from collections.abc import Callable
import contextlib
import functools
import gc
import importlib
import io
import os
import signal
import sys
from types import FrameType
from typing import Any, cast, NoReturn

# Every program by group: the module whose `main` it calls, with the words put before its own
# arguments, and what it does.
GROUPS = {
    'nodes (need ROS)': {
        'suite': ('nodes.suite.node', 'run a simulator with all that watches it, for a while'),
        'simulator': ('nodes.simulator', 'simulate the gear; publish every event'),
        'lyapunov': ('nodes.lyapunov', 'publish the Lyapunov exponents of the stream'),
        'transients': ('nodes.transients', 'recognise transients and orbits in the stream'),
        'basin': ('nodes.basin', 'publish the basins of the present parameters'),
        'control': ('nodes.control', 'hold unstable orbits of a running simulator'),
        'teleop': ('nodes.teleop.node', 'steer a simulator with the keyboard'),
        'set': ('nodes.steering set', 'set parameters of a running simulator'),
        'get': ('nodes.steering get', 'print parameters of a running simulator'),
        'reset': ('nodes.steering reset', 'reset it to its initial condition'),
        'pause': ('nodes.steering pause', 'pause the simulator'),
        'resume': ('nodes.steering resume', 'resume it'),
    },
    'bags': {
        'recorder': ('nodes.recorder.node', 'record a run (needs ROS)'),
        'replay': ('nodes.replay.node', 'publish a bag again (needs ROS)'),
        'verify': ('cli.bags.verify', 'reproduce every record of a bag, bit for bit'),
        'recover': ('cli.bags.recover', 'save what is left of a damaged bag'),
        'export': ('cli.bags.export', 'write the events of a bag as CSV or Parquet'),
    },
    'offline studies': {
        'attractors': ('cli.attractors', 'find every attractor'),
        'basins': ('cli.grids.basins', 'find on which attractor each initial condition settles'),
        'lifetimes': ('cli.grids.lifetimes', 'find how long transients last'),
        'exponents': ('cli.grids.exponents', 'find how fast neighbouring trajectories diverge'),
        'section': ('cli.trajectories.section', 'count impacts on the Poincare section'),
        'motion': ('cli.trajectories.motion', 'sample the motion between the walls'),
        'orbit_diagram': ('cli.sweeps.orbit_diagram', 'count impact velocities against alpha'),
        'continuation': ('cli.transitions.continuation', 'follow attractors across alpha'),
        'parameter_plane': ('cli.sweeps.parameter_plane',
                            'find what the gear does over two parameters'),
        'transitions': ('cli.transitions.transitions',
                        'locate every transition in windows of alpha'),
        'crisis': ('cli.transitions.crisis', 'locate the crisis of a chaotic attractor'),
        'orbits': ('cli.skeleton.orbits', 'find all periodic orbits, stable or not'),
        'manifolds': ('cli.skeleton.manifolds', 'draw the manifolds of a saddle over the basins'),
        'saddle': ('cli.skeleton.saddle', 'follow edge states and chaotic saddles'),
        'boundary': ('cli.skeleton.boundary', 'measure how fractal the boundary of basins is'),
        'stability': ('cli.robustness.stability', 'find how far attractors are from being left'),
        'hopping': ('cli.robustness.hopping', 'count hops between attractors by noise'),
        'probability_basins': ('cli.robustness.probability_basins',
                               'find where noise brings each initial condition'),
        'drift': ('cli.robustness.drift', 'find what slow ramps of alpha delay'),
        'rattle': ('cli.trajectories.rattle',
                   'find whether a gear pair rattles, how often, how hard'),
        'figures': ('cli.pictures.figures', 'redraw the figures of the paper'),
    },
    'viewing': {
        'viewer': ('nodes.viewer.node', 'watch a run in rerun (needs ROS)'),
        'explorer': ('explorer.server', 'zoom into the plane of initial conditions'),
        'draw': ('cli.pictures.draw', 'draw the dataset of a study again'),
        'summary': ('cli.pictures.summary', 'make one picture of a bag'),
    },
}
EXECUTABLES = {name: module for group in GROUPS.values() for name, (module, _) in group.items()}

# Variables that libraries read while they are imported. Rerun would warn of a file without an
# index, which the viewer adds at the end.
ENVIRONMENT = {'viewer': {'RUST_LOG': 'warn,re_log_encoding::rrd::file_sink=error'}}
# What numba imports where it is installed, and no program needs: it takes a tenth of a second.
NEEDLESS = ('scipy', 'coverage')
# Objects of the imports of a command, none of them garbage.
IMPORTED = 300_000


# A signal that comes in a callback, where it is lost, is repeated after this time [s].
AGAIN = 0.01
_signals: list[int] = []


def _interrupt(number: int, frame: FrameType | None) -> None:
    _signals.append(number)
    raise KeyboardInterrupt


def _interrupt_later(unraisable: Any) -> None:
    # Numba loads kernels through callbacks from C, which can raise nothing.
    if issubclass(unraisable.exc_type, KeyboardInterrupt):
        signal.setitimer(signal.ITIMER_REAL, AGAIN)
    else:
        sys.__unraisablehook__(unraisable)


def _prepare() -> None:
    """Let libraries find what they take for granted: UTF-8, open streams, a home, no window."""
    if sys.getfilesystemencoding() != 'utf-8' and os.environ.get('PYTHONUTF8') != '1':
        # A locale's encoding is that of every file, and is replaced only where Python begins.
        os.environ['PYTHONUTF8'] = '1'
        os.execv(sys.executable, [sys.executable, '-X', 'utf8', *sys.orig_argv[1:]])
    for name in ('stdin', 'stdout', 'stderr'):
        if getattr(sys, name) is None:
            # It was closed, and a bag would take its place: the lowest number that is free.
            setattr(sys, name, open(os.devnull, 'r' if name == 'stdin' else 'w'))
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
        signal.signal(signal.SIGALRM, _interrupt)
        sys.unraisablehook = _interrupt_later
        _prepare()
        for variable, value in ENVIRONMENT.get(name, {}).items():
            os.environ.setdefault(variable, value)
        if sys.argv[1:2] == ['--version']:
            status = _print_version(name)
        else:
            for needless in NEEDLESS:
                cast(dict[str, Any], sys.modules).setdefault(needless, None)
            place, *words = EXECUTABLES[name].split()
            sys.argv[1:1] = words
            if place.startswith('cli.'):
                gc.set_threshold(IMPORTED)
            if place.startswith('nodes.'):
                from .nodes.base.dds_room import require_pages
                require_pages()
            status = int(_import(place).main() or 0)
    except BrokenPipeError:
        # The reader, such as head, has read enough: the status of a program that SIGPIPE ends.
        status = 128 + signal.SIGPIPE
    except KeyboardInterrupt:
        # It is how a node ends, and what interrupts a command.
        is_node = EXECUTABLES[name].startswith('nodes.') and ' ' not in EXECUTABLES[name]
        status = 0 if is_node else 130
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
    _end(status)


def _import(place: str) -> Any:
    # While they are imported, libraries may swallow any exception, or make another of it.
    try:
        module = importlib.import_module(f'.{place}', __package__)
    except Exception as error:
        if _signals:
            raise KeyboardInterrupt from error
        raise
    if _signals:
        raise KeyboardInterrupt
    return module


def gear_rattle() -> NoReturn:
    """Run the program that the first argument names; without one, list them all."""
    name = sys.argv[1] if sys.argv[1:] else '--help'
    if name in EXECUTABLES:
        del sys.argv[1]
        start(name)
    status = 0
    with contextlib.suppress(BrokenPipeError):
        if name in ('-h', '--help'):
            print('usage: gear_rattle NAME ...\n\n'
                  'gear_rattle NAME --help lists the options of a program.')
            for group, programs in GROUPS.items():
                print(f'\n{group}:')
                for program, (_, words) in programs.items():
                    print(f'  {program:14} {words}')
        elif name == '--version':
            _print_version('gear_rattle')
        else:
            print(f'gear_rattle: there is no program {name!r}; gear_rattle --help lists all',
                  file=sys.stderr)
            status = 2
    _end(status)


def _print_version(name: str) -> int:
    from importlib.metadata import version
    print(name, version(str(__package__)))
    return 0


def _end(status: int) -> NoReturn:
    # Everything that was open is closed; taking LLVM and DDS down too would cost half a second.
    # A stream that nobody reads, or that is closed, changes nothing.
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError, OSError, ValueError):
            stream.flush()
    os._exit(status)


def __getattr__(name: str) -> Callable[[], NoReturn]:
    """Return the entry point of an executable, `start:NAME`."""
    if name not in EXECUTABLES:
        raise AttributeError(f'no executable {name!r}')
    return functools.partial(start, name)


if __name__ == '__main__':
    gear_rattle()
