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

"""A terminal that delivers every key at once, and is always restored to what it was."""

import contextlib
import os
import select
import shutil
import signal
import sys
import termios
import tty
from types import FrameType, TracebackType
from typing import Any


class Terminal:
    """Context in which stdin delivers keys without Enter and without echo."""

    # The caller handles SIGINT and SIGTERM; Ctrl-Z stops the program with the terminal as it was.
    def __init__(self) -> None:
        self.was_continued = False
        self._input = sys.stdin.fileno()
        self._before = termios.tcgetattr(self._input)
        self._handlers: dict[int, Any] = {}
        self._line = False

    def __enter__(self) -> 'Terminal':
        for number, handler in ((signal.SIGTSTP, self._suspend), (signal.SIGCONT, self._continue)):
            self._handlers[number] = signal.signal(number, handler)
        self._set()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        # If it is continued from here on, it must not set the terminal again.
        signal.signal(signal.SIGCONT, self._handlers[signal.SIGCONT])
        self._restore()
        signal.signal(signal.SIGTSTP, self._handlers[signal.SIGTSTP])

    def read(self, within: float) -> bytes | None:
        """Return what was typed within some time [s], b'' for nothing; None at the end."""
        ready, _, _ = select.select([self._input], [], [], within)
        if not ready:
            return b''
        try:
            return os.read(self._input, 1024) or None
        except OSError:
            # The terminal was closed.
            return None

    def show(self, line: str) -> None:
        """Replace the last line of the screen."""
        width = shutil.get_terminal_size().columns - 1
        self._write(f'\r\x1b[K{line[:width]}')
        self._line = True

    def write_lines(self, text: str) -> None:
        self._write('\r\x1b[K' + text + '\n')
        self._line = False

    def _write(self, text: str) -> None:
        # A terminal that is gone is noticed when it is read.
        with contextlib.suppress(OSError):
            sys.stdout.write(text)
            sys.stdout.flush()

    def _set(self) -> None:
        # Ctrl-C and Ctrl-Z still send their signals.
        tty.setcbreak(self._input, termios.TCSANOW)

    def _restore(self) -> None:
        with contextlib.suppress(termios.error):
            termios.tcsetattr(self._input, termios.TCSANOW, self._before)
        if self._line:
            self._write('\n')
            self._line = False

    def _suspend(self, number: int, frame: FrameType | None) -> None:
        self._restore()
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        # The process stops in this call until it is continued; where no shell could continue it,
        # the system does not stop it at all, and there is no SIGCONT.
        os.kill(os.getpid(), signal.SIGTSTP)
        signal.signal(signal.SIGTSTP, self._suspend)
        self._continue(number, frame)

    def _continue(self, number: int, frame: FrameType | None) -> None:
        # In the background the terminal belongs to others: the system stops this call until then.
        with contextlib.suppress(termios.error):
            self._set()
        self.was_continued = True
