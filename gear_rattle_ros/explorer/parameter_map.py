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
from typing import TYPE_CHECKING

from bokeh.events import Tap
from bokeh.models import ColumnDataSource, Range1d
from bokeh.plotting import figure
import numpy as np

from .plane_figure import WIDTH
from ..core.model import Parameters
from ..figures.parameter_plane import paint
from ..figures.style import Looks

if TYPE_CHECKING:
    import xarray

HEIGHT = 420


class ParameterMap:
    """The picture of a dataset of `parameter_plane`, and where in it the page is."""

    def __init__(self, dataset: 'xarray.Dataset', choose: Callable[[str, float], None]) -> None:
        names = y, x = tuple(map(str, dataset['attractors'].dims))
        (low, high), (left, right) = (dataset.attrs[f'{name}_window'] for name in names)
        self._names, self._here = names, ColumnDataSource(
            name='parameters', data={name: [] for name in names})
        self.figure = figure(
            name='map', width=WIDTH, height=HEIGHT, tools='pan,wheel_zoom,reset',
            active_scroll='wheel_zoom', x_range=Range1d(left, right), y_range=Range1d(low, high),
            x_axis_label=f'{x} [1]', y_axis_label=f'{y} [1]', min_border_left=66)
        self.figure.toolbar.logo = None
        self.figure.axis.axis_label_text_font_style = 'normal'
        picture = paint(dataset, Looks())[0]
        pixels = np.full((*picture.shape[:2], 4), 255, np.uint8)
        pixels[..., :3] = np.rint(255.0 * picture)
        self.figure.image_rgba(
            image=[pixels.view(np.uint32)[..., 0]], x=left, y=low, dw=right - left, dh=high - low)
        owners = dataset['vertex_curve'].values
        curves = [owners == number for number in np.unique(owners)]
        for colour, width in (('white', 2.5), ('black', 1.0)):
            self.figure.multi_line(*([dataset[f'vertex_{name}'].values[mine] for mine in curves]
                                     for name in (x, y)), line_color=colour, line_width=width)
        for size, colour, width in ((15, 'black', 4), (15, 'white', 2)):
            self.figure.scatter(x, y, source=self._here, size=size, marker='cross',
                                line_color=colour, line_width=width)

        def tapped(event: Tap) -> None:
            for name, value in ((x, event.x), (y, event.y)):
                choose(name, float(value))

        self.figure.on_event(Tap, tapped)

    def mark(self, parameters: Parameters) -> None:
        self._here.data = {name: [getattr(parameters, name)] for name in self._names}
