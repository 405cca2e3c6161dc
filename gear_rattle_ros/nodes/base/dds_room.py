"""
Room for the stream in Fast DDS: in the shared memory of this machine, and in its readers.

By default a publisher's segment of 512 KB holds eight batches. When a reader gets no time for as
long as eight batches take, DDS overwrites what it has not fetched and sends it again: five readers
on two cores come to a standstill. A reader that keeps everything has room for 5000 batches, and
never returns the memory of those that once had to wait.
"""

import os
from pathlib import Path

from ...places import config_folder

# Fast DDS reads them when the first node of a process is made; the second from version 3 on.
PROFILES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')
# A user who names transports has chosen them.
TRANSPORTS = 'FASTDDS_BUILTIN_TRANSPORTS'
MEMORY = Path('/dev/shm')
# The segment of config/fastdds/stream.xml, and what must be left for others [bytes].
SEGMENT = 32 << 20
SPARE = 16 << 20


def make_room() -> str:
    """Ask for a segment that holds a stream, before the node is made; return why there is none."""
    if not _is_ours() or TRANSPORTS in os.environ:
        return ''
    try:
        memory = os.statvfs(MEMORY)
    except OSError as error:
        return f'no shared memory for the stream: {MEMORY}: {error.strerror}'
    free = memory.f_bavail * memory.f_frsize
    # DDS writes to every page at once, and dies where it cannot have one.
    if free < SEGMENT + SPARE:
        return (f'{MEMORY} has {free >> 20} MB free and the stream needs {SEGMENT >> 20} MB: it '
                'will be slower with several readers; give a container more with --shm-size, and '
                'remove what killed processes have left with `fastdds shm clean`')
    _use('stream.xml')
    return ''


def bound_backlog() -> str:
    """Ask for readers that hold fewer batches, before the node is made; return no warning."""
    if _is_ours():
        _use('readers.xml')
    return ''


def _is_ours() -> bool:
    is_fast_dds = os.environ.get('RMW_IMPLEMENTATION', 'rmw_fastrtps').startswith('rmw_fastrtps')
    return is_fast_dds and not any(name in os.environ for name in PROFILES)


def _use(profile: str) -> None:
    os.environ.update(dict.fromkeys(PROFILES, str(config_folder('fastdds') / profile)))
