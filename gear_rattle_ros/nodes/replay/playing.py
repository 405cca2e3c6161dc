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

"""The replay's other thread: sends a bag's messages when they are due and readers keep up."""

from collections.abc import Callable, Mapping
import dataclasses
import functools
import threading
import time
from typing import Final

from rclpy.duration import Duration

from ..base.pacing import AcknowledgedPace, PATIENCE
from ...bags import Bag

# Messages a publisher keeps and sends before all must be acknowledged. Fast DDS asks for
# acknowledgements when a history this small is full; with a larger one they may take 3 s.
WINDOW: Final = 64
# Playing begins when the readers have not changed for this time, or after the others [s]:
_SETTLED: Final = 1.0
# while there is no reader, and in any case.
_NOBODY: Final = 5.0
_LONGEST: Final = 10.0
# The clock's step, of wall time, or at speed 0 of recorded time [s].
_CLOCK_STEP: Final = 0.01
_AT_ONCE: Final = Duration(nanoseconds=0)


@dataclasses.dataclass(frozen=True)
class Span:
    """What to play, in times of messages [ns]; speed 0 is as fast as the readers keep up."""

    start: int
    end: int
    speed: float
    is_looped: bool


class Playing:
    """Plays a bag in a thread of its own; `failure` is one line for the user."""

    def __init__(self, bag: Bag, outputs: Mapping[str, AcknowledgedPace], span: Span, readers: int,
                 tick: Callable[[int], None] | None) -> None:
        self.messages = self.rounds = 0
        self.position = span.start
        self.state = 'waiting for readers'
        self.failure = ''
        self.is_over = False
        self._bag = bag
        self._outputs = outputs
        self._span = span
        self._readers = readers
        self._tick = tick
        self._ticked = 0
        self._next_tick = 0.0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name='playing', daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop, between two messages."""
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            self._await_readers()
            while not self._stop.is_set():
                self.state = 'playing'
                self._play()
                self._await_acknowledgements()
                self.rounds += not self._stop.is_set()
                if not self._span.is_looped:
                    break
        except Exception as error:
            # Damage to a bag may show only half-way through.
            self.failure = str(error) or type(error).__name__
            self._await_acknowledgements()
        self.is_over = True

    def _await_readers(self) -> None:
        begin = since = time.monotonic()
        before: list[int] = []
        while not self._stop.wait(0.02):
            now = time.monotonic()
            counts = [output.publisher.get_subscription_count()
                      for output in self._outputs.values()]
            if self._readers:
                if max(counts) >= self._readers:
                    return
                continue
            if counts != before:
                before, since = counts, now
            if now >= begin + _LONGEST or now >= since + (_SETTLED if any(counts) else _NOBODY):
                return

    def _play(self) -> None:
        span = self._span
        begin = time.monotonic()
        self._ticked = 0
        for message in self._bag.messages(list(self._outputs), span.start, span.end):
            if span.speed:
                self._sleep(begin, message.time)
            else:
                self._step(message.time)
            if self._stop.is_set():
                return
            self.position = message.time
            output = self._outputs[message.topic]
            output.is_clear(_AT_ONCE)
            output.publish(message.data)
            self.messages += 1
            self._await(output.may_publish)

    def _sleep(self, begin: float, moment: int) -> None:
        """Wait until a message is due, while the clock runs."""
        span = self._span
        due = begin + (moment - span.start) / 1e9 / span.speed
        while not self._stop.is_set():
            now = time.monotonic()
            if self._tick is not None and now >= self._next_tick:
                self._next_tick = max(self._next_tick, now - _CLOCK_STEP) + _CLOCK_STEP
                self._tick(span.start + round((min(now, due) - begin) * span.speed * 1e9))
            if now >= due:
                return
            self._stop.wait((due if self._tick is None else min(due, self._next_tick)) - now)

    def _step(self, moment: int) -> None:
        """Let the clock follow the messages where they do not follow the clock."""
        if self._tick is not None and moment >= self._ticked + _CLOCK_STEP * 1e9:
            self._ticked = moment
            self._tick(moment)

    def _await_acknowledgements(self) -> None:
        for output in self._outputs.values():
            self._await(functools.partial(output.is_clear, PATIENCE))

    def _await(self, is_ready: Callable[[], bool]) -> None:
        while not self._stop.is_set() and not is_ready():
            self.state = 'waiting for readers'
        self.state = 'playing'
