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


"""The picture of finite-time exponents along ramps of alpha."""

from typing import TYPE_CHECKING

from matplotlib.figure import Figure
import numpy as np

from .style import Looks, new_figure
from ..core.words import counted
from ..palette import GREY

if TYPE_CHECKING:
    import xarray


def draw_drift(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw exponents along each ramp over the static curve, with the changes of orbits."""
    a = dataset.attrs
    figure = new_figure(1000, 640, looks, layout='constrained')
    axes = figure.subplots()
    alphas, exponents = dataset['alpha_of'].values, dataset['exponent'].values
    axes.plot(alphas[0], exponents[0], color='black', linewidth=2.2, label='fixed alpha')
    for k, rate in enumerate(a['rates']):
        axes.plot(alphas[k + 1], exponents[k + 1], color=looks.hue(k), linewidth=0.9,
                  label=f'{rate:g} in a drive period')
    for kind, at in zip(dataset['event_kind'].values, dataset['event_alpha'].values, strict=True):
        axes.axvline(at, color=GREY, linewidth=0.8, linestyle='--')
        axes.text(at, 0.99, f' {kind}', rotation=90, va='top', color=GREY,
                  transform=axes.get_xaxis_transform())
    finite = exponents[np.isfinite(exponents)]
    if len(finite):
        axes.set_ylim(max(float(np.min(finite)), -1.5) - 0.05, float(np.max(finite)) + 0.05)
    axes.axhline(0.0, color=GREY, linewidth=0.6)
    axes.set(xlabel='alpha [1]', xlim=(a['alpha'], a['to']),
             ylabel=f'largest exponent per impact over {counted(a["window"], "impact")} [1]')
    axes.legend(frameon=False)
    axes.set_title(looks.title or f'Ramps of alpha from {a["attractor_key"]}')
    return figure
