"""What a terminal sees of a tool at work: rate, time left, the first compilation."""

from collections.abc import Iterator
import contextlib
import math
import time
from typing import Any, Final, TextIO

from numba.core import event

from ..core.words import counted

# How often progress is told, on a terminal and elsewhere [s].
ON_TERMINAL: Final = 0.3
ELSEWHERE: Final = 10.0


class Progress:
    """
    Progress with rate and time left.

    On a terminal it is one line that is overwritten, elsewhere a line now and then.
    """

    def __init__(self, name: str, total: int, stream: TextIO) -> None:
        self._name = name
        self._total = total
        self._stream = stream
        self._terminal = stream.isatty()
        self._begin = self._told = time.monotonic()
        self._done = self._impacts = self._before = self._shown = 0

    def skip(self, done: int) -> None:
        """Count things done by an earlier run: they say nothing about the rate."""
        self._done += done
        self._before += done

    def add(self, done: int, impacts: int = 0) -> None:
        """Count things done just now, and the impacts that they took."""
        self._done += done
        self._impacts += impacts
        now = time.monotonic()
        if now - self._told >= (ON_TERMINAL if self._terminal else ELSEWHERE):
            self._told = now
            self._tell(now - self._begin)

    def end(self) -> None:
        """Leave the line of the terminal; elsewhere tell that all is done."""
        if self._told == self._begin:
            return
        if self._terminal:
            self._stream.write('\r\x1b[K')
            self._stream.flush()
        elif self._shown < self._done == self._total:
            self._tell(time.monotonic() - self._begin)

    def _tell(self, seconds: float) -> None:
        fresh, self._shown = self._done - self._before, self._done
        left = (self._total - self._done) * seconds / fresh if fresh else math.inf
        line = f'{self._name}: {self._done:,} of {self._total:,}'
        if self._impacts:
            line += f', {self._impacts / seconds / 1e6:.1f} million impacts/s'
        line += f', {in_words(left)} left' if fresh else ''
        self._stream.write(f'\r{line}\x1b[K' if self._terminal else line + '\n')
        self._stream.flush()


def in_words(seconds: float) -> str:
    """Put a duration [s] in words."""
    if seconds < 99.5:
        return f'{seconds:.0f} s'
    if seconds < 99.5 * 60.0:
        return f'{seconds / 60.0:.0f} min'
    return f'{seconds / 3600.0:.1f} h'


class Compilation(event.Listener):
    """
    Tell of the first compilation; kernels that come from the cache are no news.

    On a terminal the kernels are counted as they are compiled.
    """

    def __init__(self, name: str, stream: TextIO) -> None:
        self._name = name
        self._stream = stream
        self._terminal = stream.isatty()
        self._kernels = self._depth = 0
        self._begin = 0.0
        self._seconds = 0.0

    def on_start(self, event: Any) -> None:
        """Count a kernel whose compilation begins."""
        if not self._kernels:
            self._stream.write(f'{self._name}: compiling, once on this machine; this takes about '
                               'a minute ...\n')
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
        """Say how long it took."""
        if self._kernels:
            self._stream.write(f'{self._name}: compiled {counted(self._kernels, "kernel")} in '
                               f'{self._seconds:.0f} s; the next start has them\n')
            self._stream.flush()


@contextlib.contextmanager
def telling_of_compilation(name: str, stream: TextIO) -> Iterator[None]:
    """Tell of the first compilation while something runs."""
    listener = Compilation(name, stream)
    event.register('numba:compile', listener)
    try:
        yield
    finally:
        event.unregister('numba:compile', listener)
        listener.end()
