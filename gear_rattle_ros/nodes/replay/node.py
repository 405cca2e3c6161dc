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

"""The replay: publishes the messages of a bag again, byte for byte."""

import argparse
from collections.abc import Mapping, Sequence
import contextlib
import importlib
from pathlib import Path
import sys
from typing import Any, Final

from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock

from .playing import Playing, Span, WINDOW
from ..base.arguments import overrides, split_arguments
from ..base.dds_room import make_room
from ..base.errors import UserError
from ..base.node import ReportingNode
from ..base.pacing import AcknowledgedPace
from ..base.process import run_node, say
from ...bags import Bag, BagError, Topic
from ...core.words import counted
from ...messages import stamp_from_nanoseconds
from ...parameters import REPLAY
from ...places import program
from ...qos import check_overrides, CLOCK, OVERRIDING, profile

# What recorded nodes reported on themselves is not true of those that run now.
_NOT_UNASKED: Final = ('/diagnostics', '/parameter_events')


class Replay(ReportingNode):
    """Publishes a bag's topics under their recorded names and qualities of service."""

    def __init__(self, **options: Any) -> None:
        super().__init__('replay', **options)
        if not self.values['bag']:
            raise UserError(f'no bag is given; use {program("replay")} BAG, or the parameter bag')
        try:
            self._bag = Bag(Path(str(self.values['bag'])).expanduser())
        except BagError as error:
            raise UserError(str(error)) from None
        self._span = self._find_span()
        kinds = self._choose()
        check_overrides(self.given, {'publisher': [self.resolve_topic_name(name)
                                                   for name in kinds]})
        outputs = {name: self._make_output(self._bag.topics[name], kind)
                   for name, kind in kinds.items()}
        self._topics = len(outputs)
        clock = self.create_publisher(Clock, '/clock', CLOCK) if self.values['clock'] else None
        if not self._bag.is_whole:
            self.get_logger().warning(f'{self._bag.path} was not closed properly; '
                                      'its complete chunks are played')
        self._playing = Playing(
            self._bag, outputs, self._span, int(self.values['wait_for_readers']),
            None if clock is None else lambda log_time: clock.publish(
                Clock(clock=stamp_from_nanoseconds(log_time))))
        self.every(0.05, self._watch)

    def report(self) -> tuple[str, str, Mapping[str, object]]:
        playing = self._playing
        position, duration = self._times()
        return 'error' if playing.failure else 'ok', playing.failure or playing.state, {
            'messages': playing.messages, 'position': position, 'duration': duration,
            'rounds': playing.rounds, 'bag': str(self._bag.path)}

    def close(self) -> None:
        playing = self._playing
        playing.close()
        if playing.failure:
            self.exit_status = 1
            print(f'replay: {playing.failure}', file=sys.stderr, flush=True)
        position, duration = self._times()
        say(f'replayed {counted(playing.messages, "message")} on '
            f'{counted(self._topics, "topic")}, '
            f'{"complete" if playing.rounds else "stopped"} at {position:.3f} s of '
            f'{duration:.3f} s, from {self._bag.path}')

    def _times(self) -> tuple[float, float]:
        start = self._bag.start
        return (self._playing.position - start) / 1e9, (self._bag.end - start) / 1e9

    def _find_span(self) -> Span:
        first, last = self._bag.start, self._bag.end
        start, end = self.number('start'), self.number('end')
        if not any(self._bag.counts.values()):
            raise UserError(f'{self._bag.path} has no messages')
        if first + round(start * 1e9) > last:
            raise UserError(f'start = {start!r} is beyond the end of {self._bag.path} at '
                            f'{(last - first) / 1e9:.3f} s')
        if end and end < start:
            raise UserError(f'end = {end!r} is before start = {start!r}')
        return Span(first + round(start * 1e9), first + round(end * 1e9) if end else last,
                    self.number('speed'), bool(self.values['loop']))

    def _choose(self) -> dict[str, type]:
        """Return the types of the topics to be published; those not installed are left out."""
        known = self._bag.topics
        named = ['/' + name.lstrip('/') for name in str(self.values['topics']).split()]
        for name in named:
            if name not in known:
                raise UserError(f'topics = {name} is not in {self._bag.path}; it has '
                                f'{", ".join(sorted(known))}')
        names = named or [name for name in known if name not in _NOT_UNASKED]
        if self.values['clock']:
            names = [name for name in names if name != '/clock']
        kinds = {name: kind for name in names if (kind := _message_type(known[name]))}
        lacking = ', '.join(f'{name} ({known[name].type_name or "no type"}, '
                            f'{known[name].serialization})' for name in names if name not in kinds)
        if lacking and (named or not kinds):
            raise UserError(f'{self._bag.path}: cannot publish {lacking}: the type is not '
                            'installed here, or the messages are not in CDR')
        if not any(self._bag.counts[name] for name in kinds):
            raise UserError(f'{self._bag.path} has no messages on the topics to be published; '
                            f'it has the topics {", ".join(sorted(known))}')
        if lacking:
            self.get_logger().warning('left out, as the type is not installed here or the '
                                      f'messages are not in CDR: {lacking}')
        return kinds

    def _make_output(self, topic: Topic, kind: type) -> AcknowledgedPace:
        qos = _offered(topic.offered_qos)
        return AcknowledgedPace(self.create_publisher(
            kind, topic.name, qos, qos_overriding_options=OVERRIDING), WINDOW)

    def _watch(self) -> None:
        self.is_finished = self._playing.is_over


def _message_type(topic: Topic) -> type | None:
    """Return the type of a topic's messages; None if it is not installed, or they are not CDR."""
    with contextlib.suppress(AttributeError, ImportError, ValueError):
        package, _, name = topic.type_name.split('/')
        if topic.serialization == 'cdr':
            kind: type = getattr(importlib.import_module(f'{package}.msg'), name)
            return kind
    return None


def _offered(profiles: Sequence[Mapping[str, Any]]) -> QoSProfile:
    """Return what all recorded publishers offered; older bags have numbers instead of words."""
    is_reliable = all(qos.get('reliability') not in ('best_effort', 2) for qos in profiles)
    is_latched = bool(profiles) and all(
        qos.get('durability') in ('transient_local', 1) for qos in profiles)
    return profile(1 if is_latched else WINDOW, is_reliable=is_reliable, is_latched=is_latched)


def ros_arguments(arguments: Sequence[str]) -> list[str]:
    """Return the ROS arguments, with the plain ones turned into ROS parameters."""
    plain, ros = split_arguments(arguments)
    texts = {table.name: table.description for table in REPLAY}
    parser = argparse.ArgumentParser(prog=program('replay'), description='Publish a bag again.')
    parser.add_argument('bag', nargs='?', help=texts['bag'])
    for name, unit in (('speed', 'FACTOR'), ('start', 'SECONDS'), ('end', 'SECONDS')):
        parser.add_argument(f'--{name}', type=float, metavar=unit, help=texts[name])
    for name in ('loop', 'clock'):
        parser.add_argument(f'--{name}', action='store_true', default=None, help=texts[name])
    parser.add_argument('--topics', nargs='+', metavar='TOPIC', help=texts['topics'])
    parser.add_argument('--wait-for-readers', type=int, metavar='N',
                        help=texts['wait_for_readers'])
    given = vars(parser.parse_args(plain))
    if given['topics']:
        given['topics'] = ' '.join(given['topics'])
    own = overrides({name: value for name, value in given.items() if value is not None})
    return [*ros, '--ros-args', *own] if own else ros


def main(arguments: list[str] | None = None) -> int:
    """Run the replay; the exit status is 1 if the bag turns out to be damaged."""
    given = sys.argv[1:] if arguments is None else arguments
    return run_node('replay', Replay, ros_arguments(given), room=make_room)
