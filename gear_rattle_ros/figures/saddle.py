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

"""The picture of a saddle on the section: straddle trajectories, attractors, accessible orbits."""

import math
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from . import style
from .grids import colours_and_names
from .style import LEFT, Looks, RIGHT

if TYPE_CHECKING:
    import xarray

WIDTH, HEIGHT, BOTTOM, TOP, ROW = 720, 540, 70, 70, 20


def draw_saddle(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw the impacts straddled; of each attractor its points, and the accessible orbit."""
    a = dataset.attrs
    colours, names = colours_and_names(dataset, looks)
    keys = dict(zip(dataset['attractor_key'].values.tolist(),
                    dataset['attractor_label'].values.tolist(), strict=True))
    sides = dataset['orbit_side'].values.tolist()
    rows = 1 + len(colours) + sum(map(bool, sides))
    bottom = BOTTOM + ROW * rows
    figure = style.new_figure(LEFT + WIDTH + RIGHT, bottom + HEIGHT + TOP, looks)
    axes = style.add_axes(figure, LEFT, bottom, WIDTH, HEIGHT)
    axes.plot(dataset['phase'].values.ravel(), dataset['velocity'].values.ravel(), 'o',
              color='black', markersize=2.2, markeredgewidth=0.0, rasterized=True)
    what = (f'the orbit {a["is_orbit"]}' if a['is_orbit'] else 'the chaotic saddle')
    handles = [style.legend_mark('o', 'black', f'impacts straddled: {what}')]
    for label, colour in colours.items():
        for name, size in (('point', 46.0), ('box', 2.0)):
            mine = dataset[f'{name}_label'].values == label
            if mine.any():
                axes.scatter(dataset[f'{name}_phase'].values[mine],
                             dataset[f'{name}_velocity'].values[mine], s=size, color=colour,
                             edgecolors='white', linewidths=0.7 * (name == 'point'), zorder=3)
                handles.append(style.legend_mark('o', colour, names[label]))
    for number, side in enumerate(sides):
        if side:
            mine = dataset['orbit_point_number'].values == number
            axes.scatter(dataset['orbit_point_phase'].values[mine],
                         dataset['orbit_point_velocity'].values[mine], marker='X', s=90,
                         color=colours[keys[side]], edgecolors='white', linewidths=1.0, zorder=4)
            handles.append(style.legend_mark('X', colours[keys[side]], 'accessible from there: '
                                             f'{dataset["orbit_key"].values[number]}'))
    style.name_walls(axes)
    axes.set_ylabel(style.VELOCITY_LABEL, fontsize=12)
    style.phase_ticks(axes, (0.0, 2.0 * math.pi))
    axes.set_xlim(0.0, 2.0 * math.pi)
    figure.legend(handles=handles, loc='lower left', frameon=False, fontsize=10,
                  bbox_to_anchor=(LEFT / (LEFT + WIDTH + RIGHT), 0.0))
    kind = 'a transient' if a['straddles'] == 'lifetimes' else 'the boundary of basins'
    style.write_title(figure, LEFT, looks.title or f'alpha {a["alpha"]:g}: saddle of {kind}')
    return figure
