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

"""Ctrl-C during `make run` ends the suite, and make with 0."""

import os
from pathlib import Path
import pty
import signal
import subprocess
import sys
import time

import pytest

FOREGROUND = Path(__file__).parents[2] / 'tools' / 'foreground.py'
# It ends with 0 on the signal named, and prints when it is up.
PATIENT = """
import signal, sys, time
signal.signal(signal.{name}, lambda number, frame: sys.exit(0))
print('up', flush=True)
time.sleep(30)
sys.exit(7)
"""


@pytest.fixture
def makefile(tmp_path: Path) -> Path:
    """Return a Makefile that runs the patient program as `make run` does the suite."""
    (tmp_path / 'patient.py').write_text(PATIENT.format(name='SIGINT'))
    path = tmp_path / 'Makefile'
    path.write_text(f'run:\n\t@{sys.executable} -S {FOREGROUND} {sys.executable} patient.py\n')
    return path


def read_until(terminal: int, words: bytes) -> None:
    """Read from a terminal until it has shown some words."""
    shown = b''
    while words not in shown:
        shown += os.read(terminal, 1024)


def test_ctrl_c_ends_make_with_0(makefile: Path) -> None:
    """On a terminal Ctrl-C reaches the program alone, and its status is make's."""
    process, terminal = pty.fork()
    if process == 0:
        os.execvp('make', ['make', '-C', str(makefile.parent), 'run'])
    read_until(terminal, b'up')
    os.write(terminal, b'\x03')
    began = time.monotonic()
    _, status = os.waitpid(process, 0)
    os.close(terminal)
    assert os.waitstatus_to_exitcode(status) == 0
    assert time.monotonic() - began < 5.0


@pytest.mark.parametrize('name', ['SIGINT', 'SIGTERM'])
def test_signals_are_passed_on(name: str) -> None:
    """Without a terminal a signal reaches the program, whose status is returned."""
    process = subprocess.Popen(
        [sys.executable, '-S', str(FOREGROUND), sys.executable, '-c', PATIENT.format(name=name)],
        stdout=subprocess.PIPE, start_new_session=True)
    assert process.stdout is not None
    assert process.stdout.readline() == b'up\n'
    process.send_signal(getattr(signal, name))
    assert process.wait(5.0) == 0


def test_status_is_returned() -> None:
    """The exit status is the program's, or 128 and the signal that ended it."""
    run = [sys.executable, '-S', str(FOREGROUND)]
    assert subprocess.run([*run, 'sh', '-c', 'exit 3'], check=False).returncode == 3
    assert subprocess.run([*run, 'sh', '-c', 'kill -9 $$'], check=False).returncode == 128 + 9
