"""Begin a store, or go on with one that is to hold the same."""

from collections.abc import Mapping
import datetime
import importlib.metadata
import json
from pathlib import Path
import platform
import shutil
import sys
import tempfile
from typing import Any, Final

import numpy as np

from . import checksums, documents
from .documents import CHECKSUMS, DONE, ELSE, StoreError
from .groups import consolidate, make_array, new_group, set_attributes, write_axis
from .layout import Layout, Variable
from .store import Store

IDENTITY: Final = 'identity'
PACKAGE: Final = 'gear_rattle_ros'


def make_store(path: Path | None, layout: Layout, command: str, *, resume: bool = False) -> Store:
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
    path = Path(tempfile.mkdtemp(), 'x.zarr') if path is None else Path(path)
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


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that decide over the numbers."""
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
        'created': datetime.datetime.now(datetime.UTC).isoformat(timespec='seconds'),
        'versions': json.dumps(versions()),
    })
    sizes = {axis.name: len(axis.values) for axis in layout.axes}
    steps = {axis.name: min(axis.tile, len(axis.values)) for axis in layout.axes if axis.tile}
    for axis in layout.axes:
        write_axis(path, group, axis)
    for variable in layout.variables:
        shape = tuple(sizes[name] for name in variable.dimensions)
        chunks = tuple(steps.get(name, sizes[name]) for name in variable.dimensions)
        make_array(group, variable, shape, chunks)
    # As text: NetCDF has no lists in lists.
    tiles = json.dumps([[name, sizes[name], step] for name, step in steps.items()])
    names = json.dumps([variable.name for variable in layout.variables])
    count = int(np.prod([-(-sizes[name] // step) for name, step in steps.items()]))
    make_array(group, Variable(DONE, ('tile',), '|u1', {
        'long_name': 'tile is complete', 'tiles': tiles, 'variables': names}), (count,), (count,))
    make_array(group, Variable(CHECKSUMS, ('tile',), '<i4', {
        'long_name': 'CRC-32 of the chunks of a tile that is complete, 31 bits'}), (count,),
        (count,))


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
