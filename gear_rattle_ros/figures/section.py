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

"""Pictures of the section, and of one trajectory: its impacts in turn, its motion."""

import math
from typing import Any, Final, TYPE_CHECKING

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
import numpy as np

from . import style
from .grids import colours_and_names
from .style import LEFT, Looks, RIGHT
from ..core.flight.lanes import EMPTY
from ..core.orbits.letters import LETTERS
from ..core.words import counted
from ..palette import GREY

if TYPE_CHECKING:
    import xarray

BOTTOM, TOP = 70, 84
# Size of the pictures of one trajectory [pixels].
WIDTH, HEIGHT = 900, 420
MOTION_HEIGHT: Final = 260
TWO_PI: Final = 2.0 * math.pi


def draw_section(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw where impacts are, + for periodic orbits in the paper; or velocities in turn."""
    a = dataset.attrs
    if looks.draw == 'impacts':
        return _draw_impacts(dataset, looks)
    counts = dataset['count'].values.astype(np.float64)
    width, height = counts.shape[2], counts.shape[1]
    figure = style.new_figure(LEFT + width + RIGHT, BOTTOM + height + TOP, looks)
    axes = style.add_axes(figure, LEFT, BOTTOM, width, height)
    # In the paper all points are black.
    share = counts[1] > 0.0 if looks.is_paper else style.widened(style.equalise(counts[1]))
    picture = np.ones((height, width, 3))
    some, single = share > 0.0, len(dataset['impact_phase'].values) > 0
    if single:
        # Few points are seen better as dots.
        count = None if a['lifetime'] < 0 else max(0, a['lifetime'] - a['impacts_skipped'])
        axes.plot(*(dataset[f'impact_{name}'].values[:count] for name in ('phase', 'velocity')),
                  'o', color=looks.ink(0), markersize=1.8, markeredgewidth=0.0, rasterized=True)
    else:
        picture[some] = style.shade(looks.ink(0), share)[some]
    axes.imshow(picture, origin='lower', aspect='auto', interpolation='nearest',
                extent=(0.0, TWO_PI, *a['velocity_window']))
    marks: dict[str, Any] = (
        {'marker': '+', 's': 260, 'color': 'black', 'linewidths': 2.0} if looks.is_paper
        else {'s': 42, 'color': looks.hue(1), 'edgecolors': 'white', 'linewidths': 0.8})
    # The paper has no orbits beside the chaotic attractor.
    has_orbits = len(dataset['orbit_phase'].values) > 0 and (single or not looks.is_paper)
    if has_orbits:
        axes.scatter(dataset['orbit_phase'].values, dataset['orbit_velocity'].values, zorder=3,
                     **marks)
    style.name_walls(axes)
    axes.set_ylabel(style.VELOCITY_LABEL, fontsize=12)
    style.phase_ticks(axes, (0.0, TWO_PI))
    handles = []
    if some.any():
        darker = '' if looks.is_paper else ' (darker: more impacts)'
        handles.append(style.legend_mark('s', looks.ink(0), (
            f'chaotic transient of {counted(a["lifetime"], "impact")}' if a['lifetime'] > 0 else
            f'trajectories that do not recur{darker}')))
    if has_orbits:
        words = 'periodic orbit' if single else 'periodic orbits that were reached'
        handles.append(style.legend_mark('+' if looks.is_paper else 'o', looks.ink(1), words))
    last = a['impacts_skipped'] + a['impacts_counted']
    style.write_title(figure, LEFT, looks.title or (
        f'alpha {a["alpha"]:g}: {counted(a["trajectories"], "trajectory")}, impacts '
        f'{a["impacts_skipped"]:,} to {last:,}'))
    axes.legend(handles=handles, loc='lower left', bbox_to_anchor=(-0.01, 1.0), ncols=2,
                frameon=False, fontsize=10, handletextpad=0.2)
    return figure


def _draw_impacts(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    a, velocities = dataset.attrs, dataset['impact_velocity'].values
    if not len(velocities):
        raise ValueError('the impacts of many trajectories are not kept in turn; compute the '
                         'section of one, with --initial')
    numbers = a['impacts_skipped'] + 1 + np.arange(len(velocities))
    figure = style.new_figure(LEFT + WIDTH + RIGHT, BOTTOM + HEIGHT + style.TOP, looks)
    axes = style.add_axes(figure, LEFT, BOTTOM, WIDTH, HEIGHT)
    settled = numbers > a['lifetime'] if a['lifetime'] >= 0 else np.zeros(len(numbers), np.bool_)
    colours = {0: looks.ink(0), 1: looks.ink(1)}
    parts, size = settled.astype(np.int64), 1.6
    if 'impact_attractor' in dataset:
        # With noise, by the attractor whose core was visited last.
        parts, size = dataset['impact_attractor'].values, 1.0
        colours, names = colours_and_names(dataset, looks)
        colours[EMPTY] = GREY
        axes.legend(handles=[style.legend_mark('o', colours[label], name) for label, name in
                             names.items() if label in parts], loc='lower right',
                    bbox_to_anchor=(1.01, 0.99), ncols=2, frameon=False, handletextpad=0.2)
    for part, colour in colours.items():
        axes.plot(numbers[parts == part], velocities[parts == part], 'o', color=colour,
                  markersize=size, markeredgewidth=0.0, rasterized=True)
    if settled.any() and not looks.is_paper:
        axes.axvline(a['lifetime'], color=GREY, linewidth=0.8, linestyle='--')
    axes.set_xlim(numbers[0], numbers[-1])
    axes.xaxis.set_major_formatter(FuncFormatter(style.thousands))
    axes.set_xlabel('impact n', fontsize=12)
    axes.set_ylabel(style.VELOCITY_LABEL, fontsize=12)
    end = (f', on its orbit after {counted(a["lifetime"], "impact")}' if settled.any() else
           f', kicks of {a["noise"]:g}, {counted(a["jumps"], "jump")}' if 'jumps' in a else '')
    style.write_title(figure, LEFT, looks.title or f'alpha {a["alpha"]:g}: one trajectory{end}')
    return figure


def draw_motion(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw the displacement between both walls, with the impacts."""
    a = dataset.attrs
    letter = a['attractor_letter']
    number = LETTERS.index(letter) if letter else 0
    figure = style.new_figure(LEFT + WIDTH + RIGHT, BOTTOM + MOTION_HEIGHT + style.TOP, looks)
    axes = style.add_axes(figure, LEFT, BOTTOM, WIDTH, MOTION_HEIGHT)
    for wall, name, place in ((0.0, 'upper wall', 0.06), (-1.0, 'lower wall', -1.12)):
        axes.axhline(wall, color=GREY, linewidth=2.0)
        axes.text(0.005, place, name, transform=axes.get_yaxis_transform(), color=GREY)
    axes.plot(dataset['tau'].values / TWO_PI, dataset['displacement'].values,
              color=looks.ink(number), linewidth=1.4)
    axes.plot(dataset['impact_tau'].values / TWO_PI, -dataset['impact_wall'].values, 'o',
              color=looks.ink(number), markersize=5, clip_on=False, zorder=3)
    ends = dataset['tau'].values[[0, -1]] / TWO_PI
    axes.set(xlim=ends, ylim=(-1.18, 0.18), yticks=(-1.0, -0.5, 0.0))
    axes.set_xlabel('time τ / 2π [drive periods]', fontsize=12)
    axes.set_ylabel('displacement s [1]', fontsize=12)
    name = ' '.join(filter(None, (letter, a['attractor_key']))) or 'one trajectory'
    style.write_title(figure, LEFT, looks.title or f'{name}, alpha {a["alpha"]:g}')
    return figure
