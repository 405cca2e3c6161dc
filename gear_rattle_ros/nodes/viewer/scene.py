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

"""What the viewer logs to one rerun recording, in columns."""

from collections import deque
from collections.abc import Mapping, Sequence
import math
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt
import rerun as rr

from . import axes
from .basin import BasinPicture, KICK, Layers, LINES
from .recent import Recent, ROW, RowArray
from ..base.scales import nice_limit
from ...core.arrays import FloatArray
from ...core.stream.counters import Place
from ...core.stream.reconstruction import rebuild
from ...palette import BLUE, GREEN, PURPLE, RED, rgba

# Most impacts drawn each time, the newest in a row; older ones are thinned out.
DRAWN_MOST: Final = 800
# Points in the section; of older ones every OLD_STEP-th stays, OLD_POINTS at most; new are bright.
SECTION_POINTS: Final = 2000
OLD_STEP: Final = 7
OLD_POINTS: Final = 1000
BRIGHT_POINTS: Final = 12
CHANGES_MOST: Final = 100
ESTIMATES_MOST: Final = 20
# Interval between drawings [s], and the age at which those of a file begin to lengthen [s].
INTERVAL: Final = 0.2
FULL_DETAIL: Final = 120.0
# The running exponent means nothing before this number of impacts.
IMPACTS_LEAST: Final = 30
FLIGHT_STEP: Final = axes.TWO_PI / 48.0
# The values in a row of exponents, and how they are drawn: label, name, colour, width. The sum is
# wider than the exact one, which lies on top of it.
EXPONENTS: Final = (
    ('λ1', 'lambda_1', rgba(BLUE), 2.5), ('λ1 + error', '', rgba(BLUE, 0x80), 1.0),
    ('λ1 − error', '', rgba(BLUE, 0x80), 1.0),
    ('λ1 finite-time', 'lambda_1_finite', rgba(GREEN, 0xB0), 1.0),
    ('λ2', 'lambda_2', rgba(PURPLE), 1.5), ('λ1 + λ2', 'sum', rgba(RED), 4.0),
    ('exact sum', 'exact_sum', 0x808080FF, 1.0), ('zero', '', 0x808080C0, 1.0))

Columns: TypeAlias = Sequence[rr.ComponentColumn] | rr.ComponentColumnList


class Scene:
    """One recording: a file, whose detail falls off with its age, or a live window."""

    def __init__(self, recording: rr.RecordingStream, colour: str, thins: bool) -> None:
        self.rows = self.drawn = 0
        self._recording = recording
        self._colour = colour
        self._thins = thins
        self._begun: float | None = None
        self._next = -math.inf
        self._seen = 0
        self._ring = self._old = np.empty(0, ROW)
        # Limit of the velocities in the section, and the limit that the impacts need.
        self._limit = self._needed = 0.0
        self._basin: BasinPicture | None = None
        self._has_new_basin = False
        self._layers: Layers = {}
        self._estimates: deque[Mapping[str, float]] = deque(maxlen=ESTIMATES_MOST)
        self._document = ''
        for path, archetype in (*axes.section_axes(), *axes.flight_axes()):
            recording.log(path, archetype, static=True)
        recording.log('velocity', rr.SeriesPoints(
            colors=rgba(BLUE), names='velocity', markers='circle', marker_sizes=1.6), static=True)
        labels, _, colours, widths = zip(*EXPONENTS, strict=True)
        recording.log('exponents', rr.SeriesLines(
            colors=colours, names=labels, widths=widths), static=True)
        recording.log('alpha', rr.SeriesLines(colors=rgba(RED), names='alpha', widths=2.0,
                                              interpolation_mode='StepAfter'), static=True)

    def is_due(self, time: float) -> bool:
        if self._begun is None:
            self._begun = time
        return time >= self._next

    def estimate(self, values: Mapping[str, float]) -> None:
        """Take an estimate of the exponents; only the newest few of each interval are drawn."""
        self._estimates.append(values)

    def take_basin(self, picture: BasinPicture) -> None:
        """Take a picture of the basins; only the newest of each interval is drawn."""
        self._basin, self._has_new_basin = picture, True

    def take_layers(self, layers: Layers) -> None:
        """Take what is drawn over the basins; only the newest of each interval is drawn."""
        self._layers = layers

    def draw(self, recent: Recent, document: str, time: float) -> None:
        """Log what is new at a moment of wall time [s]."""
        age = time - (time if self._begun is None else self._begun)
        self._next = time + INTERVAL * (max(1.0, age / FULL_DETAIL) if self._thins else 1.0)
        if recent.now is None:
            return
        if recent.seen != self._seen:
            impacts = recent.impacts_after(self._seen)[-DRAWN_MOST:]
            if len(impacts):
                self._draw_impacts(impacts, recent, recent.now)
            self._draw_flight(recent)
            self._draw_alpha(recent.changes_after(self._seen)[-CHANGES_MOST:], recent.now)
            self._seen = recent.seen
        self._draw_exponents(recent)
        self._draw_basin(recent.now)
        self._draw_layers(recent.now)
        if document != self._document:
            self._document = document
            self._send('state', recent.now, rr.TextDocument.columns(
                text=[document], media_type=['text/markdown']))
        # Started, not waited for: the file of a viewer that is killed ends here.
        self._recording.flush(timeout_sec=0.0)

    def log(self, text: str, level: str, now: Place | None) -> None:
        self._send('log', now, rr.TextLog.columns(text=[text], level=[level]))

    def close(self) -> None:
        try:
            self._recording.flush(timeout_sec=2.0)
        finally:
            self._recording.disconnect()

    def _draw_impacts(self, impacts: RowArray, recent: Recent, now: Place) -> None:
        self.drawn += len(impacts)
        self._columns('velocity', impacts['impact'], impacts['drive_time'],
                      rr.Scalars.columns(scalars=impacts['velocity']))
        ring = np.concatenate([self._ring, impacts])
        self._old = np.concatenate([self._old, ring[:-SECTION_POINTS:OLD_STEP]])[-OLD_POINTS:]
        self._ring = ring[-SECTION_POINTS:]
        ring = np.concatenate([self._old, self._ring])
        self._needed = nice_limit(float(np.abs(ring['velocity']).max()), self._needed)
        self._scale(now)
        places = np.stack([ring['phase'], ring['velocity']], axis=1).astype(np.float32)
        colours = (
            axes.colours_of((ring['alpha'] - 0.4) / 1.4) if self._colour == 'alpha' else
            recent.colours_of(ring) if self._colour == 'attractor' else
            axes.colours_of(np.linspace(0.0, 1.0, len(ring)) ** 2, axes.GREYS))
        self._send('section/plane/impacts', now, points(positions=places, colors=colours))
        self._send('section/plane/newest', now, points(positions=places[-BRIGHT_POINTS:]))

    def _scale(self, now: Place) -> None:
        limit = max(self._needed, 0.0 if self._basin is None else self._basin.high)
        if limit == self._limit:
            return
        self._limit = limit
        self._send('section/plane', now, rr.Transform3D.columns(
            scale=[[1.0, -axes.HALF_HEIGHT / limit, 1.0]]))
        shares = (1.0, 0.5, 0.0, -0.5, -1.0)
        # At the left; a label stands below its point.
        self._send('section/velocity', now, points(
            positions=[(-0.4, -share * axes.HALF_HEIGHT - 0.18) for share in shares],
            labels=[f'{share * limit:g}'.replace('-', '−') for share in shares]))

    def _draw_basin(self, now: Place) -> None:
        picture = self._basin
        if picture is None or not self._has_new_basin:
            return
        self._has_new_basin = False
        self._scale(now)
        # From pixels, the first at the top left, to phase and velocity.
        scale = [axes.TWO_PI / picture.width, (picture.low - picture.high) / picture.height, 1.0]
        self._send('section/plane/basin', now, rr.Transform3D.columns(
            translation=[[0.0, picture.high, 0.0]], scale=[scale]))
        self._send('section/plane/basin/image', now, rr.EncodedImage.columns(
            blob=[picture.png], media_type=['image/png'], opacity=[axes.BASIN_OPACITY],
            draw_order=[-10.0]))
        self._send('section/plane/attractors', now, points(
            positions=picture.points, colors=picture.colours))

    def _draw_layers(self, now: Place) -> None:
        for name, places in self._layers.items():
            columns = (
                rr.Points2D.columns(positions=places) if name not in LINES else
                rr.LineStrips2D.columns(strips=list(places)) if name != KICK else
                rr.Arrows2D.columns(origins=places[:, 0], vectors=places[:, 1] - places[:, 0]))
            self._send(axes.SKELETON + name, now, columns.partition([len(places)]))
        self._layers = {}

    def _draw_flight(self, recent: Recent) -> None:
        motion = rebuild(recent.whole(), FLIGHT_STEP, axes.FLIGHT_PERIODS)
        if not len(motion.tau) or recent.now is None:
            return
        line = np.stack([motion.tau / axes.TWO_PI, motion.displacement], axis=1).astype(np.float32)
        self._send('flight/plane/motion', recent.now, rr.LineStrips2D.columns(strips=[[line]]))

    def _draw_alpha(self, changes: RowArray, now: Place) -> None:
        impact, drive_time, alpha = (np.append(changes[name], last) for name, last in (
            ('impact', now.impact), ('drive_time', now.drive_time), ('alpha', now.event['alpha'])))
        self._columns('alpha', impact, drive_time, rr.Scalars.columns(scalars=alpha))

    def _draw_exponents(self, recent: Recent) -> None:
        taken = list(self._estimates)
        self._estimates.clear()
        if not taken or recent.now is None:
            return
        # An estimate may be ahead of the events received here; the axis must not be.
        impacts = np.array([min(recent.impact_number(int(values['index'])), recent.now.impact)
                            for values in taken])
        table = np.array([exponent_row(values) for values in taken])
        self._columns(
            'exponents', impacts, np.full(len(taken), recent.now.drive_time),
            rr.Scalars.columns(scalars=table.ravel()).partition([table.shape[1]] * len(taken)))

    def _send(self, path: str, now: Place | None, columns: Columns) -> None:
        impact, drive_time = (0, 0.0) if now is None else (now.impact, now.drive_time)
        self._columns(path, np.array([impact]), np.array([drive_time]), columns)

    def _columns(self, path: str, impact: npt.NDArray[np.int64], drive_time: FloatArray,
                 columns: Columns) -> None:
        self.rows += len(impact)
        self._recording.send_columns(path, [
            rr.TimeColumn('impact', sequence=impact),
            rr.TimeColumn('drive_time', duration=drive_time)], columns)


def points(**components: Any) -> rr.ComponentColumnList:
    """Return points as one row: all components are equally long."""
    return rr.Points2D.columns(**components).partition([len(components['positions'])])


def exponent_row(values: Mapping[str, float]) -> list[float]:
    """Return one row of EXPONENTS; what is unknown or infinite leaves a gap in its line."""
    if values.get('impacts', math.inf) < IMPACTS_LEAST:
        # An epoch has just begun, as in a ramp; only the finite-time exponent crosses it.
        values = {'lambda_1': math.nan, 'lambda_1_finite': values.get('lambda_1_finite', math.nan)}
    error = values.get('lambda_1_error', math.nan)
    band = {1: values['lambda_1'] + error, 2: values['lambda_1'] - error, 7: 0.0}
    row = [band.get(i, values.get(name, math.nan)) for i, (_, name, *_) in enumerate(EXPONENTS)]
    return [value if math.isfinite(value) else math.nan for value in row]
