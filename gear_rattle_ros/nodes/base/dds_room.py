"""
Room for the stream in Fast DDS: in the shared memory of this machine, and in its readers.

The segment of 512 KB that a publisher has by default holds eight batches. When a reader's thread
gets no time for as long as eight batches take, DDS overwrites what it has not fetched and sends
it again, by which five readers on two cores come to a standstill. A reader that keeps all has
room for 5000 batches, and never gives back the memory of those that once had to wait.
"""

from collections.abc import Sequence
import os
from pathlib import Path

from .node import ShellNode
from ...parameters import Specification
from ...places import config_folder

# Read by Fast DDS when the first node of a process is made; the second from version 3 on.
PROFILES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')
# Who names transports here has chosen them.
TRANSPORTS = 'FASTDDS_BUILTIN_TRANSPORTS'
MEMORY = Path('/dev/shm')
# The segment of config/fastdds/stream.xml, and what is left to others at the least [bytes].
SEGMENT = 32 << 20
SPARE = 16 << 20


class StreamingNode(ShellNode):
    """A node that publishes a stream; says so where it has no room for it."""

    def __init__(self, name: str, table: Sequence[Specification]) -> None:
        lacking = make_room()
        super().__init__(name, table)
        if lacking:
            self.get_logger().warning(lacking)


class ReadingNode(ShellNode):
    """A node that reads a stream and keeps all of it that has to wait."""

    def __init__(self, name: str, table: Sequence[Specification]) -> None:
        bound_backlog()
        super().__init__(name, table)


def make_room() -> str:
    """Ask for a segment that holds a stream, before the node is made; tell why there is none."""
    if not _is_ours() or TRANSPORTS in os.environ:
        return ''
    try:
        memory = os.statvfs(MEMORY)
    except OSError as error:
        return f'no shared memory for the stream: {MEMORY}: {error.strerror}'
    free = memory.f_bavail * memory.f_frsize
    # DDS writes on every page at once, and dies of a page that cannot be had.
    if free < SEGMENT + SPARE:
        return (f'{MEMORY} has {free >> 20} MB free, and the stream wants {SEGMENT >> 20} MB: it '
                'is slower with several readers; a container takes --shm-size, and what killed '
                'processes have left goes by `fastdds shm clean`')
    _use('stream.xml')
    return ''


def bound_backlog() -> None:
    """Ask for readers that hold fewer batches, before the node is made."""
    if _is_ours():
        _use('readers.xml')


def _is_ours() -> bool:
    is_fast_dds = os.environ.get('RMW_IMPLEMENTATION', 'rmw_fastrtps').startswith('rmw_fastrtps')
    return is_fast_dds and not any(name in os.environ for name in PROFILES)


def _use(profile: str) -> None:
    os.environ.update(dict.fromkeys(PROFILES, str(config_folder('fastdds') / profile)))
