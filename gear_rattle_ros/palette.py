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

"""
The colours of every picture: an attractor has that of its number.

They are chosen to be told apart by the colour-blind and in grey print. With full colour vision,
protanopia, deuteranopia and tritanopia, the smallest CIELAB distance is 28.1 among the first six
hues, unsettled and white, and 20.2 among all hues, ends and white; the first four hues differ by
10.5 or more in L*. `pytest test/test_palette.py` measures it.
"""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from .core.many.settling import FLOATING, RESTS_LOWER, RESTS_UPPER, UNSETTLED

# Those that are faint on white come last.
HUES: Final = ('#164d95', '#c9280c', '#64b167', '#826cfe', '#e8a010', '#1eb0e1', '#3b673d',
               '#6e0f03', '#47144e', '#260f8f', '#06f4a7', '#80ed5c')
BLUE, RED, GREEN, PURPLE, AMBER, SKY = HUES[:6]
# Labels that are not attractors.
ENDS: Final = {UNSETTLED: '#b0b0b0', RESTS_UPPER: '#424242', RESTS_LOWER: '#777777',
               FLOATING: '#141414'}
# Manifolds, and marks over basins.
UNSTABLE: Final = '#000000'
STABLE: Final = '#00682d'
MARK: Final = '#c2007a'
# Lines and words beside what is drawn.
GREY: Final = '#606060'
# What organises the basins, over them on a dark ground.
LAYERS: Final = {
    'unstable_orbits': SKY, 'unstable_manifold': AMBER, 'stable_manifold': HUES[10],
    'edge_state': PURPLE, 'smallest_kick': '#ffffff'}
# Exponents: neighbouring trajectories converge, neither, diverge; and where all memory is lost.
EXPONENTS: Final = ('#0c4a8c', '#f7f7f7', '#b22e18')
FORGOTTEN: Final = '#4d4d4d'


def hue(number: int) -> str:
    """Return the colour of an attractor of this number."""
    return HUES[number % len(HUES)]


def colours_of(hues: Sequence[int]) -> dict[int, str]:
    """Return the colour of every label, `ENDS` among them."""
    return ENDS | {label: hue(number) for label, number in enumerate(hues)}


def painted(labels: npt.NDArray[np.signedinteger], colours: Mapping[int, str]
            ) -> npt.NDArray[np.uint8]:
    """Paint a grid of labels in red, green, blue and opacity, 0 to 255."""
    lowest = min(colours)
    table = np.zeros((max(colours) - lowest + 1, 4), np.uint8)
    for label, colour in colours.items():
        table[label - lowest] = [*rgb(colour), 255]
    return table[labels - lowest]


def reach(exponents: npt.NDArray[np.floating]) -> float:
    """Return the bound of all but the most extreme twentieth of some exponents [1]."""
    finite = np.abs(exponents[np.isfinite(exponents)])
    return max(1e-3, float(np.quantile(finite, 0.95))) if len(finite) else 1.0


def rgb(colour: str) -> tuple[int, int, int]:
    """Return red, green and blue, 0 to 255."""
    red, green, blue = bytes.fromhex(colour[1:7])
    return red, green, blue


def rgba(colour: str, opacity: int = 0xFF) -> int:
    """Return a colour as rerun takes it, red first in 32 bits."""
    return int(colour[1:], 16) << 8 | opacity
