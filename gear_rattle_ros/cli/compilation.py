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

"""The first compilation, which takes about a minute, reported on stderr."""

from collections.abc import Iterator
import contextlib
import time
from typing import Any, TextIO

from numba.core import event

from ..core.words import counted


class Compilation(event.Listener):
    """Report the first compilation, on a terminal kernel by kernel; none from the cache."""

    def __init__(self, name: str, stream: TextIO) -> None:
        self._name = name
        self._stream = stream
        self._terminal = stream.isatty()
        self._kernels = self._depth = 0
        self._begin = 0.0
        self._seconds = 0.0

    def on_start(self, event: Any) -> None:
        if not self._kernels:
            # A line of progress may stand there.
            clear = '\r\x1b[K' if self._terminal else ''
            self._stream.write(f'{clear}{self._name}: compiling, once on this machine; this takes '
                               'about a minute ...\n')
        if not self._depth:
            self._begin = time.monotonic()
        self._kernels += 1
        self._depth += 1
        if self._terminal:
            so_far = self._seconds + time.monotonic() - self._begin
            self._stream.write(f'\r{self._name}: compiling kernel {self._kernels}, '
                               f'{so_far:.0f} s so far\x1b[K')
        self._stream.flush()

    def on_end(self, event: Any) -> None:
        """Add up the time; kernels that another needs are compiled within its own."""
        self._depth -= 1
        if not self._depth:
            self._seconds += time.monotonic() - self._begin
            if self._terminal:
                self._stream.write('\r\x1b[K')
                self._stream.flush()

    def end(self) -> None:
        if self._kernels:
            self._stream.write(f'{self._name}: compiled {counted(self._kernels, "kernel")} in '
                               f'{self._seconds:.0f} s; they are kept on disk\n')
            self._stream.flush()


@contextlib.contextmanager
def reporting_compilation(name: str, stream: TextIO) -> Iterator[None]:
    """Report the first compilation while something runs."""
    listener = Compilation(name, stream)
    event.register('numba:compile', listener)
    try:
        yield
    finally:
        event.unregister('numba:compile', listener)
        listener.end()
