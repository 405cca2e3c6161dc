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

"""The picture of manifolds over the basins that they bound."""

from typing import Final, TYPE_CHECKING

from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
import numpy as np

from .grids import draw_basins
from .style import Looks
from ..palette import GREY

if TYPE_CHECKING:
    import xarray

UNSTABLE: Final = '#000000'
STABLE: Final = '#00682d'
MARK: Final = '#c2007a'
# A step over the edge of the picture is no line.
WIDE: Final = 3.0


def draw_manifolds(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw the basins pale and the manifolds over them, before and after impacts."""
    a = dataset.attrs
    figure = draw_basins(dataset, looks)
    axes = figure.axes[0]
    axes.images[0].set_alpha(0.35)
    stable, mark = ('#4d4d4d', 'black') if looks.is_paper else (STABLE, MARK)
    wall, after = -int(a['displacement']), -float(a['restitution'])
    for name, colour, width in (('stable', stable, 0.5), ('unstable', UNSTABLE, 0.7)):
        chosen = [number for number, side in enumerate(a['sides'].split(', '))
                  if side.startswith(name)]
        mine = np.isin(dataset['curve_number'].values, chosen)
        points = np.column_stack([dataset[f'curve_{axis}'].values for axis in
                                  ('phase', 'velocity')])
        joined = (mine[1:] & (dataset['curve_begins'].values[1:] == 0)
                  & (dataset['curve_wall'].values[1:] == wall)
                  & (np.abs(np.diff(points[:, 0])) < WIDE))
        steps = np.stack([points[:-1][joined], points[1:][joined]], axis=1)
        grazing = mine & (dataset['curve_grazes'].values == 1) & (
            dataset['curve_wall'].values == wall)
        for factor in (1.0, after):
            axes.add_collection(LineCollection(list(steps * (1.0, factor)), colors=colour,
                                               linewidths=width, rasterized=True))
            axes.plot(points[grazing, 0], factor * points[grazing, 1], '.', color=colour,
                      markersize=2.5, rasterized=True)
    for kind, marker in (('saddle', 'o'), ('crossing', 'x')):
        here = dataset[f'{kind}_wall'].values == wall
        axes.plot(dataset[f'{kind}_phase'].values[here], dataset[f'{kind}_velocity'].values[here],
                  marker, color=mark, markersize=7.0, markeredgewidth=2.0, zorder=4)
    axes.set_xlim(*a['phase_window'])
    axes.set_ylim(*a['velocity_window'])
    axes.legend(handles=[
        Line2D([], [], color=UNSTABLE, label='unstable manifold'),
        Line2D([], [], color=stable, label='stable manifold'),
        Line2D([], [], color=mark, marker='o', linestyle='none', label='saddle'),
        *([Line2D([], [], color=mark, marker='x', linestyle='none', label='first crossing')]
          if len(dataset['crossing_wall']) else []),
        Line2D([], [], color=GREY, marker='.', linestyle='none', label='end at a grazing')],
        loc='upper right', fontsize=9, framealpha=0.9)
    return figure
