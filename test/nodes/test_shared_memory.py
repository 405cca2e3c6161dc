"""The shared memory of the stream: as large as asked for where there is room, else as it was."""

from collections.abc import Callable
import contextlib
import os
from pathlib import Path
import re
import signal
import types
import xml.etree.ElementTree

import pytest

from gear_rattle_ros.core.points import POINT
from gear_rattle_ros.nodes import shared_memory
from gear_rattle_ros.nodes.pacing import WINDOW
from gear_rattle_ros.nodes.shared_memory import (
    make_room,
    MEMORY,
    PROFILES,
    SEGMENT,
    SPARE,
    TRANSPORTS,
)
from gear_rattle_ros.nodes.simulator import LARGEST_BATCH
from gear_rattle_ros.places import config_folder


@pytest.fixture(autouse=True)
def no_profile(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the environment as it was, and start without a profile."""
    for name in (*PROFILES, TRANSPORTS, 'RMW_IMPLEMENTATION'):
        monkeypatch.setenv(name, '')
        monkeypatch.delenv(name)


def with_free(monkeypatch: pytest.MonkeyPatch, megabytes: int) -> None:
    """Let the shared memory have so much free."""
    monkeypatch.setattr(shared_memory.os, 'statvfs', lambda path: types.SimpleNamespace(
        f_bavail=megabytes << 8, f_frsize=4096))


def test_a_window_of_batches_fits_in() -> None:
    """What is sent before the simulator waits is never overwritten; the profile says the same."""
    root = xml.etree.ElementTree.parse(config_folder('fastdds') / 'stream.xml').getroot()
    (size,) = (each.text for each in root.iter() if each.tag.endswith('segment_size'))
    assert int(size) == SEGMENT
    assert WINDOW * (LARGEST_BATCH * POINT.itemsize + 1024) < SEGMENT


def test_a_small_memory_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """DDS would die of a page that is not there; one line names what is free."""
    with_free(monkeypatch, 40)
    assert '/dev/shm has 40 MB free, and the stream wants 32 MB' in make_room()
    assert not any(name in os.environ for name in PROFILES)


def test_the_users_profile_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    """Who has configured DDS has done so."""
    with_free(monkeypatch, 1000)
    monkeypatch.setenv(PROFILES[0], 'mine.xml')
    assert make_room() == ''
    assert os.environ[PROFILES[0]] == 'mine.xml' and PROFILES[1] not in os.environ


@pytest.mark.parametrize(('name', 'value'), [
    (TRANSPORTS, 'UDPv4'), ('RMW_IMPLEMENTATION', 'rmw_cyclonedds_cpp')])
def test_other_transports_stay(monkeypatch: pytest.MonkeyPatch, name: str, value: str) -> None:
    """Nothing is asked for, and nothing said of a memory that is not used."""
    with_free(monkeypatch, 1)
    monkeypatch.setenv(name, value)
    assert make_room() == ''
    assert not any(profile in os.environ for profile in PROFILES)


def test_a_start_that_fails_leaves_no_segment(start: Callable) -> None:
    """Memory that nobody uses would soon be all there is."""
    before = set(MEMORY.glob('fastrtps_*'))
    simulator = start('simulator', '--ros-args', '-p', 'alpha:=-5.0')
    assert simulator.process.wait(60) == 2
    left = {path for path in set(MEMORY.glob('fastrtps_*')) - before
            if path.exists() and path.stat().st_size > SEGMENT}
    # Tests beside this one have segments of their own, which somebody maps.
    assert not left - mapped()


def test_the_simulator_has_it(start: Callable) -> None:
    """Its process maps a segment of that size."""
    memory = os.statvfs(MEMORY)
    if memory.f_bavail * memory.f_frsize < SEGMENT + SPARE:
        pytest.skip(f'{MEMORY} is too small')
    simulator = start('simulator')
    simulator.wait_for('ready', 120.0)
    assert max(segments(simulator.process.pid)) >= SEGMENT
    assert simulator.stop(signal.SIGINT) == 0


def mapped() -> set[Path]:
    """Return the segments that a process has."""
    found: set[Path] = set()
    for maps in Path('/proc').glob('[0-9]*/maps'):
        with contextlib.suppress(OSError):
            found |= {Path(line.split()[-1]) for line in maps.read_text().splitlines()
                      if '/dev/shm/fastrtps_' in line}
    return found


def segments(process: int) -> list[int]:
    """Return the sizes of the segments of Fast DDS that a process has [bytes]."""
    found = re.findall(r'^(\w+)-(\w+) .*/dev/shm/fastrtps_[0-9a-f]{16}$',
                       Path(f'/proc/{process}/maps').read_text(), re.MULTILINE)
    return [int(end, 16) - int(begin, 16) for begin, end in found]
