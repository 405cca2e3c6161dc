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

"""
Room for the stream in Fast DDS: in the shared memory of this machine, and in its readers.

By default a publisher's segment of 512 KB holds eight batches. When a reader gets no time for as
long as eight batches take, DDS overwrites what it has not fetched and sends it again: five readers
on two cores come to a standstill. A reader that keeps everything has room for 5000 batches, and
never returns the memory of those that once had to wait.
"""

import contextlib
import fcntl
import os
from pathlib import Path
import stat
import time

from .errors import UserError
from ...places import config_folder

# Fast DDS reads them when the first node of a process is made; the second from version 3 on.
PROFILES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')
# A user who names transports has chosen them.
TRANSPORTS = 'FASTDDS_BUILTIN_TRANSPORTS'
MEMORY = Path('/dev/shm')
# The segment of config/fastdds/stream.xml, and what must be left for others [bytes].
SEGMENT = 32 << 20
SPARE = 16 << 20
# What all nodes of a suite but the simulator take together, and some more [bytes].
LEAST = 8 << 20
# LTTng writes a page for all users and one for this one.
PAGES = 2 * 4096
# A segment that is younger may not be locked yet by the process that makes it [s].
OLD = 10.0


def make_room() -> str:
    """Ask for a segment that holds a stream, before the node is made; return why there is none."""
    if not _is_ours() or TRANSPORTS in os.environ:
        return ''
    free = _free()
    if free < SEGMENT + SPARE:
        return (f'{MEMORY} has {free >> 20} MB free and the stream needs {SEGMENT >> 20} MB: it '
                'will be slower with several readers; give a container more with --shm-size; '
                'the next suite removes what killed processes have left')
    _use('stream.xml')
    return ''


def bound_backlog() -> str:
    """Ask for readers that hold fewer batches, before the node is made; return no warning."""
    if _is_ours():
        _use('readers.xml')
    return ''


def require_pages() -> None:
    """Raise OSError where tracing, which rclpy imports, would die of SIGBUS without a word."""
    if os.access(MEMORY, os.W_OK) and _free() < PAGES:
        remove_abandoned()
        if _free() < PAGES:
            raise OSError(f'{MEMORY} is full; remove what nobody needs there')


def avoid_memory() -> str:
    """Send messages over UDP where shared memory cannot, before ROS begins; return why."""
    if not _is_fast_dds() or TRANSPORTS in os.environ:
        return ''
    if (free := _free()) < LEAST:
        why = f'{MEMORY} has {free >> 10} KB free'
        remedy = 'give a container more with --shm-size'
    elif _is_shared():
        why, remedy = 'another user has nodes in this domain', 'set ROS_DOMAIN_ID to another'
        # There ROS chooses the transports, and who may not write into our memory halts the stream.
        if os.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE') == 'LOCALHOST':
            raise UserError(f'{why}; {remedy}')
    else:
        return ''
    os.environ[TRANSPORTS] = 'UDPv4'
    return f'{why}: messages go over UDP, which is slower; {remedy}'


def remove_abandoned() -> None:
    """Remove the segments that killed processes of this user have left."""
    for lock in MEMORY.glob(f'fastrtps_{16 * "[0-9a-f]"}_el'):
        with contextlib.suppress(OSError):
            about = lock.lstat()
            if (not stat.S_ISREG(about.st_mode) or about.st_uid != os.getuid()
                    or about.st_mtime > time.time() - OLD):
                continue
            with open(lock, 'rb') as stream:
                # Refused while the process lives.
                fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
                lock.with_name(lock.name.removesuffix('_el')).unlink(missing_ok=True)
                lock.unlink()


def _is_shared() -> bool:
    """Whether nodes of another user, who may not write into our segments, are in this domain."""
    domain = os.environ.get('ROS_DOMAIN_ID', '')
    first = 7400 + 250 * (int(domain) if domain.isdecimal() else 0)
    for number in range(first, first + 250):
        lock = MEMORY / f'fastrtps_port{number}_el'
        with contextlib.suppress(OSError):
            if lock.stat().st_uid != os.getuid() and _is_held(lock):
                return True
    return False


def _is_held(lock: Path) -> bool:
    with open(lock, 'rb') as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def _free() -> int:
    """Return the shared memory that is free [bytes], 0 where there is none to be written."""
    try:
        memory = os.statvfs(MEMORY)
    except OSError:
        return 0
    return memory.f_bavail * memory.f_frsize if os.access(MEMORY, os.W_OK) else 0


def _is_fast_dds() -> bool:
    return os.environ.get('RMW_IMPLEMENTATION', 'rmw_fastrtps').startswith('rmw_fastrtps')


def _is_ours() -> bool:
    return _is_fast_dds() and not any(name in os.environ for name in PROFILES)


def _use(profile: str) -> None:
    os.environ.update(dict.fromkeys(PROFILES, str(config_folder('fastdds') / profile)))
