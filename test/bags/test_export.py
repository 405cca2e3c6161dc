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

"""Tables of events, as other programs read them, hold what the mcap reader finds in the bag."""

import csv
from pathlib import Path
import sys

from bag_maker import batches, make_bag, states, story, TYPES
from mcap.reader import make_reader
import numpy as np
import pandas
import pytest

import gear_rattle_ros
from gear_rattle_ros.cli.bags.export import main
from gear_rattle_ros.core.model import EVENT

EVENTS = story(3000)


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp('bags') / 'run.1'
    make_bag(path, batches(EVENTS), states(20))
    return path


@pytest.fixture(scope='module')
def columns(bag: Path) -> dict[str, np.ndarray]:
    """Return the columns as mcap's own reader and the definitions of rosbags have them."""
    kinds = {6: '<u4', 8: '<f8'}
    found: dict[str, list[np.ndarray]] = {}
    with next(bag.glob('*.mcap')).open('rb') as stream:
        for schema, channel, message in make_reader(stream).iter_messages(['/impacts']):
            assert channel.topic == '/impacts'
            cloud = TYPES.deserialize_cdr(message.data, schema.name)
            # The others are for viewers.
            for field in cloud.fields[-len(EVENT.names or ()):]:
                found.setdefault(field.name, []).append(np.ndarray(
                    cloud.width, kinds[field.datatype], cloud.data.tobytes(), field.offset,
                    (cloud.point_step,)))
    return {name: np.concatenate(parts) for name, parts in found.items()}


def same(table, columns: dict[str, np.ndarray]) -> bool:
    """Whether a table has these columns and no others, to the bit."""
    return list(table) == list(columns) and all(
        np.asarray(table[name], kind.dtype).tobytes() == kind.tobytes()
        for name, kind in columns.items())


def test_an_array_is_ready_for_pandas(bag: Path, columns: dict[str, np.ndarray]) -> None:
    assert same(pandas.DataFrame(gear_rattle_ros.read_bag(bag)), columns)
    assert list(gear_rattle_ros.EVENT_UNITS) == list(columns)
    assert gear_rattle_ros.EVENT_UNITS['phase'] == 'rad'


def test_csv_and_parquet_hold_what_is_in_the_bag(
        bag: Path, columns: dict[str, np.ndarray], tmp_path: Path,
        capsys: pytest.CaptureFixture[str]) -> None:
    """Named columns, every number to the bit, and units where the format has a place for them."""
    parquet = pytest.importorskip('pyarrow.parquet')
    files = [tmp_path / 'a.csv', tmp_path / 'a.parquet']
    assert main([str(bag), *map(str, files)]) == 0
    said = capsys.readouterr()
    assert (said.out, said.err) == (''.join(f'{file}: 3,001 events\n' for file in files), '')
    with files[0].open(newline='') as stream:
        rows = list(csv.DictReader(stream))
    assert same({name: [(int if name in ('kind', 'index', 'epoch', 'cycle') else float)(row[name])
                        for row in rows] for name in rows[0]}, columns)
    assert same(pandas.read_csv(files[0], float_precision='round_trip'), columns)
    table = parquet.read_table(files[1])
    assert same({name: table[name].to_numpy() for name in table.column_names}, columns)
    assert {field.name: field.metadata[b'units'].decode() for field in table.schema} == (
        gear_rattle_ros.EVENT_UNITS)
    assert sorted(tmp_path.iterdir()) == files


def test_a_table_is_named_after_its_bag(bag: Path) -> None:
    assert main([str(bag)]) == 0
    assert len((bag.parent / 'run.1.csv').read_text().splitlines()) == len(EVENTS) + 1


@pytest.mark.parametrize(('arguments', 'words'), [
    (['/nowhere/bag'], 'export: /nowhere/bag: does not exist\n'),
    (['BAG', 'a.xlsx'], 'export: a.xlsx does not end in one of .csv .parquet\n'),
    (['BAG', '/nowhere/a.csv'], 'export: /nowhere/a.csv: No such file or directory\n'),
    (['BAG', 'a.csv', '--topic', '/some'], 'has no topic /some; there are '),
    (['BAG', 'a.csv', '--topic', '/lyapunov'], 'is not a PointCloud2'),
])
def test_bad_input_is_refused_in_one_line(
        bag: Path, arguments: list[str], words: str, tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Status 2, and nothing is left behind."""
    monkeypatch.chdir(tmp_path)
    assert main([str(bag) if word == 'BAG' else word for word in arguments]) == 2
    said = capsys.readouterr()
    assert (said.out, len(said.err.splitlines())) == ('', 1)
    assert words in said.err
    assert list(tmp_path.iterdir()) == []


def test_without_pyarrow_a_line_says_what_to_do(
        bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setitem(sys.modules, 'pyarrow', None)
    assert main([str(bag), str(tmp_path / 'a.parquet')]) == 2
    assert capsys.readouterr().err == (
        'export: Parquet needs the Python package pyarrow; install it, or write .csv\n')
    assert list(tmp_path.iterdir()) == []


def test_what_is_missing_in_a_bag_is_reported(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    clouds = batches(EVENTS)
    make_bag(tmp_path / 'bag', clouds[:5] + clouds[6:])
    assert main([str(tmp_path / 'bag')]) == 0
    assert ': 1 hole, 100 impacts missing' in capsys.readouterr().err
    assert len(np.loadtxt(tmp_path / 'bag.csv', delimiter=',', skiprows=1)) == len(EVENTS) - 100
    assert EVENT.names is not None
