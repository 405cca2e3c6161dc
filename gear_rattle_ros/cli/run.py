"""
How the offline tools run: where results go, refusals, progress, Ctrl-C.

Exit status: 0, 2 after one line that says what is wrong, 130 after Ctrl-C.
"""

import argparse
from collections.abc import Callable
import dataclasses
import os
from pathlib import Path
import shlex
import sys
from typing import Final, Protocol

from .options import whole
from .progress import Progress, telling_of_compilation
from .refusal import attempt, INTERRUPTED
from ..attractors.engine import EngineError
from ..core.words import counted
from ..store.store import Store, StoreError

PACKAGE: Final = 'gear_rattle_ros'
# Endings of pictures.
PICTURES: Final = ('.png', '.pdf', '.svg', '.jpg')


class Figure(Protocol):
    """A picture, as matplotlib has it."""

    def savefig(self, fname: Path) -> None:
        """Write it."""


@dataclasses.dataclass(frozen=True)
class Run:
    """
    How a tool runs and where its results go.

    `command` is the command line as one would type it again, `output` the store and `picture` what
    is drawn of it, `cluster` the address of a Dask scheduler; without `threads` there is one for
    each processor.
    """

    name: str
    command: str
    output: Path
    resume: bool = False
    cluster: str | None = None
    threads: int | None = None
    picture: Path | None = None

    def progress(self, total: int) -> 'Progress':
        """Report on stderr how this run goes; `total` counts initial conditions or the like."""
        return Progress(self.name, total, sys.stderr)

    def finish(self, draw: Callable[[], Figure], **beside: Callable[[], Figure]) -> int:
        """
        Draw the picture where one is asked for, and say where everything is.

        `draw` imports matplotlib only when it is called; further figures are named by what is
        added to the name of the file. The exit status is 0.
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
        """Return the command line that goes on with this run."""
        resume = '' if '--resume' in shlex.split(self.command) else ' --resume'
        return self.command + resume


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


def run_tool(parser: argparse.ArgumentParser, arguments: list[str] | None, output: str,
             work: Callable[[argparse.Namespace, Run], int]) -> int:
    """
    Parse a command line, run a tool, and turn what goes wrong into one line.

    Options stand in braces in `output`, the default name of the store, such as ``{alpha:g}``. The
    exit status is that of `work`, 2 after an error, 130 after Ctrl-C.
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

    return attempt(parser.prog, action, EngineError, StoreError)


def say_stopped(run: Run) -> int:
    """Say what Ctrl-C has left of a store and how to go on; return exit status 130."""
    try:
        store = Store(run.output)
        total = len(store.tiles)
        done = total - len(store.pending())
    except StoreError:
        done = total = 0
    print(f'{run.name}: stopped; {run.output} keeps {done:,} of {counted(total, "tile")}; go on '
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
