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

"""Child processes of the suite: the nodes, each with a log file, none left behind."""

import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from ..base.errors import UserError
from ..base.process import apart

# A node that has not ended is interrupted again after this time; interval of looking [s].
AGAIN = 2.0
POLL = 0.01


class Processes:
    """Nodes running as processes of this environment's own python."""

    def __init__(self, logs: Path) -> None:
        self._logs = logs
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, name: str, arguments: list[str]) -> None:
        with open(self.log(name), 'wb') as log:
            self._running[name] = subprocess.Popen(
                [sys.executable, '-m', 'gear_rattle_ros.start', name, *arguments],
                env=os.environ | {'PYTHONUNBUFFERED': '1'},
                **apart() | {'stdout': log, 'stderr': subprocess.STDOUT})

    def log(self, name: str) -> Path:
        return self._logs / f'{name}.log'

    def check(self) -> None:
        """Raise UserError where a node has ended."""
        for name, process in self._running.items():
            if process.poll() is not None:
                raise UserError(f'{name} has ended with status {process.returncode}: '
                                f'{self.last_words(name)}')

    def last_words(self, name: str) -> str:
        lines = self.log(name).read_text(errors='replace').split('\n')
        return next((line for line in reversed(lines) if line.strip()), '')

    def stop(self, names: list[str], within: float) -> None:
        """Interrupt some nodes together and wait for them [s]; then kill those that still run."""
        deadline = time.monotonic() + within
        stopping = {name: self._running.pop(name) for name in names if name in self._running}
        while stopping and time.monotonic() < deadline:
            # A node may lose a signal while it is imported; one that is closing ignores it.
            for process in stopping.values():
                process.send_signal(signal.SIGINT)
            again = min(time.monotonic() + AGAIN, deadline)
            while stopping and time.monotonic() < again:
                time.sleep(POLL)
                stopping = {name: process for name, process in stopping.items()
                            if process.poll() is None}
        for name, process in stopping.items():
            process.kill()
            process.wait()
            print(f'{name} had not ended after {within:g} s and was killed', file=sys.stderr)
