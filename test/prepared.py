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

"""Programs of the package in processes that are forked from one that has imported them."""

import contextlib
import functools
import gc
import importlib
import json
import os
from pathlib import Path
import select
import signal
import socket
import subprocess
import sys
import time
import traceback
from typing import NoReturn

# Their imports, and with them those of all others.
NODES = ('simulator', 'lyapunov', 'transients', 'basin', 'recorder', 'replay', 'viewer', 'suite')


class Process:
    """What tests use of `subprocess.Popen`: `gear_rattle ARGUMENTS` in a session of its own."""

    def __init__(self, arguments: list[str], output: int) -> None:
        """Start it with this process's environment; what it writes goes to the descriptor."""
        self._reports, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        request = json.dumps([arguments, os.getcwd(), dict(os.environ)])
        socket.send_fds(_server(), [request.encode()], [output, theirs.fileno()])
        theirs.close()
        self.pid = int(self._reports.recv(64))
        self.returncode: int | None = None

    def poll(self, within: float | None = 0.0) -> int | None:
        """Return its exit status, or None while it runs."""
        if self.returncode is None and select.select([self._reports], [], [], within)[0]:
            self.returncode = int(self._reports.recv(64))
            self._reports.close()
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Return its exit status."""
        status = self.poll(timeout)
        if status is None:
            raise subprocess.TimeoutExpired(str(self.pid), timeout or 0.0)
        return status

    def send_signal(self, number: int) -> None:
        """Send it a signal if it still runs."""
        if self.poll() is None:
            os.kill(self.pid, number)


class NodeProcess:
    """A node of the package in a process of its own."""

    def __init__(self, name: str, arguments: list[str], log: Path) -> None:
        """Start it."""
        self.log = log
        with open(log, 'wb') as output:
            self.process = Process([name, *arguments], output.fileno())

    def text(self) -> str:
        """Return what it has written."""
        return self.log.read_text(errors='replace')

    def wait_for(self, words: str, within: float = 60.0) -> None:
        """Wait until it has written some words."""
        deadline = time.monotonic() + within
        while words not in self.text():
            assert time.monotonic() < deadline, f'no {words!r} in: {self.text()}'
            assert self.process.poll() is None or words in self.text(), self.text()
            time.sleep(0.02)

    def stop(self, number: int = signal.SIGINT, within: float = 30.0) -> int:
        """Send a signal and return the exit status."""
        self.process.send_signal(number)
        return self.process.wait(within)


@functools.cache
def _server() -> socket.socket:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    subprocess.Popen([sys.executable, __file__, str(theirs.fileno())], start_new_session=True,
                     stdin=subprocess.DEVNULL, pass_fds=[theirs.fileno()],
                     env=os.environ | {'ROS_PYTHON_CHECK_FIELDS': '1'})
    theirs.close()
    return ours


def _serve(requests: socket.socket) -> None:
    """Import everything, load the kernels of a stream, and fork until the tests have ended."""
    from gear_rattle_ros import start
    os.environ |= start.ENVIRONMENT['viewer']
    for name in NODES:
        importlib.import_module(f'gear_rattle_ros.{start.EXECUTABLES[name]}')
    from gear_rattle_ros import Parameters, RunningLyapunov, Simulation, State, TransientDetector
    events = Simulation(Parameters(), State(velocity=-0.5)).advance(10**8, 0.0, 100)
    RunningLyapunov().update(events)
    TransientDetector().update(events)
    gc.freeze()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    while True:
        request, descriptors, _, _ = socket.recv_fds(requests, 1 << 20, 2)
        if not request:
            return
        output, reports = descriptors
        if os.fork() == 0:
            requests.close()
            _watch(*json.loads(request), output, reports)
        os.close(output)
        os.close(reports)


def _watch(arguments: list[str], folder: str, environment: dict[str, str], output: int,
           reports: int) -> NoReturn:
    """Fork the program; report its number, and its status when it has ended."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    process = os.fork()
    if process == 0:
        os.close(reports)
        os.setsid()
        for stream in (1, 2):
            os.dup2(output, stream)
        os.close(output)
        os.chdir(folder)
        os.environ.clear()
        os.environ.update(environment)
        _run(arguments)
    os.close(output)
    os.write(reports, str(process).encode())
    status = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    with contextlib.suppress(BrokenPipeError):
        os.write(reports, str(status).encode())
    os._exit(0)


def _run(arguments: list[str]) -> NoReturn:
    from gear_rattle_ros import start
    sys.argv = ['gear_rattle', *arguments]
    status = 1
    try:
        start.gear_rattle()
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else 0
    except BaseException:
        traceback.print_exc()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    os._exit(status)


if __name__ == '__main__':
    _serve(socket.socket(fileno=int(sys.argv[1])))
