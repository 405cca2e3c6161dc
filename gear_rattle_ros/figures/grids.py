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

"""Pictures of grids: basins by attractor, lifetimes on a logarithmic scale, attractors."""

from collections.abc import Mapping, Sequence
import math
from typing import Any, Final, TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PathCollection
from matplotlib.colors import LinearSegmentedColormap, LogNorm, Normalize, to_rgb
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import FuncFormatter
import numpy as np
import numpy.typing as npt

from . import style
from .style import add_axes, Looks, new_figure, phase_ticks, thousands
from ..attractors.letters import numbers_of
from ..attractors.plane import IMPACT, ON_WALLS, Plane, STROBE
from ..core.many.settling import UNSETTLED
from ..core.words import counted
from ..palette import ENDS, EXPONENTS, FORGOTTEN, painted, reach

if TYPE_CHECKING:
    import xarray

# Most cells along an edge of a picture: more are not seen.
MOST: Final = 2000
# Rows of a legend below the axes, their height, and room for a scale beside them [pixels].
ROWS: Final = 8
ROW, BAR = 22, 110
# Steps of the scale of lifetimes, few enough for a small file.
STEPS: Final = 64


def draw_basins(dataset: 'xarray.Dataset', looks: Looks, below: int = 0) -> Figure:
    """Draw which initial condition goes where, with free room `below` [pixels]."""
    labels = _thinned(dataset['label'])
    colours, names = colours_and_names(dataset, looks)
    colours, names = ENDS | colours, {UNSETTLED: 'unsettled'} | names
    patches = [Patch(color=colours[label], label=f'{name}  {share_of(labels == label)}')
               for label, name in sorted(names.items(), key=lambda item: (item[0] < 0, item[1]))
               if np.any(labels == label)]
    _, figure = _plane(dataset, 'Basins of attraction', looks, painted(labels, colours),
                       legend=patches, below=below)
    return figure


def draw_lifetimes(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw how long every initial condition takes; as in the paper: linear, long is black."""
    cap, paper = dataset.attrs['cap'], looks.is_paper
    lifetimes = _thinned(dataset['lifetime'])
    censored = _thinned(dataset['label']) == UNSETTLED
    # From the decade on in which the shortest are.
    shortest = 10**int(math.log10(min(max(1, lifetimes.min()), cap / 2)))
    patch = Patch(color='black' if paper else ENDS[UNSETTLED],
                  label=f'{counted(cap, "impact")} or more  {share_of(censored)}')
    drawn, figure = _plane(
        dataset, 'Lifetimes', looks,
        np.ma.masked_array(np.maximum(lifetimes, 1), censored & (not paper)), bar=True,
        legend=[patch] * int(censored.any()),
        cmap=looks.scale('inferno').resampled(STEPS).with_extremes(bad=ENDS[UNSETTLED]),
        norm=Normalize(0, cap) if paper else LogNorm(shortest, max(cap, 2)))
    scale(figure, drawn, 'lifetime of the transient [impacts]',
          **({'format': FuncFormatter(thousands)} if paper else {}))
    return figure


def draw_exponents(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw where neighbours diverge (red) or converge (blue); what is not finite is dark."""
    exponents = _thinned(dataset['exponent'])
    bound = reach(exponents)
    colours = looks.scale('') if looks.colours else LinearSegmentedColormap.from_list(
        'exponents', EXPONENTS)
    drawn, figure = _plane(
        dataset, f'Finite-time exponents over {counted(dataset.attrs["impacts"], "impact")}',
        looks, np.ma.masked_invalid(exponents), bar=True,
        cmap=colours.with_extremes(bad=FORGOTTEN), norm=Normalize(-bound, bound))
    scale(figure, drawn, 'finite-time exponent per impact [1]', extend='both')
    return figure


def draw_probabilities(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Mix the colours of attractors by their probability; what visits no core is grey."""
    colours, names = colours_and_names(dataset, looks)
    colours = ENDS | colours
    shares = np.stack([_thinned(share) for share in dataset['probability']])
    hues = np.array([to_rgb(colours[label]) for label in dataset['attractor'].values.tolist()])
    mixed = np.einsum('kij,kc->ijc', shares, hues) + (
        1.0 - shares.sum(axis=0))[..., None] * np.array(to_rgb(ENDS[UNSETTLED]))
    patches = [Patch(color=colours[label], label=f'{names[label]}  {100.0 * np.mean(share):.2f} %')
               for label, share in zip(dataset['attractor'].values.tolist(), shares, strict=True)]
    a = dataset.attrs
    _, figure = _plane(
        dataset, f'After {counted(a["impacts"], "impact")} with noise {a["noise"]:g}', looks,
        np.clip(mixed, 0.0, 1.0), legend=patches)
    return figure


def draw_attractors(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw the attractors on the section."""
    shares = zip(dataset['attractor_label'].values, dataset['attractor_share'].values, strict=True)
    return _section(dataset, 'Attractors', looks,
                    {label: f'  {100.0 * share:.1f} %' for label, share in shares})


def draw_saddle(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw straddle trajectories, the attractors, and the orbits accessible from each."""
    a = dataset.attrs
    kind = 'a transient' if a['straddles'] == 'lifetimes' else 'the boundary of basins'
    what = f'the orbit {a["is_orbit"]}' if a['is_orbit'] else 'the chaotic saddle'
    figure = _section(dataset, f'Saddle of {kind}', looks)
    axes = figure.axes[0]
    axes.plot(dataset['phase'].values.ravel(), dataset['velocity'].values.ravel(), 'o', zorder=0,
              color='black', markersize=2.2, markeredgewidth=0.0, rasterized=True,
              label=f'impacts straddled: {what}')
    colours, _ = colours_and_names(dataset, looks)
    label_of = dict(zip(dataset['attractor_key'].values, dataset['attractor_label'].values,
                        strict=True))
    for number, side in enumerate(dataset['orbit_side'].values.tolist()):
        if side:
            mine = dataset['orbit_point_number'].values == number
            axes.scatter(dataset['orbit_point_phase'].values[mine],
                         dataset['orbit_point_velocity'].values[mine], marker='X', s=90,
                         color=colours[label_of[side]], edgecolors='white', zorder=3,
                         label=f'accessible from there: {dataset["orbit_key"].values[number]}')
    _legend(figure)
    return figure


def draw_survival(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw how many initial conditions are still transient."""
    figure, axes = _new(dataset, 'Survival', looks)
    times, survival = dataset['edge'].values, dataset['survival'].values
    begin, rate = (float(dataset.attrs[f'escape_{name}']) for name in ('begin', 'rate'))
    axes.plot(times, survival, color=looks.hue(0), label='share still transient')
    if rate > 0.0 and np.isfinite(rate):
        tail = times[times >= begin]
        at_begin = float(np.interp(begin, times, survival))
        axes.plot(tail, at_begin * np.exp(-rate * (tail - begin)), color=looks.hue(1),
                  linestyle='--', label=f'exponential tail, 1/rate = {1.0 / rate:,.0f} impacts')
    axes.set(xlabel='impacts', ylabel='share of the initial conditions', yscale='log')
    axes.xaxis.set_major_formatter(FuncFormatter(thousands))
    percent = FuncFormatter(lambda value, _: f'{100.0 * value:g} %')
    axes.yaxis.set_major_formatter(percent)
    axes.yaxis.set_minor_formatter(percent)
    axes.legend(frameon=False)
    return figure


def scatter(axes: Axes, dataset: 'xarray.Dataset', label: int, colour: str, words: str = ''
            ) -> None:
    """Mark the impacts of an attractor; a chaotic one is a thin line."""
    for name, size in (('point', 40.0), ('box', 2.0)):
        mine = dataset[f'{name}_label'].values == label
        if mine.any():
            axes.scatter(dataset[f'{name}_phase'].values[mine],
                         dataset[f'{name}_velocity'].values[mine], s=size, color=colour,
                         edgecolors='white', linewidths=0.6 * (name == 'point'), zorder=3,
                         label=words)


def colours_and_names(dataset: 'xarray.Dataset', looks: Looks
                      ) -> tuple[dict[int, str], dict[int, str]]:
    """Return each attractor's colour and its name, a letter or its label and key, by label."""
    labels = dataset['attractor_label'].values.tolist()
    letters = dict(zip(labels, dataset['attractor_letter'].values.tolist(), strict=True))
    colours = {label: looks.hue(number) for label, number in numbers_of(labels, letters).items()}
    return colours, {label: f'{letters[label] or label}  {key}' for label, key in zip(
        labels, dataset['attractor_key'].values.tolist(), strict=True)}


def _title(dataset: 'xarray.Dataset', title: str, looks: Looks) -> str:
    a = dataset.attrs
    plane = f', {Plane.of(a).words}' if 'size' in a else ''
    return looks.title or (f'{title}, alpha {a["alpha"]:g}, beta {a["beta"]:g}, gamma '
                           f'{a["gamma"]:g}, r {a["restitution"]:g}{plane}')


def _new(dataset: 'xarray.Dataset', title: str, looks: Looks) -> tuple[Figure, Axes]:
    figure = new_figure(900, 800, looks, layout='constrained')
    figure.suptitle(_title(dataset, title, looks), fontsize=13)
    return figure, figure.subplots()


def _section(dataset: 'xarray.Dataset', title: str, looks: Looks,
             after: Mapping[int, str] | None = None) -> Figure:
    # The attractors, with what comes after their names.
    figure, axes = _new(dataset, f'{title} on the section', looks)
    colours, names = colours_and_names(dataset, looks)
    for label, colour in colours.items():
        scatter(axes, dataset, label, colour, names[label] + (after or {}).get(label, ''))
    style.name_walls(axes)
    phase_ticks(axes, (0.0, 2.0 * math.pi))
    axes.set_xlim(0.0, 2.0 * math.pi)
    axes.set_ylabel(style.VELOCITY_LABEL, fontsize=12)
    _legend(figure)
    return figure


def _legend(figure: Figure) -> None:
    for legend in figure.legends:
        legend.remove()
    legend = figure.legend(loc='outside lower center', ncols=2, frameon=False)
    for handle in legend.legend_handles:
        if isinstance(handle, PathCollection):
            handle.set_sizes([60.0])


def _plane(dataset: 'xarray.Dataset', title: str, looks: Looks, grid: npt.NDArray[Any], *,
           bar: bool = False, legend: Sequence[Patch] = (), below: int = 0, **options: Any
           ) -> tuple[AxesImage, Figure]:
    # A cell is a whole number of pixels.
    plane = Plane.of(dataset.attrs)
    height, width = (style.scaled(cells) for cells in grid.shape[:2])
    rows = min(-(-len(legend) // 2), ROWS) if len(legend) > 1 else len(legend)
    below += style.BOTTOM + ROW * rows
    figure = new_figure(style.LEFT + width + (BAR if bar else style.RIGHT),
                        below + height + style.TOP - 20, looks)
    style.write_title(figure, style.LEFT, _title(dataset, title, looks))
    axes = add_axes(figure, style.LEFT, below, width, height)
    drawn = axes.imshow(grid, origin='lower', aspect='auto', interpolation='nearest',
                        extent=(*plane.window, *plane.velocity), **options)
    if len(looks.mark) == 4:
        x0, x1, v0, v1 = looks.mark
        for colour, line in (('white', 4.0), ('black', 1.8)):
            axes.add_patch(Rectangle((x0, v0), x1 - x0, v1 - v0, fill=False, edgecolor=colour,
                                     linewidth=line))
    on_walls = plane.kind in ON_WALLS
    if plane.kind == STROBE:
        axes.set_xlabel('initial displacement [1]', fontsize=12)
    else:
        phase_ticks(axes, plane.window, label=style.PHASE_LABEL if on_walls else
                    'initial drive phase [rad]')
    axes.set_xlim(*plane.window)
    axes.set_ylabel('initial velocity [1]' if not on_walls else style.VELOCITY_LABEL
                    if plane.kind == IMPACT else style.AFTER_LABEL, fontsize=12)
    if on_walls:
        style.name_walls(axes, is_after=plane.kind != IMPACT)
    if legend:
        figure.legend(handles=list(legend[:2 * ROWS]), loc='lower center', ncols=2, frameon=False,
                      fontsize=11, borderaxespad=0.1)
    return drawn, figure


def scale(figure: Figure, drawn: ScalarMappable, words: str, **options: Any) -> None:
    """Put the scale of what is drawn beside the first axes."""
    place = figure.axes[0].get_position()
    width = figure.get_size_inches()[0] * style.DPI
    axes = figure.add_axes((place.x1 + 16 / width, place.y0, 20 / width, place.height))
    figure.colorbar(drawn, cax=axes, **options).set_label(words, fontsize=11)


def _thinned(grid: 'xarray.DataArray') -> npt.NDArray[Any]:
    every = tuple(slice(None, None, -(-length // MOST)) for length in grid.shape)
    return np.asarray(grid[every].values)


def share_of(chosen: npt.NDArray[np.bool_]) -> str:
    """Write the share of the cells that are chosen."""
    return f'{100.0 * float(np.mean(chosen)):.2f} %'
