"""
Labelled arrays in Zarr on disk, resumable tile by tile.

A store is a Zarr group of format 2, which zarr-python 2 and 3 and xarray all read. It is written
through zarr alone, as importing xarray takes longer than a small grid; a tile is one chunk of
every variable, so threads and processes write tiles without knowing of each other. A tile counts
only once it is marked in `tile_done`, with the checksum of its chunks in `tile_checksum`; other
arrays and the attributes have theirs in an attribute.
"""

from collections.abc import Mapping
import functools
from pathlib import Path
from typing import Any, TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from . import checksums, documents
from .documents import CHECKSUMS, DIMENSIONS, DONE, ELSE, StoreError as StoreError
from .groups import (
    consolidate,
    OF_ZARR_2,
    open_group,
    reading,
    set_attributes,
    to_write,
    write_array,
    write_axis,
)
from .layout import Layout, Variable
from ..core.words import counted

if TYPE_CHECKING:
    import xarray


class Store:
    """
    An open store.

    Parameters
    ----------
    path : Path
        Its directory.

    Attributes
    ----------
    path : Path
        Its directory.
    tiles : list of dict
        Of every tile, a slice for each tiled dimension.

    Raises
    ------
    StoreError
        If there is none.

    """

    def __init__(self, path: Path) -> None:
        self.path = path
        if not (path / '.zgroup').is_file():
            what = 'is no store of this package' if path.exists() else 'does not exist'
            raise StoreError(f'{path} {what}; {ELSE}')
        documents.require_group(path)
        self._cuts = documents.tiles_of(path)
        self.tiles: list[dict[str, slice]] = list(documents.regions_of(self._cuts))
        self._done, self._checksums = checksums.read_marks(path, len(self.tiles))
        with reading(path):
            self._group = open_group(path)

    @property
    def attributes(self) -> dict[str, Any]:
        """Return the attributes of the store."""
        return dict(self._group.attrs)

    def pending(self) -> list[int]:
        """List the numbers of the tiles that are still to be done."""
        return [int(tile) for tile in np.flatnonzero(self._done == 0)]

    def marked(self) -> dict[int, bool]:
        """Return for every tile that is done whether it is as it was written, by number."""
        return {tile: bool(self._checksums[tile] == self._checksum(tile))
                for tile in np.flatnonzero(self._done).tolist()}

    def write(self, tile: int, values: Mapping[str, npt.ArrayLike]) -> None:
        """
        Write a tile; any thread or process may.

        Parameters
        ----------
        tile : int
            Its number.
        values : mapping
            For each variable, an array of the tile's shape.

        """
        for name, value in values.items():
            array = to_write(self._group, name)
            array[self._place(array, tile)] = np.asarray(value)

    def read(self, tile: int, name: str) -> npt.NDArray[Any]:
        """
        Read a tile of a variable.

        Parameters
        ----------
        tile : int
            Its number.
        name : str
            The variable.

        Returns
        -------
        ndarray
            A copy.

        """
        with reading(self.path / name):
            array = self._group[name]
            return np.asarray(array[self._place(array, tile)])

    def read_all(self, name: str) -> npt.NDArray[Any]:
        """
        Read a whole array.

        Parameters
        ----------
        name : str
            Variable or coordinate.

        Returns
        -------
        ndarray
            A copy.

        """
        with reading(self.path / name):
            return np.asarray(self._group[name][...])

    def has_table(self, name: str) -> bool:
        """
        Tell whether an array that is not made tile by tile is there, as it was written.

        Parameters
        ----------
        name : str
            Of the array.

        Returns
        -------
        bool
            Whether it is.

        """
        return checksums.has_table(self.path / name)

    def read_every(self, name: str, steps: Mapping[str, int]) -> npt.NDArray[Any]:
        """
        Read some cells of a whole array, a tile at a time.

        Parameters
        ----------
        name : str
            A variable whose dimensions are all tiled.
        steps : mapping
            For each dimension, every so many.

        Returns
        -------
        ndarray
            A copy.

        """
        array = self._group[name]
        names = array.attrs[DIMENSIONS]
        found = np.empty([-(-size // steps[one]) for size, one in zip(
            array.shape, names, strict=True)], array.dtype)
        for tile, region in enumerate(self.tiles):
            # The first cell of the tile that is wanted, and where it goes.
            first = [-(-region[one].start // steps[one]) for one in names]
            inside = tuple(slice(at * steps[one] - region[one].start, None, steps[one])
                           for at, one in zip(first, names, strict=True))
            cells = self.read(tile, name)[inside]
            found[tuple(slice(at, at + n) for at, n in zip(
                first, cells.shape, strict=True))] = cells
        return found

    def mark(self, tile: int, done: bool = True) -> None:
        """
        Enter a tile as done, with the checksum of what is written; one process only does this.

        Parameters
        ----------
        tile : int
            Its number.
        done : bool
            Whether it is.

        """
        self._done[tile] = done
        self._checksums[tile] = self._checksum(tile) if done else 0
        self._write_marks()

    def write_table(self, variables: Mapping[str, tuple[tuple[str, ...], npt.ArrayLike,
                                                        Mapping[str, Any]]]) -> None:
        """
        Write arrays that are not made tile by tile; those of the same name are replaced.

        Parameters
        ----------
        variables : mapping
            For each name the dimensions, the values and the attributes.

        """
        for name, (dimensions, values, attributes) in variables.items():
            write_array(self.path, self._group, Variable(name, dimensions, '', attributes),
                        np.asarray(values))
        consolidate(self.path)

    def set_attributes(self, attributes: Mapping[str, Any]) -> None:
        """
        Add attributes to the store.

        Parameters
        ----------
        attributes : mapping
            Plain values.

        """
        set_attributes(self._group, attributes)
        consolidate(self.path)

    def dataset(self) -> 'xarray.Dataset':
        """Return the finished store as a dataset."""
        return open_dataset(self.path)

    def repair(self, layout: Layout) -> list[str]:
        """
        Take back the marks of tiles that are not as they were written; write such axes anew.

        Parameters
        ----------
        layout : Layout
            What the store consists of.

        Returns
        -------
        list of str
            What has been found, in words.

        Raises
        ------
        StoreError
            If something is not as it was written that cannot be told from the layout.

        """
        documents.require_layout(self.path, layout, self._cuts)
        found: list[str] = []
        for axis in layout.axes:
            if not self.has_table(axis.name):
                found.append(f'{axis.name} is not as it was written; it is written anew')
                write_axis(self.path, self._group, axis)
            elif not np.array_equal(self.read_all(axis.name), axis.values):
                raise StoreError(f'{self.path} was made with other values of {axis.name}; {ELSE}')
        laid_out = {DONE, CHECKSUMS, *(axis.name for axis in layout.axes), *self._variables}
        for folder in sorted(self.path.iterdir()):
            if folder.is_dir() and folder.name not in laid_out and not self.has_table(folder.name):
                raise StoreError(f'{folder} is not as it was written; remove it, and --resume '
                                 'makes it anew')
        marked = self.marked()
        damaged = [tile for tile, is_whole in marked.items() if not is_whole]
        if damaged:
            names = ', '.join(str(tile) for tile in damaged[:8])
            found.append(f'{len(damaged)} of {counted(len(marked), "finished tile")} must be '
                         f'computed anew ({names}{", ..." if len(damaged) > 8 else ""}), for '
                         'what was written is damaged')
            self._done[damaged] = 0
            self._write_marks()
        # Zarr may read a chunk to write a part of it, which fails where it is torn.
        for tile in self.pending():
            for file in self._files(tile):
                file.unlink(missing_ok=True)
        return found

    def _files(self, tile: int) -> list[Path]:
        return checksums.tile_files(self.path, self._variables, {
            name: part.start // self._cuts[name][1] for name, part in self.tiles[tile].items()})

    def _checksum(self, tile: int) -> int:
        return checksums.chunks_checksum(self._files(tile))

    @functools.cached_property
    def _variables(self) -> dict[str, list[str]]:
        return documents.variables_of(self.path)

    def _write_marks(self) -> None:
        # In this order: what is marked has its checksum.
        to_write(self._group, CHECKSUMS)[:] = self._checksums
        to_write(self._group, DONE)[:] = self._done

    def _place(self, array: Any, tile: int) -> tuple[slice, ...]:
        region = self.tiles[tile]
        return tuple(region.get(name, slice(None)) for name in array.attrs[DIMENSIONS])


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
        If there is none, it is not complete, or something in it is not as it was written.

    """
    import xarray
    path = Path(path)
    require_whole(path)
    form: dict[str, Any] = {} if OF_ZARR_2 else {'zarr_format': 2}
    dataset = xarray.open_zarr(str(path), consolidated=True, chunks=None, **form)
    return dataset.drop_vars([DONE, CHECKSUMS])


def require_whole(path: Path) -> None:
    """
    Refuse a store that is not complete, or whose files are not as they were written.

    Parameters
    ----------
    path : Path
        The store.

    Raises
    ------
    StoreError
        Naming the first.

    """
    store = Store(path)
    documents.require_plain_files(path)
    checksums.require_attributes(path)
    if store.pending():
        raise StoreError(f'{path}: {len(store.pending())} of '
                         f'{counted(len(store.tiles), "tile")} must still be done; go on with '
                         '--resume')
    checksums.require_whole(path, store.marked())
