"""
The documents of a store, held against what they should say before zarr reads any of them.

Zarr trusts its files: an absurd document makes it allocate whatever it says.
"""

from collections.abc import Iterator, Mapping, Sequence
import itertools
import json
import math
from pathlib import Path
import stat
from typing import Any, Final

import numpy as np

from .layout import Layout

DIMENSIONS: Final = '_ARRAY_DIMENSIONS'
DONE: Final = 'tile_done'
CHECKSUMS: Final = 'tile_checksum'
# Readers check the bytes, too: a frame of zstd ends with a checksum of its content.
COMPRESSOR: Final[Mapping[str, Any]] = {'id': 'zstd', 'level': 1, 'checksum': True}
ELSE: Final = 'choose another --output'
DOCUMENT_MOST: Final = 1 << 26
TILES_MOST: Final = 10_000_000


class StoreError(ValueError):
    """A store that cannot be made, read or continued; the message is one line."""


def read_document(path: Path) -> dict[str, Any]:
    """Read a JSON object; StoreError where the file holds none."""
    try:
        status = path.lstat()
        if not stat.S_ISREG(status.st_mode) or status.st_size > DOCUMENT_MOST:
            raise StoreError(f'{path} is no document of a store; {ELSE}')
        found = json.loads(path.read_bytes())
    except OSError as error:
        raise StoreError(f'{path} cannot be read: {error.strerror}; {ELSE}') from error
    except (ValueError, RecursionError) as error:
        raise StoreError(f'{path} is damaged: it is no JSON; {ELSE}') from error
    if not isinstance(found, dict):
        raise StoreError(f'{path} is damaged: it holds no names; {ELSE}')
    return found


def require_group(path: Path) -> None:
    """Raise StoreError where a store is no group of this format; attributes may be any."""
    read_document(path / '.zattrs')
    if read_document(path / '.zgroup') != {'zarr_format': 2}:
        raise StoreError(f'{path}/.zgroup is damaged: it is not that of a group of format 2; '
                         f'{ELSE}')


def require_plain_files(path: Path) -> None:
    """Raise StoreError where a store holds more than files and directories of files."""
    try:
        folders = [path, *(entry for entry in path.iterdir()
                           if stat.S_ISDIR(entry.lstat().st_mode))]
        for folder in folders:
            for entry in folder.iterdir():
                mode = entry.lstat().st_mode
                if not (stat.S_ISREG(mode) or folder == path and stat.S_ISDIR(mode)):
                    raise StoreError(f'{entry} is no part of a store, which holds directories of '
                                     f'plain files; move it away, or {ELSE}')
    except OSError as error:
        raise StoreError(f'{error.filename} cannot be read: {error.strerror}; {ELSE}') from error


def tiles_of(path: Path) -> dict[str, tuple[int, int]]:
    """Read the size and tile length of every tiled dimension; StoreError if absurd."""
    if (path / CHECKSUMS / '.zarray').exists() != (path / DONE / '.zarray').exists():
        raise StoreError(f'{path} has no checksums, or nothing but these: it can be read, but not '
                         f'continued; {ELSE}')
    place = path / DONE / '.zattrs'
    given = read_document(place).get('tiles')
    wrong = StoreError(f'{place} is damaged: tiles = {shortened(given)} are none; {ELSE}')
    cuts: dict[str, tuple[int, int]] = {}
    for item in _list_of(given):
        if not isinstance(item, list) or len(item) != 3 or type(item[0]) is not str or not all(
                type(number) is int for number in item[1:]) or item[0] in cuts:
            raise wrong
        size, step = item[1:]
        if not 0 < step <= size:
            raise wrong
        cuts[item[0]] = size, step
    count = math.prod(-(-size // step) for size, step in cuts.values())
    if count > TILES_MOST:
        raise wrong
    for name, dtype in ((DONE, '|u1'), (CHECKSUMS, '<i4')):
        require_array(path / name, ('tile',), (count,), (count,), dtype)
    return cuts


def variables_of(path: Path) -> dict[str, list[str]]:
    """Read the names and dimensions of the arrays that are made tile by tile."""
    place = path / DONE / '.zattrs'
    given = read_document(place).get('variables')
    found: dict[str, list[str]] = {}
    for name in _list_of(given):
        if not isinstance(name, str) or not name.isidentifier():
            raise StoreError(f'{place} is damaged: variables = {shortened(given)} are no names; '
                             f'{ELSE}')
        dimensions = read_document(path / name / '.zattrs').get(DIMENSIONS)
        if not isinstance(dimensions, list) or not all(isinstance(o, str) for o in dimensions):
            raise StoreError(f'{path / name}/.zattrs is damaged: {DIMENSIONS} = '
                             f'{shortened(dimensions)} are none; {ELSE}')
        found[name] = dimensions
    return found


def require_array(folder: Path, dimensions: Sequence[str], shape: Sequence[int],
                  chunks: Sequence[int], dtype: str) -> None:
    """Raise StoreError where the documents of an array say anything else."""
    is_mark = folder.name in (DONE, CHECKSUMS)
    expected = {
        'zarr_format': 2, 'shape': list(shape), 'chunks': [max(1, n) for n in chunks],
        'dtype': dtype, 'fill_value': None, 'order': 'C',
        'filters': None, 'compressor': None if is_mark else dict(COMPRESSOR),
        'dimension_separator': '.'}
    document = read_document(folder / '.zarray')
    # Some versions of zarr leave it out where it is a point.
    document.setdefault('dimension_separator', '.')
    # None are none, but 0 and the like are nothing that zarr can read.
    if document.setdefault('filters', None) == []:
        document['filters'] = None
    for name in document:
        if name not in expected:
            raise StoreError(f'{folder}/.zarray is damaged: it says {shortened(name)}; {ELSE}')
    _require(folder / '.zarray', document, expected)
    _require(folder / '.zattrs', read_document(folder / '.zattrs'), {
        DIMENSIONS: list(dimensions)})


def require_layout(path: Path, layout: Layout, cuts: Mapping[str, tuple[int, int]]) -> None:
    """Raise StoreError where a document differs from the layout, but for tile lengths."""
    place = path / DONE / '.zattrs'
    sizes = {axis.name: len(axis.values) for axis in layout.axes}
    tiled = {axis.name: sizes[axis.name] for axis in layout.axes if axis.tile}
    names, expected = list(variables_of(path)), [one.name for one in layout.variables]
    if names != expected:
        raise StoreError(f'{place} is damaged: variables = {shortened(names)}, not '
                         f'{shortened(expected)}; {ELSE}')
    # In this order: it numbers the tiles.
    if list(tiled.items()) != [(name, size) for name, (size, _) in cuts.items()]:
        raise StoreError(f'{place} is damaged: tiles cover {shortened(dict(cuts))}, not '
                         f'{shortened(tiled)}; {ELSE}')
    for axis in layout.axes:
        values = np.asarray(axis.values)
        require_array(path / axis.name, (axis.name,), values.shape, values.shape,
                      values.dtype.str)
    for variable in layout.variables:
        require_array(
            path / variable.name, variable.dimensions,
            [sizes[name] for name in variable.dimensions],
            [cuts[name][1] if name in cuts else sizes[name] for name in variable.dimensions],
            variable.dtype)


def is_consolidated(path: Path) -> bool:
    """Whether the copy of all documents in one, which readers use, agrees with them."""
    documents = {name: read_document(path / name) for name in ('.zattrs', '.zgroup')}
    for folder in sorted(entry for entry in path.iterdir() if entry.is_dir()):
        for name in ('.zarray', '.zattrs'):
            documents[f'{folder.name}/{name}'] = read_document(folder / name)
    try:
        return read_document(path / '.zmetadata').get('metadata') == documents
    except StoreError:
        return False


def regions_of(cuts: Mapping[str, tuple[int, int]]) -> Iterator[dict[str, slice]]:
    """Yield every tile's slice of each tiled dimension."""
    for pieces in itertools.product(
            *([slice(a, min(a + step, size)) for a in range(0, size, step)]
              for size, step in cuts.values())):
        yield dict(zip(cuts, pieces, strict=True))


def shortened(value: object) -> str:
    """Show a value on part of a line."""
    try:
        text = ' '.join(repr(value).split())
    except (RecursionError, ValueError):
        text = type(value).__name__
    return text if len(text) <= 80 else f'{text[:77]}...'


def _list_of(given: Any) -> list[Any]:
    """Read an attribute that is a list as JSON; what is none is a list of nothing."""
    try:
        found = json.loads(given)
    except (TypeError, ValueError, RecursionError):
        found = None
    return found if isinstance(found, list) else [None]


def _require(place: Path, found: Mapping[str, Any], expected: Mapping[str, Any]) -> None:
    for name, value in expected.items():
        given = found.get(name)
        # 1 is no true, and 3.0 no length.
        is_number = isinstance(value, (int, float)) and not isinstance(given, bool)
        if given != value or not is_number and type(given) is not type(value):
            raise StoreError(f'{place} is damaged: {name} = {shortened(given)}, not '
                             f'{shortened(value)}; {ELSE}')
