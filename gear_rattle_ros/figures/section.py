"""Pictures of the section: impacts in phase and velocity."""

import math
from typing import TYPE_CHECKING

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
import numpy as np

from .style import (
    add_axes,
    equalise,
    Looks,
    new_figure,
    phase_ticks,
    shade,
    VELOCITY_LABEL,
    widened,
)
from ..core.words import counted
from ..palette import GREY

if TYPE_CHECKING:
    import xarray

LEFT, RIGHT, BOTTOM, TOP = 90, 30, 70, 84


def draw_section(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw impacts counted on the section, and the periodic orbits that were reached."""
    a = dataset.attrs
    counts = dataset['count'].values.astype(np.float64)
    width, height = counts.shape[2], counts.shape[1]
    figure = new_figure(LEFT + width + RIGHT, BOTTOM + height + TOP, looks)
    axes = add_axes(figure, LEFT, BOTTOM, width, height)
    share = widened(equalise(counts[1]))
    picture = np.ones((height, width, 3))
    some = share > 0.0
    picture[some] = shade(looks.hue(0), share)[some]
    low, high = a['velocity_window']
    axes.imshow(picture, origin='lower', aspect='auto', interpolation='nearest',
                extent=(0.0, 2.0 * math.pi, low, high))
    axes.scatter(dataset['orbit_phase'].values, dataset['orbit_velocity'].values, s=42,
                 color=looks.hue(1), edgecolors='white', linewidths=0.8, zorder=3)
    axes.axhline(0.0, color=GREY, linewidth=0.6)
    axes.text(0.01, 0.985, 'upper wall', transform=axes.transAxes, va='top', color=GREY)
    axes.text(0.01, 0.015, 'lower wall', transform=axes.transAxes, color=GREY)
    axes.set_ylabel(VELOCITY_LABEL, fontsize=12)
    phase_ticks(axes, (0.0, 2.0 * math.pi))
    handles = []
    if some.any():
        handles.append(Line2D([], [], marker='s', linestyle='none', color=looks.hue(0),
                              label='trajectories that do not recur (darker: more impacts)'))
    if len(dataset['orbit_phase'].values):
        handles.append(Line2D([], [], marker='o', linestyle='none', color=looks.hue(1),
                              label='periodic orbits that were reached'))
    total = BOTTOM + height + TOP
    figure.text(LEFT / (LEFT + width + RIGHT), 1.0 - 12 / total,
                looks.title or f'alpha {a["alpha"]:g}: '
                f'{counted(a["trajectories"], "trajectory")}, impacts '
                f'{a["impacts_skipped"]:,} to {a["impacts_skipped"] + a["impacts_counted"]:,}',
                va='top', fontsize=13)
    axes.legend(handles=handles, loc='lower left', bbox_to_anchor=(-0.01, 1.0), ncols=2,
                frameon=False, fontsize=10, handletextpad=0.2)
    return figure
