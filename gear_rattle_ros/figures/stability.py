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

import dataclasses
import math
from typing import TYPE_CHECKING

from matplotlib.figure import Figure
from matplotlib.patches import Circle
import numpy as np

from . import style
from .grids import colours_and_names, over_basins
from .style import BOTTOM, Looks
from ..palette import ENDS, GREY

if TYPE_CHECKING:
    import xarray

# Height of the axes of erosion [pixels].
EROSION = 180


def draw_stability(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw the discs round impacts, the largest discs, and the arrows of the smallest kicks."""
    a, erodes = dataset.attrs, 'erosion_alpha' in dataset
    title = looks.title or (
        f'alpha {a["alpha"]:g}: smallest kicks (arrows), discs round impacts, largest discs')
    figure, axes = over_basins(dataset, dataclasses.replace(looks, title=title), 0.45,
                               erodes * (2 * EROSION + BOTTOM + 20))
    axes.set(xlabel=style.PHASE_LABEL, ylabel=style.VELOCITY_LABEL)
    style.name_walls(axes)
    colours, _ = colours_and_names(dataset, looks)
    colours = ENDS | colours
    for k, label in enumerate(dataset['attractor_label'].values.tolist()):
        for name, size in (('point', 40.0), ('box', 2.0)):
            mine = dataset[f'{name}_label'].values == label
            phase, velocity = (dataset[f'{name}_{axis}'].values[mine] for axis in (
                'phase', 'velocity'))
            axes.scatter(phase, velocity, s=size, color=colours[label], edgecolors='white',
                         linewidths=0.6 * (name == 'point'), zorder=3)
        one = {str(name).removeprefix('attractor_'): dataset[name].values[k]
               for name in dataset.data_vars if str(name).startswith('attractor_')}
        for kind, name, line in (('disc', 'radius', ':'), ('displacement', 'size', '-')):
            radius = one[f'{kind}_{name}']
            if math.isfinite(radius) and radius > 0.0:
                axes.add_patch(Circle((one[f'{kind}_phase'], one[f'{kind}_velocity']), radius,
                                      fill=False, linestyle=line, linewidth=1.2,
                                      edgecolor='black', zorder=3))
        if math.isfinite(one['kick_size']):
            # In the velocity before the impact that has the same effect.
            scale = -1.0 / a['restitution'] if one['kick_velocity'] and a['restitution'] else 1.0
            axes.annotate('', (one['kick_phase'], one['kick_velocity'] + scale * one[
                'kick_change']), (one['kick_phase'], one['kick_velocity']), zorder=4,
                arrowprops={'arrowstyle': '->', 'color': 'black', 'shrinkA': 0, 'shrinkB': 0})
    if erodes:
        _draw_erosion(figure, dataset, colours)
    return figure


def _draw_erosion(figure: Figure, dataset: 'xarray.Dataset', colours: dict[int, str]) -> None:
    place, alphas = figure.axes[0].get_position(), dataset['erosion_alpha'].values
    height = figure.get_size_inches()[1] * style.DPI
    for q, (name, words) in enumerate((('share', 'basin stability [1]'),
                                       ('kick', 'smallest kick [1]'))):
        bottom = place.y0 - (BOTTOM + EROSION + (EROSION + 20) * q) / height
        axes = figure.add_axes((place.x0, bottom, place.width, EROSION / height))
        axes.tick_params(labelsize=11, labelbottom=q == 1)
        for k, label in enumerate(dataset['attractor_label'].values.tolist()):
            axes.plot(alphas, dataset[f'erosion_{name}'].values[k], '.-', color=colours[label],
                      linewidth=0.9, markersize=4)
            left = dataset['attractor_left'].values[k, q]
            for alpha in left[np.isfinite(left)]:
                axes.axvline(alpha, color=colours[label], linestyle=':', linewidth=1.0)
        axes.axvline(dataset.attrs['alpha'], color=GREY, linewidth=0.8)
        axes.set_xlim(alphas[0], alphas[-1])
        axes.set_ylim(bottom=0.0)
        axes.set_ylabel(words, fontsize=12)
    axes.set_xlabel('amplitude of the drive, alpha [1]', fontsize=12)
