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

"""Pictures of planes of two parameters: periods in hues, chaos in greys by its exponent."""

from typing import Any, Final, TYPE_CHECKING

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
import numpy as np
import numpy.typing as npt

from . import style
from .grids import BAR, ROW, scale, share_of
from .style import add_axes, Looks, new_figure
from ..core.arrays import FloatArray, IntArray
from ..core.many.survey import CHAOTIC, FLOATING as FLOATS, PERIODIC, RESTING, UNSETTLED
from ..core.model import Model
from ..core.words import counted
from ..palette import GREY, HUES, MARK, reach, STABLE

if TYPE_CHECKING:
    import xarray

# Greys are chaos here, so what is no orbit of few impacts has pale colours of its own.
LONG, STICKS, RESTS, BETWEEN, OPEN = '#c4b5a8', '#e6d3a3', '#ffffff', '#cfe6ea', '#f4b8d0'
# Width of a column of the legend [pixels].
COLUMN: Final = 245
# How far a hue fades where an orbit attracts strongly.
FADED: Final = 0.45
# Curves by what happens there, and the points at which they meet.
LINES: Final = {'fold': ('#000000', '-'), 'doubling': ('#000000', ':'), 'pitchfork': (STABLE, '-'),
                'grazing': (MARK, '-'), 'rest': (GREY, '--')}
MARKS: Final = {'crossing': 'x', 'cusp': '^', 'grazing': 'o', 'doubling': 'D', 'sticking': 's'}


def draw_plane(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw what most initial conditions of every cell settle on."""
    first = dataset.isel(slot=0)
    picture, greys, parts = paint(looks, *(first[name].values for name in (
        'kind', 'exponent', 'period_impacts')))
    handles: list[Artist] = [
        Patch(facecolor=colour, edgecolor=GREY, linewidth=0.5, label=f'{words}  {share_of(mine)}')
        for words, colour, mine in parts if np.any(mine)]
    return _figure(dataset, looks, picture, ScalarMappable(greys, looks.scale('gray_r')), handles)


def paint(looks: Looks, kinds: IntArray, exponents: FloatArray, periods: IntArray
          ) -> tuple[FloatArray, Normalize, list[tuple[str, str, npt.NDArray[np.bool_]]]]:
    """Return red, green and blue of every cell, the greys of chaos, and cells by colour."""
    on_orbit, is_chaos = (kinds == PERIODIC) & np.isfinite(exponents), kinds == CHAOTIC
    strength = np.clip(-exponents / reach(exponents[on_orbit]), 0.0, 1.0)
    greys = Normalize(0.0, reach(exponents[is_chaos]))
    picture = looks.scale('gray_r')(0.1 + 0.9 * greys(np.where(is_chaos, exponents, 0.0)))[..., :3]
    parts = [(counted(period, 'impact'), looks.hue(period - 1), on_orbit & (periods == period))
             for period in range(1, len(HUES) + 1)]
    parts += [(f'more than {counted(len(HUES), "impact")}', LONG,
               on_orbit & (periods > len(HUES))),
              ('sticks', STICKS, (kinds == PERIODIC) & ~on_orbit),
              ('at rest', RESTS, kinds == RESTING),
              ('between the walls', BETWEEN, kinds == FLOATS),
              ('unsettled', OPEN, kinds == UNSETTLED)]
    for _, colour, mine in parts:
        picture[mine] = style.shade(colour, 1.0 - FADED * np.where(
            on_orbit, strength, 0.0)[mine]) if colour != RESTS else 1.0
    return picture, greys, parts


def _figure(dataset: 'xarray.Dataset', looks: Looks, picture: Any, greys: ScalarMappable,
            handles: list[Artist]) -> Figure:
    a, lines = dataset.attrs, set(dataset['curve_kind'].values)
    y, x = map(str, dataset['attractors'].dims)
    height, width = (style.scaled(cells) for cells in picture.shape[:2])
    columns = min(4, (style.LEFT + width + BAR) // COLUMN)
    below = style.BOTTOM + ROW * -(-(len(handles) + len(lines)) // columns)
    # There is an axis in SI units between.
    below += style.BESIDE[0] if 'gears' in a else 0
    figure = new_figure(style.LEFT + width + BAR, below + height + style.TOP - 20, looks)
    style.write_title(figure, style.LEFT, looks.title or 'Parameter plane, ' + ', '.join(
        f'{name} {a[name]:g}' for name in Model._fields if name in a))
    axes = add_axes(figure, style.LEFT, below, width, height)
    axes.imshow(picture, origin='lower', aspect='auto', interpolation='nearest',
                extent=(*a[f'{x}_window'], *a[f'{y}_window']))
    axes.autoscale(False)
    handles += _draw_curves(dataset, axes, x, y)
    for name, set_label in ((x, axes.set_xlabel), (y, axes.set_ylabel)):
        set_label(f'{dataset[name].attrs["long_name"]}, {name} [1]', fontsize=12)
    figure.legend(handles=handles, loc='lower center', ncols=columns, frameon=False, fontsize=11,
                  borderaxespad=0.1)
    scale(figure, greys, 'largest exponent of chaos per impact [1]', extend='max')
    return figure


def _draw_curves(dataset: 'xarray.Dataset', axes: Axes, x: str, y: str) -> list[Artist]:
    owners, handles = dataset['vertex_curve'].values, {}
    for number, kind in enumerate(dataset['curve_kind'].values.tolist()):
        colour, style_of = LINES[kind]
        mine = owners == number
        for ink, width in (('white', 2.2), (colour, 1.1)):
            handles[kind], = axes.plot(
                dataset[f'vertex_{x}'].values[mine], dataset[f'vertex_{y}'].values[mine],
                color=ink, linestyle=style_of if ink == colour else '-', linewidth=width,
                label=kind)
    for kind, marker in MARKS.items():
        mine = dataset['mark_kind'].values == kind
        if mine.any():
            axes.plot(dataset[f'mark_{x}'].values[mine], dataset[f'mark_{y}'].values[mine],
                      marker, color='white', markeredgecolor='black', markersize=6)
    return list(handles.values())
