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

"""The keyboard control on a real terminal, steering a real simulator."""

from collections.abc import Callable, Iterator
import contextlib
import fcntl
import os
import pty
import signal
import struct
import sys
import termios
import threading
import time

import pytest
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.parameter import Parameter, parameter_value_to_python

from gear_rattle_ros.nodes.teleop.keys import Entry, Keys
from gear_rattle_ros.scenes import load_scenes

UP, DOWN, SHIFT_UP, SHIFT_DOWN = b'\x1b[A', b'\x1b[B', b'\x1b[1;2A', b'\x1b[1;2B'
# The leader of a session, as a shell is, with a job in the foreground of the terminal.
LEADER = """
import os, signal, sys
job = os.fork()
if job == 0:
    os.setpgid(0, 0)
    signal.signal(signal.SIGTTOU, signal.SIG_IGN)
    os.tcsetpgrp(0, os.getpid())
    signal.signal(signal.SIGTTOU, signal.SIG_DFL)
    os.execv(sys.executable, [sys.executable, *sys.argv[1:]])
signal.signal(signal.SIGINT, signal.SIG_IGN)
os.write(1, b'<job %d>' % job)
while True:
    _, status = os.waitpid(job, os.WUNTRACED)
    if not os.WIFSTOPPED(status):
        break
    os.write(1, b'<stopped>')
os.write(1, b'<status %d>' % os.waitstatus_to_exitcode(status))
signal.pause()
"""


class Screen:
    """A program on a terminal of its own."""

    def __init__(self, arguments: list[str], has_shell: bool = True) -> None:
        """Start it; the settings of the terminal before it came are remembered."""
        self.text = ''
        self._mark = 0
        self.process, self.terminal = pty.fork()
        if self.process == 0:
            leader = ['-c', LEADER] if has_shell else []
            os.execv(sys.executable, [sys.executable, *leader, *arguments])
        self.before = self.settings()
        fcntl.ioctl(self.terminal, termios.TIOCSWINSZ, struct.pack('HHHH', 24, 200, 0, 0))
        # What nobody reads would stop the program.
        threading.Thread(target=self._read, daemon=True).start()
        self.job = self.process
        if has_shell:
            self.wait_for('<job ')
            self.job = int(self.text.split('<job ')[1].split('>')[0])

    def settings(self) -> list:
        """Return what the terminal is set to."""
        return termios.tcgetattr(self.terminal)

    def press(self, keys: bytes) -> None:
        """Type."""
        self.mark()
        os.write(self.terminal, keys)

    def mark(self) -> None:
        """Regard what is shown from here on as an answer: called before what it answers."""
        self._mark = len(self.text)

    def _read(self) -> None:
        with contextlib.suppress(OSError):
            while data := os.read(self.terminal, 65536):
                self.text += data.decode(errors='replace')

    def wait_for(self, words: str, within: float = 60.0) -> None:
        """Wait until it has shown some words."""
        self._wait_for(words, 0, within)

    def wait_for_answer(self, words: str) -> None:
        """Wait for words that come after the mark: after the last keys."""
        self._wait_for(words, self._mark, 60.0)

    def _wait_for(self, words: str, after: int, within: float) -> None:
        deadline = time.monotonic() + within
        while words not in self.text[after:]:
            assert time.monotonic() < deadline, f'no {words!r} in {self.text[after:]!r}'
            time.sleep(0.02)

    def close(self) -> None:
        """End everything."""
        os.kill(self.process, signal.SIGKILL)
        os.waitpid(self.process, 0)
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.job, signal.SIGKILL)
        os.close(self.terminal)


@pytest.fixture
def teleop(domain: int) -> Iterator[Callable[..., Screen]]:
    """Start the keyboard control on a terminal."""
    screens: list[Screen] = []

    def start_one(*arguments: str, has_shell: bool = True) -> Screen:
        screens.append(Screen(
            ['-m', 'gear_rattle_ros.start', 'teleop', *arguments], has_shell))
        return screens[-1]

    yield start_one
    for screen in screens:
        screen.close()


def calls(node, spin, simulator: str):
    """Return ways to read and set parameters of a simulator, not those of the keyboard control."""
    getting = node.create_client(GetParameters, f'{simulator}/get_parameters')
    setting = node.create_client(
        SetParametersAtomically, f'{simulator}/set_parameters_atomically')

    def ask(client, request):
        spin(client.service_is_ready)
        # A service just discovered may not know yet where to send its answer.
        for _ in range(5):
            future, until = client.call_async(request), time.monotonic() + 4.0
            spin(lambda future=future, until=until: future.done() or time.monotonic() > until)
            if future.done():
                return future.result()
        raise AssertionError(f'no answer to {request}')

    def get(*names: str) -> list[float | str]:
        return [parameter_value_to_python(value)
                for value in ask(getting, GetParameters.Request(names=names)).values]

    def put(**values: float) -> None:
        ask(setting, SetParametersAtomically.Request(parameters=[
            Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]))

    return get, put


def test_keys_of_xterm_and_rxvt_come_in_any_pieces() -> None:
    """The sequences of the terminals' manuals, cut anywhere; others are skipped whole."""
    data = UP + SHIFT_DOWN + b'\x1bOC' + b'\x1b[d' + b'\x1b[15~' + b'\x1b[1;5A' + b'q \r'
    wanted = ['up', 'shift-down', 'right', 'shift-left', 'q', 'space', 'enter']
    for cut in range(len(data) + 1):
        keys = Keys()
        found = [*keys.take(data[:cut]), *keys.take(data[cut:])]
        assert found == wanted, cut
    keys = Keys()
    assert list(keys.take(b'\x1b')) == [] and list(keys.rest()) == ['escape']


def test_typed_line_can_be_mended_and_given_up() -> None:
    """Backspace takes the last one away, Escape everything."""
    entry = Entry('')
    assert [entry.take(key) for key in ('0', '.', '7', 'backspace', '6', 'up')] == [None] * 6
    assert entry.take('enter') == '0.6'
    assert Entry('').take('escape') == ''


def test_steers_a_simulator_in_another_namespace(start, teleop, rclpy_node, spin) -> None:
    """Arrows, pause, reset, ramp and scene reach the simulator that a parameter names."""
    simulator = start('simulator', '--ros-args', '-r', '__ns:=/lab', '-p', 'rate:=200')
    get, _ = calls(rclpy_node, spin, '/lab/simulator')
    screen = teleop('--ros-args', '-p', 'simulator:=/lab/simulator')
    screen.wait_for('/lab/simulator is here')
    screen.press(UP + UP + SHIFT_DOWN)
    spin(lambda: get('alpha') == [0.4995])
    screen.wait_for('alpha 0.4995')
    screen.press(b' ')
    simulator.wait_for('paused')
    screen.wait_for('paused')
    screen.press(b' ')
    simulator.wait_for('running')
    screen.press(b'r')
    simulator.wait_for('reset in drive period')
    screen.press(b'a')
    screen.wait_for('ramp alpha to')
    screen.press(b'0.51 1e-3\r')
    simulator.wait_for('the ramp has reached alpha = 0.51')
    spin(lambda: get('alpha', 'alpha_rate') == [0.51, 0.0])
    names = list(load_scenes())
    screen.press(str(names.index('long-transient') + 1).encode())
    scene = load_scenes()['long-transient'].steps[0].parameters
    spin(lambda: get('alpha', 'initial_velocity', 'rate') == [
        scene[name] for name in ('alpha', 'initial_velocity', 'rate')])
    # The arrow takes over from the scene.
    screen.wait_for_answer('scene long-transient')
    screen.press(DOWN)
    spin(lambda: get('alpha') == [pytest.approx(scene['alpha'] - 0.01, abs=1e-12)])
    screen.press(b'q')
    screen.wait_for('<status 0>')
    assert screen.settings() == screen.before


def test_any_parameter_is_stepped_or_typed(start, teleop, rclpy_node, spin) -> None:
    """A key or a typed name is what the arrows change; names and values are set together."""
    start('simulator', '--ros-args', '-p', 'restitution:=0.995')
    get, _ = calls(rclpy_node, spin, '/simulator')
    screen = teleop()
    screen.wait_for('/simulator is here')
    screen.press(b'pp')
    screen.wait_for('arrows: gamma')
    screen.press(DOWN * 12)
    spin(lambda: get('gamma', 'alpha') == [-0.02, 0.48])
    screen.press(b'trestitution\r')
    screen.wait_for('arrows: restitution')
    screen.press(UP)
    # No further than it may be.
    spin(lambda: get('restitution') == [1.0])
    screen.press(b'tbeta 0.2 noise 1e-3\r')
    spin(lambda: get('beta', 'noise') == [0.2, 1e-3])
    screen.press(b'tnois 0.2\r')
    screen.wait_for("'nois' is not one of alpha")
    screen.press(b'tbeta x\r')
    screen.wait_for('beta needs a number')
    screen.press(b'tnoise_kind uniform\r')
    spin(lambda: get('noise_kind') == ['uniform'])
    screen.press(b'torbit <9\r')
    screen.wait_for('no control here')
    screen.press(b'q')
    screen.wait_for('<status 0>')


@pytest.mark.long
def test_plays_a_scene_step_by_step(start, teleop, rclpy_node, spin) -> None:
    """A sweep goes on when its ramp has arrived, and reports when it is over."""
    simulator = start('simulator')
    _, put = calls(rclpy_node, spin, '/simulator')
    screen = teleop()
    screen.wait_for('/simulator is here')
    screen.press(str(list(load_scenes()).index('hysteresis') + 1).encode())
    screen.wait_for('-> 0.6 by')
    # What takes 13 s is done at once here.
    put(rate=1e5)
    simulator.wait_for('the ramp has reached alpha = 0.6')
    simulator.wait_for('the ramp has reached alpha = 0.47')
    screen.wait_for('scene hysteresis is over')


@pytest.mark.long
def test_refusal_is_shown_and_a_simulator_that_goes_is_noticed(start, teleop) -> None:
    """The reason appears; without a simulator it waits, and takes up the next."""
    screen = teleop()
    screen.wait_for('no simulator at /simulator; waiting')
    simulator = start('simulator')
    screen.wait_for('/simulator is here')
    screen.press(b'a')
    screen.wait_for('ramp alpha to')
    screen.press(b'2000\r')
    screen.wait_for('refused: Parameter alpha_target out of range')
    simulator.stop()
    screen.wait_for('/simulator has gone; waiting')
    screen.mark()
    start('simulator')
    screen.wait_for_answer('/simulator is here')


@pytest.mark.parametrize('number', [
    signal.SIGTERM, *(pytest.param(number, marks=pytest.mark.long)
                      for number in (signal.SIGINT, signal.SIGHUP, signal.SIGQUIT))])
def test_signals_restore_the_terminal(teleop, number) -> None:
    """Whatever ends it, the terminal is as it was, and the status 0."""
    screen = teleop()
    screen.wait_for('waiting')
    assert screen.settings() != screen.before
    os.kill(screen.job, number)
    screen.wait_for('<status 0>')
    assert screen.settings() == screen.before


def test_ctrl_z_gives_the_terminal_back_and_fg_takes_it_again(teleop) -> None:
    """Stopped, the terminal is the shell's; continued, keys come at once again."""
    screen = teleop()
    screen.wait_for('waiting')
    during = screen.settings()
    for _ in range(2):
        screen.press(b'\x1a')
        screen.wait_for_answer('<stopped>')
        assert screen.settings() == screen.before
        screen.mark()
        os.kill(screen.job, signal.SIGCONT)
        screen.wait_for_answer('waiting')
        assert screen.settings() == during
    screen.press(b'\x03')
    screen.wait_for('<status 0>')
    assert screen.settings() == screen.before


@pytest.mark.long
def test_ctrl_z_without_a_shell_changes_nothing(teleop) -> None:
    """Nobody could continue it, so the system does not stop it: it goes on with its keys."""
    screen = teleop(has_shell=False)
    screen.wait_for('waiting')
    during = screen.settings()
    assert during != screen.before
    screen.press(b'\x1a')
    screen.wait_for_answer('waiting')
    screen.press(b'h')
    screen.wait_for_answer('The keyboard steers')
    assert screen.settings() == during


@pytest.mark.long
def test_exception_restores_the_terminal(domain) -> None:
    """An error that nobody foresaw is shown, on a terminal that works."""
    screen = Screen(['-c', 'from gear_rattle_ros.nodes.teleop import node as teleop\n'
                     'teleop.Teleop.line = lambda self: 1 / 0\nteleop.main()'])
    try:
        screen.wait_for('<status 1>')
        assert 'ZeroDivisionError' in screen.text
        assert screen.settings() == screen.before
    finally:
        screen.close()


def test_without_a_terminal_it_is_refused(start) -> None:
    """One line and status 2."""
    teleop = start('teleop')
    assert teleop.process.wait(60) == 2
    assert teleop.text().splitlines() == [
        'teleop: stdin and stdout are not a terminal; start it in one, not in a pipe or a launch '
        'file']


def test_the_next_shorter_orbit_is_held_and_let_go(start, teleop) -> None:
    """Where no node does that, it says how to start one."""
    start('simulator', '--ros-args', '-p', 'alpha:=0.57', '-p', 'initial_velocity:=-1.0')
    screen = teleop()
    screen.wait_for('alpha 0.57')
    screen.press(b'o')
    screen.wait_for_answer('no control here; start it with')
    control = start('control')
    control.wait_for('ready', 120.0)
    control.wait_for('joined')
    screen.press(b'o')
    screen.wait_for_answer('looking for <9')
    screen.wait_for_answer('control of 8 impacts')
    screen.press(b'torbit 4\r')
    screen.wait_for_answer('control of 4 impacts')
    screen.press(b'tlimit 0.01\r')
    control.wait_for('limit = 0.01 is too large')
    screen.press(b'l')
    screen.wait_for_answer('let go')
