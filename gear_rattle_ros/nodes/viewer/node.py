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

"""Draws the stream, the exponents and the transient with rerun: file, window or web page."""

from collections.abc import Mapping
import functools
import math
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
from sensor_msgs.msg import JointState
from visualization_msgs.msg import MarkerArray

from .basin import BasinInput, BasinPicture, layers_of, PARTS
from .recent import Recent
from .scene import DRAWN_MOST, INTERVAL, Scene
from .sinks import add_index, chosen_mode, file_recording, Window
from ..base.dds_room import bound_backlog
from ..base.event_input import EventInput
from ..base.in_si import NodeInSi
from ..base.process import run_node
from ..base.services import listen
from ...core.many.settling import RESTS_UPPER, UNSETTLED
from ...core.model import EVENT, EventArray
from ...core.orbits.letters import LETTERS
from ...core.stream.reconstruction import rebuild
from ...core.stream.report_values import infinite_in_words
from ...core.words import counted
from ...palette import ENDS, hue
from ...qos import LATCHED, STREAM

# The values an estimate of the exponents must have to be shown.
SHOWN = ('lambda_1', 'lambda_1_error', 'lambda_2', 'lambda_2_error', 'sum', 'exact_sum', 'impacts',
         'index')


class Viewer(NodeInSi):
    """Collects what comes in and draws the newest of it a few times a second."""

    def __init__(self, **options: Any) -> None:
        super().__init__('viewer', **options)
        colour, save = str(self.values['colour']), str(self.values['save'])
        mode = chosen_mode(str(self.values['mode']), save)
        # Compile the kernels before the first batch.
        rebuild(np.zeros(2, EVENT), 0.1)
        self._scenes: list[Scene] = []
        self._file: Scene | None = None
        self._window: Window | None = None
        self._lost = ''
        if save:
            self._file = Scene(file_recording(save, colour), colour, thins=True)
            self._scenes.append(self._file)
            self.get_logger().info(f'drawing to {save}')
        if mode != 'none':
            self._window = Window(mode, int(self.number('web_port')), colour)
            self._scenes.append(Scene(self._window.recording, colour, thins=False))
            self.get_logger().info(f'drawing to {self._window.place}')
        self._recent = Recent(DRAWN_MOST + 200)
        self._estimate: Mapping[str, float] = {}
        self._transient: tuple[str, Mapping[str, str]] = ('', {})
        # Numbers of attractors without a letter.
        self._others: dict[str, int] = {}
        self._basin_input = BasinInput()
        self._basin: BasinPicture | None = None
        self._waiting_since, self._lag = math.inf, 0.0
        self._input = EventInput(self, self._recent.guard, self._take, 'the axes continue')
        listen(self, JointState, 'lyapunov', self._take_estimate, STREAM)
        listen(self, DiagnosticArray, 'transient', self._take_transient, LATCHED)
        for name, kind in PARTS.items():
            listen(self, kind, name, functools.partial(self._take_basin, name), LATCHED)
        listen(self, MarkerArray, 'skeleton', self._take_skeleton, LATCHED)
        self.every(INTERVAL, self._draw)
        self.get_logger().info('ready')

    def report(self) -> tuple[str, str, Mapping[str, object]]:
        drawn = max((scene.drawn for scene in self._scenes), default=0)
        lag, self._lag = self._lag, 0.0
        level, message, values = self._input.report(
            rows_logged=sum(scene.rows for scene in self._scenes), impacts_drawn=drawn,
            impacts_thinned_out=self._recent.impacts - drawn, largest_lag_seconds=lag,
            page=self._window.page if self._window is not None else '')
        return ('warn', self._lost, values) if self._lost else (level, message, values)

    def close(self) -> None:
        for scene in list(self._scenes):
            self._draw_scene(scene, self._document(), time.monotonic())
        is_whole = self._file in self._scenes
        for scene in list(self._scenes):
            self._drop(scene, '')
        if self._window is not None:
            self._window.close()
        save = str(self.values['save'])
        # A file that could not be completed stays as it is.
        if is_whole and (reason := add_index(save)):
            self.get_logger().warning(
                f'{save} has no index; `rerun rrd optimize` adds one: {reason}')

    def _take(self, events: EventArray) -> None:
        self._waiting_since = min(self._waiting_since, time.monotonic())
        self._recent.take(events)

    def _take_estimate(self, message: JointState) -> None:
        estimate = dict(zip(message.name, message.position, strict=True))
        missing = [name for name in SHOWN if name not in estimate]
        if missing:
            raise ValueError(f'no value {missing[0]!r}')
        for name in ('impacts', 'index'):
            if not 0.0 <= estimate[name] < 2.0**63:
                raise ValueError(f'{name} = {estimate[name]!r}')
        self._estimate = estimate
        for scene in self._scenes:
            scene.estimate(self._estimate)

    def _take_transient(self, message: DiagnosticArray) -> None:
        if not message.status:
            return
        status = message.status[0]
        values = {item.key: item.value for item in status.values}
        # Refuse what is not a number before it is kept.
        float(values.get('multiplier', 0.0))
        first = int(values.get('start', 0)) + int(values.get('lifetime', 0))
        self._transient = (status.message, values)
        self._recent.visit(first % 2**32, self._colour_of(values))
        for scene in self._scenes:
            scene.log(status.message, 'INFO', self._recent.now)

    def _colour_of(self, values: Mapping[str, str]) -> str:
        # That of its letter, the same in all pictures; others in the order of their appearance.
        if values.get('state') != 'orbit':
            return ENDS[UNSETTLED if values.get('state') != 'rest' else RESTS_UPPER]
        letter = values.get('letter', '')
        if letter in LETTERS:
            return hue(LETTERS.index(letter))
        key = values.get('orbit', '')
        return hue(len(LETTERS) + self._others.setdefault(key, len(self._others)))

    def _take_basin(self, name: str, message: Any) -> None:
        picture = self._basin_input.take(name, message)
        if picture is not None:
            self._basin = picture
            for scene in self._scenes:
                scene.take_basin(picture)

    def _take_skeleton(self, message: MarkerArray) -> None:
        layers = layers_of(message)
        for scene in self._scenes:
            scene.take_layers(layers)

    def _draw(self) -> None:
        now = time.monotonic()
        if self._window is not None and not self._window.is_open and not self._lost:
            self._drop(self._scenes[-1], 'the viewer has been closed')
        document = self._document()
        for scene in list(self._scenes):
            if scene.is_due(now):
                self._draw_scene(scene, document, now)
        if self._waiting_since < math.inf:
            self._lag = max(self._lag, time.monotonic() - self._waiting_since)
            self._waiting_since = math.inf

    def _draw_scene(self, scene: Scene, document: str, now: float) -> None:
        try:
            scene.draw(self._recent, document, now)
        except RuntimeError as error:
            # Rerun raises it for a lost connection and for a file that cannot be written.
            self._drop(scene, str(error))

    def _drop(self, scene: Scene, reason: str) -> None:
        self._scenes.remove(scene)
        try:
            scene.close()
        except RuntimeError as error:
            reason = reason or str(error)
        if reason:
            self._lost = reason
            self.get_logger().warning(f'stopped drawing: {reason}')

    def _document(self) -> str:
        if self._recent.now is None:
            return 'no impacts yet'
        event = self._recent.now.event
        text, values = self._transient
        lines = [f'**{text or "nothing known of the transient yet"}**']
        if 'multiplier' in values:
            lines.append(f'{values.get("orbit", "orbit")}, '
                         f'multiplier {float(values["multiplier"]):.4f}')
        lines.append(f'alpha **{event["alpha"]:g}**, beta {event["beta"]:g}, '
                     f'gamma {event["gamma"]:g}, r {event["restitution"]:g}')
        if self.gears:
            time, length, unit, *_ = self.gears.scales
            lines.append(
                f'in SI: velocity 1 is {1e3 * unit:.4g} mm/s, the backlash {1e6 * length:.4g} μm, '
                f'a drive period {2e3 * math.pi * time:.4g} ms; the last impact had '
                f'{1e3 * abs(event["velocity"]) * unit:.4g} mm/s')
        if self._estimate:
            e = self._estimate
            lines += [f'λ1 = {e["lambda_1"]:.5f} ± {e["lambda_1_error"]:.5f}',
                      f'λ2 = {e["lambda_2"]:.5f} ± {e["lambda_2_error"]:.5f}',
                      f'λ1 + λ2 = {e["sum"]:.6f}, exact {e["exact_sum"]:.6f}',
                      f'impulse balance {e.get("impulse_balance", math.nan):.6f}, exact '
                      f'{e.get("exact_impulse_balance", math.nan):.6f}',
                      f'over {counted(e["impacts"], "impact")}',
                      infinite_in_words(e)]
        if self._basin is not None:
            lines += ['', '**Basins** ' + self._basin.words[0], *self._basin.words[1:]]
        # Two blanks make Markdown break the line.
        return '  \n'.join(lines)


main = functools.partial(run_node, 'viewer', Viewer, room=bound_backlog)
