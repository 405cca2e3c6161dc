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

"""Begin a store, or go on with one that is to hold the same."""

from collections.abc import Mapping
import datetime
import json
import math
from pathlib import Path
import platform
import shutil
import sys
import tempfile
from typing import Any, Final

import numpy as np

from .arrays import consolidate, ELSE, new_array, plain, reading, StoreError, write_array
from .layout import Layout, Variable
from .store import DONE, IDENTITY, Store
from ..core.words import counted, shown

PACKAGE: Final = 'gear_rattle_ros'


def make_store(path: Path | str | None, layout: Layout, command: str, *, resume: bool = False
               ) -> Store:
    """Make a store, or open the one that is to be continued (with `resume`)."""
    # Without `path` the store is temporary: it is removed with the object. `command`, the command
    # line, is kept as an attribute. StoreError where there is something else, such as the store of
    # other parameters, or where it cannot be written.
    folder = None
    if path is None:
        folder = Path(tempfile.mkdtemp(prefix=f'{PACKAGE}-'))
        path = folder / 'store.zarr'
    path = Path(path)
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        store = Store(path)
        _require_identity(path, store.attrs, layout)
        if not resume:
            raise StoreError(f'{path} exists and answers the same question; open it, go on with '
                             f'it by resume=True, or {ELSE}')
        return _continued(path, store, layout)
    # A store half made must never be taken for one: it appears complete, by renaming.
    fresh = path.with_name(f'.{path.name}.new')
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(fresh, ignore_errors=True)
        fresh.mkdir()
        if path.is_dir():
            path.rmdir()
        try:
            _fill(fresh, layout, command)
            fresh.rename(path)
        finally:
            shutil.rmtree(fresh, ignore_errors=True)
    except OSError as error:
        raise StoreError(f'{path} cannot be written: {error.strerror or error}; {ELSE}') from error
    return Store(path, folder)


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that decide over the numbers."""
    import importlib.metadata
    found = {'python': platform.python_version()}
    for name in (PACKAGE, 'numpy', 'numba', 'zarr'):
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found


def _fill(path: Path, layout: Layout, command: str) -> None:
    import zarr
    group = zarr.create_group(str(path), zarr_format=3, attributes=plain({
        **layout.identity,
        **layout.attributes,
        IDENTITY: json.dumps(layout.identity, sort_keys=True),
        'command': command,
        'created': datetime.datetime.now(datetime.UTC).isoformat(timespec='seconds'),
        'versions': json.dumps(versions()),
    }))
    sizes = {axis.name: len(axis.values) for axis in layout.axes}
    steps = {axis.name: min(axis.tile, len(axis.values)) for axis in layout.axes if axis.tile}
    for axis in layout.axes:
        write_array(group, Variable(axis.name, (axis.name,), '', axis.attributes), axis.values)
    for variable in layout.variables:
        new_array(group, variable, [sizes[name] for name in variable.dimensions],
                  [steps.get(name, sizes[name]) for name in variable.dimensions])
    count = math.prod(-(-sizes[name] // step) for name, step in steps.items())
    # As text: NetCDF has no lists in lists.
    new_array(group, Variable(DONE, ('tile',), '|u1', {
        'long_name': 'tile is complete',
        'tiles': json.dumps([[name, sizes[name], step] for name, step in steps.items()]),
        'variables': json.dumps([variable.name for variable in layout.variables]),
    }), (count,), (count,))[:] = 0
    consolidate(path)


def _continued(path: Path, store: Store, layout: Layout) -> Store:
    for axis in layout.axes:
        if not store.has_table(axis.name):
            store.write_table({axis.name: ((axis.name,), axis.values, axis.attributes)})
        elif not np.array_equal(store.read_all(axis.name), axis.values):
            raise StoreError(f'{path} was made with other values of {axis.name}; {ELSE}')
    damaged = store.damaged()
    if damaged:
        store.mark(list(damaged), False)
        first, chunk = next(iter(damaged.items()))
        print(f'{layout.identity.get("tool", PACKAGE)}: {path}: '
              f'{counted(len(damaged), "finished tile")} must be computed anew: {chunk} (tile '
              f'{first}) is damaged or missing', file=sys.stderr)
    _require_version(path, store)
    if store.pending():
        # Ctrl-C may have come between the attributes and their copy.
        consolidate(path)
    return store


def _require_identity(path: Path, attributes: Mapping[str, Any], layout: Layout) -> None:
    with reading(path, ELSE):
        theirs = dict(json.loads(attributes[IDENTITY]))
    ours = json.loads(json.dumps(layout.identity))
    for name in sorted({*theirs, *ours}):
        if theirs.get(name) != ours.get(name):
            raise StoreError(f'{path} answers another question, with {name} = '
                             f'{shown(theirs.get(name))}, not {shown(ours.get(name))}; {ELSE}')


def _require_version(path: Path, store: Store) -> None:
    """Refuse to go on where tiles of another version could differ from those that are there."""
    here, pending = versions().get(PACKAGE), store.pending()
    if pending and len(pending) < len(store.tiles):
        there = json.loads(store.attrs['versions']).get(PACKAGE)
        if there != here:
            raise StoreError(f'{path} was begun by version {there!r}, this is {here!r}: its tiles '
                             f'may differ; {ELSE}')
