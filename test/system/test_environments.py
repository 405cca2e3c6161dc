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

"""Programs where something is missing that they take for granted: the work is done, or a line."""

import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from bag_maker import batches, make_bag, story
import pytest
from sensor_msgs.msg import PointCloud2

from gear_rattle_ros.core.compiled import cache_directory
from gear_rattle_ros.qos import STREAM

PROGRAM = [sys.executable, '-m', 'gear_rattle_ros.start']
NOBODY = ['unshare', '--user', '--map-user=54321']
MOUNTED = ['unshare', '--user', '--map-root-user', '--mount', 'sh', '-ec']
# Settings of the environment, None for those that are missing; and what the program is run by.
HOSTILE: dict[str, tuple[dict[str, str | None], list[str]]] = {
    'the backend of a notebook': ({'MPLBACKEND': 'module://missing.backend'}, []),
    'an unknown backend': ({'MPLBACKEND': 'nonsense'}, []),
    'no home and no name': ({'HOME': None, 'USER': None}, NOBODY),
    'a home not to be written': ({'HOME': '{}/home'}, NOBODY),
    'no temporary folder': ({'TMPDIR': '/missing'}, []),
    'a full temporary folder': ({'TMPDIR': '/mnt'}, [
        *MOUNTED, 'mount -t tmpfs -o size=4k none /mnt; head -c 4096 /dev/zero > /mnt/fill; '
        'exec "$@"', 'sh']),
    'a locale without UTF-8': (
        {'LC_ALL': 'C', 'PYTHONUTF8': '0', 'PYTHONCOERCECLOCALE': '0'}, []),
    'little shared memory': ({}, [
        *MOUNTED, 'mount -t tmpfs -o size=64k none /dev/shm; exec "$@"', 'sh']),
    'no shared memory': ({}, [
        *MOUNTED, 'mount -t tmpfs -o size=4k none /dev/shm; mount -o remount,ro none /dev/shm; '
        'exec "$@"', 'sh']),
}
FULL = [*MOUNTED, 'mount -t tmpfs -o size=64k none /dev/shm; '
        'head -c 65536 /dev/zero > /dev/shm/fill || true; exec "$@"', 'sh']


# Another user, who may read our files and write none.
OTHER = ['setpriv', '--reuid=54321', '--regid=54321', '--clear-groups',
         '--inh-caps=+dac_read_search', '--ambient-caps=+dac_read_search']


def environment(changes: dict[str, str | None], place: Path) -> dict[str, str]:
    """Return the environment with changes in a place; what is compiled stays compiled."""
    folder = cache_directory()
    assert folder is not None
    changed = {**os.environ, 'NUMBA_CACHE_DIR': str(folder.parent), **changes}
    return {name: value.replace('{}', str(place)) for name, value in changed.items()
            if value is not None}


def require(wrapper: list[str]) -> None:
    """Skip where this user may not make such an environment."""
    if subprocess.run([*wrapper, 'true'], capture_output=True, check=False).returncode:
        pytest.skip('namespaces are not allowed here')


@pytest.mark.parametrize('name', [
    pytest.param(name, marks=() if name.startswith('a home') else pytest.mark.long)
    for name in HOSTILE])
def test_a_tool_and_a_node_do_their_work(name: str, domain: int, tmp_path: Path) -> None:
    """A picture is drawn and a bag recorded, and nobody sees a traceback."""
    changes, wrapper = HOSTILE[name]
    require(wrapper)
    make_bag(tmp_path / 'bag', batches(story(500)))
    (tmp_path / 'home').mkdir(mode=0o555)
    (tmp_path / 'temporary').mkdir()
    settings = environment({'TMPDIR': '{}/temporary', **changes}, tmp_path)
    started = [
        subprocess.Popen([*wrapper, *PROGRAM, *words], stdin=subprocess.DEVNULL,
                         stdout=subprocess.PIPE, stderr=subprocess.STDOUT, cwd=tmp_path,
                         env=settings)
        for words in (['summary', 'bag', '--output', 'picture.png'],
                      ['recorder', '--ros-args', '-p', 'output:=new'])]
    tool, node = started
    try:
        words = tool.communicate(timeout=120)[0].decode()
        assert tool.returncode == 0, words
        assert (tmp_path / 'picture.png').stat().st_size > 1000
        deadline = time.monotonic() + 60.0
        while not (tmp_path / 'new' / 'metadata.yaml').exists() and node.poll() is None:
            assert time.monotonic() < deadline
            time.sleep(0.05)
        node.send_signal(signal.SIGINT)
        said = node.communicate(timeout=60)[0].decode()
    finally:
        for process in started:
            process.kill()
            process.wait()
    assert node.returncode == 0, said
    assert 'recorded ' in said and 'Traceback' not in words + said
    assert ('messages go over UDP' in said) == ('shared memory' in name)


@pytest.mark.long
@pytest.mark.parametrize('discovery', ['SUBNET', 'LOCALHOST'])
def test_nodes_of_two_users(start, rclpy_node, spin, tmp_path: Path,
                            discovery: str) -> None:
    """They hear each other over UDP, as neither writes into the other's memory, or one ends."""
    require(OTHER)
    home = tmp_path / 'home'
    home.mkdir()
    os.chown(home, 54321, 54321)
    clouds: list[PointCloud2] = []
    rclpy_node.create_subscription(PointCloud2, 'impacts', clouds.append, STREAM)
    own = start('lyapunov')
    own.wait_for('ready')
    theirs = environment({'HOME': '{}/home', 'TMPDIR': '{}/home',
                          'ROS_AUTOMATIC_DISCOVERY_RANGE': discovery}, tmp_path)
    with (tmp_path / 'log').open('w') as log:
        other = subprocess.Popen([*OTHER, *PROGRAM, 'simulator'], cwd=home, env=theirs,
                                 stdout=log, stderr=log)
    said = 'simulator: another user has nodes in this domain'
    if discovery == 'LOCALHOST':
        assert other.wait(60) == 2
        assert (tmp_path / 'log').read_text() == f'{said}; set ROS_DOMAIN_ID to another\n'
        return
    try:
        spin(lambda: len(clouds) > 20, 120.0)
        own.wait_for('joined the stream')
    finally:
        other.send_signal(signal.SIGINT)
        assert other.wait(30) == 0
    assert (tmp_path / 'log').read_text().startswith(f'{said}: messages go over UDP, which is sl')
    assert 'UDP' not in own.text()


def test_shared_memory_that_is_full_is_named(domain: int, tmp_path: Path) -> None:
    """Tracing would end the node with SIGBUS."""
    require(FULL)
    done = subprocess.run([*FULL, *PROGRAM, 'lyapunov'], capture_output=True, text=True,
                          timeout=60, check=False)
    assert (done.returncode, done.stdout) == (2, '')
    assert done.stderr == 'lyapunov: /dev/shm is full; remove what nobody needs there\n'


@pytest.mark.parametrize('words', [
    'exec "$@" >&-',
    pytest.param('"$@" | true; exit "${PIPESTATUS[0]}"', marks=pytest.mark.long)])
def test_who_reads_the_output_may_be_gone(words: str, domain: int, tmp_path: Path) -> None:
    """A recorder ends as always: its bag is whole, its status 0."""
    node = subprocess.Popen(
        ['bash', '-c', words, 'bash', *PROGRAM, 'recorder', '--ros-args', '-p',
         f'output:={tmp_path}/bag'], stderr=subprocess.PIPE, start_new_session=True)
    deadline = time.monotonic() + 60.0
    while not (tmp_path / 'bag' / 'metadata.yaml').exists():
        assert time.monotonic() < deadline and node.poll() is None
        time.sleep(0.05)
    time.sleep(0.5)
    # The shell passes it over while the node runs.
    subprocess.run(['pkill', '-INT', '-g', str(node.pid), '-f', 'start recorder'], check=True)
    said = node.communicate(timeout=60)[1].decode()
    assert node.returncode == 0, said
    assert 'Traceback' not in said
