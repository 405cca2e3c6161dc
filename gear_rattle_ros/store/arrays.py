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

"""Arrays of zarr format 3 as every reader understands them; zarr is imported when it is used."""

from collections.abc import Iterator, Mapping, Sequence
import contextlib
import json
from pathlib import Path
from typing import Any, Final
import warnings

import numpy as np
import numpy.typing as npt

from .layout import Variable
from ..core.words import shown

ELSE: Final = 'choose another --output'
REMEDY: Final = 'the same command again makes it anew'


class StoreError(ValueError):
    """A store that cannot be made, read or continued; the message is one line."""


def new_array(group: Any, variable: Variable, shape: Sequence[int], chunks: Sequence[int]) -> Any:
    """Make an array whose chunks end with a checksum; one of the same name is replaced."""
    from zarr.codecs import Crc32cCodec, ZstdCodec
    dtype = np.dtype(variable.dtype)
    # Zarr has no stable form for words of one length. A chunk cannot have no length.
    return group.create_array(
        variable.name, shape=tuple(shape), chunks=tuple(max(1, length) for length in chunks),
        dtype=str if dtype.kind == 'U' else dtype, overwrite=True,
        compressors=(ZstdCodec(level=1), Crc32cCodec()),
        chunk_key_encoding={'name': 'default', 'separator': '.'},
        attributes=plain(variable.attributes), dimension_names=variable.dimensions,
        config={'write_empty_chunks': True})


def write_array(group: Any, variable: Variable, values: npt.NDArray[Any]) -> None:
    """Make an array of one chunk, with the type of its values."""
    array = new_array(group, Variable(variable.name, variable.dimensions, values.dtype.str,
                                      variable.attributes), values.shape, values.shape)
    if values.size:
        array[...] = values


def read_array(array: Any, place: tuple[Any, ...]) -> npt.NDArray[Any]:
    """Read a part of an array; words have a fixed length, as numpy knows them."""
    values = np.asarray(array[place])
    return values.astype(object).astype('U') if values.dtype.kind in 'TO' else values


def plain(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Put a truth value as a number and a list of words as JSON, as NetCDF has neither."""
    return {name: int(value) if isinstance(value, bool) else
            json.dumps(value) if isinstance(value, (list, tuple)) and
            any(isinstance(one, str) for one in value) else value
            for name, value in attributes.items()}


def consolidate(path: Path) -> None:
    """Copy the metadata of all arrays into the group's, where xarray looks for them first."""
    import zarr
    with warnings.catch_warnings():
        warnings.filterwarnings('ignore', 'Consolidated metadata')
        zarr.consolidate_metadata(str(path), zarr_format=3)


@contextlib.contextmanager
def reading(path: Path, remedy: str) -> Iterator[None]:
    """Turn what zarr and its codecs raise for a broken file into a StoreError of one line."""
    try:
        yield
    except StoreError:
        raise
    except (ArithmeticError, AttributeError, LookupError, OSError, RuntimeError, TypeError,
            ValueError) as error:
        raise StoreError(f'{path} cannot be read: {shown(error)}; {remedy}') from error
