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


"""The picture of stability: basins on the section, discs and kicks in them; erosion below."""

import math
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
import numpy as np

from . import style
from .grids import colours_and_names
from .style import add_axes, BOTTOM, LEFT, Looks, RIGHT, TOP
from ..palette import ENDS, GREY, painted

if TYPE_CHECKING:
    import xarray

WIDTH, HEIGHT, EROSION = 860, 640, 180
# Strength of the basins behind what is drawn over them.
FAINT = 0.45


def draw_stability(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw the discs round impacts, the largest discs, and the arrows of the smallest kicks."""
    a = dataset.attrs
    erodes = 'erosion_alpha' in dataset
    below = 2 * EROSION + BOTTOM + 20 if erodes else 0
    figure = style.new_figure(LEFT + WIDTH + RIGHT, BOTTOM + below + HEIGHT + TOP, looks)
    axes = add_axes(figure, LEFT, BOTTOM + below, WIDTH, HEIGHT)
    colours, names = colours_and_names(dataset, looks)
    colours = ENDS | colours
    pixels = painted(dataset['label'].values, colours)[..., :3] / 255.0
    axes.imshow(1.0 - FAINT * (1.0 - pixels), origin='lower', aspect='auto',
                interpolation='nearest', extent=(*a['phase_window'], *a['velocity_window']))
    for k, label in enumerate(dataset['attractor_label'].values.tolist()):
        one = {str(name).removeprefix('attractor_'): dataset[name].values[k]
               for name in dataset.data_vars if str(name).startswith('attractor_')}
        for name, size in (('point', 40.0), ('box', 2.0)):
            mine = dataset[f'{name}_label'].values == label
            axes.scatter(dataset[f'{name}_phase'].values[mine],
                         dataset[f'{name}_velocity'].values[mine], s=size, color=colours[label],
                         edgecolors='white', linewidths=0.6 * (name == 'point'), zorder=3)
        for place, radius, line in (
                ((one['disc_phase'], one['disc_velocity']), one['disc_radius'], ':'),
                ((one['displacement_phase'], one['displacement_velocity']),
                 one['displacement_size'], '-')):
            if math.isfinite(radius) and radius > 0.0:
                axes.add_patch(Circle(place, radius, fill=False, linestyle=line, linewidth=1.2,
                                      edgecolor='black', zorder=3))
        if math.isfinite(one['kick_size']):
            # In the velocity before the impact that has the same effect.
            scale = -1.0 / a['restitution'] if one['kick_velocity'] and a['restitution'] else 1.0
            axes.annotate('', (one['kick_phase'], one['kick_velocity'] + scale * one[
                'kick_change']), (one['kick_phase'], one['kick_velocity']), zorder=4,
                arrowprops={'arrowstyle': '->', 'color': 'black', 'shrinkA': 0, 'shrinkB': 0})
    style.name_walls(axes)
    axes.set_xlim(*a['phase_window'])
    axes.set_ylim(*a['velocity_window'])
    style.phase_ticks(axes, tuple(a['phase_window']))
    axes.set_ylabel(style.VELOCITY_LABEL, fontsize=12)
    style.write_title(figure, LEFT, looks.title or (
        f'alpha {a["alpha"]:g}: smallest kicks (arrows), discs round impacts, largest discs'))
    shown = [style.legend_mark('s', colours[label], name) for label, name in names.items()]
    axes.legend(handles=shown, loc='lower right', bbox_to_anchor=(1.0, 0.995), frameon=False,
                ncols=len(shown) if len(shown) < 4 else 3, fontsize=9, handletextpad=0.1)
    if erodes:
        panels = [add_axes(figure, LEFT, BOTTOM + place, WIDTH, EROSION)
                  for place in (EROSION + 20, 0)]
        for panel, name, words in zip(panels, ('share', 'kick'), (
                'basin stability [1]', 'smallest kick [1]'), strict=True):
            _draw_erosion(panel, dataset, name, words, colours)
        panels[0].tick_params(labelbottom=False)
        panels[1].set_xlabel('amplitude of the drive, alpha [1]', fontsize=12)
    return figure


def _draw_erosion(axes: Axes, dataset: 'xarray.Dataset', name: str, words: str,
                  colours: dict[int, str]) -> None:
    alphas = dataset['erosion_alpha'].values
    for k, label in enumerate(dataset['attractor_label'].values.tolist()):
        axes.plot(alphas, dataset[f'erosion_{name}'].values[k], '.-', color=colours[label],
                  linewidth=0.9, markersize=4)
        left = dataset['attractor_left'].values[k, ('share', 'kick').index(name)]
        for place in left[np.isfinite(left)]:
            axes.axvline(place, color=colours[label], linestyle=':', linewidth=1.0)
    axes.axvline(dataset.attrs['alpha'], color=GREY, linewidth=0.8)
    axes.set(xlim=(alphas[0], alphas[-1]))
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel(words, fontsize=12)
