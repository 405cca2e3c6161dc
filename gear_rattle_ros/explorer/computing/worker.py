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

"""Threads of a page that always compute what was asked for last."""

from collections.abc import Callable, Iterator
import threading
import traceback
from typing import Generic, TypeVar

from .catalogues import GivenUp

Asked = TypeVar('Asked')
Result = TypeVar('Result')


class Worker(Generic[Asked, Result]):
    """Computes one thing at a time; a new one replaces what is under way."""

    def __init__(self, compute: Callable[[Asked, Callable[[], None]], Iterator[Result]],
                 show: Callable[[Result], None], is_wanted: Callable[[], bool]) -> None:
        self._compute = compute
        self._show = show
        self._is_wanted = is_wanted
        self._changed = threading.Condition()
        self._asked: Asked | None = None
        self._number, self._stopped = 0, False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def ask(self, asked: Asked) -> None:
        """Compute this from now on."""
        with self._changed:
            self._asked = asked
            self._number += 1
            self._changed.notify()

    def stop(self) -> None:
        """Abandon what is under way, and end the thread."""
        with self._changed:
            self._stopped = True
            self._changed.notify()

    def join(self, seconds: float) -> bool:
        """Wait for the end of the thread; return whether it has ended."""
        self._thread.join(seconds)
        return not self._thread.is_alive()

    def _run(self) -> None:
        number = 0
        while True:
            with self._changed:
                while not self._stopped and self._number == number:
                    self._changed.wait()
                if self._stopped:
                    return
                asked, number = self._asked, self._number
            assert asked is not None

            def check(number: int = number) -> None:
                if self._stopped or number != self._number or not self._is_wanted():
                    raise GivenUp

            try:
                for result in self._compute(asked, check):
                    check()
                    self._show(result)
            except GivenUp:
                continue
            except Exception:
                # One that fails must not leave the page without its thread.
                traceback.print_exc()
