"""
Whether the chunks of a store and its attributes are as they were written.

Zarr trusts its files: a chunk that is missing is read as anything, and one in the place of another
as that one. So their bytes have checksums.
"""

from collections.abc import Mapping, Sequence
import json
from pathlib import Path
from typing import Any, Final
import zlib

import numpy as np
import numpy.typing as npt

from .documents import (
    CHECKSUMS,
    DONE,
    ELSE,
    is_consolidated,
    read_document,
    StoreError,
    variables_of,
)

CHECKSUM: Final = 'checksum'
BITS: Final = 0x7fffffff


def attributes_checksum(attributes: Mapping[str, Any]) -> int:
    """Return the checksum of attributes in 31 bits; one among them does not count."""
    text = json.dumps({name: value for name, value in attributes.items() if name != CHECKSUM},
                      sort_keys=True)
    return zlib.crc32(text.encode()) & BITS


def require_attributes(path: Path) -> None:
    """Raise StoreError where attributes of a store do not have their checksum."""
    for place in (path, *(path / name for name in variables_of(path))):
        found = read_document(place / '.zattrs')
        if found.get(CHECKSUM) != attributes_checksum(found):
            raise StoreError(f'{place}/.zattrs is damaged: its checksum is that of other '
                             f'attributes; {ELSE}')


def chunks_checksum(files: Sequence[Path]) -> int:
    """Return the checksum of chunks, of which some may be missing: 31 bits, never 0."""
    total = 0
    for file in files:
        try:
            content = file.read_bytes()
        except FileNotFoundError:
            content = None
        # The length, so that no byte can move from one chunk to the next.
        head = f'{file.parent.name}/{file.name} {-1 if content is None else len(content)} '
        total = zlib.crc32(content or b'', zlib.crc32(head.encode(), total))
    return total & BITS or 1


def tile_files(path: Path, variables: Mapping[str, Sequence[str]],
               indices: Mapping[str, int]) -> list[Path]:
    """List the chunks of a tile, given every variable's dimensions and the tile's indices."""
    return [path / name / ('.'.join(str(indices.get(one, 0)) for one in variables[name]))
            for name in sorted(variables)]


def table_checksum(folder: Path) -> int:
    """Return the checksum of an array of one chunk, its form and attributes included."""
    form = read_document(folder / '.zarray')
    attributes = read_document(folder / '.zattrs')
    shape = form.get('shape')
    files = [folder / '.'.join('0' * len(shape))] if isinstance(shape, list) else []
    return attributes_checksum({
        'form': form, 'attributes': attributes_checksum(attributes),
        'chunk': chunks_checksum(files)})


def has_table(folder: Path) -> bool:
    """Whether an array of one chunk is there as it was written."""
    try:
        return read_document(folder / '.zattrs').get(CHECKSUM) == table_checksum(folder)
    except StoreError:
        return False


def read_marks(path: Path, count: int) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.int32]]:
    """Read the marks and checksums of all tiles; without a sound file they are 0."""
    def read(name: str, dtype: str) -> npt.NDArray[Any]:
        try:
            content = (path / name / '0').read_bytes()
        except OSError:
            content = b''
        size = count * np.dtype(dtype).itemsize
        return np.frombuffer(content if len(content) == size else bytes(size), dtype).copy()

    return read(DONE, '|u1'), read(CHECKSUMS, '<i4')


def require_whole(path: Path, marked: Mapping[int, bool]) -> None:
    """Raise StoreError for the first part of a store that is not as it was written."""
    remedy = 'go on with --resume, which makes it anew'
    for tile, is_whole in marked.items():
        if not is_whole:
            raise StoreError(f'{path}: tile {tile} is not as it was written; {remedy}')
    apart = {DONE, CHECKSUMS, *variables_of(path)}
    for folder in sorted(entry for entry in path.iterdir() if entry.is_dir()):
        if folder.name not in apart and not has_table(folder):
            raise StoreError(f'{folder} is not as it was written; {remedy}')
    if not is_consolidated(path):
        raise StoreError(f'{path}/.zmetadata is not what the other documents say; {remedy}')
