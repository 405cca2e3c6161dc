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

"""The command `export`: the events of a bag as tables that other programs read."""

from pathlib import Path
import sys
from typing import TYPE_CHECKING
import warnings

from ..refusal import attempt, Parser

if TYPE_CHECKING:
    from ...core.model import EventArray


def _csv(path: Path, events: 'EventArray') -> None:
    import csv
    with path.open('w', newline='', encoding='ascii') as stream:
        writer = csv.writer(stream, lineterminator='\n')
        writer.writerow(events.dtype.names or ())
        # The shortest digits that give the same number again; rows take much memory.
        for first in range(0, len(events), 100_000):
            writer.writerows(events[first:first + 100_000].tolist())


def _parquet(path: Path, events: 'EventArray') -> None:
    from ...bags.reader import EVENT_UNITS
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise ValueError('Parquet needs the Python package pyarrow; install it, or write .csv'
                         ) from error
    columns = [pyarrow.array(events[name].copy()) for name in EVENT_UNITS]
    pyarrow.parquet.write_table(pyarrow.Table.from_arrays(columns, schema=pyarrow.schema([
        pyarrow.field(name, column.type, False, {'units': units})
        for column, (name, units) in zip(columns, EVENT_UNITS.items(), strict=True)])), path)


FORMATS = {'.csv': _csv, '.parquet': _parquet}


def main(arguments: list[str] | None = None) -> int:
    parser = Parser('export', description='Write the events of a bag as a table, with a column '
                    'for each field of the record.')
    parser.add_argument('bag', metavar='BAG', type=Path, help='bag directory or .mcap file')
    parser.add_argument('files', nargs='*', metavar='FILE', type=Path, help='what to write: names '
                        f'end in {" or ".join(FORMATS)}; by default BAG.csv beside the bag')
    parser.add_argument('--topic', default='', help='of the events; default: the only .../impacts')
    given = parser.parse_args(arguments)
    return attempt('export', lambda: _export(given.bag, given.files, given.topic))


def _export(bag: Path, files: list[Path], topic: str) -> int:
    for file in files:
        if file.suffix not in FORMATS:
            raise ValueError(f'{file} does not end in one of {" ".join(FORMATS)}')
    from ...bags import read_bag
    from ...core.words import counted
    with warnings.catch_warnings(record=True) as faults:
        warnings.simplefilter('always')
        events = read_bag(bag, topic=topic)
    for fault in faults:
        print(f'export: {fault.message}', file=sys.stderr)
    for file in files or [bag.resolve().with_name(f'{bag.resolve().name}.csv')]:
        fresh = file.with_name(f'.{file.name}.new')
        try:
            FORMATS[file.suffix](fresh, events)
            fresh.replace(file)
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(file)) from error
        finally:
            fresh.unlink(missing_ok=True)
        print(f'{file}: {counted(len(events), "event")}')
    return 0
