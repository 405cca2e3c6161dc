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

"""A parameter plane on the page: a click sets the parameters."""

from collections.abc import Callable
import contextlib
from pathlib import Path
from typing import Final

from bokeh.events import Tap
from bokeh.models import ColumnDataSource, Range1d
from bokeh.plotting import figure
import numpy as np

from .axes import si_axis
from .plane_figure import WIDTH
from ...core.defaults import QUANTITIES
from ...core.gears import Gears
from ...core.model import Model, Parameters
from ...figures.parameter_plane import paint
from ...figures.style import Looks
from ...store.store import Store, StoreError

HEIGHT = 420
# What is painted of the first attractor of a cell, and what stands where nothing is known yet.
PAINTED: Final = {'kind': -1, 'exponent': np.nan, 'period_impacts': 0}


class ParameterMap:
    """The picture of a store of `parameter_plane`, which may grow, and where in it the page is."""

    def __init__(self, path: Path, choose: Callable[[str, float], None],
                 gears: Gears | None = None) -> None:
        self._path = path
        attributes = Store(path).attrs
        x = attributes['horizontal']
        y, = (name for name in Model._fields if name != x and f'{name}_window' in attributes)
        (low, high), (left, right) = (attributes[f'{name}_window'] for name in (y, x))
        self._names, self._here = (y, x), ColumnDataSource(
            name='parameters', data={y: [], x: []})
        columns, rows = attributes['size']
        self._cells = {name: np.full((rows, columns), empty) for name, empty in PAINTED.items()}
        self._done: set[int] = set()
        self.figure = figure(
            name='map', width=WIDTH, height=HEIGHT, tools='pan,wheel_zoom,reset',
            active_scroll='wheel_zoom', x_range=Range1d(left, right), y_range=Range1d(low, high),
            x_axis_label=f'{x} [1]', y_axis_label=f'{y} [1]', min_border_left=66)
        for name, range_, side in ((x, self.figure.x_range, 'above'),
                                   (y, self.figure.y_range, 'right')):
            quantity, unit = gears.units[name] if gears else (name, 1.0)
            if quantity != name:
                self.figure.add_layout(
                    si_axis(range_, unit, f'{quantity} [{QUANTITIES[quantity][1]}]'), side)
        self.figure.toolbar.logo = None
        self.figure.axis.axis_label_text_font_style = 'normal'
        self._image, self._curves = (ColumnDataSource(name=name, data={each: [] for each in data})
                                     for name, data in (('map_image', ('image',)),
                                                        ('map_curves', (x, y))))
        self.figure.image_rgba(image='image', source=self._image, x=left, y=low, dw=right - left,
                               dh=high - low)
        for colour, width in (('white', 2.5), ('black', 1.0)):
            self.figure.multi_line(x, y, source=self._curves, line_color=colour, line_width=width)
        for size, colour, width in ((15, 'black', 4), (15, 'white', 2)):
            self.figure.scatter(x, y, source=self._here, size=size, marker='cross',
                                line_color=colour, line_width=width)
        self.grows = self.follow()

        def tapped(event: Tap) -> None:
            for name, value in ((x, event.x), (y, event.y)):
                choose(name, float(value))

        self.figure.on_event(Tap, tapped)

    def mark(self, parameters: Parameters) -> None:
        self._here.data = {name: [getattr(parameters, name)] for name in self._names}

    def follow(self) -> bool:
        """Draw what is new in the store; whether there will be more."""
        # A table that is being written is read the next time.
        with contextlib.suppress(StoreError):
            store = Store(self._path)
            pending = set(store.pending())
            new = {*range(len(store.tiles))} - pending - self._done
            for tile in new:
                part = tuple(store.tiles[tile][name] for name in self._names)
                for name, cells in self._cells.items():
                    cells[part] = store.read(tile, name)[..., 0]
            self._done |= new
            if new or not self._image.data['image']:
                picture = paint(Looks(), *self._cells.values())[0]
                pixels = np.full((*picture.shape[:2], 4), 255, np.uint8)
                pixels[..., :3] = np.rint(255.0 * picture)
                self._image.data = {'image': [pixels.view(np.uint32)[..., 0]]}
            if pending or not store.has_table('vertex_curve'):
                return True
            owners = store.read_all('vertex_curve')
            self._curves.data = {name: [store.read_all(f'vertex_{name}')[owners == number]
                                        for number in np.unique(owners)] for name in self._names}
            return False
        return True
