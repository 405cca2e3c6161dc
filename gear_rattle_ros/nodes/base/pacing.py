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

"""How fast the simulator may publish: by the clock, or by what its readers acknowledge."""

import time
from typing import Any

from rclpy.duration import Duration
from rclpy.publisher import Publisher

# Batches published before every reader must have acknowledged them; far below STREAM_DEPTH.
WINDOW = 400
# Length of one wait for acknowledgements: parameters and Ctrl-C are served in between.
PATIENCE = Duration(nanoseconds=20_000_000)


class AcknowledgedPace:
    """Publish no faster than the slowest matched reliable reader takes the messages."""

    # A reader that keeps everything acknowledges a batch only when it has room for it, so nothing
    # is dropped. A reader that has died holds the stream up until DDS gives up on it (20 s).
    def __init__(self, publisher: Publisher, window: int = WINDOW) -> None:
        self.waiting_since: float | None = None
        self.publisher = publisher
        # Never more than the publisher keeps.
        depth = publisher.qos_profile.depth
        self._window = min(window, depth) if depth else window
        self._open = 0

    def publish(self, message: Any) -> None:
        self.publisher.publish(message)
        self._open += 1

    def may_publish(self) -> bool:
        """Whether there is room for another message; waits a moment where there is none."""
        return self._open < self._window or self.is_clear(PATIENCE)

    def is_clear(self, patience: Duration) -> bool:
        """Whether everything is acknowledged, within some time."""
        if self._open and not self.publisher.wait_for_all_acked(patience):
            self.waiting_since = self.waiting_since or time.monotonic()
            return False
        self._open, self.waiting_since = 0, None
        return True


class ClockPace:
    """Drive periods that are due since the last call, at a rate per second of wall time."""

    def __init__(self, longest: float) -> None:
        self.lag = 0.0
        self._longest = longest
        self._before = time.monotonic()

    def due(self, rate: float) -> float:
        """Return the drive periods due; time beyond the longest tick is skipped, as lag [s]."""
        now = time.monotonic()
        passed = now - self._before
        self._before = now
        self.lag = max(passed - self._longest, 0.0)
        return rate * min(passed, self._longest)
