"""The keyboard control: steers a simulator from a terminal."""

import signal
import sys
import time

from rclpy._rclpy_pybind11 import RCLError
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.utilities import try_shutdown

from .arguments import explained
from .services import harden
from .shell import GivenNode, initialise, StartError, Stop
from .teleop_keys import Entry, Keys
from .teleop_link import Link
from .teleop_terminal import Terminal
from ..parameters import declare, TELEOP
from ..scenes import load_scenes, Performance

# Keys are awaited so long, while an answer is under way and otherwise [s].
SOON, LATER = 0.02, 0.1
MORE = ('up', 'right', 'shift-up', 'shift-right')
LESS = ('down', 'left', 'shift-down', 'shift-left')


class Teleop:
    """Makes requests of keys, plays scenes, and says how things are in one line."""

    def __init__(self, node: Node) -> None:
        values = declare(node, TELEOP)
        self.link = Link(node, str(values['simulator']))
        self.is_over = False
        self._scenes = list(load_scenes().values())[:9]
        self._coarse, self._fine = float(values['coarse']), float(values['fine'])
        self._ramp_rate = float(values['ramp_rate'])
        self._entry: Entry | None = None
        self._scene = ''
        self._performance: Performance | None = None
        # Time of the scene, which stands still in a pause [s].
        self._played = 0.0
        self._before = time.monotonic()
        # Where the arrows lead while settings of alpha are under way [1].
        self._aim: float | None = None

    def help_text(self) -> str:
        """Return what the keys do."""
        scenes = '\n'.join(
            f'  {number}        scene {scene.name}: {scene.title}'
            for number, scene in enumerate(self._scenes, 1))
        return (
            f'The keyboard steers {self.link.name}:\n'
            f'  arrows   alpha: up and right add {self._coarse:g}, down and left take it away; '
            f'with shift {self._fine:g}\n'
            '  space    pause, and go on\n'
            '  r        reset to the initial state\n'
            '  a        ramp of alpha: type where to, and if you like the step per drive period\n'
            f'{scenes}\n'
            '  h        these lines\n'
            '  q        end; what runs goes on')

    def line(self) -> str:
        """Return the present state."""
        if self._entry is not None:
            return f'{self._entry.question}{self._entry.text}_'
        link, values = self.link, self.link.values
        if not link.is_here:
            why = link.words or f'no simulator at {link.name}'
            return f'{why}; waiting (q ends; name another with -p simulator:=NAME)'
        alpha = f'alpha {values["alpha"]:.10g}'
        if values['alpha_rate'] > 0.0:
            alpha += f' -> {values["alpha_target"]:g} by {values["alpha_rate"]:g}'
        speed = f'{values["rate"]:g} periods/s' if values['rate'] > 0.0 else 'full speed'
        parts = [alpha, 'paused' if link.paused else speed]
        if self._performance is not None:
            parts.append(f'scene {self._scene}')
        if link.words:
            parts.append(link.words)
        parts.append(f'beta {values["beta"]:g} gamma {values["gamma"]:g} '
                     f'r {values["restitution"]:g} noise {values["noise"]:g}')
        return ' | '.join(parts)

    def take(self, key: str) -> str:
        """Do what a key asks for; return lines that are to stay on the screen."""
        if self._entry is not None:
            text = self._entry.take(key)
            if text is not None:
                self._entry = None
                self._begin_ramp(text)
            return ''
        if key == 'q':
            self.is_over = True
        elif key in ('h', '?'):
            return self.help_text()
        elif self.link.is_here:
            self._steer(key)
        return ''

    def tick(self) -> None:
        """Take answers, and go on with a scene."""
        now = time.monotonic()
        self.link.tick(now)
        if not self.link.has_asked:
            self._aim = None
        if not self.link.is_here:
            self._performance = self._entry = None
        elif self._performance is not None and not self.link.has_asked:
            self._play()
        if not self.link.paused:
            self._played += now - self._before
        self._before = now

    def _steer(self, key: str) -> None:
        link = self.link
        if key in MORE + LESS:
            step = self._fine if key.startswith('shift') else self._coarse
            before = link.values['alpha'] if self._aim is None else self._aim
            # Steps of a hundredth lead to hundredths.
            self._aim = max(round(before + (step if key in MORE else -step), 12), 0.0)
            self._performance = None
            link.put({'alpha': self._aim})
        elif key == 'space':
            link.pause(not link.paused)
        elif key == 'r':
            link.reset()
        elif key == 'a':
            self._entry = Entry('ramp alpha to (Escape: not at all): ')
        elif key.isdigit() and 1 <= int(key) <= len(self._scenes):
            scene = self._scenes[int(key) - 1]
            self._scene, self._performance = scene.name, Performance(scene.steps)
            link.words = ''
            if link.paused:
                link.pause(False)

    def _begin_ramp(self, text: str) -> None:
        if not text:
            return
        try:
            target, *rates = map(float, text.split())
            rate, = rates or [self._ramp_rate]
        except ValueError:
            self.link.words = f'{text!r} is no number, nor two'
            return
        self._performance = None
        self.link.put({'alpha_target': target, 'alpha_rate': rate}, 'ramp')

    def _play(self) -> None:
        performance, alpha = self._performance, self.link.values['alpha']
        assert performance is not None
        step = performance.due(self._played, alpha)
        if step is not None:
            if step.parameters:
                self.link.put(step.parameters)
                self._aim = step.parameters.get('alpha')
            if step.reset:
                self.link.reset()
        elif performance.is_over(self._played, alpha):
            self._performance = None
            self.link.words = f'scene {self._scene} is over; the simulator goes on'


def main(arguments: list[str] | None = None) -> int:
    """Run the keyboard control; the exit status is 0, or 2 where it cannot start."""
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        print('teleop: stdin and stdout are no terminal; start it in one, not in a pipe or a '
              'launch file', file=sys.stderr)
        return 2
    stop = Stop()
    try:
        try:
            initialise('teleop', arguments)
            node = GivenNode('teleop')
            teleop = Teleop(node)
            harden(node)
        except (StartError, ValueError, RCLError) as error:
            print(f'teleop: {explained(error)}', file=sys.stderr)
            return 2
        # From here on signals end the loop, and so restore the terminal.
        stop.spinning = True
        for number in (signal.SIGHUP, signal.SIGQUIT):
            signal.signal(number, signal.getsignal(signal.SIGTERM))
        with Terminal() as terminal:
            executor = SingleThreadedExecutor()
            executor.add_node(node)
            _run(teleop, terminal, executor, stop)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        stop.spinning = True
        try_shutdown()
    return 0


def _run(teleop: Teleop, terminal: Terminal, executor: SingleThreadedExecutor,
         stop: Stop) -> None:
    keys, shown = Keys(), ''
    terminal.write_lines(teleop.help_text())
    while not (stop.asked or teleop.is_over):
        typed = terminal.read(SOON if teleop.link.is_busy or keys.is_open else LATER)
        if typed is None:
            return
        for key in keys.take(typed) if typed else keys.rest():
            lines = teleop.take(key)
            if lines:
                terminal.write_lines(lines)
                shown = ''
        executor.spin_once(timeout_sec=0.0)
        teleop.tick()
        line = teleop.line()
        if line != shown or terminal.was_continued:
            terminal.was_continued = False
            terminal.show(line)
            shown = line
