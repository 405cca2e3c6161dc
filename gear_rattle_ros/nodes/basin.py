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

"""The basins at the present parameters: coarse at once, finer while the parameters stay."""

from collections.abc import Callable, Mapping, Sequence
import contextlib
import dataclasses
import functools
import os
from pathlib import Path
import queue
import threading
import time
from typing import Any, Final

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from sensor_msgs.msg import Image, PointCloud2
from visualization_msgs.msg import MarkerArray

from .base.event_input import arrived
from .base.node import ReportingNode
from .base.process import run_node
from .base.scales import nice_limit
from .. import messages
from ..attractors.catalogue import Attractor, Catalogue, Kind, others_where
from ..attractors.finding import CONSERVES, conserves_areas, find_attractors
from ..attractors.matching import points_of, recognise, Trace
from ..attractors.plane import DISPLACEMENT, Plane, STROBE
from ..attractors.skeleton.kicks import Kick, smallest_kick
from ..attractors.skeleton.skeleton import skeletons
from ..attractors.watching import Basins, Dropped, glance, sizes_up_to, watch, WHOLE_FROM
from ..core.flight.lanes import make_initial_conditions
from ..core.many.chaotic_sets import BRIEF
from ..core.many.settling import UNSETTLED
from ..core.model import EventArray, Parameters, Wall
from ..core.words import counted
from ..palette import colours_of, painted
from ..qos import LATCHED, NEWEST

# Interval at which the newest event is read [s].
POLL: Final = 0.01
# Parameters that stay for this time have settled; until then pictures are coarse [s].
SETTLED: Final = 0.05
# Time between two looks at where the present trajectory leads [s], and impacts of one.
LOOK: Final = 1.0
LOOK_CAP: Final = 2_000
# Steps of the scans for kicks: each takes a few tenths of a second.
KICK_STEPS: Final = 128
# Highest velocity of the plane, in units of the fastest impact's.
ROOM: Final = 1.5
POINT: Final = np.dtype([('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('rgb', '<f4'),
                         ('label', '<i4'), ('share', '<f4')])


def give_way(niceness: int) -> None:
    """Make niceness count against other sessions: Linux first shares its time among those."""
    if os.getsid(0) == os.getpid():
        # Linux without autogroups has no such file; there niceness counts as it is.
        with contextlib.suppress(OSError):
            Path('/proc/self/autogroup').write_text(str(niceness))


class Unwatched(MutuallyExclusiveCallbackGroup):
    """A group the executor never runs: its subscription is read when there is time for it."""

    def can_execute(self, entity: Any) -> bool:
        return False


@dataclasses.dataclass(frozen=True)
class Wanted:
    """Parameters, their place in the stream, and when they arrived [s of wall time]."""

    parameters: Parameters
    epoch: int
    stamp: Time
    since: float
    # Whether the previous parameters had not settled.
    is_passing: bool


@dataclasses.dataclass(frozen=True)
class Settings:
    sizes: tuple[int, ...]
    plane: Plane
    velocity_limit: float
    cap: int
    threads: int
    niceness: int
    frame: str = messages.SECTION_FRAME
    has_skeleton: bool = True


@dataclasses.dataclass(frozen=True)
class Memory:
    """What one picture leaves to the next: colours, and the limit of the velocity."""

    traces: tuple[Trace, ...] = ()
    limit: float = 0.0


@dataclasses.dataclass(frozen=True)
class Picture:
    """Messages that are published together, and what the next picture needs."""

    image: Image
    attractors: PointCloud2
    state: DiagnosticArray
    memory: Memory


@dataclasses.dataclass(frozen=True)
class Kicks:
    """The smallest kick of every attractor, by label, and later what organises its basin."""

    catalogue: Catalogue
    kicks: Mapping[int, Kick | None]
    skeletons: Mapping[int, MarkerArray] = dataclasses.field(default_factory=dict)


class Job(threading.Thread):
    """A thread of low priority that computes the pictures at one set of parameters."""

    def __init__(self, wanted: Wanted, memory: Memory, settings: Settings, is_coarse: bool,
                 put: Callable[['Job', Picture | Kicks | None], None]) -> None:
        super().__init__(name='basins', daemon=True)
        self.wanted = wanted
        self.is_coarse = is_coarse
        self.failure = ''
        self._memory = memory
        self._settings = settings
        self._put = put
        # Set where the thread is to end soon.
        self.dropped = threading.Event()

    def run(self) -> None:
        """Compute pictures and hand them over; None is the last."""
        # Nice this thread and those it starts, not the process: the thread that receives the
        # stream must not hold up the publisher.
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), self._settings.niceness)
        try:
            self._compute()
        except Dropped:
            pass
        except Exception as error:
            # Whatever went wrong, the node continues with the next parameters.
            self.failure = f'{type(error).__name__}: {error}'
        self._put(self, None)

    def _compute(self) -> None:
        wanted, settings, memory = self.wanted, self._settings, self._memory
        seen, fastest = glance(wanted.parameters, np.concatenate(
            [np.zeros((0, 3)), *(trace.points[:1] for trace in memory.traces)]))
        limit = settings.velocity_limit or (
            nice_limit(ROOM * fastest, memory.limit) if fastest else memory.limit or 1.0)
        sizes = settings.sizes[:1] if self.is_coarse else settings.sizes
        planes = [dataclasses.replace(settings.plane, velocity=(-limit, limit), phases=size,
                                      velocities=size) for size in sizes]
        kicks: Kicks | None = None
        for basins in watch(seen, planes, cap=settings.cap, threads=settings.threads,
                            is_dropped=self.dropped.is_set):
            traces, hues = recognise(memory.traces, basins.catalogue,
                                     is_complete=basins.is_complete)
            memory = Memory(traces, limit)
            # Finer pictures give way to everything, but must not starve: they may hold the GIL.
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), 19)
            self._put(self, picture_of(wanted, basins, hues, memory, settings))
            if kicks is None and basins.is_complete and len(basins.labels) >= min(
                    WHOLE_FROM, settings.sizes[-1]):
                kicks = Kicks(basins.catalogue, {each.label: smallest_kick(
                    basins.catalogue, each, steps=KICK_STEPS, cap=basins.catalogue.hold,
                    threads=settings.threads, check=self._check)
                    for each in basins.catalogue.attractors})
                self._put(self, kicks)
        if kicks is not None and settings.has_skeleton:
            for found in skeletons(kicks.catalogue, kicks.kicks, planes[-1], self._check):
                self._put(self, dataclasses.replace(kicks, skeletons={
                    label: messages.markers_from_layers(layers, wanted.stamp, settings.frame)
                    for label, layers in found.items()}))

    def _check(self) -> None:
        if self.dropped.is_set():
            raise Dropped


class Basin(ReportingNode):
    """Watches the parameters in the stream and publishes the basins at them."""

    def __init__(self, **options: Any) -> None:
        super().__init__('basin', **options)
        cap, threads, niceness = (
            int(self.number(name)) for name in ('cap', 'threads', 'niceness'))
        self._settings = Settings(
            sizes_up_to(int(self.number('size'))), self._plane(), self.number('velocity_limit'),
            cap, threads, niceness, self.frame(), bool(self.values['skeleton']))
        self._memory = Memory()
        self._wanted: Wanted | None = None
        # The job that runs, and the one that was started last.
        self._job: Job | None = None
        self._begun: Job | None = None
        self._results: queue.SimpleQueue[tuple[Job, Picture | Kicks | None]] = queue.SimpleQueue()
        # The newest event and its stamp, the kicks at its parameters, and what was published last.
        self._last: tuple[EventArray, Time] | None = None
        self._kicks: Kicks | None = None
        self._announced: tuple[int, int] | None = None
        self._skeleton: MarkerArray | None = None
        self._waking, self._is_closed = threading.Lock(), False
        self._words = 'no impacts yet'
        self._counts = {'pictures': 0, 'parameters': 0, 'dropped': 0}
        self._seconds = {'first_picture_seconds': 0.0, 'last_picture_seconds': 0.0}
        warm_up(self._settings)
        give_way(self._settings.niceness)
        self._outputs = [self.create_publisher(kind, name, LATCHED) for kind, name in (
            (DiagnosticArray, 'basin_state'), (PointCloud2, 'attractors'), (Image, 'basin'))]
        self._kick_output = self.create_publisher(DiagnosticArray, 'smallest_kick', LATCHED)
        self._skeleton_output = self.create_publisher(MarkerArray, 'skeleton', LATCHED)
        self._stream = self.create_subscription(
            PointCloud2, 'impacts', lambda cloud: None, NEWEST, callback_group=Unwatched())
        self._arrived = self.create_guard_condition(self._publish)
        self.every(POLL, self._look)
        self.every(LOOK, self._announce)
        self.get_logger().info('ready')

    def _plane(self) -> Plane:
        kind = str(self.values['plane'])
        return Plane(self.number('displacement') if kind == DISPLACEMENT else None,
                     self.number('phase') if kind == STROBE else None, kind=kind)

    def report(self) -> tuple[str, str, Mapping[str, object]]:
        return 'ok', self._words, self._counts | self._seconds

    def close(self) -> None:
        # What a job finds from now on would wake a node that is being destroyed.
        with self._waking:
            self._is_closed = True
        if self._job is not None:
            self._job.dropped.set()

    def _look(self) -> None:
        for cloud, _ in arrived(self._stream, 1):
            self._take(cloud)
        self._decide()

    def _take(self, cloud: PointCloud2) -> None:
        try:
            events = messages.events_from_cloud(cloud)
        except ValueError as error:
            self.get_logger().warning(f'refused a batch: {error}', once=True)
            return
        if not len(events):
            return
        last = events[-1]
        parameters = Parameters.of(last)
        is_new_epoch = self._last is not None and last['epoch'] != self._last[0][0]['epoch']
        self._last = events[-1:], cloud.header.stamp
        before, now = self._wanted, time.monotonic()
        if before is None or parameters != before.parameters:
            self._wanted = Wanted(parameters, int(last['epoch']), cloud.header.stamp, now,
                                  before is not None and now - before.since < SETTLED)
            self._counts['parameters'] += 1
            self._kicks = self._announced = None
            self._show(None, cloud.header.stamp)
        elif is_new_epoch:
            self._announce()

    def _announce(self) -> None:
        """Publish the smallest kick of the attractor that the present trajectory leads to."""
        if self._kicks is None or self._last is None:
            return
        catalogue, (event, stamp) = self._kicks.catalogue, self._last
        found = catalogue.label(make_initial_conditions(
            catalogue.parameters, event['phase'], event['displacement'],
            event['velocity_after']), LOOK_CAP, threads=1)
        label, epoch = int(found['label'][0]), int(event['epoch'][0])
        if (label, epoch) != self._announced:
            self._announced = label, epoch
            self._kick_output.publish(kick_report(self._kicks, label, epoch, stamp))
        self._show(self._kicks.skeletons.get(label), stamp)

    def _show(self, skeleton: MarkerArray | None, stamp: Time) -> None:
        # None deletes what was shown.
        if skeleton is not self._skeleton:
            self._skeleton = skeleton
            self._skeleton_output.publish(
                skeleton or messages.markers_from_layers({}, stamp, self._settings.frame))

    def _decide(self) -> None:
        wanted, job, begun = self._wanted, self._job, self._begun
        if wanted is None:
            return
        # While parameters keep moving, a coarse picture of where they were is better than none.
        if job is not None:
            if job.wanted is wanted or job.is_coarse:
                return
            job.dropped.set()
            self._counts['dropped'] += 1
            self._job = None
        has_settled = time.monotonic() - wanted.since >= SETTLED
        if begun is None or begun.wanted is not wanted or (begun.is_coarse and has_settled):
            self._job = self._begun = Job(wanted, self._memory, self._settings,
                                          wanted.is_passing and not has_settled, self._put)
            self._job.start()

    def _put(self, job: Job, picture: Picture | Kicks | None) -> None:
        self._results.put((job, picture))
        with self._waking:
            if not self._is_closed:
                self._arrived.trigger()

    def _publish(self) -> None:
        while not self._results.empty():
            job, picture = self._results.get()
            if job is not self._job:
                continue
            if isinstance(picture, Kicks):
                self._kicks = picture
                self._announce()
                continue
            if picture is None:
                self._job = None
                if job.failure:
                    self._words = f'no basins at {job.wanted.parameters}: {job.failure}'
                    self.get_logger().warning(self._words)
                self._decide()
                continue
            self._memory = picture.memory
            for output, message in zip(self._outputs, (
                    picture.state, picture.attractors, picture.image), strict=True):
                output.publish(message)
            self._words = picture.state.status[0].message
            self._counts['pictures'] += 1
            seconds = time.monotonic() - job.wanted.since
            is_first = picture.image.width == self._settings.sizes[0]
            self._seconds.update(dict.fromkeys(
                self._seconds if is_first else ['last_picture_seconds'], seconds))


def picture_of(wanted: Wanted, basins: Basins, hues: tuple[int, ...], memory: Memory,
               settings: Settings) -> Picture:
    """Return the messages of one picture, all with the same stamp."""
    stamp, colours = wanted.stamp, colours_of(hues)
    # The top row has the greatest velocity.
    pixels = painted(basins.labels, colours)[::-1, :, :3]
    found = [each for each in basins.catalogue.attractors if each.label >= 0]
    found += others_where(lambda label: bool(np.any(basins.labels == label)))
    found = [dataclasses.replace(each, share=basins.share(each.label)) for each in found]
    parts = [np.zeros(0, POINT)]
    for each, (places, _) in zip(found, points_of(basins.catalogue), strict=False):
        part = np.zeros(len(places), POINT)
        part['x'], part['y'], part['z'] = places[:, 1], places[:, 2], -places[:, 0]
        # PCL packs colours as the bytes of an integer in a float.
        part['rgb'] = np.uint32(int(colours[each.label][1:], 16)).view(np.float32)
        part['label'], part['share'] = each.label, each.share
        parts.append(part)
    return Picture(
        messages.image_from_pixels(pixels, stamp, settings.frame),
        messages.cloud_from_records(np.concatenate(parts), stamp, settings.frame),
        state_of(wanted, basins, found, colours), memory)


def state_of(wanted: Wanted, basins: Basins, found: Sequence[Attractor],
             colours: Mapping[int, str]) -> DiagnosticArray:
    plane, parameters, stamp = basins.plane, wanted.parameters, wanted.stamp
    unsettled = basins.share(UNSETTLED)
    fixed = {name: value for name in ('displacement', 'phase')
             if isinstance(value := getattr(plane, name), float)}
    words = (f'{plane.phases} x {plane.velocities} at alpha {parameters.alpha:g}: '
             f'{counted(sum(each.label != UNSETTLED for each in found), "attractor")}, '
             f'{unsettled:.1%} unsettled')
    if conserves_areas(parameters):
        words += f': {CONSERVES}'
    state = messages.diagnostic_array('basin: picture', 'basin', 'ok', words, {
        **dataclasses.asdict(parameters), 'epoch': wanted.epoch, 'size': plane.phases,
        'plane': plane.kind, **fixed, f'{plane.across}_low': plane.window[0],
        f'{plane.across}_high': plane.window[1], 'velocity_low': plane.velocity[0],
        'velocity_high': plane.velocity[1], 'unsettled': unsettled,
        'has_searched_chaos': basins.is_complete}, stamp)
    for each in found:
        state.status.extend(messages.diagnostic_array(
            f'basin: {each.key}', 'basin', 'ok', f'{each.title}: {each.share:.2%}', {
                'label': each.label, 'letter': each.letter, 'key': each.key,
                'kind': each.kind.value, 'share': each.share, 'colour': colours[each.label],
                'impacts': each.impacts, 'drive_periods': each.drive_periods}, stamp).status)
    return state


def kick_report(kicks: Kicks, label: int, epoch: int, stamp: Time) -> DiagnosticArray:
    """Return the message on the smallest kick of an attractor."""
    # Rest may be reached that no initial condition of the search did.
    known = {each.label: each for each in (
        *others_where(lambda _: True), *kicks.catalogue.attractors)}
    one = known[label]
    kick = kicks.kicks.get(label)
    values: dict[str, object] = {
        **dataclasses.asdict(kicks.catalogue.parameters), 'epoch': epoch, 'letter': one.letter,
        'key': one.key, 'kind': one.kind.value}
    if kick is None:
        words = (f'{one.title}: within {counted(LOOK_CAP, "impact")} it is on no attractor'
                 if one.kind is Kind.UNSETTLED else
                 f'{one.title}: no kick that was tried changes the attractor')
    else:
        target, wall = known[kick.target], Wall(kick.wall).label
        words = (f'{one.title}: a kick of {kick.change:+.6f} at the {wall} wall, phase '
                 f'{kick.phase:.4f}, leads to {target.title}')
        values |= {'kick': kick.change, 'wall': wall, 'phase': kick.phase,
                   'velocity': kick.velocity, 'velocity_after': kick.velocity_after,
                   'target_letter': target.letter, 'target_key': target.key,
                   'resolution': kick.resolution, 'unsettled': kick.unsettled}
    return messages.diagnostic_array('basin: smallest kick', 'basin', 'ok', words, values, stamp)


def warm_up(settings: Settings) -> None:
    seen, _ = glance(Parameters(), np.zeros((0, 3)))
    planes = [dataclasses.replace(settings.plane, phases=size, velocities=size)
              for size in (4, 8)]
    for basins in watch(seen, planes, cap=100, threads=1, is_dropped=lambda: False):
        recognise((), basins.catalogue)
    chaos = Parameters(alpha=1.1)
    find_attractors(chaos, planes[0].draw(chaos, 8, 1), hold=300, effort=BRIEF, threads=1)


main = functools.partial(run_node, 'basin', Basin)
