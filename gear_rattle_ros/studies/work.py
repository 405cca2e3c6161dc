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

"""How a study runs and where its dataset is kept: the keywords that every study takes."""

from collections.abc import Callable, Iterator, Sequence
import contextlib
import dataclasses
import functools
import inspect
import json
from pathlib import Path
import sys
from typing import Final, Generic, ParamSpec, TYPE_CHECKING, TypeAlias, TypedDict, TypeVar

from .progress import Progress
from ..attractors.engine import run_tiles
from ..attractors.listing import named
from ..core.defaults import QUANTITIES
from ..core.gears import Gears
from ..core.model import Parameters
from ..core.words import counted
from ..store.layout import Layout
from ..store.making import make_store
from ..store.store import Store

if TYPE_CHECKING:
    import xarray

# Its import takes long.
Dataset: TypeAlias = 'xarray.Dataset'
# What `describe` of a study puts in words.
Arrays: TypeAlias = 'Store | xarray.Dataset'
# What every study takes, at the end of its parameters.
OPTIONS: Final = '\n**options\n    As `Work` explains them.\n'
Item = TypeVar('Item')
Result = TypeVar('Result')
P = ParamSpec('P')


class Study(Generic[P]):
    """A study: called, it returns its dataset."""

    def __init__(self, compute: Callable[P, Store]) -> None:
        self._compute = compute
        functools.update_wrapper(self, compute)
        self.__doc__ = inspect.cleandoc(compute.__doc__ or '') + OPTIONS
        self.__signature__ = inspect.signature(compute).replace(return_annotation=Dataset)

    def compute(self, *args: P.args, **options: P.kwargs) -> Store:
        """Compute the store; for commands, as xarray takes longer to import than a small grid."""
        gears = options.get('gears')
        if isinstance(gears, Gears) and args and isinstance(args[0], Parameters):
            gears.require(args[0])
        store = self._compute(*args, **options)
        if isinstance(gears, Gears):
            _add_units(store, gears)
        return store

    def __call__(self, *args: P.args, **options: P.kwargs) -> Dataset:
        return self.compute(*args, **options).dataset()


class WorkOptions(TypedDict, total=False):
    """Keywords of every study, which `Work` explains."""

    store: Path | str | None
    resume: bool
    threads: int | None
    cluster: str | None
    command: str
    progress: bool | None
    gears: Gears | None


@dataclasses.dataclass(frozen=True)
class Work:
    """
    How a study runs and where its dataset is kept.

    `store` is the directory of the Zarr store; without one the dataset is in memory only.
    `resume` goes on with a store that exists. `threads` is by default one for each processor;
    `cluster` is the address of a Dask scheduler whose workers see the store. `command`, the
    command line that does the same, is kept in the dataset. `progress` is reported on stderr, by
    default where that is a terminal. `gears` is the gear pair that has these parameters: the
    dataset then has SI units, too.
    """

    store: Path | str | None = None
    resume: bool = False
    threads: int | None = None
    cluster: str | None = None
    command: str = ''
    progress: bool | None = None
    gears: Gears | None = None

    def begin(self, layout: Layout) -> Store:
        """Make the store, or open the one to go on with; StoreError where neither can be."""
        path = None if self.store is None else Path(self.store)
        was_there = path is not None and (path / 'zarr.json').exists()
        store = make_store(path, layout, self.command, resume=self.resume)
        if was_there and self._reports:
            total = len(store.tiles)
            print(f'{path} answers the same question: {total - len(store.pending()):,} of '
                  f'{counted(total, "tile")} done already', file=sys.stderr)
        return store

    @property
    def _reports(self) -> bool:
        return sys.stderr.isatty() if self.progress is None else self.progress

    def report(self, name: str, total: int, *, uneven: bool = False) -> Progress:
        """Begin to report progress; `total` counts initial conditions or the like."""
        return Progress(name, total, sys.stderr, not self._reports, uneven)

    def run(self, fill: Callable[[int], Result], tiles: list[int],
            finished: Callable[[int, Result], None]) -> None:
        """Fill tiles on the threads or the cluster, as `run_tiles` does."""
        run_tiles(fill, tiles, finished, cluster=self.cluster, threads=self.threads)

    def each(self, name: str, items: Sequence[Item], do: Callable[[Item], Result]
             ) -> list[Result]:
        """Do something with each item, on the threads, and report it; return what comes of it."""
        results: dict[int, Result] = {}
        with self.report(name, len(items), uneven=True) as progress:
            def finished(number: int, result: Result) -> None:
                results[number] = result
                progress.add(1)

            run_tiles(lambda number: do(items[number]), range(len(items)), finished,
                      threads=self.threads)
        return [results[number] for number in range(len(items))]

    @contextlib.contextmanager
    def pending(self, name: str, store: Store, size: Callable[[int], int]
                ) -> Iterator[tuple[list[int], Callable[[int, int], None]]]:
        """
        Report the progress of a store; give its pending tiles, and what marks one as done.

        The latter takes the tile and its impacts; `size` is what a tile counts for.
        """
        pending = store.pending()
        total = sum(map(size, range(len(store.tiles))))
        with self.report(name, total) as progress:
            progress.skip(total - sum(map(size, pending)))

            def finished(tile: int, impacts: int) -> None:
                store.mark(tile)
                progress.add(size(tile), impacts)

            yield pending, finished


def _add_units(store: Store, gears: Gears) -> None:
    """Add to a store the gear pair, its scales, and what is not made tile by tile in SI units."""
    scales, added = gears.scales, {}
    velocity = scales.velocity_m_per_s, '{}_m_per_s', 'm/s'
    units = dict.fromkeys(('velocity', 'velocity_after', 'kick', 'kick_size'), velocity) | {
        'displacement': (scales.displacement_m, '{}_m', 'm'),
        'tau': (scales.time_s, 'time_s', 's')} | {
        name: (unit, quantity, QUANTITIES[quantity][1])
        for name, (quantity, unit) in gears.units.items() if name != quantity}
    for name, (dimensions, words) in store.tables().items():
        for last, (unit, form, symbol) in units.items():
            if name == last or name.endswith(f'_{last}'):
                added[name.removesuffix(last) + form.format(last)] = (
                    dimensions, store.read_all(name) * unit, named(words, symbol))
    store.write_table(added)
    store.set_attributes({'gears': json.dumps(gears.given), 'omega': gears.omega,
                          **{f'scale_{name}': value for name, value in scales._asdict().items()},
                          'coordinates': ' '.join(added)})
