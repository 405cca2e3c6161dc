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

"""The figure of the plane: picture, layers, read-out at the pointer, the clicked point."""

from collections.abc import Callable
import math
from typing import Any, Final

from bokeh import models
from bokeh.events import Tap
from bokeh.models import ColumnDataSource, CustomJSHover, Range1d
from bokeh.plotting import figure
import numpy as np

from .axes import formatter, read_out, si_axis, ticker
from .painting import Colours, paint
from ..computing.computing import Picture
from ..computing.skeleton import Layers, LONGEST, places
from ..view import NARROWEST, PHASE_BOUND, VELOCITY_BOUND, View
from ...attractors.plane import STROBE, TWO_PI, Window
from ...core.gears import Gears
from ...palette import AMBER, MARK, STABLE, UNSTABLE

WIDTH = 618
HEIGHT = 590
# Stands for an unknown exponent, for which the browser would write NaN [1].
NONE = 1e9
# Opacity of a picture below layers [1].
PALE = 0.45
TIP = """
<div style="font:12px system-ui,sans-serif;padding:1px 3px">
<b>@label{custom}</b><br>lifetime @lifetime{custom} impacts@exponent{custom}<br>
ACROSS, velocity $y{custom}</div>
"""
NAME_TIP: Final = '<div style="font:12px system-ui,sans-serif;padding:1px 3px">@name</div>'
COLUMNS: Final = {
    'stable': ('x', 'y'), 'unstable': ('x', 'y'), 'edge': ('x', 'y'),
    'orbits': ('x', 'y', 'size', 'filled', 'name'), 'kick': ('x', 'y', 'to_x', 'to_y')}
# Diameter of the mark of an orbit, and what it is larger by for each impact less [pixels].
SMALLEST: Final = 5.0
LARGER: Final = 1.6


class PlaneFigure:
    """The plane of initial conditions."""

    def __init__(self, view: View, moved: Callable[[Window, Window], None],
                 clicked: Callable[[float, float], None], along: figure | None = None,
                 name: str = '', gears: Gears | None = None) -> None:
        # `along` is a plane whose window this one shares, `name` an ending of all names; with a
        # gear pair it has second axes in SI units.
        x_range, y_range = (along.x_range, along.y_range) if along else (
            Range1d(*view.window, min_interval=NARROWEST),
            Range1d(*view.velocity, bounds=(-VELOCITY_BOUND, VELOCITY_BOUND),
                    min_interval=NARROWEST))
        self.source = ColumnDataSource(name=f'picture{name}', data={
            each: [] for each in ('image', 'label', 'lifetime', 'exponent', 'x', 'y', 'dw', 'dh')})
        self._names = ColumnDataSource(data={'label': [], 'name': []})
        self._point = ColumnDataSource(name=f'point{name}', data={'x': [], 'y': []})
        wheel = models.WheelZoomTool()
        self.figure = figure(
            name=f'plane{name}', width=WIDTH, height=HEIGHT, x_range=x_range, y_range=y_range,
            tools=[models.PanTool(), wheel, models.BoxZoomTool(),
                   models.SaveTool(filename='explorer')],
            active_scroll=wheel, toolbar_location='right', min_border_left=66)
        plot = self.figure
        plot.toolbar.logo = None
        plot.axis.axis_label_text_font_style = 'normal'
        plot.yaxis.axis_label = "initial velocity s' [1]"
        plot.yaxis.ticker = ticker(y_range, is_phase=False)
        plot.yaxis.formatter = formatter(y_range, is_phase=False)
        plot.grid.visible = False
        plot.background_fill_color = '#f2f2f2'
        self._image = image = plot.image_rgba(image='image', x='x', y='y', dw='dw', dh='dh',
                                              source=self.source)
        self._layers = LayerGlyphs(plot, name)
        for size, colour, width in ((15, 'black', 4), (15, 'white', 2)):
            plot.scatter('x', 'y', source=self._point, size=size, marker='cross',
                         line_color=colour, line_width=width)
        self._hover = models.HoverTool(renderers=[image], formatters={
            '@label': CustomJSHover(args={'names': self._names}, code="""
                const at = names.data.label.indexOf(value);
                return at < 0 ? '' : names.data.name[at];"""),
            '@lifetime': CustomJSHover(code='return value.toLocaleString("en")'),
            '@exponent': CustomJSHover(args={'none': NONE}, code="""
                if (value >= none) return '';
                return ', exponent ' + (value <= -none ? '\u2212\u221e'
                    : value.toFixed(3).replace('-', '\u2212'));"""),
            '$x': read_out(x_range), '$y': read_out(y_range)})
        plot.add_tools(self._hover)
        self._above: models.LinearAxis | None = None
        if gears:
            unit = 1e3 * gears.scales.velocity_m_per_s
            self._hover.formatters['$y'] = read_out(y_range, unit, 'mm/s')
            plot.add_layout(si_axis(y_range, unit, '[mm/s]'), 'right')
            self._above = si_axis(x_range, 1e6 * gears.scales.displacement_m, '[μm]')
            plot.add_layout(self._above, 'above')
        self.lay(view)
        self._moved, self._is_moving = moved, False
        for range_ in () if along else (x_range, y_range):
            for end in ('start', 'end'):
                range_.on_change(end, self._note)
        plot.on_event(Tap, lambda event: clicked(event.x, event.y))

    def lay(self, view: View) -> None:
        """Lay the axis of the phase, or of the displacement, as the plane of a view has it."""
        is_phase, axis, range_ = view.on != STROBE, self.figure.below[0], self.figure.x_range
        range_.update(start=view.window[0], end=view.window[1])
        range_.update(bounds=(-PHASE_BOUND, PHASE_BOUND) if is_phase else (-1.0, 0.0),
                      max_interval=TWO_PI if is_phase else 1.0)
        axis.axis_label = f'initial {"drive phase τ [rad]" if is_phase else "displacement s [1]"}'
        axis.ticker, axis.formatter = ticker(range_, is_phase), formatter(range_, is_phase)
        if self._above:
            self._above.visible = not is_phase
        self._hover.tooltips = TIP.replace('ACROSS', 'phase $x{custom} rad' if is_phase else
                                           'displacement $x{custom}')

    def _note(self, attr: str, old: float, new: float) -> None:
        # Both ends of both ranges change one by one; Bokeh's event would wait for the wheel.
        if not self._is_moving:
            self._is_moving = True
            self.figure.document.add_next_tick_callback(self._move)

    def _move(self) -> None:
        self._is_moving = False
        across, velocity = self.figure.x_range, self.figure.y_range
        self._moved((across.start, across.end), (velocity.start, velocity.end))

    def show(self, picture: Picture, colours: Colours) -> None:
        """Draw a picture in the window for which it was computed."""
        view = picture.view
        pixels = paint(picture, colours)
        exponents = np.full(picture.labels.shape, NONE, np.float32)
        if picture.exponents is not None:
            exponents = np.nan_to_num(picture.exponents, nan=NONE, neginf=-NONE)
        labels = sorted(colours.names)
        self._names.data = {'label': labels, 'name': [colours.names[each] for each in labels]}
        self.source.data = {
            'image': [pixels.view('uint32').reshape(pixels.shape[:2])],
            'label': [picture.labels], 'lifetime': [picture.lifetimes], 'exponent': [exponents],
            'x': [view.window[0]], 'y': [view.velocity[0]],
            'dw': [view.window[1] - view.window[0]], 'dh': [view.velocity[1] - view.velocity[0]]}

    def show_layers(self, layers: Layers, view: View) -> None:
        """Draw layers over a view, whose picture becomes pale."""
        self._image.glyph.global_alpha = PALE if layers.asked.names else 1.0
        self._layers.show(layers, view.window)

    def mark(self, across: float, velocity: float) -> None:
        """Mark the point whose trajectory is shown."""
        self._point.data = {'x': [across], 'y': [velocity]}

    def go_to(self, across: Window, velocity: Window) -> None:
        self.figure.x_range.update(start=across[0], end=across[1])
        self.figure.y_range.update(start=velocity[0], end=velocity[1])


class LayerGlyphs:
    """The marks and lines of layers in one figure."""

    def __init__(self, plot: figure, ending: str) -> None:
        self._sources = {name: ColumnDataSource(name=f'{name}{ending}', data={
            column: [] for column in columns}) for name, columns in COLUMNS.items()}
        self._drawn: dict[str, tuple[Any, range]] = {}
        for name, colour in (('stable', STABLE), ('unstable', UNSTABLE)):
            plot.line('x', 'y', source=self._sources[name], color=colour)
        plot.scatter('x', 'y', source=self._sources['edge'], marker='diamond', size=6,
                     fill_color=AMBER, line_color='black', line_width=0.4)
        orbits = plot.scatter('x', 'y', source=self._sources['orbits'], size='size',
                              fill_color='white', fill_alpha='filled', line_color='black',
                              line_width=1.4)
        plot.add_tools(models.HoverTool(renderers=[orbits], tooltips=NAME_TIP))
        plot.add_layout(models.Arrow(
            source=self._sources['kick'], x_start='x', y_start='y', x_end='to_x', y_end='to_y',
            line_color=MARK, line_width=3,
            end=models.NormalHead(size=9, fill_color=MARK, line_color=MARK)))
        plot.scatter('x', 'y', source=self._sources['kick'], size=7, color=MARK)

    def show(self, layers: Layers, phase: tuple[float, float]) -> None:
        """Draw what is new, in every turn of phase that a window touches."""
        turns = range(math.floor(phase[0] / TWO_PI), math.ceil(phase[1] / TWO_PI))
        for name, source in self._sources.items():
            drawn = getattr(layers, name)
            before = self._drawn.get(name)
            if before is not None and before[0] is drawn and before[1] == turns:
                continue
            self._drawn[name] = drawn, turns
            columns = _marks(layers) if name == 'orbits' else [*np.transpose(drawn)]
            source.data = {column: np.concatenate(
                [values + TWO_PI * each if column.endswith('x') else values for each in turns])
                for column, values in zip(COLUMNS[name], columns, strict=True)}


def _marks(layers: Layers) -> list[np.ndarray]:
    # Impacts are filled just before, and hollow just after.
    rows = [(*point, SMALLEST + LARGER * (LONGEST - orbit.impacts), filled, orbit.name)
            for orbit in layers.orbits
            for filled, there in zip((1.0, 0.0), places(
                layers.asked.view, orbit.walls, orbit.points), strict=True)
            for point in there[np.isfinite(there[:, 0])].tolist()]
    return [np.array([row[k] for row in rows]) for k in range(len(COLUMNS['orbits']))]
