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

"""Pictures over the basins: periodic orbits, manifolds, stability."""

import dataclasses
import math
from typing import Any, Final, TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch
import numpy as np

from . import style
from .grids import colours_and_names, draw_basins, scatter
from .style import BOTTOM, legend_mark, Looks
from ..attractors.plane import IMPACT, Plane
from ..core.orbits.curves import pieces
from ..core.words import counted
from ..palette import ENDS, GREY, MARK, STABLE, UNSTABLE

if TYPE_CHECKING:
    import xarray

# Marks of orbits by their impacts: those of the least, which have the fewest points, are largest.
SIZES: Final = (9.0, 7.0, 5.5, 4.0, 2.5, 1.5)
# Height of the axes of erosion [pixels].
EROSION: Final = 180


def over_basins(dataset: 'xarray.Dataset', looks: Looks, strength: float, below: int = 0
                ) -> tuple[Figure, Axes]:
    """Draw the basins with this opacity [1]; what is drawn over them does not move the window."""
    figure = draw_basins(dataset, looks, below)
    axes = figure.axes[0]
    axes.images[0].set_alpha(strength)
    axes.set_ylim(*dataset.attrs['velocity_window'])
    return figure, axes


def draw_orbits(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw the basins pale and the impacts of unstable orbits over them, before and after."""
    figure, axes = over_basins(dataset, looks, 0.4)
    owner, wall, phase, velocity = (dataset[f'cycle_point_{name}'].values for name in (
        'number', 'wall', 'phase', 'velocity'))
    plane = Plane.of(dataset.attrs)
    factors = plane.factors(dataset.attrs['restitution'])
    here = (plane.holds(wall)
            & ~dataset['cycle_is_stable'].values.astype(np.bool_)[owner])
    impacts = dataset['cycle_impacts'].values[owner]
    handles = []
    shown = np.unique(impacts[here])
    colours = looks.scale('viridis')(np.linspace(0.0, 0.9, max(len(shown), 1)))
    for k, q in enumerate(shown.tolist()):
        mine = here & (impacts == q)
        size = SIZES[min(k, len(SIZES) - 1)]
        for factor, fill in zip(factors, (colours[k], 'none'), strict=False):
            axes.plot(phase[mine], factor * velocity[mine], 'o', color=colours[k],
                      markerfacecolor=fill, markersize=size, markeredgewidth=0.8, zorder=40 - k,
                      rasterized=True)
        if k < len(SIZES) or k == len(shown) - 1:
            handles.append(Line2D([], [], color=colours[k], marker='o', linestyle='none',
                                  markersize=size, label=counted(q, 'impact')))
    if len(factors) > 1:
        handles.append(Line2D([], [], color=GREY, marker='o', linestyle='none',
                              markerfacecolor='none', label='just after the impact'))
    axes.legend(handles=handles, loc='best', fontsize=9, framealpha=0.9,
                title='unstable orbits')
    return figure


def draw_manifolds(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw the basins pale and the manifolds over them, before and after impacts."""
    a, plane = dataset.attrs, Plane.of(dataset.attrs)
    factors = plane.factors(a['restitution'])
    figure, axes = over_basins(dataset, looks, 0.35)
    stable, mark = ('#4d4d4d', 'black') if looks.is_paper else (STABLE, MARK)
    curve = {name: dataset[f'curve_{name}'].values
             for name in ('number', 'wall', 'begins', 'grazes')}
    points = np.column_stack([dataset[f'curve_{axis}'].values for axis in ('phase', 'velocity')])
    for name, colour, width in (('stable', stable, 0.5), ('unstable', UNSTABLE, 0.7)):
        mine = plane.holds(curve['wall']) & np.isin(curve['number'], [
            number for number, side in enumerate(a['sides'].split(', ')) if side.startswith(name)])
        steps = pieces(points[mine], curve['begins'][mine] != 0)
        ends = points[mine & (curve['grazes'] == 1)]
        for factor in factors:
            axes.add_collection(LineCollection(list(steps * (1.0, factor)), colors=colour,
                                               linewidths=width, rasterized=True))
            axes.plot(ends[:, 0], factor * ends[:, 1], '.', color=colour, markersize=2.5,
                      rasterized=True)
    handles: list[Any] = [Line2D([], [], color=UNSTABLE, label='unstable manifold'),
                          Line2D([], [], color=stable, label='stable manifold')]
    for kind, words, marker in (('saddle', 'saddle', 'o'), ('crossing', 'first crossing', 'x')):
        here = plane.holds(dataset[f'{kind}_wall'].values)
        axes.plot(dataset[f'{kind}_phase'].values[here],
                  factors[0] * dataset[f'{kind}_velocity'].values[here], marker, color=mark,
                  markersize=7.0, markeredgewidth=2.0, zorder=4)
        handles += [legend_mark(marker, mark, words)] * bool(len(here))
    for number in np.unique(dataset['cell_number'].values).tolist():
        mine = (dataset['cell_number'].values == number) & plane.holds(
            dataset['cell_wall'].values)
        phase = np.unwrap(dataset['cell_phase'].values[mine])
        for turned in (-math.tau, 0.0, math.tau):
            axes.fill(phase + turned, factors[0] * dataset['cell_velocity'].values[mine],
                      color=mark, alpha=0.3, linewidth=0.0)
        handles += [Patch(color=mark, alpha=0.3, label='basin cell')] * (number == 0)
    axes.legend(handles=[*handles, legend_mark('.', GREY, 'end at a grazing')], loc='upper right',
                fontsize=9, framealpha=0.9)
    return figure


def draw_stability(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw the discs round impacts, the largest discs, and the arrows of the smallest kicks."""
    a, erodes = dataset.attrs, 'erosion_share' in dataset
    plane = Plane.of(a)
    has_impacts = plane.kind == IMPACT
    title = looks.title or f'alpha {a["alpha"]:g}: ' + (
        'smallest kicks (arrows), discs round impacts, largest discs' if has_impacts else
        f'largest discs in the basins, {plane.words}')
    figure, axes = over_basins(dataset, dataclasses.replace(looks, title=title), 0.45,
                               erodes * (2 * EROSION + BOTTOM + 20))
    colours, _ = colours_and_names(dataset, looks)
    colours = ENDS | colours
    for k, label in enumerate(dataset['attractor_label'].values.tolist()):
        if has_impacts:
            scatter(axes, dataset, label, colours[label])
        one = {str(name).removeprefix('attractor_'): dataset[name].values[k]
               for name in dataset.data_vars if str(name).startswith('attractor_')}
        for kind, name, line in (('disc', 'radius', ':'), ('displacement', 'size', '-'))[
                :1 + has_impacts]:
            radius = one[f'{kind}_{name}']
            if math.isfinite(radius) and radius > 0.0:
                centre = one[f'{kind}_{plane.across}'], one[f'{kind}_velocity']
                axes.add_patch(Circle(centre, radius,
                                      fill=False, linestyle=line, linewidth=1.2,
                                      edgecolor='black', zorder=3))
        if has_impacts and math.isfinite(one['kick_size']):
            # In the velocity before the impact that has the same effect.
            scale = -1.0 / a['restitution'] if one['kick_velocity'] and a['restitution'] else 1.0
            axes.annotate('', (one['kick_phase'], one['kick_velocity'] + scale * one[
                'kick_change']), (one['kick_phase'], one['kick_velocity']), zorder=4,
                arrowprops={'arrowstyle': '->', 'color': 'black', 'shrinkA': 0, 'shrinkB': 0})
    if erodes:
        _draw_erosion(figure, dataset, colours)
    return figure


def _draw_erosion(figure: Figure, dataset: 'xarray.Dataset', colours: dict[int, str]) -> None:
    place = figure.axes[0].get_position()
    axis = dataset.attrs.get('erosion_window_along', 'alpha')
    places = dataset[f'erosion_{axis}']
    height = figure.get_size_inches()[1] * style.DPI
    for q, (name, words) in enumerate((('share', 'basin stability [1]'),
                                       ('kick', 'smallest kick [1]'))):
        bottom = place.y0 - (BOTTOM + EROSION + (EROSION + 20) * q) / height
        axes = figure.add_axes((place.x0, bottom, place.width, EROSION / height))
        axes.tick_params(labelsize=11, labelbottom=q == 1)
        for k, label in enumerate(dataset['attractor_label'].values.tolist()):
            axes.plot(places, dataset[f'erosion_{name}'].values[k], '.-', color=colours[label],
                      linewidth=0.9, markersize=4)
            left = dataset['attractor_left'].values[k, q]
            for each in left[np.isfinite(left)]:
                axes.axvline(each, color=colours[label], linestyle=':', linewidth=1.0)
        if axis in dataset.attrs:
            axes.axvline(dataset.attrs[axis], color=GREY, linewidth=0.8)
        axes.set_xlim(*places.values[[0, -1]])
        axes.set_ylim(bottom=0.0)
        axes.set_ylabel(words, fontsize=12)
    axes.set_xlabel(f'{places.attrs["long_name"]}, {axis} [1]', fontsize=12)
