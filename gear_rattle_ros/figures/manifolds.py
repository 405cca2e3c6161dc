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

import math
from typing import Any, Final, TYPE_CHECKING

from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
import numpy as np

from .grids import over_basins
from .style import legend_mark, Looks
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
    figure, axes = over_basins(dataset, looks, 0.35)
    stable, mark = ('#4d4d4d', 'black') if looks.is_paper else (STABLE, MARK)
    curve = {name: dataset[f'curve_{name}'].values
             for name in ('number', 'wall', 'begins', 'grazes')}
    points = np.column_stack([dataset[f'curve_{axis}'].values for axis in ('phase', 'velocity')])
    for name, colour, width in (('stable', stable, 0.5), ('unstable', UNSTABLE, 0.7)):
        mine = (curve['wall'] == -a['displacement']) & np.isin(curve['number'], [
            number for number, side in enumerate(a['sides'].split(', ')) if side.startswith(name)])
        joined = mine[1:] & (curve['begins'][1:] == 0) & (np.abs(np.diff(points[:, 0])) < WIDE)
        steps = np.stack([points[:-1][joined], points[1:][joined]], axis=1)
        ends = points[mine & (curve['grazes'] == 1)]
        for factor in (1.0, -a['restitution']):
            axes.add_collection(LineCollection(list(steps * (1.0, factor)), colors=colour,
                                               linewidths=width, rasterized=True))
            axes.plot(ends[:, 0], factor * ends[:, 1], '.', color=colour, markersize=2.5,
                      rasterized=True)
    handles: list[Any] = [Line2D([], [], color=UNSTABLE, label='unstable manifold'),
                          Line2D([], [], color=stable, label='stable manifold')]
    for kind, words, marker in (('saddle', 'saddle', 'o'), ('crossing', 'first crossing', 'x')):
        here = dataset[f'{kind}_wall'].values == -a['displacement']
        axes.plot(*(dataset[f'{kind}_{axis}'].values[here] for axis in ('phase', 'velocity')),
                  marker, color=mark, markersize=7.0, markeredgewidth=2.0, zorder=4)
        handles += [legend_mark(marker, mark, words)] * bool(len(here))
    for number in np.unique(dataset['cell_number'].values):
        mine = (dataset['cell_number'].values == number) & (
            dataset['cell_wall'].values == -a['displacement'])
        phase = np.unwrap(dataset['cell_phase'].values[mine])
        for turned in (-math.tau, 0.0, math.tau):
            axes.fill(phase + turned, dataset['cell_velocity'].values[mine], color=mark,
                      alpha=0.3, linewidth=0.0)
        handles += [Patch(color=mark, alpha=0.3, label='basin cell')] * (number == 0)
    axes.legend(handles=[*handles, legend_mark('.', GREY, 'end at a grazing')], loc='upper right',
                fontsize=9, framealpha=0.9)
    return figure
