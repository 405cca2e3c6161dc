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

"""The labels of some programs, and below each where they are not ours."""

from pathlib import Path

import numpy as np

from gear_rattle_ros.attractors.catalogue import Catalogue
from gear_rattle_ros.attractors.letters import numbers_of
from gear_rattle_ros.core.many.settling import UNSETTLED
from gear_rattle_ros.figures.style import add_axes, DPI, Looks, new_figure, phase_ticks, scaled
from gear_rattle_ros.palette import AMBER, colours_of, ENDS, painted

EDGE, LEFT, BOTTOM, GAP, TOP = 300, 84, 62, 32, 56
SAME, OTHER = 0, 1
DIFFERS = {UNSETTLED: ENDS[UNSETTLED], SAME: '#ffffff', OTHER: AMBER}


def draw(programs: dict[str, tuple[np.ndarray, np.ndarray]], ours: np.ndarray,
         catalogue: Catalogue, path: Path) -> None:
    """Draw a column for each program: its labels above those that are compared with ours."""
    size = round(len(ours)**0.5)
    edge, window = scaled(size, EDGE), (0.0, 2.0 * np.pi, -2.0, 2.0)
    orbits = range(len(catalogue.orbits))
    colours = colours_of(list(numbers_of(orbits, catalogue.letters).values()))
    figure = new_figure(LEFT + len(programs) * (edge + GAP), BOTTOM + 2 * (edge + TOP), Looks())
    for column, (name, (labels, compared)) in enumerate(programs.items()):
        left, none = LEFT + column * (edge + GAP), compared < 0
        differs = np.where(none, UNSETTLED, np.where(compared == ours, SAME, OTHER))
        words = (f'{100.0 * np.mean(differs == OTHER):.2f} % another label, '
                 f'{100.0 * np.mean(none):.2f} % none')
        for row, values, table, title in ((1, labels, colours, name),
                                          (0, differs, DIFFERS, words)):
            axes = add_axes(figure, left, BOTTOM + row * (edge + TOP), edge, edge)
            axes.imshow(painted(values.reshape(size, size), table), extent=window, origin='lower',
                        aspect='auto', interpolation='nearest')
            axes.set_title(title, fontsize=12)
            phase_ticks(axes, window[:2])
            if column == 0:
                axes.set_ylabel("velocity s' [1]", fontsize=12)
            axes.tick_params(labelleft=column == 0, labelbottom=row == 0)
            if row == 1:
                axes.set_xlabel('')
    figure.savefig(path, dpi=DPI)
