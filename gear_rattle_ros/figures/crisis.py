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

"""Pictures of crises: lifetimes along the path, and the law."""

from typing import TYPE_CHECKING

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
import numpy as np

from .style import add_axes, Looks, new_figure, thousands
from ..palette import GREY
from ..studies.attractors import swept

if TYPE_CHECKING:
    import xarray

WIDTH, HEIGHT = 900, 640


def draw_law(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw mean lifetimes against the distance from the crisis, with the law."""
    a, axis = dataset.attrs, swept(dataset.attrs)
    touch, place = a[f'tangency_{axis}'], a[f'law_{axis}_c']
    places, rates = dataset[axis].values[1:], dataset['escape_rate'].values[1:]
    errors = dataset['escape_rate_error'].values[1:]
    some = rates > 0.0
    direction = a['direction']
    beyond = direction * (places - touch)
    figure = new_figure(WIDTH, HEIGHT, looks)
    axes = add_axes(figure, 130, 80, WIDTH - 170, HEIGHT - 150)
    axes.errorbar(beyond[some], 1.0 / rates[some], yerr=(errors / rates**2)[some], fmt='o',
                  color=looks.hue(0), markersize=5, capsize=3,
                  label='mean lifetime from escapes over impacts at risk, ± standard error')
    x = np.geomspace(0.7 * beyond[0], 1.4 * beyond[-1], 200)
    shifted = x + direction * (touch - place)
    axes.plot(x[shifted > 0], 1.0 / (a['law_scale'] * shifted[shifted > 0]**a['law_exponent']),
              color=looks.hue(1), label=f'law with {axis}_c = {place:.7f} ± '
              f'{a[f"law_{axis}_c_error"]:.1g} and exponent {a["law_exponent"]:.2f} ± '
              f'{a["law_exponent_error"]:.2f}, all fitted')
    # Anchored at the middle of the rates.
    middle = np.exp(np.mean(np.log(rates[some] * beyond[some]**-a['tangency_exponent'])))
    axes.plot(x, 1.0 / (middle * x**a['tangency_exponent']), '--', color=GREY,
              label=f'slope {a["tangency_exponent"]:.3f} of the {a["tangency"]} tangency')
    axes.set(xscale='log', yscale='log')
    axes.set_xlabel(f'distance from {axis} = {touch:.8f}, where the manifolds touch [1]',
                    fontsize=12)
    axes.set_ylabel('mean lifetime of the transient [impacts]', fontsize=12)
    axes.yaxis.set_major_formatter(FuncFormatter(thousands))
    axes.grid(which='both', color='#e8e8e8', linewidth=0.6)
    axes.set_axisbelow(True)
    axes.legend(loc='lower left', fontsize=10, framealpha=0.95)
    figure.text(0.144, 0.955, looks.title or 'Lifetimes diverge at the boundary crisis of '
                f'{a["attractor"]}', fontsize=13)
    figure.text(0.144, 0.915, f'it collides with the saddle {a["saddle"]}', fontsize=10,
                color=GREY)
    return figure
