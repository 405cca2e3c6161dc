"""Stores of which anything is damaged: made whole again, or refused in one line that names it."""

import dataclasses
import json
import os
from pathlib import Path
import shutil

from hypothesis import given, settings, strategies as st
import numpy as np
import pytest

from gear_rattle_ros.store import making as store_making
from gear_rattle_ros.store.layout import Axis, Layout, Variable
from gear_rattle_ros.store.making import make_store
from gear_rattle_ros.store.store import open_dataset, Store, StoreError
from gear_rattle_ros.studies import (
    attractors,
    basins,
    continuation,
    exponents,
    lifetimes,
    orbit_diagram,
    section,
)

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


def compute(path: Path, resume: bool = True, layout: Layout = LAYOUT) -> Store:
    """Do what a tool does: the tiles that are to be done, then the table and an attribute."""
    store = make_store(path, layout, 'command', resume=resume)
    for tile in store.pending():
        part = store.tiles[tile]['velocity'], store.tiles[tile]['phase']
        store.write(tile, {'label': LABELS[part], 'rate': RATES[part]})
        store.mark(tile)
    store.write_table({'key': (('attractor',), KEYS, {'long_name': 'name'})})
    store.set_attributes({'stay': 3})
    return store


def is_right(store: Store) -> bool:
    """Tell whether it holds what was computed, and nothing else."""
    return (store.pending() == [] and np.array_equal(store.read_all('label'), LABELS)
            and np.array_equal(store.read_all('rate'), RATES)
            and list(store.read_all('key')) == list(KEYS)
            and all(np.array_equal(store.read_all(axis.name), axis.values)
                    for axis in LAYOUT.axes)
            and store.attributes['alpha'] == 0.48 and store.attributes['stay'] == 3)


def line_of(path: Path, error: StoreError) -> str:
    """Return what it says, having seen that it is one line that names the store."""
    line = str(error)
    assert str(path) in line and '\n' not in line and len(line) < 500
    return line


def judge(path: Path) -> str:
    """Read a store and go on with it: nothing but what is right, or one line that names it."""
    try:
        dataset = open_dataset(path)
    except StoreError as error:
        line_of(path, error)
    else:
        assert np.array_equal(dataset['label'].values, LABELS)
        assert np.array_equal(dataset['rate'].values, RATES)
        assert dataset.attrs['alpha'] == 0.48
    try:
        store = compute(path)
    except StoreError as error:
        line = line_of(path, error)
        assert 'choose another --output' in line or 'remove it' in line
        return line
    assert is_right(store)
    assert np.array_equal(open_dataset(path)['label'].values, LABELS)
    return ''


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    """Return a store with everything in it."""
    path = tmp_path_factory.mktemp('whole') / 'a.zarr'
    assert is_right(compute(path, resume=False))
    assert judge(path) == ''
    return path


@pytest.fixture
def copy(whole, tmp_path):
    """Return a copy of it to be damaged."""
    return Path(shutil.copytree(whole, tmp_path / 'a.zarr'))


def files_of(path: Path) -> list[Path]:
    """List all files of a store."""
    return sorted(file for file in path.rglob('*') if file.is_file())


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_cut_flipped_missing_and_swapped(whole, tmp_path_factory, data):
    """Whatever happens to its files, no other number comes out."""
    path = tmp_path_factory.mktemp('damaged') / 'a.zarr'
    shutil.copytree(whole, path)
    files = files_of(path)
    for _ in range(data.draw(st.integers(1, 3))):
        file = data.draw(st.sampled_from(files))
        content = bytearray(file.read_bytes()) if file.exists() else bytearray()
        what = data.draw(st.sampled_from(('cut', 'flip', 'remove', 'swap', 'add')))
        if what == 'flip' and content:
            place = data.draw(st.integers(0, 8 * len(content) - 1))
            content[place // 8] ^= 1 << place % 8
            file.write_bytes(content)
        elif what == 'cut':
            file.write_bytes(content[:data.draw(st.integers(0, len(content)))])
        elif what == 'add':
            file.write_bytes(content + data.draw(st.binary(max_size=9)))
        elif what == 'remove':
            file.unlink(missing_ok=True)
        else:
            other = data.draw(st.sampled_from(files))
            theirs = other.read_bytes() if other.exists() else b''
            other.write_bytes(content)
            file.write_bytes(theirs)
    judge(path)
    shutil.rmtree(path.parent)


@pytest.mark.parametrize('what', ['one bit', 'cut', 'missing', 'swapped'])
def test_a_damaged_tile_is_computed_anew(copy, capsys, what):
    """It is told by its number, and only it is done again."""
    chunk, other = copy / 'label' / '1.1', copy / 'label' / '1.0'
    content = bytearray(chunk.read_bytes())
    content[-6] ^= 1
    if what == 'one bit':
        chunk.write_bytes(content)
    elif what == 'cut':
        chunk.write_bytes(content[:5])
    elif what == 'missing':
        chunk.unlink()
    else:
        chunk.write_bytes(other.read_bytes())
    with pytest.raises(StoreError, match=r'a\.zarr: tile 4 is not as it was written; .*--resume'):
        open_dataset(copy)
    store = make_store(copy, LAYOUT, 'command', resume=True)
    assert store.pending() == [4]
    assert capsys.readouterr().err == (
        f'test: {copy}: 1 of 9 finished tiles must be computed anew (4), for what was written is '
        'damaged\n')
    with pytest.raises(StoreError, match='1 of 9 tiles must still be done; go on with --resume'):
        open_dataset(copy)
    assert judge(copy) == ''


def test_other_readers_see_a_flipped_bit(copy):
    """Zarr alone refuses the chunk: its frame has a checksum of its own."""
    import zarr
    chunk = copy / 'label' / '1.1'
    content = bytearray(chunk.read_bytes())
    refused = 0
    for place in range(8 * 6, 8 * len(content)):
        content[place // 8] ^= 1 << place % 8
        chunk.write_bytes(content)
        content[place // 8] ^= 1 << place % 8
        try:
            found = zarr.open_group(str(copy), mode='r')['label'][3:6, 2:4]
        except (RuntimeError, ValueError):
            refused += 1
            continue
        # What is left over in a frame says nothing of its content.
        assert np.array_equal(found, LABELS[3:6, 2:4])
    assert refused > 4 * len(content)


ABSURD = [
    ('label/.zarray', 'shape', [10**15, 5]), ('label/.zarray', 'shape', [7]),
    ('label/.zarray', 'chunks', [-3, 2]), ('label/.zarray', 'chunks', [0, 2]),
    ('label/.zarray', 'dtype', '<f8'), ('label/.zarray', 'dtype', [['a', '<i2', [10**9]]]),
    ('label/.zarray', 'dtype', '|O'), ('label/.zarray', 'compressor', {'id': 'pickle'}),
    ('label/.zarray', 'compressor', None), ('label/.zarray', 'filters', [{'id': 'json2'}]),
    ('label/.zarray', 'filters', 0), ('label/.zarray', 'filters', ''),
    ('label/.zarray', 'fill_value', 0), ('label/.zarray', 'order', 'F'),
    ('label/.zarray', 'dimension_separator', '/'), ('label/.zarray', 'zarr_format', 3),
    ('label/.zarray', 'more', 3),
    ('rate/.zarray', 'fill_value', 'NaN'), ('rate/.zattrs', '_ARRAY_DIMENSIONS', ['a', 'b', 'c']),
    ('label/.zattrs', '_ARRAY_DIMENSIONS', ['phase', 'velocity']),
    ('label/.zattrs', '_ARRAY_DIMENSIONS', 7), ('velocity/.zarray', 'shape', [70]),
    ('tile_done/.zattrs', 'tiles', [['velocity', 10**30, 1], ['phase', 5, 2]]),
    ('tile_done/.zattrs', 'tiles', [['velocity', 7, 0], ['phase', 5, 2]]),
    ('tile_done/.zattrs', 'tiles', [['velocity', 7, -1], ['phase', 5, 2]]),
    ('tile_done/.zattrs', 'tiles', [['velocity', 7.0, True], ['phase', 5, 2]]),
    ('tile_done/.zattrs', 'tiles', [['phase', 5, 2], ['velocity', 7, 3]]),
    ('tile_done/.zattrs', 'tiles', {'velocity': 1}), ('tile_done/.zattrs', 'tiles', None),
    ('tile_done/.zattrs', 'variables', ['../../label']),
    ('tile_done/.zattrs', 'variables', ['label']), ('tile_done/.zattrs', 'variables', [{}]),
    ('tile_checksum/.zarray', 'shape', [10**12]), ('tile_done/.zarray', 'dtype', '<u4'),
    ('label/.zattrs', 'long_name', 'lapel'), ('rate/.zattrs', 'units', '0'),
    ('label/.zattrs', 'more', 'x'),
    ('.zattrs', 'alpha', 0.57), ('.zattrs', 'stay', 4), ('.zattrs', 'identity', 7),
    ('.zgroup', 'zarr_format', 'x')]


@pytest.mark.parametrize(('file', 'name', 'value'), ABSURD)
def test_absurd_documents(copy, file, name, value):
    """Valid JSON with a value that is not ours is refused with the file, before zarr sees it."""
    document = json.loads((copy / file).read_text())
    if file == 'tile_done/.zattrs':
        value = json.dumps(value)
    (copy / file).write_text(json.dumps({**document, name: value}))
    line = judge(copy)
    assert f'{copy}/{file}'.rsplit('/', 1)[0] in line and 'another --output' in line
    assert file.startswith('.') or name in line or 'checksum' in line


@pytest.mark.parametrize('text', [
    '', '{', '[' * 10**5, '{"a":' * 10**5, '7', 'null', '[]', '\x00', '1' * 5000, '{"a": 1e999}',
    '{"zarr_format": 2}', '{"shape": NaN}', '\ufeff{}'])
@pytest.mark.parametrize('file', ['.zattrs', 'label/.zarray', 'label/.zattrs', 'phase/.zarray',
                                  'tile_done/.zattrs', 'key/.zarray', 'key/.zattrs'])
def test_documents_that_are_none(copy, file, text):
    """Cut off, too deep or something else: refused with their file."""
    (copy / file).write_text(text)
    assert file.split('/')[0] in judge(copy)


@pytest.mark.filterwarnings('ignore:Object at zarr.json')
def test_a_document_of_another_format_is_not_read(copy):
    """What a newer zarr would prefer does not count."""
    (copy / 'zarr.json').write_text(json.dumps({
        'zarr_format': 3, 'node_type': 'array', 'shape': [10**15], 'data_type': 'float64'}))
    assert judge(copy) == ''


def test_what_leads_out_is_refused(copy, tmp_path):
    """Neither a link nor a pipe is followed, nor a directory in a directory."""
    outside = tmp_path / 'outside'
    shutil.copytree(copy / 'label', outside)
    for make in (lambda place: place.symlink_to(outside), os.mkfifo,
                 lambda place: (place.mkdir(), (place / 'deeper').mkdir())):
        for place in (copy / 'label', copy / 'other'):
            kept = tmp_path / 'kept'
            if place.exists():
                place.rename(kept)
            make(place)
            assert str(place) in judge(copy)
            shutil.rmtree(place) if place.is_dir() and not place.is_symlink() else place.unlink()
            if kept.exists():
                kept.rename(place)
    (copy / 'label' / '0.0').unlink()
    (copy / 'label' / '0.0').symlink_to(outside / '0.0')
    assert 'label/0.0 is no part of a store' in judge(copy)
    assert (outside / '0.0').read_bytes() != b''


def test_nothing_is_made_through_a_link(tmp_path):
    """A link in the place of the half made store is removed, what it leads to is not."""
    (tmp_path / 'mine').mkdir()
    (tmp_path / 'mine' / 'file').write_text('mine')
    (tmp_path / '.a.zarr.new').symlink_to(tmp_path / 'mine')
    assert is_right(compute(tmp_path / 'a.zarr', resume=False))
    assert [file.name for file in (tmp_path / 'mine').iterdir()] == ['file']


def test_another_store_is_refused(copy):
    """Of another tool, of other parameters, of other values along an axis."""
    for name, value in (('alpha', 0.57), ('alpha', float('nan')), ('alpha', float('inf')),
                        ('tool', 'basins'), ('phase_window', [0.0, 6.0]), ('more', 1)):
        other = dataclasses.replace(LAYOUT, identity={**LAYOUT.identity, name: value})
        with pytest.raises(StoreError, match=f'was made with {name} = .*; choose another'):
            compute(copy, layout=other)
    axes = (dataclasses.replace(LAYOUT.axes[0], values=np.linspace(-1.0, 2.0, 7)),
            *LAYOUT.axes[1:])
    with pytest.raises(StoreError, match='other values of velocity'):
        compute(copy, layout=dataclasses.replace(LAYOUT, axes=axes))
    assert judge(copy) == ''


def test_another_version_goes_on_with_nothing_half_done(copy, monkeypatch):
    """A complete store is read by any version; one with tiles to do by its own only."""
    monkeypatch.setattr(store_making, 'versions', lambda: {'gear_rattle_ros': '9.9'})
    assert judge(copy) == ''
    make_store(copy, LAYOUT, 'command', resume=True).mark(4, done=False)
    with pytest.raises(StoreError, match="begun by version '.*', this is '9.9'.*another --output"):
        compute(copy)


def test_a_store_without_checksums_is_refused(copy):
    """As the first ones were; zarr still reads it."""
    import zarr
    shutil.rmtree(copy / 'tile_checksum')
    assert 'has no checksums' in judge(copy)
    assert np.array_equal(zarr.open_group(str(copy), mode='r')['label'][:], LABELS)


def test_what_is_no_store(tmp_path):
    """A file is left alone; what is not there is said not to be."""
    (tmp_path / 'file').write_text('mine')
    for name in ('file', 'nothing'):
        with pytest.raises(StoreError, match=f'{name} .*; choose another --output'):
            open_dataset(tmp_path / name)
    with pytest.raises(StoreError, match='file is no store of this package'):
        compute(tmp_path / 'file')
    assert (tmp_path / 'file').read_text() == 'mine'


def small(tool, path):
    """Return the command line of a tool on a few starts."""
    words = {basins: '--size 6 --starts 20 --tile 3 --hold 1000', exponents: '--size 6',
             section: '--alpha 0.48 --trajectories 3 --keep 300 --skip 10 --bins 9 8',
             lifetimes: '--size 6 --starts 20 --tile 3 --hold 1000 --cap 2000',
             orbit_diagram: '--alpha 0.48 0.5 --columns 3 --bins 20 --trajectories 3 --skip 100 '
             '--keep 256',
             continuation: '--alpha 0.5 0.51 --columns 2 --trajectories 4 --hold 500 --skip 300 '
             '--keep 256 --tolerance 1e-3',
             attractors: '--starts 20 --hold 1000'}[tool]
    return [*words.split(), '--output', str(path), '--resume']


@pytest.mark.parametrize('tool', [exponents, *(
    pytest.param(tool, marks=pytest.mark.long)
    for tool in (basins, section, lifetimes, orbit_diagram, continuation, attractors))])
def test_tools_make_it_whole_or_say_one_line(tool, tmp_path, capsys):
    """File by file with a bit in its middle flipped: the same output and numbers, or status 2."""
    path, kept = tmp_path / 'a.zarr', tmp_path / 'kept'
    assert tool.main(small(tool, path)) == 0
    said = capsys.readouterr().out
    shutil.copytree(path, kept)
    values = {file.parent.name: open_dataset(path)[file.parent.name].values
              for file in path.glob('*/.zarray') if not file.parent.name.startswith('tile_')}
    made_whole = 0
    for file in files_of(kept):
        shutil.rmtree(path)
        shutil.copytree(kept, path)
        content = bytearray(file.read_bytes())
        content[len(content) // 2] ^= 4
        (path / file.relative_to(kept)).write_bytes(content)
        status = tool.main(small(tool, path))
        captured = capsys.readouterr()
        assert status in (0, 2)
        if status == 2:
            line, = captured.err.splitlines()
            assert line.startswith(f'{tool.__name__.split(".")[-1]}: {path}')
            continue
        made_whole += 1
        assert captured.out == said
        for name, expected in values.items():
            found = open_dataset(path)[name].values
            assert np.array_equal(found, expected, equal_nan=found.dtype.kind == 'f'), name
    # Chunks, marks and checksums at the least; attractors have no tiles.
    assert made_whole >= (3 if tool is attractors else 4)
