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

"""The picture of a boundary: shares of cut probes with their power laws, and entropies."""

import math
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np

from .style import add_axes, LEFT, Looks, new_figure, write_title
from ..attractors.plane import Plane
from ..core.arrays import FloatArray
from ..core.boundaries.entropy import SMOOTH
from ..core.boundaries.uncertainty import PROBES
from ..palette import GREY
from ..studies.attractors import swept
from ..studies.skeleton.boundary import DECIDED, entropies_of, law_of

if TYPE_CHECKING:
    import xarray

WIDTH, HEIGHT = 1100, 560
# The bottom of both axes, their height, and the width of the left ones [pixels].
BOTTOM, TALL, WIDE = 76, 430, 540


def draw_boundary(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw how many probes a boundary cuts at any distance, and the entropies of boxes."""
    a = dataset.attrs
    if 'columns' in a:
        return _draw_along(dataset, looks)
    figure = new_figure(WIDTH, HEIGHT, looks)
    write_title(figure, LEFT, looks.title or f'Basin boundary, alpha {a["alpha"]:g}, beta '
                f'{a["beta"]:g}, gamma {a["gamma"]:g}, r {a["restitution"]:g}, '
                f'{Plane.of(a).words}')
    axes = add_axes(figure, LEFT, BOTTOM, WIDE, TALL)
    sizes = dataset['distance'].values
    decided = sizes >= DECIDED
    for number, probe in enumerate(PROBES):
        cut, probes = (dataset[name].values[number] for name in ('cut', 'probes'))
        share, some = cut / np.maximum(probes, 1), (cut > 0) & decided
        colour, law = looks.ink(number), law_of(dataset, probe)
        axes.errorbar(sizes[some], share[some], np.sqrt(share * (1.0 - share) / np.maximum(
            probes, 1))[some], fmt='o', markersize=4, color=colour, mfc='white' if number else
            colour, label='box counting' if number else 'triplets')
        if law is not None:
            ends = np.array([law.low, law.high])
            axes.plot(ends, law.constant * ends**law.exponent, color=colour, linewidth=1.2,
                      label=f'exponent {law.exponent:.4f} ± {law.error:.4f}')
        if probe == 'triplet' and share[-1] > 0.0:
            axes.axhline(share[-1], color=GREY, linestyle=':',
                         label='triplets cut by rounding alone')
    axes.set(xscale='log', yscale='log')
    axes.set_xlabel('distance, edge of a box [1 and rad]', fontsize=12)
    axes.set_ylabel('share that the boundary cuts', fontsize=12)
    axes.legend(frameon=False, fontsize=11)
    right = LEFT + WIDE + 100
    axes = add_axes(figure, right, BOTTOM, WIDTH - right - 30, TALL)
    boxes = [each for each in entropies_of(dataset) if each.edge]
    for number, (name, words) in enumerate((('boundary', 'in boxes on the boundary, S_bb'),
                                            ('mean', 'in all boxes, S_b'))):
        axes.errorbar([each.edge for each in boxes], [getattr(each, name) for each in boxes],
                      [getattr(each, f'{name}_error') for each in boxes], fmt='o-', markersize=4,
                      color=looks.ink(number), mfc='white' if number else looks.ink(number),
                      label=words)
    for value, line, words in ((math.log(2.0), '--', 'ln 2: fractal above'),
                               (SMOOTH, ':', 'smooth boundary, discs')):
        axes.axhline(value, color=GREY, linestyle=line, linewidth=1.0, label=words)
    axes.set_ylim(0.0, None)
    axes.set_xlabel('edge of a box [cells]', fontsize=12)
    axes.set_ylabel('entropy [1]', fontsize=12)
    axes.legend(frameon=False, fontsize=11, loc='lower right')
    return figure


def _draw_along(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    axis = swept(dataset.attrs)
    figure = new_figure(WIDTH, HEIGHT, looks)
    write_title(figure, LEFT, looks.title or f'Basin boundary against {axis}')
    axes = add_axes(figure, LEFT, BOTTOM, WIDTH - LEFT - 30, TALL)
    draw_values(axes, dataset[axis].values, *(
        dataset[name].values for name in ('entropy_boundary', 'entropy_boundary_error')), *(
        dataset[name].values[:, 0] for name in ('exponent', 'exponent_error')))
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel(f'{dataset[axis].attrs["long_name"]}, {axis} [1]', fontsize=12)
    return figure


def draw_values(axes: Axes, places: FloatArray, entropy: FloatArray, entropy_error: FloatArray,
                exponent: FloatArray, exponent_error: FloatArray) -> None:
    """Draw the entropy and the exponent of the boundary between basins against a parameter."""
    for values, errors, mark, colour, words in (
            (entropy, entropy_error, 'o', 'black', 'boundary basin entropy S_bb'),
            (exponent, exponent_error, 's', GREY, 'uncertainty exponent')):
        axes.errorbar(places, values, errors, fmt=f'{mark}-', markersize=3, linewidth=0.9,
                      color=colour, label=words)
    axes.set_ylabel('boundary [1]', fontsize=12)
    axes.legend(frameon=False, fontsize=11)
