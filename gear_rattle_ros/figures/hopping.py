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


"""The picture of mean residence times against the strength of the noise."""

from typing import TYPE_CHECKING

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
import numpy as np

from .grids import colours_and_names
from .style import Looks, new_figure, thousands
from ..studies.robustness.hopping import residences

if TYPE_CHECKING:
    import xarray


def draw_hopping(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw mean residence times over 1/sigma^2; an arrow is a lower bound."""
    a = dataset.attrs
    colours, names = colours_and_names(dataset, looks)
    figure = new_figure(900, 640, looks, layout='constrained')
    axes = figure.subplots()
    across = np.array(a['noise'])**-2.0
    for label, found in residences(dataset).items():
        means = np.array([each.mean for each in found])
        errors = np.nan_to_num([each.mean_error for each in found])
        seen = np.array([each.ends > 0 for each in found])
        bound = ~seen & (means > 0.0)
        axes.errorbar(across[seen], means[seen], errors[seen], fmt='o-', capsize=3,
                      color=colours[label], label=names[label])
        axes.errorbar(across[bound], means[bound], 0.5 * means[bound], lolims=True, fmt='o',
                      markerfacecolor='white', color=colours[label])
    axes.set(yscale='log', xlabel='1/sigma² [1]', ylabel='mean residence time [impacts]')
    axes.yaxis.set_major_formatter(FuncFormatter(thousands))
    axes.grid(color='#e8e8e8', linewidth=0.6)
    axes.legend(title='± Poisson error; hollow: lower bound at 95 %', frameon=False)
    axes.set_title(looks.title or f'Residence times with {a["kind"]} noise, alpha {a["alpha"]:g}')
    return figure
