"""
Labelled arrays in Zarr on disk, resumable tile by tile.

A store is a Zarr group of format 2, which zarr-python 2 and 3 and xarray all read. It is written
through zarr alone, as importing xarray takes longer than a small grid; a tile is one chunk of
every variable, so threads and processes write tiles without knowing of each other. A tile counts
only once it is marked in the bitmap `tile_done`.
"""

from collections.abc import Mapping, Sequence
import datetime
import importlib.metadata
import itertools
import json
from pathlib import Path
import platform
import shutil
from typing import Any, Final, TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import zarr

from .layout import Layout, Variable

if TYPE_CHECKING:
    import xarray

DIMENSIONS: Final = '_ARRAY_DIMENSIONS'
DONE: Final = 'tile_done'
IDENTITY: Final = 'identity'
OF_ZARR_2: Final = zarr.__version__.startswith('2.')


class StoreError(Exception):
    """A store that cannot be made, read or continued; the message is one line."""


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
        try:
            self._group = _open_group(path)
            done = self._group[DONE]
            cuts = {str(name): (int(size), int(step)) for name, size, step in done.attrs['tiles']}
        except (OSError, KeyError, ValueError) as error:
            what = 'is no store of this package' if path.exists() else 'does not exist'
            raise StoreError(f'{path} {what}; choose another --output') from error
        self.tiles: list[dict[str, slice]] = [
            dict(zip(cuts, pieces, strict=True)) for pieces in itertools.product(
                *([slice(a, min(a + step, size)) for a in range(0, size, step)]
                  for size, step in cuts.values()))]
        self._done = np.asarray(done[:], np.uint8)

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
        return np.asarray(self._group[name][...])

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
        Enter a tile as done; one process only does this.

        Parameters
        ----------
        tile : int
            Its number.
        done : bool
            Whether it is.

        """
        self._done[tile] = done
        self._group[DONE][:] = self._done

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
            array = np.asarray(values)
            _make_array(self._group, Variable(name, dimensions, array.dtype.str, attributes,
                                              '' if array.dtype.kind == 'U' else 0),
                        array.shape, array.shape)
            if array.size:
                self._group[name][...] = array
        _consolidate(self.path)

    def set_attributes(self, attributes: Mapping[str, Any]) -> None:
        """
        Add attributes to the store.

        Parameters
        ----------
        attributes : mapping
            Plain values.

        """
        self._group.attrs.update(attributes)
        _consolidate(self.path)

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
        store = Store(path)
        _require_identity(path, store.attributes.get(IDENTITY, '{}'), layout)
        return store
    # A store half made must never be taken for one: it appears complete, by renaming.
    fresh = path.with_name(f'.{path.name}.new')
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(fresh, ignore_errors=True)
        if path.is_dir():
            path.rmdir()
        group = _new_group(fresh)
        _fill(group, layout, command)
        _consolidate(fresh)
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

    """
    import xarray
    dataset = xarray.open_zarr(str(path), consolidated=True, chunks=None, mask_and_scale=False)
    return dataset.drop_vars(DONE)


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


def _fill(group: Any, layout: Layout, command: str) -> None:
    group.attrs.update({
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
        values = np.asarray(axis.values)
        _make_array(group, Variable(axis.name, (axis.name,), values.dtype.str, axis.attributes,
                                    '' if values.dtype.kind == 'U' else 0),
                    values.shape, values.shape)
        group[axis.name][...] = values
    for variable in layout.variables:
        shape = tuple(sizes[name] for name in variable.dimensions)
        chunks = tuple(steps.get(name, sizes[name]) for name in variable.dimensions)
        _make_array(group, variable, shape, chunks)
    # A list: some versions of zarr sort the keys of what is in an attribute.
    tiles = [[name, sizes[name], step] for name, step in steps.items()]
    count = int(np.prod([-(-sizes[name] // step) for name, step in steps.items()]))
    _make_array(group, Variable(DONE, ('tile',), '|u1', {
        'long_name': 'tile is complete', 'tiles': tiles}), (count,), (count,))


def _require_identity(path: Path, text: str, layout: Layout) -> None:
    theirs, ours = json.loads(text), json.loads(json.dumps(layout.identity))
    for name in sorted({*theirs, *ours}):
        if theirs.get(name) != ours.get(name):
            raise StoreError(
                f'{path} was made with {name} = {theirs.get(name)!r}, not {ours.get(name)!r}; '
                'choose another --output')


def _new_group(path: Path) -> Any:
    if OF_ZARR_2:
        return zarr.open_group(str(path), mode='w', zarr_version=2)
    return zarr.open_group(str(path), mode='w', zarr_format=2)


def _open_group(path: Path) -> Any:
    # The copy of all metadata in one file is for readers: it is behind while a store is made.
    if OF_ZARR_2:
        return zarr.open_group(str(path), mode='r+')
    return zarr.open_group(str(path), mode='r+', use_consolidated=False)


def _make_array(group: Any, variable: Variable, shape: Sequence[int],
                chunks: Sequence[int]) -> None:
    # An array cannot have chunks of no length.
    settings: dict[str, Any] = {
        'shape': tuple(shape), 'chunks': tuple(max(1, n) for n in chunks),
        'dtype': np.dtype(variable.dtype), 'fill_value': variable.fill, 'overwrite': True}
    if OF_ZARR_2:
        array = group.create_dataset(variable.name, **settings)
    else:
        array = group.create_array(variable.name, **settings)
    array.attrs.update({**variable.attributes, DIMENSIONS: list(variable.dimensions)})


def _consolidate(path: Path) -> None:
    zarr.consolidate_metadata(str(path))
