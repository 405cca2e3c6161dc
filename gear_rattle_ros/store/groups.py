"""Groups of arrays as zarr-python 2 and 3 both make them."""

from collections.abc import Iterator, Mapping, Sequence
import contextlib
import json
from pathlib import Path
from typing import Any, Final

import numcodecs
import numpy as np
import zarr

from .checksums import attributes_checksum, CHECKSUM, table_checksum
from .documents import CHECKSUMS, COMPRESSOR, DIMENSIONS, DONE, ELSE, shortened, StoreError
from .layout import Axis, Variable

OF_ZARR_2: Final = zarr.__version__.startswith('2.')


def new_group(path: Path) -> Any:
    """Make an empty group of format 2; what is in the directory is lost."""
    if OF_ZARR_2:
        return zarr.open_group(str(path), mode='w', zarr_version=2)
    return zarr.open_group(str(path), mode='w', zarr_format=2)


def open_group(path: Path) -> Any:
    """Open a group of format 2 to be read and written."""
    # The copy of all metadata in one file is for readers: it is behind while a store is made.
    if OF_ZARR_2:
        return zarr.open_group(str(path), mode='r+')
    # Of this format: a document of another beside it must not be read in its place.
    return zarr.open_group(str(path), mode='r+', use_consolidated=False, zarr_format=2)


def make_array(group: Any, variable: Variable, shape: Sequence[int], chunks: Sequence[int]
               ) -> None:
    """Make an array; one of the same name is replaced."""
    # An array cannot have chunks of no length.
    settings: dict[str, Any] = {
        'shape': tuple(shape), 'chunks': tuple(max(1, n) for n in chunks),
        # Readers take what is equal to a fill for missing: none is.
        'dtype': np.dtype(variable.dtype), 'fill_value': None, 'overwrite': True}
    # Marks are as long as their tiles, whatever is in them: that needs no trust in a codec.
    compressor = None if variable.name in (DONE, CHECKSUMS) else numcodecs.get_codec(
        dict(COMPRESSOR))
    if OF_ZARR_2:
        array = group.create_dataset(variable.name, compressor=compressor, **settings)
    else:
        array = group.create_array(variable.name, compressors=compressor, **settings)
    attributes = plain(variable.attributes) | {DIMENSIONS: list(variable.dimensions)}
    array.attrs.update({**attributes, CHECKSUM: attributes_checksum(attributes)})


def plain(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Put a truth value as a number and a list of words as JSON, as NetCDF has neither."""
    return {name: int(value) if isinstance(value, bool) else
            json.dumps(value) if isinstance(value, (list, tuple)) and
            any(isinstance(one, str) for one in value) else value
            for name, value in attributes.items()}


def to_write(group: Any, name: str) -> Any:
    """Open an array of which every chunk is written: without a fill, one left out is nothing."""
    array = group[name]
    return array if OF_ZARR_2 else array.with_config({'write_empty_chunks': True})


def write_array(path: Path, group: Any, variable: Variable, values: np.ndarray[Any, Any]) -> None:
    """Make an array of one chunk, with the type of its values and its checksum."""
    make_array(group, Variable(variable.name, variable.dimensions, values.dtype.str,
                               variable.attributes), values.shape, values.shape)
    if values.size:
        to_write(group, variable.name)[...] = values
    group[variable.name].attrs.update({CHECKSUM: table_checksum(path / variable.name)})


def write_axis(path: Path, group: Any, axis: Axis) -> None:
    """Make the array of an axis."""
    write_array(path, group, Variable(axis.name, (axis.name,), '', axis.attributes),
                np.asarray(axis.values))


def set_attributes(group: Any, attributes: Mapping[str, Any]) -> None:
    """Add attributes to a group, and the checksum of all."""
    merged = dict(group.attrs) | plain(attributes)
    group.attrs.update(merged | {CHECKSUM: attributes_checksum(merged)})


def consolidate(path: Path) -> None:
    """Copy all documents of a group into one."""
    with reading(path):
        if OF_ZARR_2:
            zarr.consolidate_metadata(str(path))
        else:
            zarr.consolidate_metadata(str(path), zarr_format=2)


@contextlib.contextmanager
def reading(path: Path) -> Iterator[None]:
    """Turn what zarr and its codecs say of a broken file into a StoreError of one line."""
    try:
        yield
    except (ArithmeticError, AttributeError, LookupError, RuntimeError, TypeError,
            ValueError) as error:
        raise StoreError(f'{path} cannot be read: {shortened(str(error))}; make it whole with '
                         f'--resume, or {ELSE}') from error
