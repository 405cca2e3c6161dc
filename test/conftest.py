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

"""Real processes on real DDS, each test in a ROS domain of its own, nothing left behind."""

from collections.abc import Callable, Iterator
import contextlib
import fcntl
import os
from pathlib import Path
import signal
import time

from prepared import NodeProcess
import pytest

# Where Fast DDS has its segments, each beside a file that its process holds locked.
_MEMORY = Path('/dev/shm')
_LOCKS = 'fastrtps_' + 16 * '[0-9a-f]' + '_el'
_BEFORE = set(_MEMORY.glob(_LOCKS))
# Domains 1 to 101 keep clear of ephemeral ports.
_DOMAINS = iter(range(10_000))


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Remove the shared memory of nodes that were killed; workers leave it to the one session."""
    if hasattr(session.config, 'workerinput'):
        return
    for lock in set(_MEMORY.glob(_LOCKS)) - _BEFORE:
        with contextlib.suppress(OSError), open(lock, 'rb') as stream:
            # Refused while the process lives.
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            lock.with_name(lock.name.removesuffix('_el')).unlink(missing_ok=True)
            lock.unlink()


@pytest.fixture
def domain(monkeypatch: pytest.MonkeyPatch) -> int:
    """Return a ROS domain of the test's own, on this machine only."""
    # Workers of pytest-xdist take every other one.
    worker = int(os.environ.get('PYTEST_XDIST_WORKER', 'gw0')[2:]) % 2
    number = 1 + worker + 2 * ((os.getpid() + 7 * next(_DOMAINS)) % 50)
    monkeypatch.setenv('ROS_DOMAIN_ID', str(number))
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    monkeypatch.setenv('ROS_PYTHON_CHECK_FIELDS', '1')
    return number


@pytest.fixture
def start(domain: int, tmp_path: Path) -> Iterator[Callable[..., NodeProcess]]:
    """Start nodes; whatever still runs at the end is killed."""
    running: list[NodeProcess] = []

    def start_one(name: str, *arguments: str) -> NodeProcess:
        process = NodeProcess(name, list(arguments), tmp_path / f'{len(running)}_{name}.log')
        running.append(process)
        return process

    yield start_one
    for process in running:
        if process.process.poll() is None:
            os.killpg(process.process.pid, signal.SIGKILL)
            process.process.wait()


@pytest.fixture
def rclpy_node(domain: int):
    """Return an rclpy node of the test's own."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions
    context = rclpy.context.Context()
    rclpy.init(context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node('test_node', context=context)
    yield node
    node.destroy_node()
    context.try_shutdown()


@pytest.fixture
def spin(rclpy_node) -> Iterator[Callable[..., None]]:
    """Spin the test's node until a condition holds."""
    from rclpy.executors import SingleThreadedExecutor
    executor = SingleThreadedExecutor(context=rclpy_node.context)
    executor.add_node(rclpy_node)

    def spin_until(condition: Callable[[], object], within: float = 60.0) -> None:
        deadline = time.monotonic() + within
        while not condition():
            assert time.monotonic() < deadline, 'it did not come about in time'
            executor.spin_once(timeout_sec=0.05)

    yield spin_until
    # Before the node goes, which wakes the executor it is in.
    executor.remove_node(rclpy_node)
    executor.shutdown()
