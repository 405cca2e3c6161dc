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

"""Pictures of orbit diagrams."""

from collections.abc import Iterator
import math
from typing import Final, TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
import numpy as np
import numpy.typing as npt

from . import style
from .boundary import draw_values
from .style import add_axes, BOTTOM, Looks, new_figure, RIGHT, TOP
from ..attractors.catalogue import Kind
from ..core.arrays import FloatArray
from ..core.model import Model
from ..core.orbits.letters import LETTERS
from ..core.path import SEVERAL
from ..core.words import counted
from ..palette import GREY
from ..studies.attractors import swept
from ..studies.sweeps.diagram import KINDS

if TYPE_CHECKING:
    import xarray

# Margins of a picture [pixels].
LEFT, GAP = 100, 16
# Least size of a raster [pixels].
WIDTH, HEIGHT, EXPONENT_HEIGHT = 780, 450, 190
# Largest height of all rasters together, roughly [pixels].
TALLEST: Final = 1100
# Number of attractors for which the legend has room.
LEGEND_MOST: Final = 5
# An attractor in fewer columns than this share is not in the legend.
RARE: Final = 0.02
# How transitions are marked, and in which words.
MARKS: Final = {
    '^': ('birth or end of an orbit', ('fold', 'pitchfork', 'grazing', 'window')),
    'd': ('doubling', ('doubling',)), '>': ('chaos begins', ('accumulation',)),
    'v': ('merging or growth', ('merging', 'growth', 'interior crisis')),
    'X': ('crisis', ('crisis',))}
# Room for their legend [pixels].
MARKED: Final = 26
SWEEPS: Final = {'random': 'from many initial conditions at each {}',
                 'up': 'followed upwards in {}', 'down': 'followed downwards'}


def draw_diagram(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    exponent, raster = looks.draw != 'velocity', looks.draw != 'exponent'
    sweeps = [str(name) for name in dataset['sweep'].values]
    axis = swept(dataset.attrs)
    columns, bins = len(dataset[axis].values), len(dataset['velocity'].values)
    width = style.scaled(columns, WIDTH)
    merged = max(1, round(bins * len(sweeps) / TALLEST))
    height = bins // merged * max(1, round(HEIGHT * merged / bins)) if raster else 0
    below = EXPONENT_HEIGHT if exponent and raster else HEIGHT if exponent else 0
    marked = MARKED if looks.transitions is not None and not looks.is_paper else 0
    total = (TOP + BOTTOM + marked + len(sweeps) * height + below
             + GAP * (len(sweeps) * raster + exponent - 1))
    figure = new_figure(LEFT + width + RIGHT, total, looks)
    style.write_title(figure, LEFT, looks.title or _title(dataset))
    bottom = total - TOP
    panels: list[Axes] = []
    for k, sweep in enumerate(sweeps if raster else ()):
        bottom -= height
        panels.append(add_axes(figure, LEFT, bottom, width, height))
        panels[-1].tick_params(labelbottom=False)
        draw_raster(panels[-1], dataset, k, merged, looks)
        if len(sweeps) > 1:
            panels[-1].text(0.01, 0.02, SWEEPS.get(sweep, sweep).format(axis),
                            transform=panels[-1].transAxes, color=GREY)
        bottom -= GAP
    if exponent:
        panels.append(add_axes(figure, LEFT, bottom - below, width, below))
        draw_exponents(panels[-1], dataset, looks)
    for panel in panels:
        _mark(panel, dataset, looks)
    panels[-1].tick_params(labelbottom=True)
    panels[-1].set_xlabel(_label(dataset), fontsize=12)
    _legend(panels[0], dataset, looks)
    if marked:
        figure.legend(handles=_mark_transitions(panels[0], looks), loc='lower center',
                      ncols=len(MARKS), frameon=False, fontsize=11, handletextpad=0.1,
                      columnspacing=1.4, borderaxespad=0.2)
    return figure


def draw_raster(axes: Axes, dataset: 'xarray.Dataset', sweep: int, merged: int, looks: Looks
                ) -> None:
    """Draw counts of impacts, each attractor in a hue of its own."""
    counts = dataset['count'].values[sweep]
    places, velocities = dataset[swept(dataset.attrs)].values, dataset['velocity'].values
    bins = len(velocities) // merged
    picture = np.ones((bins, len(places), 3))
    strength = np.zeros((bins, len(places)))
    for mine, colour in _coloured(dataset, sweep, looks):
        own = np.asarray(np.sum(counts * mine[:, :, None], axis=1), np.float64)
        own = own[:, :bins * merged].reshape(len(places), bins, merged).sum(axis=2)
        # In steps of a tenth: what differs by rounding has one shade.
        with np.errstate(divide='ignore'):
            level = np.log(own / np.maximum(1.0, own.sum(axis=1, keepdims=True)))
        share = style.widened(style.equalise(np.exp(np.round(10.0 * level) / 10.0)).T)
        above = share > strength
        picture[above] = style.shade(colour, share)[above]
        strength[above] = share[above]
    axes.imshow(picture, origin='lower', aspect='auto', interpolation='nearest',
                extent=_extent(places, velocities))
    axes.set_ylabel(style.VELOCITY_LABEL, fontsize=12)
    for number, letter in _letters(dataset).items():
        # Above the fastest impacts, where it does not meet the next one yet.
        cells = np.argwhere(dataset['attractor'].values[sweep] == number)
        if len(cells) >= RARE * len(places) and (letter in 'ABC' or not looks.is_paper):
            column, slot = cells[len(cells) // 4]
            axes.annotate(letter, (places[column], velocities[np.flatnonzero(
                counts[column, slot])[-1]]), (0, 5), textcoords='offset points', ha='center',
                color=looks.ink(number), fontsize=13, fontweight='bold')


def draw_exponents(axes: Axes, dataset: 'xarray.Dataset', looks: Looks) -> None:
    """Draw the largest exponent of every attractor of the first sweep with its error."""
    places = dataset[swept(dataset.attrs)].values
    exponents, errors = (dataset[name].values[0] for name in ('exponent', 'exponent_error'))
    axes.axhline(0.0, color='black', linewidth=0.8)
    for mine, colour in _coloured(dataset, 0, looks):
        line, band = (_of(mine, values) for values in (exponents, errors))
        if np.count_nonzero(np.isfinite(line)) < RARE * len(places):
            axes.plot(places, line, '.', color=colour, markersize=2)
            continue
        axes.fill_between(places, line - band, line + band, color=colour, alpha=0.3, linewidth=0)
        axes.plot(places, line, color=colour, linewidth=0.9)
    half = 0.5 * (places[1] - places[0])
    axes.set_xlim(places[0] - half, places[-1] + half)
    axes.set_ylabel('largest exponent\nper impact [1]', fontsize=12)
    axes.grid(color='#e4e4e4', linewidth=0.6)
    axes.set_axisbelow(True)


def draw_shares(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw the shares of the attractors along the path, with what happens to them."""
    if looks.draw:
        return draw_diagram(dataset, looks)
    places = dataset[swept(dataset.attrs)].values
    shares = dataset['share'].values[0]
    count = dataset.attrs['trajectories']
    panels = [draw_panel for name, draw_panel in (('kick', _draw_kicks),
                                                  ('boundary_exponent', _draw_boundary))
              if name in dataset]
    below = len(panels) * (EXPONENT_HEIGHT + GAP)
    figure = new_figure(LEFT + WIDTH + RIGHT, 560 + below, looks)
    axes = add_axes(figure, LEFT, BOTTOM + below, WIDTH, 560 - BOTTOM - TOP)
    for mine, colour in _coloured(dataset, 0, looks):
        share = _of(mine, shares)
        error = np.sqrt(share * (1.0 - share) / count)
        axes.fill_between(places, share - error, share + error, color=colour, alpha=0.25,
                          linewidth=0)
        axes.plot(places, share, '.-', color=colour, linewidth=0.9, markersize=3)
    _mark(axes, dataset, looks)
    axes.set(xlim=(places[0], places[-1]), ylim=(0.0, 1.02))
    lowest = axes
    for row, draw_panel in enumerate(panels, 1):
        lowest.tick_params(labelbottom=False)
        lowest = add_axes(figure, LEFT, BOTTOM + below - row * (EXPONENT_HEIGHT + GAP), WIDTH,
                          EXPONENT_HEIGHT)
        draw_panel(lowest, dataset, looks)
        lowest.set_xlim(places[0], places[-1])
        lowest.set_ylim(bottom=0.0)
    lowest.set_xlabel(_label(dataset), fontsize=12)
    axes.set_ylabel('share of the trajectories [1], ± standard error', fontsize=12)
    style.write_title(figure, LEFT, looks.title or (
        'Shares of the attractors; fold solid, doubling dotted, crisis dashed'))
    _legend(axes, dataset, looks)
    return figure


def _draw_kicks(axes: Axes, dataset: 'xarray.Dataset', looks: Looks) -> None:
    for mine, colour in _coloured(dataset, 0, looks):
        axes.plot(dataset[swept(dataset.attrs)].values, _of(mine, dataset['kick'].values[0]), '.-',
                  color=colour, linewidth=0.9, markersize=3)
    axes.set_ylabel('smallest kick [1]', fontsize=12)


def _draw_boundary(axes: Axes, dataset: 'xarray.Dataset', looks: Looks) -> None:
    draw_values(axes, dataset[swept(dataset.attrs)].values, *(
        dataset[f'boundary_{name}'].values[0] for name in (
            'entropy', 'entropy_error', 'exponent', 'exponent_error')))


def _coloured(dataset: 'xarray.Dataset', sweep: int, looks: Looks
              ) -> Iterator[tuple[npt.NDArray[np.bool_], str]]:
    # Where each attractor is, shape (column, slot), with its colour; what is unsettled last.
    numbers, kinds = (dataset[name].values[sweep] for name in ('attractor', 'kind'))
    for number in np.unique(numbers[numbers >= 0]):
        yield numbers == number, looks.ink(int(number))
    unsettled = kinds == KINDS.index(Kind.UNSETTLED.value)
    if unsettled.any():
        yield unsettled, GREY


def _of(mine: npt.NDArray[np.bool_], values: FloatArray) -> FloatArray:
    line = np.full(len(mine), math.nan)
    rows = mine.any(axis=1)
    line[rows] = values[rows, mine.argmax(axis=1)[rows]]
    line[~np.isfinite(line)] = math.nan
    return line


def _extent(places: FloatArray, velocities: FloatArray) -> tuple[float, float, float, float]:
    a, v = 0.5 * (places[1] - places[0]), 0.5 * (velocities[1] - velocities[0])
    return places[0] - a, places[-1] + a, velocities[0] - v, velocities[-1] + v


def _legend(axes: Axes, dataset: 'xarray.Dataset', looks: Looks) -> None:
    numbers = dataset['attractor'].values
    columns = numbers.shape[1]
    names = [int(n) for n in np.unique(numbers[numbers >= 0])
             if np.max(np.count_nonzero((numbers == n).any(axis=2), axis=1)) >= RARE * columns]
    if looks.is_paper:
        return
    letters = _letters(dataset)
    handles = [style.legend_mark('s', looks.hue(n), letters.get(n, f'attractor {n}'))
               for n in names[:LEGEND_MOST]]
    if np.any(dataset['kind'].values == KINDS.index(Kind.UNSETTLED.value)):
        handles.append(style.legend_mark('s', GREY, 'unsettled'))
    axes.legend(handles=handles, loc='lower right', bbox_to_anchor=(1.0, 1.0), frameon=False,
                ncols=len(handles), fontsize=11, handletextpad=0.2, columnspacing=1.2,
                borderaxespad=0.1)


def _letters(dataset: 'xarray.Dataset') -> dict[int, str]:
    numbers, letters = dataset['attractor'].values, dataset['letter'].values
    return {int(number): str(letters[numbers == number].max())
            for number in np.unique(numbers[letters != ''])}


def _mark(axes: Axes, dataset: 'xarray.Dataset', looks: Looks) -> None:
    # Places that were asked for, and what happens to the attractors.
    for place in looks.mark:
        axes.axvline(place, color=GREY, linestyle=(0, (1, 3)), linewidth=1.0)
        axes.text(place, 0.01, f' {place:.5g}', transform=axes.get_xaxis_transform(), color=GREY,
                  va='bottom', fontsize=10)
    axis = swept(dataset.attrs)
    if f'event_{axis}' not in dataset or looks.is_paper:
        return
    low, high = dataset[axis].values[[0, -1]]
    for kind, place, number in zip(*(dataset[f'event_{name}'].values for name in (
            'kind', axis, 'attractor')), strict=True):
        if low <= place <= high:
            dashes = {'fold': '-', 'doubling': ':', 'crisis': '--'}.get(str(kind), '-.')
            axes.axvline(place, color=looks.hue(int(number)), linestyle=dashes, linewidth=1.0)


def _mark_transitions(axes: Axes, looks: Looks) -> list[Line2D]:
    # On the upper edge, in the colours of letters; returns their legend.
    found = looks.transitions
    assert found is not None
    places, kinds, letters = (found[name].values.ravel() for name in (
        swept(found.attrs), 'kind', 'letter'))
    low, high = axes.get_xlim()
    handles = []
    for marker, (words, group) in MARKS.items():
        here = np.isin(kinds, group) & (places >= low) & (places <= high)
        colours = [looks.hue(LETTERS.index(letter)) if letter else GREY
                   for letter in letters[here]]
        axes.scatter(places[here], np.ones(np.count_nonzero(here)), marker=marker, s=34,
                     c=colours, transform=axes.get_xaxis_transform(), clip_on=False, zorder=4,
                     linewidths=0.5, edgecolors='white')
        handles.append(style.legend_mark(marker, GREY, words))
    return handles


def _label(dataset: 'xarray.Dataset') -> str:
    axis = swept(dataset.attrs)
    return f'{dataset[axis].attrs["long_name"]}, {axis} [1]'


def _title(dataset: 'xarray.Dataset') -> str:
    a = dataset.attrs
    several = swept(a) == SEVERAL
    values = ', '.join(
        f'{short} {a[name]:g}' if name in a else '{} {:g} to {:g}'.format(
            short, *a[f'{name}_window']) for name, short in zip(
                Model._fields, (*Model._fields[:-1], 'r'), strict=True) if name in a or several)
    return (f'{counted(a["impacts_counted"], "impact")} of '
            f'{counted(a["trajectories"], "trajectory")}; {values}')
