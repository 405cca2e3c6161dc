"""Pictures of grids: basins by attractor, lifetimes on a logarithmic scale, sections."""

import math
from typing import Any, Final

from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PathCollection
from matplotlib.colors import LinearSegmentedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter
import numpy as np
import numpy.typing as npt

from .style import phase_ticks
from ..attractors.catalogue import Attractor, Catalogue, Kind
from ..attractors.plane import Plane
from ..core.arrays import FloatArray
from ..core.many.settling import UNRESOLVED
from ..core.words import counted
from ..palette import BLUE, colours_of, EXPONENTS, FORGOTTEN, GREY, hue, ORANGE, painted, UNSETTLED

DPI: Final = 120
# No picture has more cells than this along an edge: the rest is not seen anyway.
EDGE: Final = 2000


def draw_basins(labels: npt.NDArray[np.int64], plane: Plane, attractors: tuple[Attractor, ...],
                title: str) -> Figure:
    """Draw which start goes where."""
    figure, axes = _new(title)
    colours = colours_of(range(len(attractors)))
    axes.imshow(painted(labels, colours), **_placed(plane))
    names = {each.label: each.key for each in attractors} | {UNRESOLVED: 'unsettled'}
    patches = [Patch(color=colours[label], label=f'{label}  {name}  {_share(labels == label)}')
               for label, name in names.items() if np.any(labels == label)]
    figure.legend(handles=patches[:16], loc='outside lower center', ncols=2, frameon=False)
    _label(axes, plane)
    return figure


def draw_lifetimes(lifetimes: npt.NDArray[np.int64], censored: npt.NDArray[np.bool_],
                   plane: Plane, cap: int, title: str, *, grey: bool = False) -> Figure:
    """Draw how long every start takes to settle; grey as in the paper: linear, long is black."""
    figure, axes = _new(title)
    norm = Normalize(0, cap) if grey else LogNorm(1, max(cap, 2))
    shown = np.ma.masked_array(np.maximum(lifetimes, 1), censored & (not grey))
    colours = colormaps['gray_r' if grey else 'inferno'].with_extremes(bad=UNSETTLED)
    drawn = axes.imshow(shown, cmap=colours, norm=norm, **_placed(plane))
    bar = figure.colorbar(drawn, ax=axes, shrink=0.9)
    bar.set_label('lifetime of the transient [impacts]')
    if np.any(censored):
        words = f'{counted(cap, "impact")} or more  {_share(censored)}'
        figure.legend(handles=[Patch(color='black' if grey else UNSETTLED, label=words)],
                      loc='outside lower center', frameon=False)
    _label(axes, plane)
    return figure


def draw_exponents(exponents: FloatArray, plane: Plane, title: str) -> Figure:
    """Draw how fast neighbours part (red) or meet (blue); what is not finite is dark."""
    figure, axes = _new(title)
    finite = np.abs(exponents[np.isfinite(exponents)])
    reach = max(1e-3, float(np.quantile(finite, 0.95))) if len(finite) else 1.0
    colours = LinearSegmentedColormap.from_list('exponents', EXPONENTS).with_extremes(
        bad=FORGOTTEN)
    drawn = axes.imshow(np.ma.masked_invalid(exponents), cmap=colours,
                        norm=Normalize(-reach, reach), **_placed(plane))
    figure.colorbar(drawn, ax=axes, shrink=0.9, extend='both').set_label(
        'finite-time exponent per impact [1]')
    _label(axes, plane)
    return figure


def draw_section(catalogue: Catalogue) -> Figure:
    """Draw the attractors on the section."""
    figure, axes = _new(f'Attractors on the section, {in_words(catalogue)}')
    for each in catalogue.attractors:
        points = each.points()
        if len(points):
            # A chaotic attractor is a thin line.
            axes.scatter(points[:, 1], points[:, 2], s=3.0 if each.kind is Kind.CHAOTIC else 40.0,
                         color=hue(each.label), linewidths=0,
                         label=f'{each.label}  {each.key}  {100.0 * each.share:.1f} %')
    axes.axhline(0.0, color=GREY, linewidth=0.6)
    axes.set_xlim(0.0, 2.0 * math.pi)
    legend = figure.legend(loc='outside lower center', ncols=2, frameon=False)
    for handle in legend.legend_handles:
        if isinstance(handle, PathCollection):
            handle.set_sizes([60.0])
    _label(axes, None)
    axes.set_ylabel("velocity before the impact s' [1]; upper wall above 0, lower below")
    return figure


def draw_survival(times: FloatArray, survival: FloatArray,
                  begin: float, rate: float, title: str) -> Figure:
    """Draw how many starts are still in their transient."""
    figure, axes = _new(title)
    axes.plot(times, survival, color=BLUE, label='share still transient')
    if rate > 0.0 and np.isfinite(rate):
        tail = times[times >= begin]
        at_begin = float(np.interp(begin, times, survival))
        axes.plot(tail, at_begin * np.exp(-rate * (tail - begin)), color=ORANGE,
                  linestyle='--', label=f'exponential tail, 1/rate = {1.0 / rate:,.0f} impacts')
    axes.set(xlabel='impacts', ylabel='share of the starts', yscale='log')
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f'{value:,.0f}'))
    percent = FuncFormatter(lambda value, _: f'{100.0 * value:g} %')
    axes.yaxis.set_major_formatter(percent)
    axes.yaxis.set_minor_formatter(percent)
    axes.legend(frameon=False)
    return figure


def in_words(catalogue: Catalogue) -> str:
    """Name the parameters."""
    model = catalogue.parameters
    return (f'alpha {model.alpha:g}, beta {model.beta:g}, gamma {model.gamma:g}, '
            f'r {model.restitution:g}')


def thinned(plane: Plane) -> dict[str, int]:
    """Return which cells are drawn: every so many along velocity and phase."""
    return {'velocity': -(-plane.velocities // EDGE), 'phase': -(-plane.phases // EDGE)}


def _new(title: str) -> tuple[Figure, Axes]:
    figure = Figure((9.0, 8.0), dpi=DPI, layout='constrained')
    FigureCanvasAgg(figure)
    figure.suptitle(title, fontsize=12)
    return figure, figure.subplots()


def _placed(plane: Plane) -> dict[str, Any]:
    return {'origin': 'lower', 'aspect': 'auto', 'interpolation': 'nearest',
            'extent': (*plane.phase, *plane.velocity)}


def _label(axes: Axes, plane: Plane | None) -> None:
    window = (0.0, 2.0 * math.pi) if plane is None else plane.phase
    axes.set_ylabel('velocity [1]', fontsize=12)
    phase_ticks(axes, window)
    axes.set_xlim(*window)


def _share(chosen: npt.NDArray[np.bool_]) -> str:
    return f'{100.0 * float(np.mean(chosen)):.2f} %'
