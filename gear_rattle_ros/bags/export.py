"""Events as tables in files: CSV, and Parquet by pyarrow."""

from collections.abc import Callable, Iterator, Sequence
import contextlib
import csv
import itertools
from pathlib import Path
import sys
from typing import Any
import warnings

import numpy as np

from .reader import EVENT_UNITS, read_batches
from ..core.model import EVENT, EventArray

# Events that are written together: a row group of Parquet.
_TOGETHER = 500_000


def export(path: Path, files: Sequence[Path], topic: str = '') -> int:
    """
    Write the events of a bag into files, which appear whole or not; return how many there are.

    What `read_bag` warns of is reported on stderr.
    """
    count = 0
    try:
        with warnings.catch_warnings(record=True) as faults, contextlib.ExitStack() as stack:
            warnings.simplefilter('always')
            # A bag that cannot be read is refused before anything is written.
            batches = _joined(read_batches(path, topic))
            first = next(batches, np.empty(0, EVENT))
            writers = [stack.enter_context(_FORMATS[file.suffix](_unfinished(file)))
                       for file in files]
            for events in itertools.chain([first], batches):
                count += len(events)
                for write in writers:
                    write(events)
        for file in files:
            _unfinished(file).replace(file)
    finally:
        for file in files:
            _unfinished(file).unlink(missing_ok=True)
    for fault in faults:
        print(f'export: {fault.message}', file=sys.stderr)
    return count


@contextlib.contextmanager
def _csv(path: Path) -> Iterator[Callable[[EventArray], object]]:
    with path.open('w', newline='', encoding='ascii') as stream:
        writer = csv.writer(stream, lineterminator='\n')
        writer.writerow(EVENT.names or ())
        # The shortest digits that give the same number again.
        yield lambda events: writer.writerows(events.tolist())


@contextlib.contextmanager
def _parquet(path: Path) -> Iterator[Callable[[EventArray], object]]:
    try:
        import pyarrow
        from pyarrow.parquet import ParquetWriter
    except ImportError as error:
        raise ValueError('Parquet needs the Python package pyarrow; install it, or write .csv'
                         ) from error
    schema = pyarrow.schema([
        pyarrow.field(name, pyarrow.from_numpy_dtype(EVENT[name]), False, {'units': units})
        for name, units in EVENT_UNITS.items()])

    def table(events: EventArray) -> Any:
        return pyarrow.Table.from_arrays(
            [pyarrow.array(np.ascontiguousarray(events[name])) for name in EVENT_UNITS], schema=schema)

    with ParquetWriter(path, schema) as writer:
        yield lambda events: writer.write_table(table(events))


_FORMATS = {'.csv': _csv, '.parquet': _parquet}


def _unfinished(file: Path) -> Path:
    return file.with_name(f'.{file.name}.new')


def _joined(batches: Iterator[EventArray]) -> Iterator[EventArray]:
    waiting: list[EventArray] = []
    for events in batches:
        waiting.append(events)
        if sum(map(len, waiting)) >= _TOGETHER:
            yield np.concatenate(waiting)
            waiting = []
    if waiting:
        yield np.concatenate(waiting)
