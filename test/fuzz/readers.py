"""What reads bytes of others: what it makes of them, or its one line of refusal."""

from pathlib import Path
import tempfile

from gear_rattle_ros.bags import Bag, BagError
from gear_rattle_ros.bags.clouds import CloudDecoder
from gear_rattle_ros.bags.metadata import file_names
from gear_rattle_ros.core.model import EventKind


def read_mcap(data: bytes) -> str:
    """Read all of a file, its EVENT records too."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'bag.mcap'
        path.write_bytes(data)
        try:
            bag = Bag(path)
            for _ in bag.messages():
                pass
            for events in bag.events():
                assert events['kind'].max(initial=0) <= max(EventKind)
        except BagError as error:
            return str(error)
    return ''


def read_cloud(data: bytes) -> str:
    """Read a serialized cloud."""
    try:
        events = CloudDecoder().events(data)
    except ValueError as error:
        return str(error)
    assert events['kind'].max(initial=0) <= max(EventKind)
    return ''


def read_metadata(data: bytes) -> str:
    """Read a metadata.yaml."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder)
        (path / 'metadata.yaml').write_bytes(data)
        try:
            names = file_names(path)
        except BagError as error:
            return str(error)
    assert all(name == Path(name).name for name in names)
    return ''


# By the first byte of an input; the rest is what is read.
READERS = {b'M': read_mcap, b'C': read_cloud, b'Y': read_metadata}


def read(data: bytes) -> str:
    """Give the bytes to their reader; return the refusal, which is one line, or nothing."""
    reader = READERS.get(data[:1])
    if reader is None:
        return ''
    refusal = reader(data[1:])
    assert '\n' not in refusal and len(refusal) < 1000, refusal
    return refusal
