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

"""Three figures of one trajectory: the motion, its impacts on the section, velocity by impact."""

from typing import Any

from bokeh.models import ColumnDataSource, Range1d, Span
from bokeh.palettes import Viridis256
from bokeh.plotting import figure
from bokeh.transform import linear_cmap
import numpy as np

from .axes import formatter, si_axis, ticker
from ..computing.trajectory import IMPACTS, PERIODS, Trajectory
from ...attractors.plane import TWO_PI
from ...core.gears import Gears
from ...palette import BLUE, GREY

WIDTH = 636
MOTION_HEIGHT = 190
HEIGHT = 270


class TrajectoryFigures:
    """Draws the trajectory from the point that was clicked."""

    def __init__(self, gears: Gears | None = None) -> None:
        self._motion = ColumnDataSource(name='motion', data={'t': [], 's': []})
        self._impacts = ColumnDataSource(
            name='impacts', data={'n': [], 'phase': [], 'velocity': []})
        self.motion = _figure('motion', WIDTH, MOTION_HEIGHT, Range1d(0, PERIODS),
                              y_range=Range1d(-1.12, 0.12))
        self.motion.line('t', 's', source=self._motion, color=BLUE, line_width=1.4)
        for wall in (-1.0, 0.0):
            self.motion.add_layout(Span(location=wall, dimension='width', line_color=GREY,
                                        line_width=2))
        self.motion.xaxis.axis_label = 'drive periods τ/2π'
        self.motion.yaxis.axis_label = 's [1]'
        self.motion.yaxis.ticker = [-1, -0.5, 0]
        age = linear_cmap('n', Viridis256[::-1], 1, IMPACTS)
        phases = Range1d(0, TWO_PI)
        self.section = _figure('section: impacts, late ones dark', WIDTH // 2, HEIGHT, phases)
        self.section.scatter('phase', 'velocity', source=self._impacts, size=4, color=age)
        self.section.xaxis.ticker = ticker(phases, is_phase=True)
        self.section.xaxis.formatter = formatter(phases, is_phase=True)
        self.section.xaxis.axis_label = 'drive phase [rad]'
        self.section.yaxis.axis_label = "s' before impact [1]"
        self.sequence = _figure('velocity by impact', WIDTH - WIDTH // 2, HEIGHT,
                                Range1d(0, IMPACTS))
        self.sequence.scatter('n', 'velocity', source=self._impacts, size=2.5, color=age)
        self.sequence.xaxis.axis_label = 'impact n'
        self.sequence.yaxis.axis_label = 'v_n [1]'
        if gears:
            self.sequence.add_layout(si_axis(
                self.sequence.y_range, 1e3 * gears.scales.velocity_m_per_s, '[mm/s]'), 'right')

    def show(self, trajectory: Trajectory) -> None:
        self._motion.data = {'t': trajectory.periods, 's': trajectory.displacement}
        self._impacts.data = {'n': np.arange(1, len(trajectory.phases) + 1),
                              'phase': trajectory.phases, 'velocity': trajectory.velocities}


def _figure(title: str, width: int, height: int, x_range: Range1d, **options: Any) -> figure:
    plot = figure(title=title, width=width, height=height, x_range=x_range, tools='',
                  toolbar_location=None, **options)
    plot.title.text_font_size = '12px'
    plot.axis.axis_label_text_font_style = 'normal'
    plot.grid.grid_line_color = '#ececec'
    return plot
