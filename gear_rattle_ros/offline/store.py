"""
Labelled arrays in Zarr on disk, resumable tile by tile.

A store is a Zarr group of format 2, which zarr-python 2 and 3 and xarray all read. It is written
through zarr alone, as importing xarray takes longer than a small grid; a tile is one chunk of
every variable, so threads and processes write tiles without knowing of each other. A tile counts
only once it is marked in `tile_done`, with the checksum of its chunks in `tile_checksum`; other
arrays and the attributes have theirs in an attribute.
"""

from collections.abc import Mapping
import datetime
import functools
import importlib.metadata
import json
from pathlib import Path
import platform
import shutil
import sys
from typing import Any, Final, TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from . import checksums, documents
from .documents import CHECKSUMS, DIMENSIONS, DONE, ELSE, StoreError as StoreError
from .groups import (
    consolidate,
    make_array,
    new_group,
    OF_ZARR_2,
    open_group,
    reading,
    set_attributes,
    write_array,
)
from .layout import Axis, Layout, Variable

if TYPE_CHECKING:
    import xarray

IDENTITY: Final = 'identity'
PACKAGE: Final = 'gear_rattle_ros'


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
        """
        List the tiles that are still to be done.

        Returns
        -------
        list of int
            Their numbers.

        """
        return [int(tile) for tile in np.flatnonzero(self._done == 0)]

    def marked(self) -> dict[int, bool]:
        """
        Tell of the tiles that are done whether they are as they were written.

        Returns
        -------
        dict
            By number.

        """
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
            array = self._group[name]
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
                _write_axis(self.path, self._group, axis)
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
            found.append(f'{len(damaged)} of {len(marked)} finished tiles are not as they were '
                         f'written ({names}{", ..." if len(damaged) > 8 else ""}); they are '
                         'computed anew')
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
        self._group[CHECKSUMS][:] = self._checksums
        self._group[DONE][:] = self._done

    def _place(self, array: Any, tile: int) -> tuple[slice, ...]:
        region = self.tiles[tile]
        return tuple(region.get(name, slice(None)) for name in array.attrs[DIMENSIONS])


def make_store(path: Path, layout: Layout, command: str, *, resume: bool = False) -> Store:
    """
    Make a store, or open the one that is to be continued.

    Parameters
    ----------
    path : Path
        Its directory.
    layout : Layout
        What it consists of.
    command : str
        The command line, kept as an attribute.
    resume : bool
        Whether a store that exists may be continued; then it must be the same result.

    Returns
    -------
    Store
        Ready to be written to.

    Raises
    ------
    StoreError
        If there is something else, or it cannot be written.

    """
    path = Path(path)
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        if not resume:
            raise StoreError(f'{path} exists; add --resume to go on with it, or choose another '
                             '--output')
        return _continued(path, layout)
    # A store half made must never be taken for one: it appears complete, by renaming.
    fresh = path.with_name(f'.{path.name}.new')
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # Never through a link, and only into a directory that is made here.
        if fresh.is_symlink() or fresh.is_file():
            fresh.unlink()
        shutil.rmtree(fresh, ignore_errors=True)
        fresh.mkdir()
        if path.is_dir():
            path.rmdir()
        group = new_group(fresh)
        _fill(fresh, group, layout, command)
        consolidate(fresh)
        fresh.rename(path)
    except OSError as error:
        raise StoreError(f'{path} cannot be written: {error.strerror or error}; choose another '
                         '--output') from error
    return Store(path)


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
    dataset = xarray.open_zarr(str(path), consolidated=True, chunks=None, mask_and_scale=False,
                               **form)
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
        raise StoreError(f'{path}: {len(store.pending())} of {len(store.tiles)} tiles are not '
                         'done; go on with --resume')
    checksums.require_whole(path, store.marked())


def versions() -> dict[str, str]:
    """
    Tell what computes here.

    Returns
    -------
    dict
        Version of Python and of the packages that decide over the numbers.

    """
    found = {'python': platform.python_version()}
    for name in ('gear_rattle_ros', 'numpy', 'numba', 'zarr'):
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found


def _fill(path: Path, group: Any, layout: Layout, command: str) -> None:
    set_attributes(group, {
        **layout.identity,
        **layout.attributes,
        IDENTITY: json.dumps(layout.identity, sort_keys=True),
        'command': command,
        'created': datetime.datetime.now(datetime.timezone.utc).isoformat(timespec='seconds'),
        'versions': json.dumps(versions()),
    })
    sizes = {axis.name: len(axis.values) for axis in layout.axes}
    steps = {axis.name: min(axis.tile, len(axis.values)) for axis in layout.axes if axis.tile}
    for axis in layout.axes:
        _write_axis(path, group, axis)
    for variable in layout.variables:
        shape = tuple(sizes[name] for name in variable.dimensions)
        chunks = tuple(steps.get(name, sizes[name]) for name in variable.dimensions)
        make_array(group, variable, shape, chunks)
    # A list: some versions of zarr sort the keys of what is in an attribute.
    tiles = [[name, sizes[name], step] for name, step in steps.items()]
    count = int(np.prod([-(-sizes[name] // step) for name, step in steps.items()]))
    make_array(group, Variable(DONE, ('tile',), '|u1', {
        'long_name': 'tile is complete', 'tiles': tiles,
        'variables': [variable.name for variable in layout.variables]}), (count,), (count,))
    make_array(group, Variable(CHECKSUMS, ('tile',), '<u4', {
        'long_name': 'CRC-32 of the chunks of a tile that is complete'}), (count,), (count,))


def _write_axis(path: Path, group: Any, axis: Axis) -> None:
    write_array(path, group, Variable(axis.name, (axis.name,), '', axis.attributes),
                np.asarray(axis.values))


def _continued(path: Path, layout: Layout) -> Store:
    store = Store(path)
    documents.require_plain_files(path)
    checksums.require_attributes(path)
    _require_identity(path, store.attributes, layout)
    for what in store.repair(layout):
        print(f'{layout.identity.get("tool", PACKAGE)}: {path}: {what}', file=sys.stderr)
    _require_version(path, store)
    # What Ctrl-C or a damage has left behind; nothing is written where nothing has to be.
    if not documents.is_consolidated(path):
        consolidate(path)
    return store


def _require_identity(path: Path, attributes: Mapping[str, Any], layout: Layout) -> None:
    try:
        theirs = json.loads(attributes[IDENTITY])
        if not isinstance(theirs, dict):
            raise ValueError
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise StoreError(f'{path} is no store of this package; {ELSE}') from error
    ours = json.loads(json.dumps(layout.identity))
    for name in sorted({*theirs, *ours}):
        if theirs.get(name) != ours.get(name):
            raise StoreError(
                f'{path} was made with {name} = {documents.shortened(theirs.get(name))}, not '
                f'{documents.shortened(ours.get(name))}; {ELSE}')


def _require_version(path: Path, store: Store) -> None:
    """Refuse to go on where tiles of another version could differ from those that are there."""
    here, pending = versions().get(PACKAGE), store.pending()
    if not pending or len(pending) == len(store.tiles):
        return
    try:
        there = json.loads(store.attributes['versions'])[PACKAGE]
    except (KeyError, TypeError, ValueError, RecursionError):
        there = None
    if there != here:
        raise StoreError(f'{path} was begun by version {documents.shortened(there)}, this is '
                         f'{here!r}: its tiles may differ; {ELSE}')
