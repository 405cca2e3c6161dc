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

"""Progress of long work on a terminal: rate and time left."""

import math
import time
from typing import Final, Self, TextIO

# Time between two reports, on a terminal and elsewhere [s].
ON_TERMINAL: Final = 0.3
ELSEWHERE: Final = 10.0


class Progress:
    """Progress with rate and time left; it ends with its context."""

    # On a terminal it is one line that is overwritten, elsewhere a line now and then.
    def __init__(self, name: str, total: int, stream: TextIO, quiet: bool = False,
                 uneven: bool = False) -> None:
        self._every = math.inf if quiet else ON_TERMINAL if stream.isatty() else ELSEWHERE
        self._name = name
        # What is counted takes so different a time that none can be foreseen.
        self._uneven = uneven
        self._total = total
        self._stream = stream
        self._terminal = stream.isatty()
        self._begin = self._reported = time.monotonic()
        self._done = self._impacts = self._before = self._shown = 0

    def skip(self, done: int) -> None:
        """Count things done by an earlier run: they do not count for the rate."""
        self._done += done
        self._before += done

    def add(self, done: int, impacts: int = 0) -> None:
        """Count things done just now, and the impacts that they took."""
        self._done += done
        self._impacts += impacts
        now = time.monotonic()
        if now - self._reported >= self._every:
            self._reported = now
            self._report(now - self._begin)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        """Leave the line of the terminal; elsewhere report that all is done."""
        if self._reported == self._begin:
            return
        if self._terminal:
            self._stream.write('\r\x1b[K')
            self._stream.flush()
        elif self._shown < self._done == self._total:
            self._report(time.monotonic() - self._begin)

    def _report(self, seconds: float) -> None:
        fresh, self._shown = self._done - self._before, self._done
        left = (self._total - self._done) * seconds / fresh if fresh else math.inf
        line = f'{self._name}: {self._done:,} of {self._total:,}'
        if self._impacts:
            line += f', {self._impacts / seconds / 1e6:.1f} million impacts/s'
        line += f', {in_words(left)} left' if fresh and not self._uneven else ''
        self._stream.write(f'\r{line}\x1b[K' if self._terminal else line + '\n')
        self._stream.flush()


def in_words(seconds: float) -> str:
    """Put a duration [s] in words."""
    if seconds < 99.5:
        return f'{seconds:.0f} s'
    if seconds < 99.5 * 60.0:
        return f'{seconds / 60.0:.0f} min'
    return f'{seconds / 3600.0:.1f} h'
