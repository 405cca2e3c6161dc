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
from typing import Any, Final, NoReturn, Protocol

from .engine import EngineError
from .grid import Plane
from .progress import Progress, telling_of_compilation
from .store import Store, StoreError
from ..core.model import ALPHA_MAXIMUM, Parameters, require_finite

PACKAGE: Final = 'gear_rattle_ros'
INTERRUPTED: Final = 130
GREATEST: Final = 2**31 - 1
# Endings of pictures.
PICTURES: Final = ('.png', '.pdf', '.svg', '.jpg')


class Figure(Protocol):
    """A picture, as matplotlib has it."""

    def savefig(self, fname: Path) -> None:
        """Write it."""


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

    def finish(self, draw: Callable[[], Figure], **beside: Callable[[], Figure]) -> int:
        """
        Draw the picture where one is asked for, and say where everything is.

        Parameters
        ----------
        draw : callable
            Makes the figure; imports matplotlib only then.
        **beside : callable
            Further figures, by what is added to the name of the file.

        Returns
        -------
        int
            The exit status, 0.

        """
        print(self.output)
        if self.picture is not None:
            for suffix, one in {'': draw, **beside}.items():
                path = self.picture
                if suffix:
                    path = path.with_name(f'{path.stem}-{suffix}{path.suffix}')
                one().savefig(path)
                print(path)
        return 0

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
        The least one taken; the greatest is what 32 bits hold, as lifetimes have.

    Returns
    -------
    callable
        Takes the text, also as 1e5.

    """
    def read(text: str) -> int:
        value = number(text)
        if value != int(value) or value < least:
            raise argparse.ArgumentTypeError(f'{text!r} is not a whole number from {least} on')
        if value > GREATEST:
            raise argparse.ArgumentTypeError(f'{text!r} is more than {GREATEST:,}')
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


def add_alpha_window(parser: argparse.ArgumentParser, low: float, high: float, words: str
                     ) -> None:
    """
    Add a window of amplitudes, and the other parameters of the model.

    Parameters
    ----------
    parser : ArgumentParser
        Receives them.
    low, high : float
        The window by default [1].
    words : str
        What it is.

    """
    parser.add_argument('--alpha', type=number, nargs=2, default=[low, high], metavar=('A', 'B'),
                        help=f'{words} [1]; {low:g} {high:g} by default')
    add_model(parser, names=('beta', 'gamma', 'restitution'))


def add_plane(parser: argparse.ArgumentParser, *, size: int | None = 400,
              displacement: float = 0.0) -> None:
    """
    Add the options of the plane of initial conditions.

    Parameters
    ----------
    parser : ArgumentParser
        Receives them.
    size : int or None
        Default number of cells along an edge; None for no such option.
    displacement : float
        Default displacement [1].

    """
    group = parser.add_argument_group('initial conditions')
    group.add_argument('--displacement', type=number, default=displacement, metavar='S',
                       help='displacement of all starts [1], -1 to 0; '
                            f'{displacement:g} by default')
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
        What was given; of a window of amplitudes the higher end is taken.

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
    values = {name: getattr(given, name) for name in names if hasattr(given, name)}
    if isinstance(values['alpha'], list):
        values['alpha'] = alpha_window_of(given)[1]
    return Parameters(**values)


def alpha_window_of(given: argparse.Namespace) -> tuple[float, float]:
    """
    Read a window of amplitudes.

    Parameters
    ----------
    given : Namespace
        What was given.

    Returns
    -------
    tuple of float
        The lower and the higher end [1].

    Raises
    ------
    ValueError
        If it is empty, reversed or out of range.

    """
    low, high = (require_finite('alpha', value, 0.0, ALPHA_MAXIMUM) for value in given.alpha)
    if not low < high:
        raise ValueError(f'alpha window {low:g} to {high:g} is empty or reversed; give the lower '
                         'end first')
    return low, high


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


def run_tool(parser: argparse.ArgumentParser, arguments: list[str] | None, output: str,
             work: Callable[[argparse.Namespace, Run], int]) -> int:
    """
    Parse a command line, run a tool, and turn what goes wrong into one line.

    Parameters
    ----------
    parser : ArgumentParser
        With the options of the tool; those of running are added.
    arguments : list of str or None
        Without the program's name; None for those of the process.
    output : str
        Name of the store by default; options stand in it in braces, such as ``{alpha:g}``.
    work : callable
        Takes what was given and how to run; returns an exit status.

    Returns
    -------
    int
        Exit status: that of the work, 2 with one line that says why, 130 after Ctrl-C.

    """
    add_run(parser)
    given = parser.parse_args(arguments)

    def action() -> int:
        run = _run_of(parser, given, arguments, output.format_map(vars(given)))
        try:
            with telling_of_compilation(run.name, sys.stderr):
                return work(given, run)
        except KeyboardInterrupt:
            return say_stopped(run)

    return attempt(parser.prog, action)


def attempt(name: str, action: Callable[[], int]) -> int:
    """
    Do something and turn what goes wrong into one line and an exit status.

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
    except (EngineError, MemoryError, StoreError, ValueError) as error:
        message = str(error) or 'not enough memory'
    except OSError as error:
        message = f'{error.filename}: {error.strerror}' if error.filename else str(error)
    print(f'{name}: {message}', file=sys.stderr)
    return 2


def say_stopped(run: Run) -> int:
    """
    Say what Ctrl-C has left of a store, and how to go on.

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
        total = len(store.tiles)
        done = total - len(store.pending())
    except StoreError:
        done = total = 0
    print(f'{run.name}: stopped; {done:,} of {total:,} tiles are kept in {run.output}; go on '
          f'with: {run.how_to_resume()}', file=sys.stderr)
    return INTERRUPTED


def _run_of(parser: argparse.ArgumentParser, given: argparse.Namespace,
            arguments: list[str] | None, output: str) -> Run:
    words = sys.argv[1:] if arguments is None else arguments
    if given.picture is not None:
        # Told before a long computation, not after it.
        folder = given.picture.resolve().parent
        if given.picture.is_dir() or not os.access(folder, os.W_OK):
            raise ValueError(f'--picture {given.picture} cannot be written')
        if given.picture.suffix not in PICTURES:
            raise ValueError(f'--picture {given.picture} does not end in one of '
                             f'{" ".join(PICTURES)}')
    return Run(parser.prog, shlex.join(['ros2', 'run', PACKAGE, parser.prog, *words]),
               given.output or Path(output), given.resume, given.cluster, given.threads,
               given.picture)
