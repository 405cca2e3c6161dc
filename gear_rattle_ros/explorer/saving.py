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

"""Saving a view: its dataset and picture, made by the command that reproduces them."""

from collections.abc import Callable
import datetime
from pathlib import Path
import shlex
import signal
import subprocess
import sys
import threading
from typing import Final

from .view import View

# How long a tool that is interrupted may take to write its tiles [s].
PATIENCE: Final = 5.0


class Saving:
    """Saves one view at a time, in a process of its own; a stopped one can be resumed."""

    def __init__(self, folder: Path, report: Callable[[str, bool], None]) -> None:
        self._folder = folder
        self._report = report
        self._process: subprocess.Popen[str] | None = None
        self._lock = threading.Lock()

    def begin(self, view: View) -> None:
        """Start saving a view, unless one is being saved, and report how it ends."""
        with self._lock:
            if self._process is not None:
                self._report('one view is still being saved', False)
                return
            now = datetime.datetime.now().strftime('%Y-%m-%d-%H%M%S-%f')[:-3]
            place = self._folder / f'{now}-{view.kind}'
            words = view.command(f'{view.kind}.zarr', f'{view.kind}.png')
            command = shlex.join(['gear_rattle', *words])
            try:
                place.mkdir(parents=True)
                (place / 'command.txt').write_text(command + '\n')
                self._process = subprocess.Popen(
                    [sys.executable, '-m', 'gear_rattle_ros.start', *words], cwd=place,
                    stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                    text=True)
            except OSError as error:
                self._report(f'cannot save in {place}: {error.strerror}', False)
                return
            threading.Thread(target=self._finish, args=(self._process, place), daemon=True).start()
        self._report(f'saving into {place} ...', True)

    def stop(self) -> None:
        """Stop saving; the tiles are kept, and the command in command.txt goes on."""
        process = self._process
        if process is not None and process.poll() is None:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                process.kill()

    def _finish(self, process: subprocess.Popen[str], place: Path) -> None:
        errors = process.communicate()[1].strip().splitlines()
        with self._lock:
            self._process = None
        if process.returncode == 0:
            self._report(f'saved in {place}: dataset, picture and the command for them', True)
        else:
            self._report(f'not saved: {errors[-1] if errors else process.returncode}', False)
