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

"""Layers as they are drawn over the plane."""

import math
from typing import Any, Final

from bokeh import models
from bokeh.models import ColumnDataSource
from bokeh.plotting import figure
import numpy as np

from .skeleton import Layers, LONGEST, places
from ..attractors.plane import TWO_PI
from ..palette import AMBER, MARK, STABLE, UNSTABLE

COLUMNS: Final = {
    'stable': ('x', 'y'), 'unstable': ('x', 'y'), 'edge': ('x', 'y'),
    'orbits': ('x', 'y', 'size', 'filled', 'name'), 'kick': ('x', 'y', 'to_x', 'to_y')}
# Diameter of the mark of an orbit, and what it is larger by for each impact less [pixels].
SMALLEST: Final = 5.0
LARGER: Final = 1.6
TIP: Final = '<div style="font:12px system-ui,sans-serif;padding:1px 3px">@name</div>'


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
        plot.add_tools(models.HoverTool(renderers=[orbits], tooltips=TIP))
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
