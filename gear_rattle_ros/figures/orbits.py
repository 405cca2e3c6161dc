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

"""The picture of periodic orbits over the basins."""

from typing import TYPE_CHECKING

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
import numpy as np

from .grids import over_basins
from .style import Looks
from ..core.words import counted
from ..palette import GREY

if TYPE_CHECKING:
    import xarray

# Marks of orbits by their impacts: those of the least, which have the fewest points, are largest.
SIZES = (9.0, 7.0, 5.5, 4.0, 2.5, 1.5)


def draw_orbits(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw the basins pale and the impacts of unstable orbits over them, before and after."""
    figure, axes = over_basins(dataset, looks, 0.4)
    owner, wall, phase, velocity = (dataset[f'cycle_point_{name}'].values for name in (
        'number', 'wall', 'phase', 'velocity'))
    here = ((wall == -dataset.attrs['displacement'])
            & ~dataset['cycle_is_stable'].values.astype(np.bool_)[owner])
    impacts = dataset['cycle_impacts'].values[owner]
    handles = []
    shown = np.unique(impacts[here])
    colours = looks.scale('viridis')(np.linspace(0.0, 0.9, max(len(shown), 1)))
    for k, q in enumerate(shown.tolist()):
        mine = here & (impacts == q)
        size = SIZES[min(k, len(SIZES) - 1)]
        for factor, fill in ((1.0, colours[k]), (-dataset.attrs['restitution'], 'none')):
            axes.plot(phase[mine], factor * velocity[mine], 'o', color=colours[k],
                      markerfacecolor=fill, markersize=size, markeredgewidth=0.8, zorder=40 - k,
                      rasterized=True)
        if k < len(SIZES) or k == len(shown) - 1:
            handles.append(Line2D([], [], color=colours[k], marker='o', linestyle='none',
                                  markersize=size, label=counted(q, 'impact')))
    handles.append(Line2D([], [], color=GREY, marker='o', linestyle='none',
                          markerfacecolor='none', label='just after the impact'))
    axes.legend(handles=handles, loc='upper right', fontsize=9, framealpha=0.9,
                title='unstable orbits')
    return figure
