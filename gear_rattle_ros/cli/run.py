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
How commands run: one parser, where results go, refusals, Ctrl-C.

Nothing but the standard library is imported before the options are read, so that --help is quick.
"""

import argparse
from collections.abc import Callable, Mapping, Sequence
import contextlib
import dataclasses
import importlib
import inspect
import os
from pathlib import Path
import shlex
import sys
from typing import Any, Final, TYPE_CHECKING

from .options import (
    model_of,
    number,
    one_by_one,
    path_of,
    paths_of,
    place_of,
    plane_of,
    whole,
)
from .refusal import attempt, INTERRUPTED, Parser
from .. import PLACES
from ..gear_pairs import parse
from ..places import PACKAGE, typed

if TYPE_CHECKING:
    from ..attractors.plane import Plane
    from ..store.store import Store

# Endings of pictures.
PICTURES: Final = ('.png', '.pdf', '.svg', '.jpg')
# Options that do not change a dataset.
UNNAMED: Final = ('colours', 'wav', 'seconds')


@dataclasses.dataclass(frozen=True)
class Command:
    """A command that runs the study of its name; called, it returns the exit status."""

    name: str
    description: str
    add_options: Callable[[Parser], None]
    # An option with the name of a keyword of the study is passed to it; these replace some.
    keywords: Callable[[argparse.Namespace], dict[str, Any]] = lambda given: {}
    # The study is run for each.
    planes: 'Callable[[argparse.Namespace], list[Plane]]' = lambda given: [plane_of(given)]
    has_picture: bool = True
    # What else is written of the dataset.
    finish: 'Callable[[argparse.Namespace, Store], list[Path]]' = lambda given, store: []

    def __call__(self, arguments: Sequence[str] | None = None) -> int:
        words = sys.argv[1:] if arguments is None else list(arguments)
        parser = Parser(self.name, description=self.description)
        self.add_options(parser)
        asked = list(parser._actions)
        _add_run(parser)
        if self.has_picture:
            add_picture(parser)
            add_views(parser)

        def run() -> int:
            given = parse(parser, words)
            defaults = {each.dest: each.default for each in asked}
            for one, mark in one_by_one(given):
                one.output = _marked(given.output, mark) or Path(
                    f'{_name(self.name, defaults, one)}.zarr')
                if self.has_picture:
                    one.picture = _marked(given.picture, mark)
                status = self._run(one, words)
                if status:
                    return status
            return 0

        return attempt(self.name, run)

    def _run(self, given: argparse.Namespace, words: list[str]) -> int:
        drawn = getattr(given, 'picture', None)
        require_picture(drawn)
        path = output = given.output
        command = shlex.join(['gear_rattle', self.name, *words])
        try:
            from .compilation import reporting_compilation
            with reporting_compilation(self.name, sys.stderr):
                planes = self.planes(given)
                for level, plane in enumerate(planes):
                    number = f'-{level}' if len(planes) > 1 else ''
                    path = _marked(output, number)
                    self._study(given, plane, path, _marked(drawn, number), command)
            return 0
        except KeyboardInterrupt:
            return _report_stop(self.name, path, words)

    def _study(self, given: argparse.Namespace, plane: 'Plane', output: Path,
               picture: Path | None, command: str) -> None:
        module = module_of(self.name)
        study = getattr(module, self.name)
        takes = inspect.signature(study).parameters
        keywords = {name: tuple(value) if isinstance(value, list) else value
                    for name, value in vars(given).items() if name in takes} | {'plane': plane}
        model: Any = {'path': path_of, 'paths': paths_of, 'place': place_of}.get(
            next(iter(takes)), model_of)(given)
        if given.pair is not None:
            if isinstance(model, type(given.pair.parameters)) and given.pair.parameters != model:
                given.pair = given.pair.with_parameters(model)
            keywords['gears'] = given.pair
            print(given.pair.describe())
        if 'pair' in takes:
            model = keywords.pop('gears', None)
            if model is None:
                raise ValueError('there is no gear pair: give its file with --gears, or its '
                                 'quantities')
            del keywords['pair']
        store = study.compute(
            model, **keywords | self.keywords(given), store=output,
            resume=True, cluster=given.cluster, threads=given.threads, command=command,
            progress=True)
        print(module.describe(store))
        print(output)
        for path in self.finish(given, store):
            print(path)
        if picture is not None:
            from ..figures.draw import save
            for path in save(store.dataset(), picture, **looks_of(given)):
                print(path)


def module_of(name: str, room: str = 'studies') -> Any:
    """Import a study, or from `cli` its command: both stand in rooms of the same names."""
    place = PLACES.get(name, f'studies.{name}').replace('studies', room, 1)
    return importlib.import_module(f'{PACKAGE}.{place}')


def _marked(path: Path | None, mark: str) -> Any:
    return path and path.with_name(f'{path.stem}{mark}{path.suffix}')


def _add_run(parser: Parser) -> None:
    group = parser.add_argument_group('running')
    group.add_argument('--output', type=Path, metavar='DIR.zarr',
                       help='the store, by default named after the tool, alpha and every '
                       'other option that changes the result (of several values, a store for '
                       'each); an existing one that answers the '
                       'same question is continued, or drawn again')
    # Older versions continued a store only when they were told to.
    group.add_argument('--resume', action='store_true', help=argparse.SUPPRESS)
    group.add_argument('--cluster', metavar='ADDRESS',
                       help='run the tiles on a Dask cluster, such as tcp://host:8786')
    group.add_argument('--threads', type=whole(1), metavar='N',
                       help='threads here; one for each processor by default')


def _name(name: str, asked: Mapping[str, Any], given: argparse.Namespace) -> str:
    """Return the name of a store: the tool, a single alpha, and all options with other values."""
    parts = [name]
    for option, default in asked.items():
        value = getattr(given, option, default)
        is_single = option == 'alpha' and isinstance(value, float) and given.pair is None
        if option not in UNNAMED and (is_single or _flat(value) != _flat(default)):
            parts += [*([] if is_single else [option.replace('_', '-')]), '_'.join(_flat(value))]
    return '-'.join(parts)


def _flat(value: Any) -> list[str]:
    if isinstance(value, (list, tuple)):
        return [word for each in value for word in _flat(each)]
    return [Path(str(value)).stem if isinstance(value, Path)
            else str(value).removesuffix('.0').replace('/', '_')]


def add_picture(parser: Parser) -> None:
    group = parser.add_argument_group('picture')
    group.add_argument('--picture', type=Path, metavar='FILE',
                       help=f'draw the result; the name ends in {", ".join(PICTURES)}')
    group.add_argument('--title', metavar='TEXT', help='title instead of the usual one')
    group.add_argument('--dpi', type=number, metavar='X',
                       help='pixels per inch of a picture made of pixels')
    group.add_argument('--colours', metavar='NAME',
                       help="a colour map of matplotlib, or 'paper' for the looks of the paper")


def add_views(parser: Parser) -> None:
    """Add the options of what the picture of a dataset shows."""
    group = parser.add_argument_group('what the picture shows')
    group.add_argument('--draw', choices=('velocity', 'exponent', 'both', 'impacts'),
                       help='of an orbit diagram the velocity, the exponent or both; of the '
                       'section of one trajectory its impacts in turn')
    group.add_argument('--mark', type=number, nargs='+', metavar='X', help='mark values, or '
                       'the window of a magnification: two phases and two velocities, or on a '
                       'strobe two displacements first')
    group.add_argument('--transitions', type=Path, metavar='STORE.zarr', help='mark in a diagram '
                       'what the tool transitions has found')


def looks_of(given: argparse.Namespace) -> dict[str, Any]:
    """Return how a picture is to look, as far as that was given."""
    looks: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value
        for name in ('title', 'dpi', 'colours', 'draw', 'mark', 'transitions')
        if (value := getattr(given, name, None)) is not None}
    if 'transitions' in looks:
        from ..store.store import open_dataset
        looks['transitions'] = open_dataset(looks['transitions'])
    return looks


def require_picture(path: Path | None) -> None:
    """Refuse a picture that cannot be written before a long computation, not after it."""
    if path is None:
        return
    if path.is_dir() or not os.access(path.resolve().parent, os.W_OK):
        raise ValueError(f'--picture {path} cannot be written')
    if path.suffix not in PICTURES:
        raise ValueError(f'--picture {path} does not end in one of {" ".join(PICTURES)}')


def _report_stop(name: str, output: Path, words: list[str]) -> int:
    from ..core.words import counted
    done = total = 0
    try:
        from ..store.store import Store, StoreError
        with contextlib.suppress(StoreError):
            store = Store(output)
            total = len(store.tiles)
            done = total - len(store.pending())
    except Exception as error:
        # A library that was interrupted in its import cannot be imported again.
        raise KeyboardInterrupt from error
    print(f'{name}: stopped; {output} keeps {done:,} of {counted(total, "tile")}; go on '
          f'with: {shlex.join([*typed(name), *words])}', file=sys.stderr)
    return INTERRUPTED
