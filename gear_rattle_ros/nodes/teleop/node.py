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

"""The keyboard control: steers a simulator from a terminal."""

from collections.abc import Callable
import math
import shlex
import signal
import sys
import threading
import time
from typing import Any

from rclpy.executors import SingleThreadedExecutor

from .keys import Entry, Keys
from .terminal import Terminal
from ..base.client import ClientError, LET_GO, PUT, RefusalError, SHORTER, SimulatorClient
from ..base.errors import UserError
from ..base.node import BaseNode
from ..base.process import exit_status, Stop
from ..steering import KNOWN, LIVE, OF_CONTROL, require_known, values_of
from ...core.flight.law import Law
from ...core.words import counted
from ...places import typed
from ...scenes import load_scenes, Performance

# How long to wait for a key, while an answer is awaited and otherwise [s].
SOON, LATER = 0.02, 0.1
MORE = ('up', 'right', 'shift-up', 'shift-right')
LESS = ('down', 'left', 'shift-down', 'shift-left')
SHOWN = ('alpha', 'alpha_target', 'alpha_rate', 'beta', 'gamma', 'restitution', 'noise', 'rate',
         'control')
# What the arrows may change, in the order of the key.
STEPPED = ('alpha', 'beta', 'gamma', 'restitution', 'noise')
NO_CONTROL = f'no control here; start it with: {shlex.join(typed("control"))}'
# Interval at which the parameters are read, besides every change [s].
LOOK_EVERY = 0.25


class Teleop(BaseNode):
    """Turns keys into requests, plays scenes, and shows the present state in one line."""

    def __init__(self, **options: Any) -> None:
        super().__init__('teleop', **options)
        self.simulator = SimulatorClient(self, str(self.values['simulator']))
        self._holder = SimulatorClient(self, 'control', (PUT, SHORTER, LET_GO), 'control')
        # The parameters of the simulator, none while it is absent, and a remark on it.
        self._values: dict[str, Any] = {}
        self._words = ''
        self._paused = False
        self._looked = -math.inf
        self.is_over = self._is_due = False
        self._scenes = list(load_scenes().values())[:9]
        self._coarse, self._fine = self.number('coarse'), self.number('fine')
        self._entry: Entry | None = None
        self._entered: Callable[[str], None] = self._begin_ramp
        self._name = STEPPED[0]
        self._scene = ''
        self._performance: Performance | None = None
        # Time of the scene, which stops during a pause [s].
        self._played = 0.0
        self._before = time.monotonic()
        # The value that the arrows ask for while requests are open [1]; whether one is due.
        self._aim: float | None = None

    def help_text(self) -> str:
        scenes = '\n'.join(
            f'  {number}        scene {scene.name}: {scene.title}'
            for number, scene in enumerate(self._scenes, 1))
        return (
            f'The keyboard steers {self.simulator.name}:\n'
            f'  arrows   one parameter: up and right add {self._coarse:g}, down and left subtract '
            f'it; with shift {self._fine:g}\n'
            f'  p        which one: {", ".join(STEPPED)}\n'
            '  t        type names and values, such as beta 0.2; a name alone is for the arrows\n'
            '  o        hold the next shorter unstable orbit: the node control must run\n'
            '  l        let go of it\n'
            '  space    pause and continue\n'
            '  r        reset to the initial condition\n'
            '  a        ramp of alpha: type the target and, if you like, the step per drive '
            'period\n'
            f'{scenes}\n'
            '  h        show these lines\n'
            '  q        quit; the simulator keeps running')

    def line(self) -> str:
        if self._entry is not None:
            return f'{self._entry.question}{self._entry.text}_'
        values = self._values
        if not values:
            why = self._words or f'no simulator at {self.simulator.name}'
            return f'{why}; waiting (q quits; name another with -p simulator:=NAME)'
        alpha = f'alpha {values["alpha"]:.10g}'
        if values['alpha_rate'] > 0.0:
            alpha += f' -> {values["alpha_target"]:g} by {values["alpha_rate"]:g}'
        speed = f'{values["rate"]:g} periods/s' if values['rate'] > 0.0 else 'full speed'
        if self._name != 'alpha':
            alpha += f' | arrows: {self._name}'
        parts = [alpha, 'paused' if self._paused else speed]
        if law := Law.of_text(values['control']):
            parts.append(f'control of {counted(len(law.points), "impact")}')
        if self._performance is not None:
            parts.append(f'scene {self._scene}')
        if self._words:
            parts.append(self._words)
        parts.append(f'beta {values["beta"]:g} gamma {values["gamma"]:g} '
                     f'r {values["restitution"]:g} noise {values["noise"]:g}')
        return ' | '.join(parts)

    def take(self, key: str) -> str:
        """Do what a key asks for; return lines that stay on the screen."""
        if self._entry is not None:
            text = self._entry.take(key)
            if text is not None:
                self._entry = None
                if text:
                    self._entered(text)
            return ''
        if key == 'q':
            self.is_over = True
        elif key in ('h', '?'):
            return self.help_text()
        elif self._values:
            self._steer(key)
        return ''

    def tick(self) -> None:
        """Take answers, and continue a scene."""
        now = time.monotonic()
        is_there = self.simulator.count > 0
        if self._values and not is_there:
            self._lose(f'{self.simulator.name} has gone')
        for client in (self.simulator, self._holder):
            try:
                client.tick()
            except ClientError as error:
                if client is self.simulator and not isinstance(error, RefusalError):
                    self._lose(str(error))
                else:
                    self._words = str(error).removeprefix(f'{self.simulator.name} ')
        if is_there and not self.simulator.is_busy:
            self._ask(now)
        if not self._paused:
            self._played += now - self._before
        self._before = now

    def _ask(self, now: float) -> None:
        if self._is_due and self._aim is not None:
            self.simulator.put({self._name: self._aim})
            self._is_due = False
        else:
            self._aim = None
            if self._performance is not None:
                self._play()
        if self.simulator.is_busy or now > self._looked + LOOK_EVERY:
            self._looked = now
            self.simulator.get(SHOWN, self._look)

    def _look(self, values: dict[str, Any]) -> None:
        self._words = self._words if self._values else f'{self.simulator.name} is here'
        self._values = values

    def _lose(self, words: str) -> None:
        self.simulator.forget()
        self._values, self._words, self._paused = {}, words, False
        self._performance = self._entry = None
        self._is_due = False

    def _note(self, words: str) -> None:
        self._words = words.split(';')[0]

    def _pause(self, paused: bool) -> None:
        self.simulator.pause(paused, lambda _: setattr(self, '_paused', paused))

    def _steer(self, key: str) -> None:
        if key in MORE + LESS:
            step = self._fine if key.startswith('shift') else self._coarse
            before = self._values[self._name] if self._aim is None else self._aim
            low, high = KNOWN[self._name].low, KNOWN[self._name].high
            assert low is not None and high is not None
            # Steps of 0.01 must lead to multiples of 0.01.
            self._aim = min(max(round(before + (step if key in MORE else -step), 12), low), high)
            self._performance, self._is_due = None, True
        elif key == 'space':
            self._pause(not self._paused)
        elif key == 'r':
            self.simulator.reset(self._note)
        elif key == 'a':
            self._entry = Entry('ramp alpha to (Escape cancels): ')
            self._entered = self._begin_ramp
        elif key == 't':
            self._entry = Entry('set (NAME VALUE, or NAME for the arrows; Escape cancels): ')
            self._entered = self._set
        elif key in ('o', 'l') and not self._holder.count:
            self._words = NO_CONTROL
        elif key in ('o', 'l'):
            self._performance = None
            self._holder.trigger(SHORTER if key == 'o' else LET_GO, self._note)
        elif key == 'p':
            self._choose(STEPPED[(STEPPED.index(self._name) + 1) % len(STEPPED)])
        elif key.isdigit() and 1 <= int(key) <= len(self._scenes):
            scene = self._scenes[int(key) - 1]
            self._scene, self._performance = scene.name, Performance(scene.steps)
            self._words, self._is_due = '', False
            if self._paused:
                self._pause(False)

    def _choose(self, name: str) -> None:
        self._name, self._aim, self._is_due, self._words = name, None, False, f'arrows: {name}'

    def _set(self, text: str) -> None:
        words = text.split()
        if len(words) == 1 and words[0] in STEPPED:
            self._choose(words[0])
            return
        try:
            require_known(words[::2], LIVE)
            values = values_of(words)
        except ValueError as error:
            self._words = str(error)
            return
        self._performance, self._aim, self._is_due, self._words = None, None, False, ''
        for client, is_own in ((self.simulator, False), (self._holder, True)):
            own = {name: value for name, value in values.items() if (name in OF_CONTROL) is is_own}
            if own and client.count:
                client.put(own)
            elif own:
                self._words = NO_CONTROL

    def _begin_ramp(self, text: str) -> None:
        try:
            target, *rates = map(float, text.split())
            rate, = rates or [self.number('ramp_rate')]
        except ValueError:
            self._words = f'{text!r} is neither one number nor two'
            return
        self._performance, self._is_due, self._words = None, False, 'ramp'
        self.simulator.put({'alpha_target': target, 'alpha_rate': rate})

    def _play(self) -> None:
        performance, alpha = self._performance, self._values['alpha']
        assert performance is not None
        step = performance.due(self._played, alpha)
        if step is not None:
            self.simulator.begin(step, self._note)
            self._aim = step.parameters.get(self._name, self._aim)
        elif performance.is_over(self._played, alpha):
            self._performance = None
            self._words = f'scene {self._scene} is over; the simulator keeps running'


def main(arguments: list[str] | None = None) -> int:
    return exit_status('teleop', arguments, _make, _run)


def _make() -> Teleop:
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise UserError('stdin and stdout are not a terminal; start it in one, not in a pipe or a '
                        'launch file')
    return Teleop()


def _run(teleop: Teleop, stop: Stop) -> int:
    # Other signals, too, end the loop and so restore the terminal.
    for number in (signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.getsignal(signal.SIGTERM))
    with Terminal() as terminal:
        executor = SingleThreadedExecutor()
        executor.add_node(teleop)
        # DDS keeps ten answers, those to other clients included: they are taken at once.
        spinning = threading.Thread(target=executor.spin, daemon=True)
        spinning.start()
        try:
            _control(teleop, terminal, stop)
        finally:
            executor.shutdown()
            spinning.join(1.0)
    return 0


def _control(teleop: Teleop, terminal: Terminal, stop: Stop) -> None:
    keys, shown = Keys(), ''
    terminal.write_lines(teleop.help_text())
    while not (stop.asked or teleop.is_over):
        typed = terminal.read(SOON if teleop.simulator.is_busy or keys.is_open else LATER)
        if typed is None:
            return
        for key in keys.take(typed) if typed else keys.rest():
            lines = teleop.take(key)
            if lines:
                terminal.write_lines(lines)
                shown = ''
        teleop.tick()
        line = teleop.line()
        if line != shown or terminal.was_continued:
            terminal.was_continued = False
            terminal.show(line)
            shown = line
