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

"""Stores that were interrupted or damaged: repaired when gone on with, or refused in one line."""

import dataclasses
import json
import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import xarray

from gear_rattle_ros.store import making as store_making
from gear_rattle_ros.store.layout import Axis, Layout, Variable
from gear_rattle_ros.store.making import make_store
from gear_rattle_ros.store.store import open_dataset, Store, StoreError

LAYOUT = Layout(
    (Axis('velocity', np.linspace(-1.0, 1.0, 7), {'units': '1'}, 3),
     Axis('phase', np.arange(5.0), {'units': 'rad'}, 2),
     Axis('word', np.array(['one', 'two']))),
    (Variable('label', ('velocity', 'phase'), '<i2', {'long_name': 'label'}),
     Variable('rate', ('velocity', 'phase', 'word'), '<f8', {'units': '1'})),
    {'tool': 'test', 'alpha': 0.48, 'phase_window': [0.0, 5.0]})
LABELS = np.arange(35, dtype=np.int16).reshape(7, 5) % 11 - 1
RATES = np.sin(np.arange(70.0)).reshape(7, 5, 2)
KEYS = np.array(['a', 'bcd'])


def compute(path: Path, resume: bool = True, layout: Layout = LAYOUT, pause: float = 0.0) -> Store:
    """Do what a tool does: the pending tiles, then the table and an attribute."""
    store = make_store(path, layout, 'command', resume=resume)
    for tile in store.pending():
        part = store.tiles[tile]['velocity'], store.tiles[tile]['phase']
        store.write(tile, {'label': LABELS[part], 'rate': RATES[part]})
        time.sleep(pause)
        store.mark(tile)
    store.write_table({'key': (('attractor',), KEYS, {'long_name': 'name'})})
    store.set_attributes({'stay': 3})
    return store


def require_right(path: Path) -> None:
    """See that xarray alone reads what was computed, and nothing else."""
    for dataset in (open_dataset(path), xarray.open_zarr(path, chunks=None)):
        for name, values in {'label': LABELS, 'rate': RATES, 'key': KEYS,
                             **{axis.name: axis.values for axis in LAYOUT.axes}}.items():
            assert np.array_equal(dataset[name].values, values), name
        assert dataset.attrs['alpha'] == 0.48 and dataset.attrs['stay'] == 3


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    """Return a store with everything in it."""
    path = tmp_path_factory.mktemp('whole') / 'a.zarr'
    compute(path, resume=False)
    require_right(path)
    return path


@pytest.fixture
def copy(whole, tmp_path):
    """Return a copy of it to be damaged."""
    return Path(shutil.copytree(whole, tmp_path / 'a.zarr'))


def flip(file: Path, place: int = -6) -> None:
    """Flip a bit of a file."""
    content = bytearray(file.read_bytes())
    content[place] ^= 1
    file.write_bytes(content)


@pytest.mark.parametrize('after', [
    0.3, *(pytest.param(after, marks=pytest.mark.long) for after in (0.1, 0.5))])
def test_killed_in_the_middle(tmp_path, after):
    """A process that is killed leaves whole tiles that count and nothing that does not."""
    path = tmp_path / 'a.zarr'
    code = (f'import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); '
            'from pathlib import Path; from test_damaged_stores import compute; '
            f'print(flush=True); compute(Path({str(path)!r}), False, pause=0.2)')
    process = subprocess.Popen([sys.executable, '-c', code], stdout=subprocess.PIPE)
    process.stdout.readline()
    deadline = time.monotonic() + 60.0
    while not path.exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(after)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    store = Store(path)
    assert store.pending() and store.damaged() == {}
    for tile in {*range(len(store.tiles))} - {*store.pending()}:
        part = store.tiles[tile]['velocity'], store.tiles[tile]['phase']
        assert np.array_equal(store.read(tile, 'label'), LABELS[part])
    compute(path)
    require_right(path)


@pytest.mark.parametrize('what', ['one bit', 'cut', 'missing', 'other bytes'])
def test_a_damaged_tile_is_computed_anew(copy, capsys, what):
    """Its chunk and number are named, and only it is done again."""
    chunk = copy / 'rate' / 'c.1.1.0'
    if what == 'one bit':
        flip(chunk)
    elif what == 'cut':
        chunk.write_bytes(chunk.read_bytes()[:5])
    elif what == 'missing':
        chunk.unlink()
    else:
        chunk.write_bytes(bytes(100))
    with pytest.raises(StoreError, match=r'a\.zarr/rate/c\.1\.1\.0: tile 4 is damaged or missing; '
                                         r'the same command again makes it anew$'):
        open_dataset(copy)
    store = make_store(copy, LAYOUT, 'command', resume=True)
    assert store.pending() == [4]
    assert capsys.readouterr().err == (
        f'test: {copy}: 1 finished tile must be computed anew: {chunk} (tile 4) is damaged or '
        'missing\n')
    with pytest.raises(StoreError, match='1 of 9 tiles must still be done; the same command'):
        open_dataset(copy)
    compute(copy)
    require_right(copy)


def test_every_bit_of_a_chunk_is_guarded(copy):
    """Other readers notice it, too: xarray alone refuses the chunk."""
    chunk = copy / 'label' / 'c.1.1'
    for place in range(len(chunk.read_bytes())):
        flip(chunk, place)
        with pytest.raises(ValueError, match='checksum'):
            xarray.open_zarr(copy, chunks=None)['label'].load()
        flip(chunk, place)
    require_right(copy)


@pytest.mark.parametrize('remove', [False, True])
@pytest.mark.parametrize('name', ['velocity', 'word', 'key', 'tile_done'])
def test_damage_beside_the_tiles(copy, name, remove):
    """Axes, tables and marks are named as well, and written anew."""
    chunk = copy / name / 'c.0'
    chunk.unlink() if remove else flip(chunk)
    expected = 'of 9 tiles must still be done' if name == 'tile_done' else (
        f'{name} is damaged or missing; the same command')
    with pytest.raises(StoreError, match=expected):
        open_dataset(copy)
    assert not Store(copy).has_table(name) or name == 'tile_done' and not remove
    compute(copy)
    require_right(copy)


@pytest.mark.parametrize('text', ['', '{', '[' * 10**5, '7', 'null', '{"zarr_format": 3}'])
@pytest.mark.parametrize('file', ['zarr.json', 'label/zarr.json', 'tile_done/zarr.json'])
def test_metadata_that_cannot_be_read(copy, file, text):
    """One line names the store and the remedy."""
    (copy / file).write_text(text)
    for attempt in (open_dataset, compute):
        with pytest.raises(StoreError) as caught:
            attempt(copy)
        line = str(caught.value)
        assert str(copy) in line and 'choose another --output' in line and '\n' not in line


def test_another_store_is_refused(copy):
    """Of another tool, of other parameters, of other values along an axis."""
    for name, value in (('alpha', 0.57), ('alpha', float('nan')), ('alpha', float('inf')),
                        ('tool', 'basins'), ('phase_window', [0.0, 6.0]), ('more', 1)):
        other = dataclasses.replace(LAYOUT, identity={**LAYOUT.identity, name: value})
        with pytest.raises(StoreError, match=f'another question, with {name} = .*; choose'):
            compute(copy, layout=other)
    axes = (dataclasses.replace(LAYOUT.axes[0], values=np.linspace(-1.0, 2.0, 7)),
            *LAYOUT.axes[1:])
    with pytest.raises(StoreError, match='other values of velocity'):
        compute(copy, layout=dataclasses.replace(LAYOUT, axes=axes))
    require_right(copy)


def test_another_version_goes_on_with_nothing_half_done(copy, monkeypatch):
    """A complete store is read by any version; one with tiles to do by its own only."""
    monkeypatch.setattr(store_making, 'versions', lambda: {'gear_rattle_ros': '9.9'})
    compute(copy)
    make_store(copy, LAYOUT, 'command', resume=True).mark(4, done=False)
    with pytest.raises(StoreError, match="begun by version '.*', this is '9.9'.*another --output"):
        compute(copy)


def test_what_is_not_a_store(tmp_path):
    """Files, stores of other programs and those of older versions are named and left alone."""
    (tmp_path / 'file').write_text('mine')
    xarray.Dataset({'label': (('x',), [1, 2])}).to_zarr(
        tmp_path / 'other', zarr_format=3, consolidated=False)
    (tmp_path / 'old').mkdir()
    (tmp_path / 'old' / '.zgroup').write_text(json.dumps({'zarr_format': 2}))
    for name, words in (('file', 'is not a store of this package'),
                        ('other', 'is not a store of this package'),
                        ('old', r'was written by an older version \(zarr format 2\)')):
        for attempt in (open_dataset, compute):
            with pytest.raises(StoreError, match=f'{name} {words}; choose another --output$'):
                attempt(tmp_path / name)
    with pytest.raises(StoreError, match='nothing does not exist; choose another --output'):
        open_dataset(tmp_path / 'nothing')
    assert (tmp_path / 'file').read_text() == 'mine'
    assert os.listdir(tmp_path / 'old') == ['.zgroup']
