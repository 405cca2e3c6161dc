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

"""What reads bytes of others: what it makes of them, or its one line of refusal."""

import atexit
import functools
import os
from pathlib import Path
import shutil
import tempfile

from gear_rattle_ros.bags import Bag, BagError
from gear_rattle_ros.bags.clouds import CloudDecoder
from gear_rattle_ros.bags.metadata import file_names
from gear_rattle_ros.bags.salvage import Salvage
from gear_rattle_ros.core.model import EventKind
from gear_rattle_ros.core.stream.event_points import check_events

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
    """Read what is left of a file, and check that the report of its damage makes sense."""
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


# By the first byte of an input; the rest is what is read.
READERS = {b'M': read_mcap, b'C': read_cloud, b'Y': read_metadata, b'S': salvage}


def read(data: bytes) -> str:
    """Give the bytes to their reader; return the refusal, which is one line, or nothing."""
    reader = READERS.get(data[:1])
    if reader is None:
        return ''
    refusal = reader(data[1:])
    assert '\n' not in refusal and len(refusal) < 1000, refusal
    return refusal
