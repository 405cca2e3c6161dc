"""Colours, the same in every picture: an attractor has that of its number."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from .core.many.settling import FLOATING, RESTS_LOWER, RESTS_UPPER, UNSETTLED

# Told apart by the colour-blind too (Okabe & Ito); those that are faint on white come late, then
# darker ones.
HUES: Final = ('#0072b2', '#d55e00', '#009e73', '#cc79a7', '#e69f00', '#56b4e9', '#004a75',
               '#7a3600', '#00523c', '#7d3c63', '#8f5f00', '#f0e442')
BLUE, ORANGE, GREEN, PURPLE, AMBER, SKY = HUES[:6]
# Of labels that are no number of an attractor.
ENDS: Final = {UNSETTLED: '#d9d9d9', RESTS_UPPER: '#6b6b6b', RESTS_LOWER: '#a3a3a3',
               FLOATING: '#4d4d4d'}
# Lines and words beside what is drawn.
GREY: Final = '#606060'
# Exponents: neighbours meet, neither, part; and all memory is lost.
EXPONENTS: Final = ('#0c4a8c', '#f7f7f7', '#b22e18')
FORGOTTEN: Final = '#4d4d4d'


def hue(number: int) -> str:
    """Return the colour of an attractor of this number."""
    return HUES[number % len(HUES)]


def colours_of(hues: Sequence[int]) -> dict[int, str]:
    """List the colour of every label; those of the unsettled and of rest are among them."""
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
