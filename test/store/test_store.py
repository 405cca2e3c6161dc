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

"""Stores: labelled, resumable, refused where they are something else."""

import dataclasses
import gc
import os
import subprocess
import sys

import numpy as np
import pytest
import zarr

from gear_rattle_ros.store.layout import Axis, Layout, Variable
from gear_rattle_ros.store.making import make_store
from gear_rattle_ros.store.store import open_dataset, Store, StoreError

LAYOUT = Layout(
    (Axis('velocity', np.linspace(-1.0, 1.0, 7), {'units': '1'}, 3),
     Axis('phase', np.arange(5.0), {'units': 'rad'}, 2)),
    (Variable('label', ('velocity', 'phase'), '<i2', {'long_name': 'label'}),),
    {'tool': 'basins', 'alpha': 0.48, 'phase_window': [0.0, 5.0]})


def test_tiles_cover_every_cell_once(tmp_path):
    """Each tile written with its number: every cell has one, in the right place."""
    store = make_store(tmp_path / 'a', LAYOUT, 'command')
    count = np.zeros((7, 5), int)
    for tile, region in enumerate(store.tiles):
        place = (region['velocity'], region['phase'])
        count[place] += 1
        store.write(tile, {'label': np.full(count[place].shape, tile)})
        store.mark(tile)
    assert np.all(count == 1)
    label = open_dataset(tmp_path / 'a')['label']
    for tile, region in enumerate(store.tiles):
        assert np.all(label.values[region['velocity'], region['phase']] == tile)
    assert Store(tmp_path / 'a').pending() == []


def test_a_chunk_of_zeros_is_written(tmp_path):
    """What is missing could be anything to other readers: so it is there, or noticed."""
    store = make_store(tmp_path / 'a', LAYOUT, 'command')
    for tile in store.pending():
        store.write(tile, {'label': 0})
        store.mark(tile)
    assert not open_dataset(tmp_path / 'a')['label'].values.any()
    (tmp_path / 'a' / 'label' / 'c.1.1').unlink()
    with pytest.raises(StoreError, match=r'label/c\.1\.1: tile 4 is damaged or missing'):
        open_dataset(tmp_path / 'a')


def test_an_independent_reader_finds_everything(tmp_path):
    """Without this package, zarr alone reads arrays, dimensions and attributes."""
    store = make_store(tmp_path / 'a', LAYOUT, 'the command')
    store.write_table({'key': (('attractor',), np.array(['a', 'bcd']), {'long_name': 'name'})})
    store.write_table({'key': (('attractor',), np.array(['a', 'bcd', 'x']), {})})
    group = zarr.open_group(str(tmp_path / 'a'), mode='r')
    assert group.attrs['alpha'] == 0.48
    assert group.attrs['command'] == 'the command'
    assert list(group['key'][:]) == ['a', 'bcd', 'x']
    assert group['label'].metadata.dimension_names == ('velocity', 'phase')
    assert np.array_equal(group['velocity'][:], np.linspace(-1.0, 1.0, 7))


def test_marks_outlive_the_process_that_made_them(tmp_path):
    """A store that is opened again has its marks."""
    store = make_store(tmp_path / 'a', LAYOUT, 'command')
    store.write(4, {'label': 4})
    store.mark(4)
    again = make_store(tmp_path / 'a', LAYOUT, 'command', resume=True)
    assert again.pending() == [tile for tile in range(len(store.tiles)) if tile != 4]


def test_what_is_something_else_is_refused(tmp_path):
    """Without resume, with other parameters, and where there is no store at all."""
    make_store(tmp_path / 'a', LAYOUT, 'command')
    with pytest.raises(StoreError, match='answers the same question; .* resume=True'):
        make_store(tmp_path / 'a', LAYOUT, 'command')
    other = dataclasses.replace(LAYOUT, identity={**LAYOUT.identity, 'alpha': 0.57})
    with pytest.raises(StoreError, match=r'alpha = 0\.48, not 0\.57'):
        make_store(tmp_path / 'a', other, 'command', resume=True)
    (tmp_path / 'b').mkdir()
    (tmp_path / 'b' / 'file').write_text('mine')
    with pytest.raises(StoreError, match='b is not a store of this package'):
        make_store(tmp_path / 'b', LAYOUT, 'command', resume=True)
    assert (tmp_path / 'b' / 'file').read_text() == 'mine'
    with pytest.raises(StoreError, match='does not exist'):
        Store(tmp_path / 'c')


def test_an_output_that_cannot_be_written_is_refused(tmp_path):
    """Below a file no directory can be made."""
    (tmp_path / 'file').write_text('')
    with pytest.raises(StoreError, match='cannot be written'):
        make_store(tmp_path / 'file' / 'a', LAYOUT, 'command')
    assert os.listdir(tmp_path) == ['file']


def test_a_temporary_store_leaves_nothing(tmp_path, monkeypatch):
    """Without a path it goes with the object or when it is closed; its dataset stays."""
    monkeypatch.setattr('tempfile.tempdir', str(tmp_path))
    for end in (Store.close, lambda store: None):
        store = make_store(None, LAYOUT, 'command')
        for tile in store.pending():
            store.write(tile, {'label': tile})
            store.mark(tile)
        dataset = store.dataset()
        assert os.listdir(tmp_path) != []
        end(store)
        del store
        gc.collect()
        assert os.listdir(tmp_path) == []
        assert dataset['label'].values[6, 4] == 8 and dataset.attrs['alpha'] == 0.48


def test_zarr_is_imported_only_with_a_store():
    """Tools that show their help or an error need not wait for it."""
    code = ("import sys, gear_rattle_ros.store.making; assert not {'zarr', 'xarray', "
            "'numcodecs'} & {*sys.modules}")
    assert subprocess.run([sys.executable, '-c', code]).returncode == 0
