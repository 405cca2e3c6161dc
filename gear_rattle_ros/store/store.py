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
Labelled arrays in Zarr on disk, resumable tile by tile.

A store is a Zarr group of format 3, which zarr and xarray read. A tile is one chunk of every
variable, so threads and processes write tiles without knowing of each other. It counts only once
it is marked in `tile_done`. Every chunk ends with a checksum (CRC-32C), which all readers check.
"""

from collections.abc import Iterator, Mapping
import itertools
import json
from pathlib import Path
import shutil
from types import MappingProxyType, SimpleNamespace
from typing import Any, Final, TYPE_CHECKING
import weakref

import numpy as np
import numpy.typing as npt

from .arrays import (
    consolidate,
    ELSE,
    plain,
    read_array,
    reading,
    REMEDY,
    StoreError as StoreError,
    write_array,
)
from .layout import Variable
from ..core.words import counted

if TYPE_CHECKING:
    import xarray

DONE: Final = 'tile_done'
IDENTITY: Final = 'identity'


class Store:
    """
    An open store; raises StoreError where `path` does not hold one.

    `path` is its directory, and `tiles` holds for every tile a slice for each tiled dimension.
    With `folder` the store is temporary: that directory is removed with the object.
    """

    def __init__(self, path: Path | str, folder: Path | None = None) -> None:
        import zarr
        self.path = path = Path(path)
        if not (path / 'zarr.json').is_file():
            if (path / '.zgroup').is_file():
                raise StoreError(f'{path} was written by an older version (zarr format 2); {ELSE}')
            what = 'is not a store of this package' if path.exists() else 'does not exist'
            raise StoreError(f'{path} {what}; {ELSE}')
        self._arrays: dict[str, Any] = {}
        with reading(path, ELSE):
            # While a store is made, the consolidated metadata is behind.
            self._group: Any = zarr.open_group(
                str(path), mode='r+', zarr_format=3, use_consolidated=False)
            if IDENTITY not in self._group.attrs or DONE not in self._group:
                raise StoreError(f'{path} is not a store of this package; {ELSE}')
            marks = self._array(DONE)
            self._cuts: dict[str, tuple[int, int]] = {
                name: (size, step) for name, size, step in json.loads(marks.attrs['tiles'])}
            self._variables: list[str] = json.loads(marks.attrs['variables'])
        self.tiles: list[dict[str, slice]] = list(_tiles_of(self._cuts))
        try:
            self._done = read_array(marks, (...,))
        except ValueError:
            # Without marks nothing counts as done.
            self._done = np.zeros(marks.shape, marks.dtype)
        self._remove = folder and weakref.finalize(self, shutil.rmtree, folder, True)

    def __reduce__(self) -> tuple[type['Store'], tuple[Path]]:
        """Let another process open it anew."""
        return Store, (self.path,)

    def close(self) -> None:
        """Remove a temporary store; any other stays."""
        if self._remove:
            self._remove()

    @property
    def attrs(self) -> dict[str, Any]:
        """Return the attributes of the store."""
        return dict(self._group.attrs)

    def __getitem__(self, name: str) -> Any:
        """Return what has the `values` of an array, as a dataset does."""
        return SimpleNamespace(values=self.read_all(name))

    def pending(self) -> list[int]:
        """List the numbers of the tiles that are still to be done."""
        return [int(tile) for tile in np.flatnonzero(self._done == 0)]

    def damaged(self) -> dict[int, Path]:
        """Return the tiles that are marked but cannot be read, each with its first bad chunk."""
        found = {}
        for tile in np.flatnonzero(self._done).tolist():
            for name in self._variables:
                chunk = self._chunk(tile, name)
                try:
                    self.read(tile, name)
                    is_whole = chunk.is_file()
                except StoreError:
                    is_whole = False
                if not is_whole:
                    found[tile] = chunk
                    break
        return found

    def write(self, tile: int, values: Mapping[str, npt.ArrayLike]) -> None:
        """Write a tile of each variable, an array of the tile's shape; any process may."""
        for name, value in values.items():
            array = self._array(name)
            array[self._place(array, tile)] = np.asarray(value)

    def read(self, tile: int, name: str) -> npt.NDArray[Any]:
        """Read a tile of a variable."""
        array = self._array(name)
        with reading(self.path / name, REMEDY):
            return read_array(array, self._place(array, tile))

    def read_all(self, name: str) -> npt.NDArray[Any]:
        """Read a whole array: a variable, a coordinate or a table."""
        array = self._array(name)
        with reading(self.path / name, REMEDY):
            return read_array(array, (...,))

    def has_table(self, name: str) -> bool:
        """Whether an array that is not made tile by tile is there and can be read."""
        try:
            self.read_all(name)
            array = self._array(name)
            return bool(array.nchunks_initialized == array.nchunks)
        except StoreError:
            return False

    def tables(self) -> dict[str, tuple[tuple[str, ...], str]]:
        """Return the dimensions and the long name of all that is not made tile by tile."""
        return {name: (tuple(array.metadata.dimension_names), array.attrs.get('long_name', ''))
                for name, array in self._group.arrays()
                if name not in (*self._variables, DONE)}

    def mark(self, tile: int | list[int], done: bool = True) -> None:
        """Enter whether tiles are done; one process only does this."""
        self._done[tile] = done
        self._array(DONE)[:] = self._done

    def write_table(self, variables: Mapping[str, tuple[tuple[str, ...], npt.ArrayLike,
                                                        Mapping[str, Any]]],
                    attributes: Mapping[str, Any] = MappingProxyType({})) -> None:
        """
        Write arrays that are not made tile by tile; those of the same name are replaced.

        Each name comes with dimensions, values and attributes; `attributes` are of the store.
        """
        for name, (dimensions, values, words) in variables.items():
            self._arrays.pop(name, None)
            write_array(self._group, Variable(name, dimensions, '', words), np.asarray(values))
        self._group.attrs.update(plain(attributes))
        consolidate(self.path)

    def set_attributes(self, attributes: Mapping[str, Any]) -> None:
        """Add attributes to the store."""
        self.write_table({}, attributes)

    def dataset(self) -> 'xarray.Dataset':
        """
        Return what is in a store whose tiles are all done.

        Arrays are read when they are looked at; those of a temporary store are in memory.
        """
        import xarray
        if self.pending():
            raise StoreError(f'{self.path}: {len(self.pending())} of '
                             f'{counted(len(self.tiles), "tile")} must still be done; the same '
                             'command again does them')
        with reading(self.path, REMEDY):
            dataset = xarray.open_zarr(str(self.path), consolidated=False, chunks=None)
            # What was asked for comes first, then the tables, whatever order the disk has.
            names = [str(name) for name in dataset.data_vars if name != DONE]
            dataset = dataset[sorted(names, key=lambda name: (name not in self._variables, name))]
            return dataset.load() if self._remove else dataset

    def require_whole(self) -> None:
        """Raise StoreError for the first array that is damaged or not complete."""
        for tile, chunk in self.damaged().items():
            raise StoreError(f'{chunk}: tile {tile} is damaged or missing; {REMEDY}')
        with reading(self.path, ELSE):
            names = sorted(self._group.array_keys())
        for name in names:
            if name not in (*self._variables, DONE) and not self.has_table(name):
                raise StoreError(f'{self.path / name} is damaged or missing; {REMEDY}')

    def _array(self, name: str) -> Any:
        if name not in self._arrays:
            with reading(self.path / name, ELSE):
                array = self._group[name]
                # Zarr reads a missing chunk as zeros, so a chunk of zeros must be there.
                self._arrays[name] = array.with_config({'write_empty_chunks': True})
        return self._arrays[name]

    def _chunk(self, tile: int, name: str) -> Path:
        metadata, region = self._array(name).metadata, self.tiles[tile]
        return self.path / name / str(metadata.encode_chunk_key(tuple(
            region[one].start // self._cuts[one][1] if one in region else 0
            for one in metadata.dimension_names)))

    def _place(self, array: Any, tile: int) -> tuple[slice, ...]:
        region = self.tiles[tile]
        return tuple(region.get(name, slice(None)) for name in array.metadata.dimension_names)


def open_dataset(path: Path | str) -> 'xarray.Dataset':
    """
    Open a store as a labelled dataset; arrays are read when they are looked at.

    Parameters
    ----------
    path : Path or str
        The store.

    Returns
    -------
    xarray.Dataset
        Grids, coordinates, tables and attributes.

    Raises
    ------
    StoreError
        If there is no store, it is not complete, or something in it is damaged.

    """
    store = Store(path)
    store.require_whole()
    return store.dataset()


def _tiles_of(cuts: Mapping[str, tuple[int, int]]) -> Iterator[dict[str, slice]]:
    for pieces in itertools.product(
            *([slice(a, min(a + step, size)) for a in range(0, size, step)]
              for size, step in cuts.values())):
        yield dict(zip(cuts, pieces, strict=True))
