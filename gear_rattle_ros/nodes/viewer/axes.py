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

"""Frames, ticks and colours of the viewer's pictures, and the blueprint that arranges them."""

import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import rerun as rr
import rerun.blueprint as rrb

from .basin import EDGE, KICK, LINES
from ...core.arrays import FloatArray
from ...palette import AMBER, LAYERS, rgba, SKY

TWO_PI = 2.0 * math.pi
# Half the height of the section; its width is 2 pi. Velocities are scaled to it.
HALF_HEIGHT: Final = 2.2
FLIGHT_PERIODS: Final = 4
# Width of a drive period, in units of the backlash.
PERIOD_WIDTH: Final = 1.3
# Impacts, or drive periods, in the view of the velocity.
VELOCITY_WINDOW: Final = 2000
# Pictures with their own axes have a dark ground in both themes, so that colours stay the same.
GROUND: Final = (18, 20, 26)
FRAME: Final = 0x8A8F98FF
FAINT: Final = 0x4A4F58FF
LABEL: Final = 0xE4E7ECFF
# Basins are faint so that impacts stand out.
BASIN_OPACITY: Final = 0.35
# Entities of what organises them begin with it.
SKELETON: Final = 'section/plane/skeleton/'
# Plasma without its darkest part, evenly spaced.
PLASMA: Final = np.array([
    (0x74, 0x3A, 0xC0), (0x96, 0x38, 0xB8), (0xB8, 0x3C, 0x98), (0xD8, 0x57, 0x6B),
    (0xED, 0x79, 0x53), (0xFA, 0x9E, 0x3B), (0xFD, 0xC9, 0x26), (0xF0, 0xF9, 0x21)], float)
# Seen over any basin.
GREYS: Final = np.array([(0x50, 0x50, 0x50), (0xFF, 0xFF, 0xFF)], float)

Logged = tuple[str, rr.AsComponents]


def colours_of(values: FloatArray, scale: FloatArray = PLASMA) -> npt.NDArray[np.uint32]:
    """Return RGBA colours of values from 0 (dark) to 1 (bright); others are clipped."""
    place = np.linspace(0.0, 1.0, len(scale))
    red, green, blue = (np.interp(values, place, channel).astype(np.uint32) for channel in scale.T)
    return np.asarray(red << 24 | green << 16 | blue << 8 | 0xFF, np.uint32)


def section_axes() -> list[Logged]:
    """Return the static part of the section: frame, ticks of the phase, the line of rest."""
    low, high = -HALF_HEIGHT, HALF_HEIGHT
    frame = [[(0, low), (TWO_PI, low), (TWO_PI, high), (0, high), (0, low)]]
    inner = [[(k * math.pi / 2, low), (k * math.pi / 2, high)] for k in (1, 2, 3)]
    inner += [[(0, y), (TWO_PI, y)] for y in (-HALF_HEIGHT / 2, 0.0, HALF_HEIGHT / 2)]
    ticks = [(k * math.pi / 2, high + 0.08) for k in range(5)]
    return [
        ('section/frame', _lines(frame, 0.8, FRAME, 1.0)),
        ('section/grid', _lines(inner, 0.4, FAINT, 0.0)),
        ('section/phase', _labels(ticks, ['0', 'π/2', 'π', '3π/2', '2π'])),
        ('section/velocity', rr.Points2D.from_fields(radii=0.0, colors=LABEL, show_labels=True)),
        *((SKELETON + name, _styles(name, rgba(colour))) for name, colour in LAYERS.items()),
        ('section/plane/attractors', rr.Points2D.from_fields(
            radii=rr.Radius.ui_points(3.5), draw_order=20.0)),
        ('section/plane/impacts', rr.Points2D.from_fields(
            radii=rr.Radius.ui_points(1.3), draw_order=30.0)),
        ('section/plane/newest', rr.Points2D.from_fields(
            radii=rr.Radius.ui_points(2.2), colors=0xFFFFFFFF, draw_order=40.0))]


def flight_axes() -> list[Logged]:
    """Return the static part of s(tau): both walls, the beginnings of drive periods."""
    first, last = -FLIGHT_PERIODS, 1
    walls = [[(first, wall), (last, wall)] for wall in (0, -1)]
    lines = [[(x, 0), (x, -1)] for x in range(first, last + 1)]
    edge = first * PERIOD_WIDTH - 0.35
    ticks = [(x * PERIOD_WIDTH, 1.02) for x in range(first, last + 1)]
    return [
        # Displacement points up, y down.
        ('flight/plane', rr.Transform3D(scale=[PERIOD_WIDTH, -1.0, 1.0])),
        ('flight/plane/walls', _lines(walls, 1.2, rgba(AMBER), 1.0)),
        ('flight/plane/periods', _lines(lines, 0.4, FAINT, 0.0)),
        ('flight/plane/motion', rr.LineStrips2D.from_fields(
            radii=rr.Radius.ui_points(1.0), colors=rgba(SKY), draw_order=30.0)),
        ('flight/tau', _labels(
            ticks, [f'{x}'.replace('-', '−') for x in range(first, last + 1)])),
        ('flight/walls', _labels([(edge, -0.1), (edge, 0.75)], ['s = 0', 's = −1']))]


def _styles(name: str, colour: int) -> rr.AsComponents:
    if name == KICK:
        return rr.Arrows2D.from_fields(
            radii=rr.Radius.ui_points(1.5), colors=colour, draw_order=25.0)
    if name in LINES:
        return rr.LineStrips2D.from_fields(
            radii=rr.Radius.ui_points(0.6), colors=colour, draw_order=5.0)
    # The many points of an edge state would hide the few of an orbit.
    size, order = (1.4, 8.0) if name == EDGE else (2.5, 12.0)
    return rr.Points2D.from_fields(
        radii=rr.Radius.ui_points(size), colors=colour, draw_order=order)


def _lines(strips: Any, width: float, colour: int, order: float) -> rr.LineStrips2D:
    return rr.LineStrips2D(
        strips, radii=rr.Radius.ui_points(width), colors=colour, draw_order=order)


def _labels(places: list[tuple[float, float]], labels: list[str]) -> rr.Points2D:
    return rr.Points2D(places, labels=labels, show_labels=True, radii=0.0, colors=LABEL)


def blueprint(colour: str) -> rrb.Blueprint:
    meaning = {'age': 'newest brightest', 'alpha': 'coloured by alpha, 0.4 to 1.8',
               'attractor': 'in the colour of the attractor visited last'}[colour]
    back, cursor = VELOCITY_WINDOW, rrb.TimeRangeBoundary.cursor_relative
    dark: dict[str, Any] = {'background': rrb.Background(color=GROUND)}
    bare: dict[str, Any] = {'plot_legend': rrb.PlotLegend(visible=False)}
    section = rrb.Spatial2DView(
        origin='/section', name=f'Section: velocity over drive phase, {meaning}',
        visual_bounds=rrb.VisualBounds2D(x_range=[-0.8, 6.6], y_range=[-2.35, 2.65]), **dark)
    flight = rrb.Spatial2DView(
        origin='/flight', name='s over the last drive periods (0 = present one)',
        visual_bounds=rrb.VisualBounds2D(x_range=[-6.0, 1.45], y_range=[-0.12, 1.36]), **dark)
    velocity = rrb.TimeSeriesView(
        origin='/velocity', name='Velocity before the impact', **bare, time_ranges=[
            rrb.VisibleTimeRange('impact', start=cursor(seq=-back), end=cursor(seq=0)),
            rrb.VisibleTimeRange(
                'drive_time', start=cursor(seconds=-back), end=cursor(seconds=0.0))])
    whole = rrb.TimeAxis(view_range=rr.TimeRange(
        start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.infinite()))
    exponents = rrb.TimeSeriesView(
        origin='/exponents', axis_x=whole, **bare,
        name='Exponents: λ1 ± error blue, finite-time green, λ2 purple, sum red, exact grey')
    alpha = rrb.TimeSeriesView(origin='/alpha', axis_x=whole, name='Alpha', **bare)
    state = rrb.TextDocumentView(origin='/state', name='State')
    log = rrb.TextLogView(origin='/log', name='Changes', columns=rrb.TextLogColumns(
        timeline_columns=['impact'], text_log_columns=['body']))
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(section, rrb.Horizontal(state, log, column_shares=[1, 1.1]),
                         row_shares=[2.1, 1]),
            rrb.Vertical(flight, velocity, exponents, alpha, row_shares=[1.25, 1.1, 1.5, 0.7]),
            column_shares=[1, 1.15]),
        rrb.TimePanel(state='collapsed', timeline='impact', play_state='following'),
        rrb.BlueprintPanel(state='hidden'), rrb.SelectionPanel(state='hidden'),
        auto_views=False, auto_layout=False)
