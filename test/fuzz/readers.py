"""What reads bytes of others: what it makes of them, or its one line of refusal."""

import atexit
import functools
import json
import math
import os
from pathlib import Path
import shutil
import tempfile

import numpy as np

from gear_rattle_ros.bags import Bag, BagError
from gear_rattle_ros.bags.clouds import CloudDecoder
from gear_rattle_ros.bags.metadata import file_names
from gear_rattle_ros.bags.salvage import Salvage
from gear_rattle_ros.core.model import EventKind
from gear_rattle_ros.core.stream.event_points import check_events
from gear_rattle_ros.store.checksums import attributes_checksum, CHECKSUM, require_attributes
from gear_rattle_ros.store.documents import require_group, require_layout, StoreError, tiles_of
from gear_rattle_ros.store.layout import Axis, Layout, Variable
from gear_rattle_ros.store.making import make_store

LAYOUT = Layout(
    (Axis('velocity', np.linspace(-1.0, 1.0, 7), {'units': '1'}, 3),
     Axis('phase', np.arange(5.0), {'units': 'rad'}, 2)),
    (Variable('label', ('velocity', 'phase'), '<i2', {'long_name': 'label'}),),
    {'tool': 'test', 'alpha': 0.48})
# By the first byte of an input of the documents: the one that it changes. The second is the number
# of the name in it whose value it gives; RAW where it gives the whole document.
RAW = 255
DOCUMENTS = ('.zattrs', '.zgroup', 'label/.zarray', 'label/.zattrs', 'phase/.zarray',
             'tile_done/.zarray', 'tile_done/.zattrs', 'tile_checksum/.zarray')
# One decoder for all inputs, as for all messages of a topic.
DECODER = CloudDecoder()


@functools.cache
def folder() -> Path:
    """Return a place for the files to be read: in memory, where there is one."""
    memory = Path('/dev/shm')
    path = tempfile.mkdtemp(dir=memory if os.access(memory, os.W_OK) else None)
    # This process only: workers of another have their own.
    atexit.register(shutil.rmtree, path, ignore_errors=True)
    return Path(path)


def read_mcap(data: bytes) -> str:
    """Read all of a file, its EVENT records too."""
    path = folder() / 'bag.mcap'
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
    """Read a serialized cloud; one decoder that has read others and a new one agree."""
    said = []
    for decoder in (DECODER, CloudDecoder()):
        try:
            events = decoder.events(data)
        except ValueError as error:
            said.append((str(error), b''))
        else:
            check_events(events)
            assert len(events) == decoder.parse(data).count
            said.append(('', events.tobytes()))
    assert said[0] == said[1]
    return said[0][0]


def read_metadata(data: bytes) -> str:
    """Read a metadata.yaml."""
    path = folder() / 'bag'
    path.mkdir(exist_ok=True)
    (path / 'metadata.yaml').write_bytes(data)
    try:
        names = file_names(path)
    except BagError as error:
        return str(error)
    assert all(name == Path(name).name for name in names)
    return ''


def salvage(data: bytes) -> str:
    """Read what is left of a file, and see that what is told of its damage makes sense."""
    path = folder() / 'left.mcap'
    path.write_bytes(data)
    left = Salvage(path)
    for topic, message in left.messages():
        assert isinstance(topic.name, str) and len(message.data) <= 2**20
    before = 0
    for damage in left.damages:
        assert before <= damage.start < damage.end <= len(data)
        before = damage.end
    return ''


@functools.cache
def store() -> Path:
    """Make a store."""
    path = folder() / 'a.zarr'
    made = make_store(path, LAYOUT, 'command')
    for tile in made.pending():
        part = {name: piece.stop - piece.start for name, piece in made.tiles[tile].items()}
        made.write(tile, {'label': np.full(tuple(part.values()), tile, np.int16)})
        made.mark(tile)
    made.set_attributes({'stay': 3})
    return path


def read_document(data: bytes) -> str:
    """Hold a store of which a document is changed against its layout."""
    if len(data) < 2:
        return ''
    path = store()
    file = path / DOCUMENTS[data[0] % len(DOCUMENTS)]
    right = file.read_bytes()
    content = data[2:]
    if data[1] != RAW:
        document = json.loads(right)
        try:
            document[list(document)[data[1] % len(document)]] = json.loads(content)
            if isinstance(document.get(CHECKSUM), int):
                document[CHECKSUM] = attributes_checksum(document)
            content = json.dumps(document).encode()
        except (ValueError, RecursionError):
            return ''
    file.write_bytes(content)
    try:
        require_group(path)
        require_attributes(path)
        cuts = tiles_of(path)
        require_layout(path, LAYOUT, cuts)
    except StoreError as error:
        return str(error)
    finally:
        file.write_bytes(right)
    # What passes says what it should, in whatever words.
    found, wanted = json.loads(content), json.loads(right)
    if file.name == '.zarray':
        if found.setdefault('filters', None) == []:
            found['filters'] = None
        assert found == {name: wanted[name] for name in found}
    assert {name: size for name, (size, _) in cuts.items()} == {'velocity': 7, 'phase': 5}
    assert math.prod(-(-size // step) for size, step in cuts.values()) == 9
    return ''


# By the first byte of an input; the rest is what is read.
READERS = {b'M': read_mcap, b'C': read_cloud, b'Y': read_metadata, b'S': salvage,
           b'J': read_document}


def read(data: bytes) -> str:
    """Give the bytes to their reader; return the refusal, which is one line, or nothing."""
    reader = READERS.get(data[:1])
    if reader is None:
        return ''
    refusal = reader(data[1:])
    assert '\n' not in refusal and len(refusal) < 1000, refusal
    return refusal
