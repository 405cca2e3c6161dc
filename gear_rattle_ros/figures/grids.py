"""Pictures of grids: basins by attractor, lifetimes on a logarithmic scale, attractors."""

from collections.abc import Sequence
import math
from typing import Any, Final, TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.colors import LinearSegmentedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter
import numpy as np
import numpy.typing as npt

from .style import Looks, new_figure, phase_ticks, thousands
from ..core.many.settling import UNSETTLED
from ..core.words import counted
from ..palette import ENDS, EXPONENTS, FORGOTTEN, GREY, painted, reach

if TYPE_CHECKING:
    import xarray

DPI: Final = 120
# Most cells along an edge of a picture: more are not seen.
EDGE: Final = 2000


def draw_basins(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw which initial condition goes where."""
    figure, axes = _new(dataset, 'Basins of attraction', looks)
    labels = _thinned(dataset['label'])
    names = dict(zip(dataset['attractor_label'].values.tolist(),
                     dataset['attractor_key'].values.tolist(), strict=True))
    names |= {UNSETTLED: 'unsettled'}
    colours = ENDS | {label: looks.hue(label) for label in names if label >= 0}
    axes.imshow(painted(labels, colours), **_placed(dataset))
    patches = [Patch(color=colours[label], label=f'{label}  {name}  {_share(labels == label)}')
               for label, name in names.items() if np.any(labels == label)]
    figure.legend(handles=patches[:16], loc='outside lower center', ncols=2, frameon=False)
    _label(axes, dataset.attrs['phase_window'])
    return figure


def draw_lifetimes(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw how long every initial condition takes; as in the paper: linear, long is black."""
    figure, axes = _new(dataset, 'Lifetimes', looks)
    cap, paper = dataset.attrs['cap'], looks.is_paper
    lifetimes = _thinned(dataset['lifetime'])
    censored = _thinned(dataset['label']) == UNSETTLED
    norm = Normalize(0, cap) if paper else LogNorm(1, max(cap, 2))
    shown = np.ma.masked_array(np.maximum(lifetimes, 1), censored & (not paper))
    colours = looks.scale('inferno').with_extremes(bad=ENDS[UNSETTLED])
    drawn = axes.imshow(shown, cmap=colours, norm=norm, **_placed(dataset))
    bar = figure.colorbar(drawn, ax=axes, shrink=0.9)
    bar.set_label('lifetime of the transient [impacts]')
    if np.any(censored):
        words = f'{counted(cap, "impact")} or more  {_share(censored)}'
        figure.legend(handles=[Patch(color='black' if paper else ENDS[UNSETTLED], label=words)],
                      loc='outside lower center', frameon=False)
    _label(axes, dataset.attrs['phase_window'])
    return figure


def draw_exponents(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw where neighbours diverge (red) or converge (blue); what is not finite is dark."""
    figure, axes = _new(dataset, 'Finite-time exponents over '
                        f'{counted(dataset.attrs["impacts"], "impact")}', looks)
    exponents = _thinned(dataset['exponent'])
    bound = reach(exponents)
    colours = looks.scale('') if looks.colours else LinearSegmentedColormap.from_list(
        'exponents', EXPONENTS)
    drawn = axes.imshow(np.ma.masked_invalid(exponents),
                        cmap=colours.with_extremes(bad=FORGOTTEN),
                        norm=Normalize(-bound, bound), **_placed(dataset))
    figure.colorbar(drawn, ax=axes, shrink=0.9, extend='both').set_label(
        'finite-time exponent per impact [1]')
    _label(axes, dataset.attrs['phase_window'])
    return figure


def draw_attractors(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw the attractors on the section."""
    figure, axes = _new(dataset, 'Attractors on the section', looks)
    for label, key, share in zip(*(dataset[f'attractor_{name}'].values
                                   for name in ('label', 'key', 'share')), strict=True):
        # A chaotic attractor is a thin line.
        for name, size in (('point', 40.0), ('box', 3.0)):
            mine = dataset[f'{name}_label'].values == label
            if mine.any():
                axes.scatter(dataset[f'{name}_phase'].values[mine],
                             dataset[f'{name}_velocity'].values[mine], s=size, linewidths=0,
                             color=looks.hue(int(label)),
                             label=f'{label}  {key}  {100.0 * share:.1f} %')
    axes.axhline(0.0, color=GREY, linewidth=0.6)
    legend = figure.legend(loc='outside lower center', ncols=2, frameon=False)
    for handle in legend.legend_handles:
        if isinstance(handle, PathCollection):
            handle.set_sizes([60.0])
    _label(axes, (0.0, 2.0 * math.pi))
    axes.set_ylabel("velocity before the impact s' [1]; upper wall above 0, lower below")
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


def _new(dataset: 'xarray.Dataset', title: str, looks: Looks) -> tuple[Figure, Axes]:
    a = dataset.attrs
    figure = new_figure(1080, 960, looks, DPI, layout='constrained')
    plane = f', s = {a["displacement"]:g}' if 'size' in a else ''
    figure.suptitle(looks.title or f'{title}, alpha {a["alpha"]:g}, beta {a["beta"]:g}, gamma '
                    f'{a["gamma"]:g}, r {a["restitution"]:g}{plane}', fontsize=12)
    return figure, figure.subplots()


def _thinned(grid: 'xarray.DataArray') -> npt.NDArray[Any]:
    every = tuple(slice(None, None, -(-length // EDGE)) for length in grid.shape)
    return np.asarray(grid[every].values)


def _placed(dataset: 'xarray.Dataset') -> dict[str, Any]:
    a = dataset.attrs
    return {'origin': 'lower', 'aspect': 'auto', 'interpolation': 'nearest',
            'extent': (*a['phase_window'], *a['velocity_window'])}


def _label(axes: Axes, window: Sequence[float]) -> None:
    axes.set_ylabel('velocity [1]', fontsize=12)
    phase_ticks(axes, (window[0], window[1]))
    axes.set_xlim(*window)


def _share(chosen: npt.NDArray[np.bool_]) -> str:
    return f'{100.0 * float(np.mean(chosen)):.2f} %'
