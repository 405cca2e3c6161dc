"""
What the offline tools share on the command line: options, refusals, progress, Ctrl-C.

Exit status: 0, 2 after one line that says what is wrong, 130 after Ctrl-C.
"""

import argparse
from collections.abc import Callable
import dataclasses
import math
import os
from pathlib import Path
import re
import shlex
import sys
import time
from typing import Any, Final, NoReturn, TextIO

from .engine import EngineError
from .grid import Plane
from .store import Store, StoreError
from ..core.compiled import cache_directory
from ..core.model import Parameters

PACKAGE: Final = 'gear_rattle_ros'
INTERRUPTED: Final = 130
# How often progress is told, on a terminal and elsewhere [s].
ON_TERMINAL: Final = 0.3
ELSEWHERE: Final = 10.0


class Parser(argparse.ArgumentParser):
    """Options of a tool; refuses with one line, and takes ``-1e-3`` and ``-pi`` for numbers."""

    def __init__(self, *arguments: Any, **settings: Any) -> None:
        """Make it as argparse does."""
        super().__init__(*arguments, **settings)
        self._negative_number_matcher = re.compile(r'^-[\d.p]')

    def error(self, message: str) -> NoReturn:
        """Refuse the command line."""
        self.exit(2, f'{self.prog}: {message}\n')


@dataclasses.dataclass(frozen=True)
class Run:
    """
    How a tool runs and where its results go.

    Attributes
    ----------
    name : str
        The tool.
    command : str
        The command line, as one would type it again.
    output : Path
        The store.
    resume : bool
        Whether an unfinished store is continued.
    cluster : str or None
        Address of a Dask scheduler.
    threads : int or None
        Threads of this process; None for one a processor.
    picture : Path or None
        The picture to draw.

    """

    name: str
    command: str
    output: Path
    resume: bool = False
    cluster: str | None = None
    threads: int | None = None
    picture: Path | None = None

    def progress(self, total: int) -> 'Progress':
        """
        Tell how this run goes, on stderr.

        Parameters
        ----------
        total : int
            Number of starts, or whatever is counted.

        Returns
        -------
        Progress
            At none of them.

        """
        return Progress(self.name, total, sys.stderr)

    def how_to_resume(self) -> str:
        """
        Say how to go on.

        Returns
        -------
        str
            A command line.

        """
        resume = '' if '--resume' in shlex.split(self.command) else ' --resume'
        return self.command + resume


class Progress:
    """
    Progress with rate and time left.

    Parameters
    ----------
    name : str
        What is running.
    total : int
        How many things there are to do.
    stream : TextIO
        Where to; one line that is overwritten where it is a terminal, a line now and then
        elsewhere.

    """

    def __init__(self, name: str, total: int, stream: TextIO) -> None:
        self._name = name
        self._total = total
        self._stream = stream
        self._terminal = stream.isatty()
        self._begin = self._told = time.monotonic()
        self._done = self._impacts = self._before = 0

    def skip(self, done: int) -> None:
        """Count things done by an earlier run: they say nothing about the rate."""
        self._done += done
        self._before += done

    def add(self, done: int, impacts: int = 0) -> None:
        """Count things done just now, and the impacts that they took."""
        self._done += done
        self._impacts += impacts
        now = time.monotonic()
        if now - self._told >= (ON_TERMINAL if self._terminal else ELSEWHERE):
            self._told = now
            self._tell(now - self._begin)

    def end(self) -> None:
        """Leave the line of the terminal."""
        if self._terminal and self._told > self._begin:
            self._stream.write('\r\x1b[K')
            self._stream.flush()

    def _tell(self, seconds: float) -> None:
        fresh = self._done - self._before
        left = (self._total - self._done) * seconds / fresh if fresh else math.inf
        line = f'{self._name}: {self._done:,} of {self._total:,}'
        if self._impacts:
            line += f', {self._impacts / seconds / 1e6:.1f} million impacts/s'
        line += f', {in_words(left)} left' if fresh else ''
        self._stream.write(f'\r{line}\x1b[K' if self._terminal else line + '\n')
        self._stream.flush()


def in_words(seconds: float) -> str:
    """
    Put a duration in words.

    Parameters
    ----------
    seconds : float
        The duration [s].

    Returns
    -------
    str
        Seconds, minutes or hours.

    """
    if seconds < 99.5:
        return f'{seconds:.0f} s'
    if seconds < 99.5 * 60.0:
        return f'{seconds / 60.0:.0f} min'
    return f'{seconds / 3600.0:.1f} h'


def number(text: str) -> float:
    """
    Read a finite number; `pi` may stand at its end.

    Parameters
    ----------
    text : str
        Such as 0.48, -1e-3, 2pi, -pi or 0.5pi.

    Returns
    -------
    float
        The number.

    Raises
    ------
    argparse.ArgumentTypeError
        If it is none.

    """
    factor, rest = (math.pi, text[:-2]) if text.endswith('pi') else (1.0, text)
    if factor != 1.0 and rest in ('', '-'):
        rest += '1'
    try:
        value = float(rest) * factor
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f'{text!r} is not a finite number')
    return value


def whole(least: int) -> Callable[[str], int]:
    """
    Make a reader of whole numbers.

    Parameters
    ----------
    least : int
        The least one taken.

    Returns
    -------
    callable
        Takes the text, also as 1e5.

    """
    def read(text: str) -> int:
        value = number(text)
        if value != int(value) or value < least:
            raise argparse.ArgumentTypeError(f'{text!r} is not a whole number from {least} on')
        return int(value)

    return read


def add_model(parser: argparse.ArgumentParser, *, alpha: float = 0.48,
              names: tuple[str, ...] = ('alpha', 'beta', 'gamma', 'restitution')) -> None:
    """
    Add the options of the model.

    Parameters
    ----------
    parser : ArgumentParser
        Receives them.
    alpha : float
        Default of the amplitude [1].
    names : tuple of str
        Which of the parameters.

    """
    group = parser.add_argument_group('model')
    standard = Parameters(alpha=alpha)
    for name, words in (('alpha', 'amplitude of the drive'), ('beta', 'damping'),
                        ('gamma', 'constant load'), ('restitution', 'coefficient of restitution')):
        if name in names:
            value = getattr(standard, name)
            group.add_argument(f'--{name}', type=number, default=value, metavar='X',
                               help=f'{words} [1]; {value:g} by default')


def add_plane(parser: argparse.ArgumentParser, *, size: int | None = 400) -> None:
    """
    Add the options of the plane of initial conditions.

    Parameters
    ----------
    parser : ArgumentParser
        Receives them.
    size : int or None
        Default number of cells along an edge; None for no such option.

    """
    group = parser.add_argument_group('initial conditions')
    group.add_argument('--displacement', type=number, default=0.0, metavar='S',
                       help='displacement of all starts [1], -1 to 0; 0 by default')
    group.add_argument('--phase', type=number, nargs=2, default=[0.0, 2.0 * math.pi],
                       metavar=('A', 'B'),
                       help='window of the drive phase [rad]; 0 2pi by default')
    group.add_argument('--velocity', type=number, nargs=2, default=[-2.0, 2.0],
                       metavar=('A', 'B'), help='window of the velocity [1]; -2 2 by default')
    if size is not None:
        group.add_argument('--size', type=whole(1), nargs='+', default=[size], metavar='N',
                           help='cells along phase and velocity, N or N M; '
                                f'{size} {size} by default')


def add_seed(parser: argparse.ArgumentParser) -> None:
    """Add the option of the seed of random starts."""
    parser.add_argument('--seed', type=whole(0), default=1, metavar='N',
                        help='seed of the random starts; 1 by default')


def add_run(parser: argparse.ArgumentParser) -> None:
    """Add the options of how to run and where to put results."""
    group = parser.add_argument_group('running')
    group.add_argument('--output', type=Path, metavar='DIR.zarr',
                       help='the store; named after the tool and its parameters by default')
    group.add_argument('--resume', action='store_true',
                       help='go on with a store whose tiles are not all done')
    group.add_argument('--cluster', metavar='ADDRESS',
                       help='run the tiles on a Dask cluster, such as tcp://host:8786')
    group.add_argument('--threads', type=whole(1), metavar='N',
                       help='threads here; one for each processor by default')
    group.add_argument('--picture', type=Path, metavar='FILE.png', help='draw the result')


def model_of(given: argparse.Namespace) -> Parameters:
    """
    Read the parameters of the model.

    Parameters
    ----------
    given : Namespace
        What was given.

    Returns
    -------
    model : Parameters
        Validated.

    Raises
    ------
    ValueError
        If one is out of range.

    """
    names = [field.name for field in dataclasses.fields(Parameters)]
    return Parameters(**{name: getattr(given, name) for name in names if hasattr(given, name)})


def plane_of(given: argparse.Namespace) -> Plane:
    """
    Read the plane of initial conditions.

    Parameters
    ----------
    given : Namespace
        What was given.

    Returns
    -------
    Plane
        Validated.

    Raises
    ------
    ValueError
        If a window is reversed or a size is wrong.

    """
    size = getattr(given, 'size', [1])
    if len(size) > 2:
        raise ValueError(f'--size takes one or two numbers, not {len(size)}')
    return Plane(given.displacement, tuple(given.phase), tuple(given.velocity), size[0], size[-1])


def run_of(parser: argparse.ArgumentParser, given: argparse.Namespace,
           arguments: list[str] | None, output: str) -> Run:
    """
    Read how to run.

    Parameters
    ----------
    parser : ArgumentParser
        Of the tool.
    given : Namespace
        What was given.
    arguments : list of str or None
        The words given to `main`.
    output : str
        Name of the store by default.

    Returns
    -------
    Run
        How.

    Raises
    ------
    ValueError
        If the picture cannot be written.

    """
    words = sys.argv[1:] if arguments is None else arguments
    command = shlex.join(['ros2', 'run', PACKAGE, parser.prog, *words])
    if given.picture is not None:
        # Told before a long computation, not after it.
        folder = given.picture.resolve().parent
        if given.picture.is_dir() or not os.access(folder, os.W_OK):
            raise ValueError(f'--picture {given.picture} cannot be written')
    return Run(parser.prog, command, given.output or Path(output), given.resume, given.cluster,
               given.threads, given.picture)


def attempt(name: str, action: Callable[[], int]) -> int:
    """
    Run a tool and turn what goes wrong into one line and an exit status.

    Parameters
    ----------
    name : str
        The tool.
    action : callable
        Does everything and returns an exit status.

    Returns
    -------
    int
        That status; 2 where the input is wrong or something cannot be written.

    """
    try:
        return action()
    except (StoreError, EngineError, ValueError) as error:
        message = str(error)
    except OSError as error:
        message = f'{error.filename}: {error.strerror}' if error.filename else str(error)
    print(f'{name}: {message}', file=sys.stderr)
    return 2


def say_interrupted(run: Run, done: int, total: int) -> int:
    """
    Say what Ctrl-C has left and how to go on.

    Parameters
    ----------
    run : Run
        What was running.
    done, total : int
        Tiles.

    Returns
    -------
    int
        The exit status, 130.

    """
    print(f'{run.name}: stopped; {done:,} of {total:,} tiles are kept in {run.output}; go on '
          f'with: {run.how_to_resume()}', file=sys.stderr)
    return INTERRUPTED


def say_stopped(run: Run) -> int:
    """
    Say what Ctrl-C has left of a store.

    Parameters
    ----------
    run : Run
        What was running.

    Returns
    -------
    int
        The exit status, 130.

    """
    try:
        store = Store(run.output)
    except StoreError:
        return say_interrupted(run, 0, 0)
    return say_interrupted(run, len(store.tiles) - len(store.pending()), len(store.tiles))


def announce_compilation(name: str, kernel: str) -> None:
    """
    Say so where the first run compiles.

    Parameters
    ----------
    name : str
        The tool.
    kernel : str
        Function that is compiled last.

    """
    if not any(cache_directory().rglob(f'*{kernel}*.nbc')):
        print(f'{name}: compiling, once on this machine; this takes about a minute ...',
              file=sys.stderr, flush=True)
