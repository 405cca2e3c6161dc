"""The replay: publishes the messages of a bag again, byte for byte."""

import argparse
from collections.abc import Mapping, Sequence
import importlib
import json
from pathlib import Path
import sys
from typing import Any, Final

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from .playing import Output, Playing, Span, WINDOW
from ..base.arguments import split_arguments
from ..base.dds_room import StreamingNode
from ..base.node import run_node, StartError
from ...bags import Bag, BagError, Topic
from ...core.words import counted
from ...messages import stamp_from_nanoseconds
from ...parameters import REPLAY
from ...qos import CLOCK

# What the nodes of then said of themselves is not true of those that run now.
_NOT_UNASKED: Final = ('/diagnostics', '/parameter_events')


class Replay(StreamingNode):
    """Publishes a bag's topics under their recorded names and qualities of service."""

    def __init__(self) -> None:
        super().__init__('replay', REPLAY)
        if not self.values['bag']:
            raise StartError('no bag is given; say replay BAG, or set the parameter bag')
        try:
            self._bag = Bag(Path(str(self.values['bag'])).expanduser())
        except BagError as error:
            raise StartError(str(error)) from None
        self._span = self._find_span()
        names = self._choose()
        outputs = {name: self._make_output(self._bag.topics[name]) for name in names}
        self._topics = len(outputs)
        self._clock_output = self.create_publisher(Clock, '/clock', CLOCK) \
            if self.values['clock'] else None
        if not self._bag.is_whole:
            self.get_logger().warning(f'{self._bag.path} was not closed properly; '
                                      'its complete chunks are played')
        self._playing = Playing(
            self._bag, outputs, self._span, int(self.values['wait_for_readers']),
            self._tick if self._clock_output else None)
        self.every(0.05, self._watch)

    @property
    def has_failed(self) -> bool:
        """Whether the bag could not be played to its end."""
        return bool(self._playing.failure)

    def report(self) -> tuple[str, str, Mapping[str, object]]:
        """Return how far it is."""
        playing = self._playing
        values = {
            'messages': playing.messages,
            'position': (playing.position - self._bag.start) / 1e9,
            'duration': (self._bag.end - self._bag.start) / 1e9,
            'rounds': playing.rounds,
            'bag': str(self._bag.path),
        }
        if playing.failure:
            return 'error', playing.failure, values
        return 'ok', playing.state, values

    def close(self) -> None:
        """Stop, and say what was published."""
        playing = self._playing
        playing.close()
        if playing.failure:
            print(f'replay: {playing.failure}', file=sys.stderr, flush=True)
        position = (playing.position - self._bag.start) / 1e9
        duration = (self._bag.end - self._bag.start) / 1e9
        print(f'replayed {counted(playing.messages, "message")} on '
              f'{counted(self._topics, "topic")}, '
              f'{"complete" if playing.rounds else "stopped"} at {position:.3f} s of '
              f'{duration:.3f} s, from {self._bag.path}', flush=True)

    def _find_span(self) -> Span:
        first, last = self._bag.start, self._bag.end
        start, end = self.number('start'), self.number('end')
        if not any(self._bag.counts.values()):
            raise StartError(f'{self._bag.path}: has no messages')
        if first + round(start * 1e9) > last:
            raise StartError(f'start = {start!r} is beyond the end of {self._bag.path} at '
                             f'{(last - first) / 1e9:.3f} s')
        if end and end < start:
            raise StartError(f'end = {end!r} is before start = {start!r}')
        return Span(first + round(start * 1e9), first + round(end * 1e9) if end else last,
                    self.number('speed'), bool(self.values['loop']))

    def _choose(self) -> list[str]:
        known = self._bag.topics
        asked = str(self.values['topics']).split()
        if not asked:
            names = [name for name in known if name not in _NOT_UNASKED]
        else:
            names = ['/' + name.lstrip('/') for name in asked]
            for name in names:
                if name not in known:
                    raise StartError(f'topics = {name} is not in {self._bag.path}; there are '
                                     f'{", ".join(sorted(known))}')
        if self.values['clock']:
            names = [name for name in names if name != '/clock']
        if not any(self._bag.counts[name] for name in names):
            raise StartError(f'{self._bag.path}: has no messages on the topics to be published; '
                             f'there are {", ".join(sorted(known))}')
        return names

    def _make_output(self, topic: Topic) -> Output:
        qos = _offered(topic.offered_qos)
        try:
            package, _, name = topic.type_name.split('/')
            kind = getattr(importlib.import_module(f'{package}.msg'), name)
        except (AttributeError, ImportError, ValueError):
            raise StartError(f'{topic.name} has the type {topic.type_name}, which is not '
                             'installed here; leave it out with topics') from None
        return Output(self.create_publisher(kind, topic.name, qos), qos.depth)

    def _tick(self, log_time: int) -> None:
        if self._clock_output is not None:
            self._clock_output.publish(Clock(clock=stamp_from_nanoseconds(log_time)))

    def _watch(self) -> None:
        self.is_finished = self._playing.is_over


def _offered(profiles: Sequence[Mapping[str, Any]]) -> QoSProfile:
    """Return what all recorded publishers offered; older bags have numbers for the words."""
    is_reliable = all(qos.get('reliability') not in ('best_effort', 2) for qos in profiles)
    is_latched = bool(profiles) and all(
        qos.get('durability') in ('transient_local', 1) for qos in profiles)
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=1 if is_latched else WINDOW,
        reliability=ReliabilityPolicy.RELIABLE if is_reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if is_latched else DurabilityPolicy.VOLATILE,
    )


def ros_arguments(arguments: Sequence[str]) -> list[str]:
    """Return the ROS arguments, with the plain ones said as ROS parameters."""
    plain, ros = split_arguments(arguments)
    texts = {table.name: table.description for table in REPLAY}
    parser = argparse.ArgumentParser(prog='replay', description='Publish a bag again.')
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
    # JSON is the YAML that ROS reads, and keeps a bag called 2026 a text.
    settings = [f'{name}:={json.dumps(value, ensure_ascii=False)}'
                for name, value in given.items() if value is not None]
    own = [part for setting in settings for part in ('-p', setting)]
    return [*ros, '--ros-args', *own] if own else ros


def main(arguments: list[str] | None = None) -> int:
    """Run the replay; exit status 1 if the bag proves damaged on the way."""
    made: list[Replay] = []

    def make() -> Replay:
        made.append(Replay())
        return made[0]

    given = sys.argv[1:] if arguments is None else arguments
    status = run_node('replay', make, ros_arguments(given))
    return status or int(any(node.has_failed for node in made))
