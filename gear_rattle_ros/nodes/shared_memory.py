"""
Room for the stream in the shared memory by which Fast DDS hands it to readers of this machine.

The segment of 512 KB that a publisher has by default holds eight batches. When a reader's thread
gets no time for as long as eight batches take, DDS overwrites what it has not fetched and sends
it again, by which five readers on two cores come to a standstill.
"""

from collections.abc import Sequence
import os
from pathlib import Path

from .shell import ShellNode
from ..parameters import Specification
from ..places import config_folder

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


def make_room() -> str:
    """Ask for a segment that holds a stream, before the node is made; tell why there is none."""
    is_fast_dds = os.environ.get('RMW_IMPLEMENTATION', 'rmw_fastrtps').startswith('rmw_fastrtps')
    if not is_fast_dds or any(name in os.environ for name in (*PROFILES, TRANSPORTS)):
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
    profile = str(config_folder('fastdds') / 'stream.xml')
    os.environ.update(dict.fromkeys(PROFILES, profile))
    return ''
