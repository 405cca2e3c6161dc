"""
How commands run: one parser, where results go, refusals, Ctrl-C.

Nothing but the standard library is imported before the options are read, so that --help is quick.
"""

import argparse
from collections.abc import Callable, Sequence
import dataclasses
import os
from pathlib import Path
import shlex
import sys
from typing import Any, Final, TYPE_CHECKING

from .options import number, whole
from .refusal import attempt, INTERRUPTED, Parser

if TYPE_CHECKING:
    import xarray

    from ..studies.work import WorkOptions

PACKAGE: Final = 'gear_rattle_ros'
# Endings of pictures.
PICTURES: Final = ('.png', '.pdf', '.svg', '.jpg')


@dataclasses.dataclass(frozen=True)
class Run:
    """
    How a command runs and where its results go.

    `command` is the command line as one would type it again, `output` the store, `picture` what is
    drawn of it and `looks` how; `cluster` is the address of a Dask scheduler.
    """

    name: str
    command: str
    output: Path
    resume: bool = False
    cluster: str | None = None
    threads: int | None = None
    picture: Path | None = None
    looks: dict[str, Any] = dataclasses.field(default_factory=dict)

    @property
    def work(self) -> 'WorkOptions':
        """Return what a study has to know of it."""
        return {'store': self.output, 'resume': self.resume, 'cluster': self.cluster,
                'threads': self.threads, 'command': self.command, 'progress': True}

    def finish(self, dataset: 'xarray.Dataset', words: str, **looks: Any) -> None:
        """Print what was found and where everything is; draw the picture if one is asked for."""
        print(words)
        print(self.output)
        if self.picture is not None:
            from ..figures.draw import save
            for path in save(dataset, self.picture, **self.looks | looks):
                print(path)

    def numbered(self, number: int) -> 'Run':
        """Return one of several runs, whose store and picture have its number in their names."""
        def name(path: Path) -> Path:
            return path.with_name(f'{path.stem}-{number}{path.suffix}')

        return dataclasses.replace(self, output=name(self.output),
                                   picture=self.picture and name(self.picture))


@dataclasses.dataclass(frozen=True)
class Command:
    """
    A command that runs a study; called with its arguments it returns the exit status.

    `output` is the default name of the store, with options in braces, such as ``{alpha:g}``.
    """

    name: str
    description: str
    output: str
    add_options: Callable[[Parser], None]
    work: Callable[[argparse.Namespace, Run], None]

    def __call__(self, arguments: Sequence[str] | None = None) -> int:
        """Return 0, 2 after one line that says what is wrong, or 130 after Ctrl-C."""
        words = sys.argv[1:] if arguments is None else list(arguments)
        parser = Parser(self.name, description=self.description)
        self.add_options(parser)
        _add_run(parser)
        given = parser.parse_args(words)

        def action() -> int:
            require_picture(given.picture)
            run = Run(
                self.name, shlex.join(['ros2', 'run', PACKAGE, self.name, *words]),
                given.output or Path(self.output.format_map(vars(given))), given.resume,
                given.cluster, given.threads, given.picture, looks_of(given))
            from .compilation import reporting_compilation
            try:
                with reporting_compilation(self.name, sys.stderr):
                    self.work(given, run)
                return 0
            except KeyboardInterrupt:
                return _report_stop(run)

        return attempt(self.name, action)


def _add_run(parser: Parser) -> None:
    group = parser.add_argument_group('running')
    group.add_argument('--output', type=Path, metavar='DIR.zarr',
                       help='the store; named after the tool and its parameters by default')
    group.add_argument('--resume', action='store_true',
                       help='go on with a store whose tiles are not all done')
    group.add_argument('--cluster', metavar='ADDRESS',
                       help='run the tiles on a Dask cluster, such as tcp://host:8786')
    group.add_argument('--threads', type=whole(1), metavar='N',
                       help='threads here; one for each processor by default')
    add_picture(parser)


def add_picture(parser: Parser) -> None:
    """Add the options of a picture."""
    group = parser.add_argument_group('picture')
    group.add_argument('--picture', type=Path, metavar='FILE',
                       help=f'draw the result; the name ends in {", ".join(PICTURES)}')
    group.add_argument('--title', metavar='TEXT', help='title instead of the usual one')
    group.add_argument('--dpi', type=number, metavar='X',
                       help='pixels per inch of a picture made of pixels')
    group.add_argument('--colours', metavar='NAME',
                       help="a colour map of matplotlib, or 'paper' for the greys of the paper")


def looks_of(given: argparse.Namespace) -> dict[str, Any]:
    """Return how a picture is to look, as far as that was given."""
    return {name: value for name in ('title', 'dpi', 'colours')
            if (value := getattr(given, name)) is not None}


def require_picture(path: Path | None) -> None:
    """Refuse a picture that cannot be written before a long computation, not after it."""
    if path is None:
        return
    if path.is_dir() or not os.access(path.resolve().parent, os.W_OK):
        raise ValueError(f'--picture {path} cannot be written')
    if path.suffix not in PICTURES:
        raise ValueError(f'--picture {path} does not end in one of {" ".join(PICTURES)}')


def _report_stop(run: Run) -> int:
    from ..core.words import counted
    from ..store.store import Store, StoreError
    try:
        store = Store(run.output)
        total = len(store.tiles)
        done = total - len(store.pending())
    except StoreError:
        done = total = 0
    resume = '' if '--resume' in shlex.split(run.command) else ' --resume'
    print(f'{run.name}: stopped; {run.output} keeps {done:,} of {counted(total, "tile")}; go on '
          f'with: {run.command}{resume}', file=sys.stderr)
    return INTERRUPTED
