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

"""The picture of a dataset, whichever study it is from."""

import importlib
import json
from pathlib import Path
from typing import Any, Final, TYPE_CHECKING

from matplotlib.figure import Figure

from .style import add_si_axes, Looks
from ..core.gears import Gears

if TYPE_CHECKING:
    import xarray

# The pictures of each study: what is added to the name of the file, and who draws it.
PICTURES: Final = {
    'attractors': {'': 'grids.draw_attractors'},
    'basins': {'': 'grids.draw_basins'},
    'boundary': {'': 'boundary.draw_boundary'},
    'continuation': {'': 'diagrams.draw_shares'},
    'crisis': {'': 'crisis.draw_law'},
    'drift': {'': 'drift.draw_drift'},
    'exponents': {'': 'grids.draw_exponents'},
    'hopping': {'': 'hopping.draw_hopping'},
    'lifetimes': {'': 'grids.draw_lifetimes', 'survival': 'grids.draw_survival'},
    'manifolds': {'': 'over_basins.draw_manifolds'},
    'motion': {'': 'section.draw_motion'},
    'orbit_diagram': {'': 'diagrams.draw_diagram'},
    'orbits': {'': 'over_basins.draw_orbits'},
    'parameter_plane': {'': 'parameter_plane.draw_plane'},
    'probability_basins': {'': 'grids.draw_probabilities'},
    'rattle': {'': 'rattle.draw_rattle'},
    'saddle': {'': 'grids.draw_saddle'},
    'section': {'': 'section.draw_section'},
    'stability': {'': 'over_basins.draw_stability'},
}


def draw(dataset: 'xarray.Dataset', **looks: Any) -> Figure:
    """
    Draw a dataset.

    Parameters
    ----------
    dataset : xarray.Dataset
        As a study returns it, or `open_dataset`.
    **looks
        `title`; `dpi`; `colours`, a colour map of matplotlib or 'paper'; `draw`, which picture of
        several; `mark`, amplitudes or a window that are marked; and `transitions`, a dataset of
        that study, which is marked in a diagram.

    Returns
    -------
    matplotlib.figure.Figure
        Ready to be saved.

    """
    return _drawn(_names(dataset)[''], dataset, looks)


def save(dataset: 'xarray.Dataset', path: Path | str, **looks: Any) -> list[Path]:
    """
    Draw a dataset into a file, and what belongs beside it into others.

    Parameters
    ----------
    dataset : xarray.Dataset
        As a study returns it, or `open_dataset`.
    path : Path or str
        Ends in .png, .pdf, .svg or .jpg; the fonts of PDF and SVG are real ones.
    **looks
        As `draw` takes them.

    Returns
    -------
    list of Path
        What was written.

    """
    path, written = Path(path), []
    for suffix, name in _names(dataset).items():
        written.append(path.with_name(f'{path.stem}-{suffix}{path.suffix}') if suffix else path)
        _drawn(name, dataset, looks).savefig(written[-1])
    return written


def _names(dataset: 'xarray.Dataset') -> dict[str, str]:
    tool = dataset.attrs.get('tool')
    if tool not in PICTURES:
        raise ValueError(f'the dataset is of {tool!r}, which has no picture; there are '
                         f'{", ".join(PICTURES)}')
    return PICTURES[tool]


def _drawn(name: str, dataset: 'xarray.Dataset', looks: dict[str, Any]) -> Figure:
    module, function = name.split('.')
    drawer = getattr(importlib.import_module(f'.{module}', __package__), function)
    figure: Figure = drawer(dataset, Looks(**looks))
    if 'gears' in dataset.attrs:
        add_si_axes(figure, Gears.of(json.loads(dataset.attrs['gears'])))
    return figure
