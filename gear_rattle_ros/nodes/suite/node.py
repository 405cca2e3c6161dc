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

"""The whole suite in one command: starts the nodes, shows their state, and ends them."""

import argparse
from collections.abc import Sequence
import contextlib
import math
import os
from pathlib import Path
import shlex
import subprocess
import sys
import time

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import ParameterEvent
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_parameter_events
from rich.console import Console
from rich.live import Live
from sensor_msgs.msg import JointState

from .display import render, Status
from .processes import Processes
from ..base.arguments import overrides
from ..base.client import PUT, RESET, SimulatorClient
from ..base.dds_room import remove_abandoned
from ..base.errors import UserError
from ..base.node import set_back
from ..base.process import apart, ended_in_time, exit_status, say, Stop, woken
from ..base.services import listen
from ...gear_pairs import add_gears, parse
from ...parameters import SIMULATOR
from ...places import program, typed
from ...qos import LATCHED, STREAM
from ...scenes import find_scene, INITIAL, load_scenes, NAMES, Performance, Step

READERS = ('lyapunov', 'transients', 'recorder', 'viewer')
# Two situations of the paper: a chaotic attractor, and a chaotic transient after the crisis.
STORY = (0.57, 1.244)
# Compiling for the first time may take this long on a slow machine [s].
START_WITHIN = 180.0
# A start that takes longer than this is explained [s].
EXPLAINED_AFTER = 3.0
EXPLANATION = 'the first start compiles the kernels for up to a minute'
REFRESH = 0.25
SUMMARY_WITHIN = 60.0
# How long the others may take to end, on a busy machine too [s].
ENDS_WITHIN = 5.0
# How long the recorder may take to write what it has acknowledged, much at full rate [s].
WRITTEN_WITHIN = 30.0
# Loads everything slow while the nodes run; a line on stdin means that the bag is closed.
SUMMARISE = (
    'import sys; from gear_rattle_ros.cli.pictures.summary import main; '
    'from gear_rattle_ros.figures.summary import prepare; prepare(); '
    'sys.exit(main(sys.argv[1:]) if sys.stdin.readline() else 0)')
PLAIN_EVERY = 5.0


class Monitor(Node):
    """Listens to the nodes and keeps the status up to date."""

    def __init__(self, status: Status) -> None:
        super().__init__('suite', start_parameter_services=False)
        self.status = status
        self._seen = (time.monotonic(), 0)
        listen(self, JointState, 'lyapunov', self._take_exponents, STREAM)
        listen(self, DiagnosticArray, 'transient', self._take_transient, LATCHED)
        listen(self, DiagnosticArray, '/diagnostics', self._take_diagnostics, 10)
        listen(self, ParameterEvent, '/parameter_events', self._take_parameters,
               qos_profile_parameter_events)
        self.simulator = SimulatorClient(self, 'simulator', (PUT, RESET))

    def _take_exponents(self, message: JointState) -> None:
        values = dict(zip(message.name, message.position, strict=True))
        now, index = time.monotonic(), int(values['index'])
        self.status.exponents = values
        since, before = self._seen
        if not before:
            self._seen = (now, index)
        elif now - since >= 1.0:
            self.status.impacts_per_second = max(index - before, 0) / (now - since)
            self._seen = (now, index)
        self.status.impacts = index

    def _take_transient(self, message: DiagnosticArray) -> None:
        self.status.trajectory = message.status[0].message

    def _take_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            name = status.name.split(':')[0]
            values = {item.key: item.value for item in status.values}
            if 'gaps' in values:
                self.status.gaps[name] = int(values['gaps'])
                self.status.lost[name] = int(values.get('lost_impacts', 0))
            if name == 'viewer':
                self.status.page = values.get('page', '')
            if name == 'simulator':
                self.status.alpha = float(values['alpha'])

    def _take_parameters(self, event: ParameterEvent) -> None:
        if event.node.split('/')[-1] == 'simulator':
            for parameter in [*event.new_parameters, *event.changed_parameters]:
                if parameter.name == 'alpha':
                    self.status.alpha = parameter.value.double_value


class Suite:
    """One run: its folder, its processes and its status."""

    def __init__(self, options: argparse.Namespace, ros_arguments: list[str]) -> None:
        self._options = options
        self._folder = _make_folder(options.output)
        (self._folder / 'log').mkdir()
        self._processes = Processes(self._folder / 'log')
        self._ros_arguments = ros_arguments
        self._summary: subprocess.Popen[bytes] | None = None
        self._readers = (*READERS, *(['basin'] if options.basin else []),
                         *(['control'] if options.hold else []))
        self._status = Status(duration=options.duration, alpha=options.alpha)

    def run(self, stop: Stop) -> int:
        """Run from the first process to the last; all of them are ended in any case."""
        monitor = Monitor(self._status)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(monitor)
        try:
            remove_abandoned()
            self._start_nodes()
            with woken(self._executor):
                self._watch(monitor, stop)
        finally:
            self._end_nodes()
            with ended_in_time():
                self._executor.shutdown()
                monitor.destroy_node()
        self._print_result()
        if self._summary is not None and self._summary.returncode > 0:
            raise UserError(f'the summary was not drawn (status {self._summary.returncode})')
        return 0

    def _print_result(self) -> None:
        say(self._processes.last_words('recorder').split(']: ')[-1])
        rerun = _command('rerun')
        for what, command, name in (
                ('bag', rerun, 'bag/bag_0.mcap'), ('replay', shlex.join(typed('replay')), 'bag'),
                ('viewer', rerun, 'run.rrd'), ('summary', 'xdg-open', 'summary.png')):
            if (self._folder / name).exists():
                say(f'{what:8} {command} {_quoted(self._folder / name)}')

    def _start_nodes(self) -> None:
        pair = self._options.pair.given if self._options.pair else {}
        of_pair: dict[str, object] = {
            name: value for name, value in pair.items() if name != 'restitution'}
        own: dict[str, dict[str, object]] = {
            'simulator': pair | {name: getattr(self._options, name) for name in NAMES} | {
                'wait_for_readers': len(self._readers), 'wait_at_most': 0.0},
            'transients': of_pair,
            'recorder': {'output': str(self._folder / 'bag')},
            'control': {'orbit': self._options.hold},
            'viewer': of_pair | {'mode': self._options.viewer,
                                 'save': str(self._folder / 'run.rrd')}}
        for name in ('simulator', *self._readers):
            arguments = secured(name, self._ros_arguments) or ['--ros-args']
            self._processes.start(name, [*arguments, *overrides(own.get(name, {}))])

    def _prepare_summary(self) -> None:
        self._summary = subprocess.Popen(
            [sys.executable, '-c', SUMMARISE, str(self._folder / 'bag'), '--output',
             str(self._folder / 'summary.png')],
            **apart(0) | {'stdin': subprocess.PIPE, 'stderr': None})

    def _end_nodes(self) -> None:
        self._processes.stop(['simulator'], within=ENDS_WITHIN)
        # The last batches arrive; then the analysis nodes publish their last reports.
        self._processes.stop(['lyapunov', 'transients', 'basin', 'control'], within=ENDS_WITHIN)
        self._processes.stop(['recorder', 'viewer'], within=WRITTEN_WITHIN)
        if self._summary is not None:
            try:
                self._summary.communicate(b'\n', timeout=SUMMARY_WITHIN)
            except subprocess.TimeoutExpired:
                # A large bag takes longer: it can be summarised later.
                self._summary.kill()
                self._summary.wait()
                say(f'summary  {shlex.join(typed("summary"))} {_quoted(self._folder / "bag")}')

    def _watch(self, monitor: Monitor, stop: Stop) -> None:
        options, status = self._options, self._status
        console = Console()
        live = Live(
            render(status), console=console, auto_refresh=False) if console.is_terminal else None
        with live or contextlib.nullcontext():
            began, page = time.monotonic(), ''
            first = shown = 0.0
            performance = Performance(_steps(options))
            while not stop.asked:
                self._executor.spin_once(timeout_sec=0.05)
                now = time.monotonic()
                self._processes.check()
                if status.page and not page:
                    # Above the display, on a line of its own, where it can be clicked.
                    page = status.page
                    console.print(f'viewer   {page}', soft_wrap=True, highlight=False)
                if not first:
                    status.phase = f'starting, {now - began:.0f} s'
                    if now - began > EXPLAINED_AFTER:
                        status.phase += f'; {EXPLANATION}'
                        if live is None and not shown:
                            shown = now
                            say(f'starting; {EXPLANATION}')
                    if status.impacts:
                        first = now
                        # The simulator was started with the parameters of the first step.
                        performance.due(now, status.alpha)
                        self._prepare_summary()
                        status.phase = 'running'
                        if live is None:
                            say(f'running after {first - began:.1f} s')
                    elif now - began > START_WITHIN:
                        raise UserError(f'no impact in {START_WITHIN:.0f} s; '
                                        f'see {self._folder / "log"}')
                else:
                    status.seconds = now - first
                    step = performance.due(now, status.alpha)
                    if step is not None:
                        monitor.simulator.begin(step)
                        monitor.simulator.finish(self._executor)
                    if performance.is_over(now, status.alpha) if options.plays_out else (
                            0.0 < options.duration <= status.seconds):
                        break
                status.set_back = set_back()
                status.bag_bytes = sum(
                    path.stat().st_size for path in (self._folder / 'bag').glob('*.mcap'))
                if live is not None and now - shown > REFRESH:
                    shown = now
                    live.update(render(status), refresh=True)
                elif live is None and first and now - shown > PLAIN_EVERY:
                    shown = now
                    say(status.line())


def _steps(options: argparse.Namespace) -> Sequence[Step]:
    if options.scene is not None:
        return find_scene(options.scene).steps
    if options.then is not None:
        return [Step({}, options.duration / 2.0), Step({'alpha': options.then}, 0.0)]
    return [Step({}, 0.0)]


def enclave(name: str) -> str:
    """Return the SROS 2 enclave of a node, as in config/sros2."""
    return f'/gear_rattle_ros/{name}'


def secured(name: str, ros_arguments: list[str]) -> list[str]:
    """Return ROS arguments with the enclave of a node, where security is on."""
    is_on = os.environ.get('ROS_SECURITY_ENABLE') == 'true'
    if not is_on or '--enclave' in ros_arguments or '-e' in ros_arguments:
        return ros_arguments
    return [*(ros_arguments or ['--ros-args']), '--enclave', enclave(name)]


def _command(name: str) -> str:
    """Return how to call an executable of this environment from here."""
    path = Path(sys.executable).parent / name
    return _quoted(path) if path.exists() else name


def _quoted(path: Path) -> str:
    with contextlib.suppress(ValueError):
        path = path.relative_to(Path.cwd())
    return shlex.quote(str(path))


def _make_folder(output: str | None) -> Path:
    folder = Path(output or time.strftime('runs/%Y-%m-%d_%H-%M-%S'))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise UserError(f'{folder} is not empty; name a new folder with --output')
    except OSError as error:
        raise UserError(f'{folder} cannot be made: {error.strerror}') from error
    return folder.resolve()


def _parse(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog=program('suite'), description=__doc__)
    add = parser.add_argument
    add('--alpha', type=float, help='amplitude of the drive [1]; by default two situations of the '
        f'paper, {STORY[0]} and, from half-way, {STORY[1]}')
    add('--scene', metavar='NAME', help='a situation of the paper, for as long as it takes; '
        'list shows them all; other options override its parameters')
    add('--then', type=float, metavar='ALPHA', help='alpha from half-way on [1]')
    add('--duration', type=float, default=30.0, help='seconds; 0 = until stopped (%(default)s)')
    for given in SIMULATOR:
        if given.name in INITIAL and given.name not in ('alpha_rate', 'control'):
            name = given.name.removeprefix('initial_').replace('_', '-')
            add(f'--{name}', dest=given.name, metavar=name.upper(),
                type=type(INITIAL[given.name]), default=INITIAL[given.name],
                help=f'{given.descriptor().description} (%(default)s)')
    add('--viewer', choices=('auto', 'native', 'web', 'none'), default='auto',
        help='how to watch live; run.rrd is written in any case (%(default)s)')
    add('--basin', action=argparse.BooleanOptionalAction, default=True,
        help='compute the basins of the present parameters (on)')
    add('--hold', metavar='ORBIT', default='', help='unstable orbit to hold: its key, a letter or '
        'its number of impacts')
    add('--output', help='folder for everything (runs/<date and time>)')
    add_gears(parser)
    parser.set_defaults(alpha_target=0.0, alpha_rate=0.0, control='', plays_out=False)
    options = parser.parse_args(arguments)
    if options.scene is not None:
        try:
            if options.scene == 'list':
                parser.exit(0, ''.join(
                    f'{name:16} {scene.title}\n' for name, scene in load_scenes().items()))
            scene = find_scene(options.scene)
        except ValueError as error:
            parser.exit(2, f'suite: {error}\n')
        if options.then is not None:
            parser.exit(2, 'suite: --then and --scene exclude each other; leave one out\n')
        # The command line overrides the scene.
        parser.set_defaults(duration=math.inf, **scene.steps[0].parameters)
    try:
        options = parse(parser, arguments)
    except ValueError as error:
        parser.exit(2, f'suite: {error}\n')
    if options.scene is not None:
        # On a slow machine its ramps take longer.
        options.plays_out = math.isinf(options.duration)
        options.duration = scene.seconds if options.plays_out else options.duration
    if not options.duration >= 0.0:
        parser.error(f'--duration {options.duration:g} is negative; 0 = until stopped')
    if options.alpha is None:
        options.alpha = STORY[0]
        if options.then is None and options.duration > 0.0:
            options.then = STORY[1]
    if options.then is not None and options.duration == 0.0:
        parser.error('--then needs a --duration: it applies from half-way on')
    try:
        for given in SIMULATOR:
            if given.name in NAMES:
                given.check(getattr(options, given.name))
    except ValueError as error:
        parser.exit(2, f'suite: {error}\n')
    return options


def main(arguments: list[str] | None = None) -> int:
    words = sys.argv[1:] if arguments is None else arguments
    cut = words.index('--ros-args') if '--ros-args' in words else len(words)
    options = _parse(words[:cut])
    # The nodes stay on this machine unless the user has set something else.
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    return exit_status('suite', secured('suite', words[cut:]),
                       lambda: Suite(options, words[cut:]), Suite.run)
