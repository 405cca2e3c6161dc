"""Pictures of the section: impacts in phase and velocity."""

import math
from typing import TYPE_CHECKING

from matplotlib.figure import Figure
import numpy as np

from . import style
from .style import Looks
from ..core.words import counted

if TYPE_CHECKING:
    import xarray

LEFT, RIGHT, BOTTOM, TOP = 90, 30, 70, 84


def draw_section(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    a = dataset.attrs
    counts = dataset['count'].values.astype(np.float64)
    width, height = counts.shape[2], counts.shape[1]
    figure = style.new_figure(LEFT + width + RIGHT, BOTTOM + height + TOP, looks)
    axes = style.add_axes(figure, LEFT, BOTTOM, width, height)
    share = style.widened(style.equalise(counts[1]))
    picture = np.ones((height, width, 3))
    some = share > 0.0
    picture[some] = style.shade(looks.hue(0), share)[some]
    low, high = a['velocity_window']
    axes.imshow(picture, origin='lower', aspect='auto', interpolation='nearest',
                extent=(0.0, 2.0 * math.pi, low, high))
    axes.scatter(dataset['orbit_phase'].values, dataset['orbit_velocity'].values, s=42,
                 color=looks.hue(1), edgecolors='white', linewidths=0.8, zorder=3)
    style.name_walls(axes)
    axes.set_ylabel(style.VELOCITY_LABEL, fontsize=12)
    style.phase_ticks(axes, (0.0, 2.0 * math.pi))
    handles = []
    if some.any():
        handles.append(style.legend_mark(
            's', looks.hue(0), 'trajectories that do not recur (darker: more impacts)'))
    if len(dataset['orbit_phase'].values):
        handles.append(style.legend_mark(
            'o', looks.hue(1), 'periodic orbits that were reached'))
    style.write_title(figure, LEFT, looks.title or (
        f'alpha {a["alpha"]:g}: {counted(a["trajectories"], "trajectory")}, impacts '
        f'{a["impacts_skipped"]:,} to {a["impacts_skipped"] + a["impacts_counted"]:,}'))
    axes.legend(handles=handles, loc='lower left', bbox_to_anchor=(-0.01, 1.0), ncols=2,
                frameon=False, fontsize=10, handletextpad=0.2)
    return figure
