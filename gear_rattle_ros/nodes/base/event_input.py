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

"""The stream as a node receives it: batches of events, and whether they are whole."""

from collections.abc import Callable, Iterator, Mapping
import time
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.node import Node
from rclpy.subscription import Subscription
from sensor_msgs.msg import PointCloud2

from ...core.model import EventArray
from ...core.stream.guard import StreamGuard
from ...core.words import counted
from ...messages import events_from_cloud
from ...qos import STREAM_INPUT

# A node that ends takes in the batches that have arrived, for at most this long [s].
DRAIN_WITHIN = 0.5
# Batches taken in one callback.
TAKEN_AT_ONCE = 16
# Holes named in one line of the log; the others are counted in it.
NAMED_AT_ONCE = 20
STREAM_TYPE = 'sensor_msgs/msg/PointCloud2'


def arrived(subscription: Subscription, most: int) -> Iterator[tuple[Any, Mapping[str, Any]]]:
    """Yield messages that have arrived, with their info: cheaper than through the executor."""
    handle = subscription.handle
    for _ in range(most):
        with handle:
            taken = handle.take_message(subscription.msg_type, subscription.raw)
        if taken is None:
            return
        yield taken


class StreamHealth:
    """Logs and reports what a guard finds: where a reader joins, and every hole by its numbers."""

    def __init__(self, node: Node, guard: StreamGuard, consequence: str) -> None:
        self._node, self._guard, self._consequence = node, guard, consequence
        self._logged = (0, 0)
        self._joined = False

    def log(self) -> None:
        guard, log = self._guard, self._node.get_logger()
        # Both only grow; in the recorder another thread counts them.
        gaps, restarts = guard.gaps, guard.restarts
        if not self._joined and guard.first_index is not None:
            self._joined = True
            log.info(f'joined the stream at impact {guard.first_index}')
        fresh = gaps - self._logged[0]
        if fresh:
            latest = list(guard.holes)[-fresh:]
            words = '; '.join(hole.describe() for hole in latest[:NAMED_AT_ONCE])
            rest = fresh - min(len(latest), NAMED_AT_ONCE)
            more = f'; and {counted(rest, "more gap")}' if rest else ''
            log.warning(f'lost: {words}{more}; {self._consequence}')
        if restarts != self._logged[1]:
            log.info(f'the stream has restarted; {self._consequence}')
        self._logged = (gaps, restarts)

    def report(self) -> tuple[str, str, dict[str, object]]:
        """Return level, message and what was lost, for the diagnostics."""
        guard = self._guard
        level = 'warn'
        publishers = self._node.get_publishers_info_by_topic(
            self._node.resolve_topic_name('impacts'))
        foreign = [each for each in publishers if each.topic_type != STREAM_TYPE]
        if foreign:
            message = (f'{foreign[0].node_name} publishes impacts as {foreign[0].topic_type}, '
                       f'not {STREAM_TYPE}')
        elif len(publishers) > 1:
            message = f'{len(publishers)} publishers on impacts: their streams are mixed'
        elif self._joined and guard.gaps:
            message = f'{counted(guard.lost, "impact")} lost in {counted(guard.gaps, "gap")}'
        else:
            level, message = 'ok', 'whole' if self._joined else 'no impacts yet'
        return level, message, {
            'gaps': guard.gaps, 'lost_impacts': guard.lost, 'restarts': guard.restarts,
            **({'last_hole': guard.holes[-1].describe()} if guard.holes else {})}


class EventInput:
    """The subscription to `impacts`: hands every EVENT batch on, and refuses anything else."""

    def __init__(self, node: Node, guard: StreamGuard, take: Callable[[EventArray], object],
                 consequence: str) -> None:
        self.stamp = Time()
        self._log = node.get_logger()
        self.health = StreamHealth(node, guard, consequence)
        self._take = take
        self._batches = self._events = self._refused = 0
        self._last_refusal = ''
        self._before = (time.monotonic(), 0)
        self._subscription = node.create_subscription(
            PointCloud2, 'impacts', self._receive, STREAM_INPUT)

    def report(self, **own: object) -> tuple[str, str, dict[str, object]]:
        """Return level, message and values for the diagnostics, with the node's own at the end."""
        level, message, losses = self.health.report()
        now, (since, before) = time.monotonic(), self._before
        self._before = now, self._events
        return level, message, {
            'batches': self._batches, 'events': self._events,
            'events_per_second': (self._events - before) / max(now - since, 1e-9),
            'refused_batches': self._refused, **losses, **own}

    def drain(self) -> None:
        """Take in what has arrived: it was acknowledged, so nobody else keeps it for this node."""
        deadline = time.monotonic() + DRAIN_WITHIN
        while time.monotonic() < deadline and self._take_arrived(1):
            pass

    def _receive(self, cloud: PointCloud2) -> None:
        self._decode(cloud)
        self._take_arrived(TAKEN_AT_ONCE - 1)

    def _take_arrived(self, most: int) -> int:
        return sum(self._decode(cloud) for cloud, _ in arrived(self._subscription, most))

    def _decode(self, cloud: PointCloud2) -> int:
        try:
            events = events_from_cloud(cloud)
        except ValueError as error:
            self._refused += 1
            if str(error) != self._last_refusal:
                self._last_refusal = str(error)
                self._log.warning(f'refused a batch: {error}')
            return 1
        self._batches += 1
        self._events += len(events)
        self.stamp = cloud.header.stamp
        self._take(events)
        self.health.log()
        return 1
