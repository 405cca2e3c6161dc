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

"""How figures look: colours, axes that match pixels, ticks in pi."""

import dataclasses
import functools
import math
from pathlib import Path
import struct
from typing import Any, Final, TYPE_CHECKING
import zlib

from matplotlib import colormaps, rc_context
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, MaxNLocator, MultipleLocator
import numpy as np
import numpy.typing as npt
from PIL import Image

from ..core.arrays import FloatArray
from ..core.defaults import QUANTITIES
from ..core.gears import Gears
from ..palette import GREY, hue

if TYPE_CHECKING:
    import xarray

DPI: Final = 100
# Letters stay letters in PDF and SVG, as journals ask: no outlines, no fonts of Type 3.
FONTS: Final[Any] = {'pdf.fonttype': 42, 'ps.fonttype': 42, 'svg.fonttype': 'none'}
# Basins in the greys of the paper: light and black first.
PAPER: Final = ('#bfbfbf', '#000000', '#7f7f7f', '#dfdfdf', '#3f3f3f')
PALE: Final = 0.14
# A line one pixel thick is widened upwards and downwards at this strength.
HALO: Final = 0.45
# Edge of a grid in a picture, about, and margins of its axes [pixels].
EDGE: Final = 800
LEFT, RIGHT, BOTTOM, TOP = 90, 30, 66, 64
# How far below and left of its axes an axis in SI units is [pixels].
BESIDE: Final = 52, 78
VELOCITY_LABEL: Final = "velocity before impact, s' [1]"
AFTER_LABEL: Final = "velocity after impact, s' [1]"
PHASE_LABEL: Final = 'drive phase τ mod 2π [rad]'


@dataclasses.dataclass(frozen=True)
class Looks:
    """How a picture looks, where that is not as usual."""

    title: str | None = None
    dpi: float | None = None
    # A colour map of matplotlib, or 'paper': the greys of the paper.
    colours: str | None = None
    # What is drawn, where a dataset has several pictures.
    draw: str | None = None
    # Amplitudes, or the window of a magnification: two phases and two velocities.
    mark: tuple[float, ...] = ()
    # What `transitions` has found, marked in a diagram.
    transitions: 'xarray.Dataset | None' = None

    def __post_init__(self) -> None:
        if self.dpi is not None and not 10.0 <= self.dpi <= 2400.0:
            raise ValueError(f'--dpi {self.dpi:g} is not between 10 and 2400')
        if self.colours not in (None, 'paper', *colormaps):
            raise ValueError(f'--colours {self.colours} is no colour map of matplotlib; try '
                             'viridis, cividis, tab10 or paper')

    @property
    def is_paper(self) -> bool:
        return self.colours == 'paper'

    def hue(self, number: int) -> str:
        """Return the colour of an attractor of this number."""
        if self.colours is None:
            return hue(number)
        if self.is_paper:
            return PAPER[number % len(PAPER)]
        colours = colormaps[self.colours]
        return to_hex(colours(number % colours.N if colours.N < 64 else
                              number * math.tau % 1.0))

    def ink(self, number: int) -> str:
        """Return the colour of thin lines and points of an attractor: black in the paper."""
        return PAPER[1] if self.is_paper else self.hue(number)

    def scale(self, usual: str) -> Colormap:
        """Return the colour map of a quantity."""
        return colormaps['gray_r' if self.is_paper else self.colours or usual]


class Picture(Figure):
    """A figure that is saved with real fonts, whatever the caller has set."""

    def savefig(self, *arguments: Any, **options: Any) -> None:
        if any(axes.child_axes for axes in self.axes):
            # Those in SI units lie outside.
            options = {'bbox_inches': 'tight', 'pad_inches': 0.1} | options
        with rc_context(FONTS):
            super().savefig(*arguments, **options)


def new_figure(width: int, height: int, looks: Looks, dpi: int = DPI, **options: Any) -> Figure:
    """Make an empty figure of a size in pixels, at the usual `dpi`."""
    return Picture((width / dpi, height / dpi), dpi=looks.dpi or dpi, facecolor='white', **options)


def add_axes(figure: Figure, left: int, bottom: int, width: int, height: int) -> Axes:
    """Put axes on whole pixels; the numbers are those of the area inside them."""
    w, h = (round(side * DPI) for side in figure.get_size_inches())
    axes = figure.add_axes((left / w, bottom / h, width / w, height / h))
    axes.tick_params(direction='out', labelsize=11)
    return axes


def add_si_axes(figure: Figure, gears: Gears) -> None:
    """Add a second axis in SI units beside each axis of a velocity, parameter or the like."""
    scales = gears.scales
    units = {'velocity': (1e3 * scales.velocity_m_per_s, '[mm/s]'),
             'smallest kick': (1e3 * scales.velocity_m_per_s, '[mm/s]'),
             'displacement s': (1e6 * scales.displacement_m, '[μm]'),
             '[drive periods]': (2e3 * math.pi * scales.time_s, '[ms]')} | {
        f', {name} [1]': (unit, '{} [{}]'.format(*QUANTITIES[quantity]))
        for name, (quantity, unit) in gears.units.items() if name != quantity}
    for axes in [*figure.axes]:
        box = axes.get_position().size * figure.get_size_inches() * DPI
        for is_upright, label in enumerate((axes.get_xlabel(), axes.get_ylabel())):
            for words, (unit, name) in units.items():
                if words in label:
                    add = axes.secondary_yaxis if is_upright else axes.secondary_xaxis
                    second = add(-BESIDE[is_upright] / box[1 - is_upright], functions=(
                        functools.partial(np.multiply, unit),
                        functools.partial(np.multiply, 1.0 / unit)))
                    (second.set_ylabel if is_upright else second.set_xlabel)(name, fontsize=11)


def write_title(figure: Figure, left: int, text: str) -> None:
    """Write a title at the top, beginning at a pixel."""
    width, height = figure.get_size_inches() * DPI
    figure.text(left / width, 1.0 - 14 / height, text, va='top', fontsize=13)


def legend_mark(marker: str, colour: str, label: str) -> Line2D:
    return Line2D([], [], marker=marker, linestyle='none', color=colour, label=label)


def name_walls(axes: Axes, *, is_after: bool = False) -> None:
    """Draw the line between impacts on the two walls, and name both sides."""
    axes.axhline(0.0, color=GREY, linewidth=0.6)
    walls = ('lower', 'upper') if is_after else ('upper', 'lower')
    for y, wall, side in zip((0.985, 0.015), walls, ('top', 'bottom'), strict=True):
        axes.text(0.01, y, f'{wall} wall', transform=axes.transAxes, va=side, color=GREY)


def pack(picture: Path, packed: Path) -> None:
    """Copy a picture into fewer bytes, every pixel as it is."""
    # Rows that are not filtered: the adaptive filters of encoders double the size of a grid.
    with Image.open(picture) as whole:
        pixels = np.asarray(whole.convert('RGB'))
    height, width, _ = pixels.shape
    rows = np.pad(pixels.reshape(height, -1), ((0, 0), (1, 0)))
    header = struct.pack('>2I5B', width, height, 8, 2, 0, 0, 0)
    packed.write_bytes(b'\x89PNG\r\n\x1a\n' + b''.join(
        struct.pack('>I', len(data)) + name + data + struct.pack('>I', zlib.crc32(name + data))
        for name, data in ((b'IHDR', header), (b'IDAT', zlib.compress(rows.tobytes(), 9)),
                           (b'IEND', b''))))


def scaled(cells: int, edge: int = EDGE) -> int:
    """Return the length of an edge [pixels] on which a cell is a whole number of pixels."""
    return cells * max(1, round(edge / cells))


def phase_ticks(axes: Axes, window: tuple[float, float], size: int = 12,
                label: str = PHASE_LABEL) -> None:
    """Mark the phase axis in fractions of pi, or in plain numbers where the window is narrow."""
    axes.set_xlabel(label, fontsize=size)
    for parts in (2, 4):
        if (window[1] - window[0]) >= 2.5 * math.pi / parts:
            axes.xaxis.set_major_locator(MultipleLocator(math.pi / parts))
            axes.xaxis.set_major_formatter(
                FuncFormatter(lambda value, _, parts=parts: in_pi(value, parts)))
            return
    axes.xaxis.set_major_locator(MaxNLocator(6))


def thousands(value: float, _: int | None = None) -> str:
    """Write a count with its thousands apart."""
    return f'{value:,.0f}'


def in_pi(value: float, parts: int) -> str:
    """Write a number as a multiple of pi over some parts, such as 3π/2."""
    n = round(value / (math.pi / parts))
    if n == 0:
        return '0'
    common = math.gcd(n, parts)
    top, bottom = n // common, parts // common
    text = {1: 'π', -1: '−π'}.get(top, f'{top}π'.replace('-', '−'))
    return text if bottom == 1 else f'{text}/{bottom}'


def shade(colour: str, share: FloatArray) -> FloatArray:
    """Shade from nearly white (0) to a colour (1) in steps that look equal: linear in Oklab."""
    full = _to_oklab(np.array([int(colour[k:k + 2], 16) / 255.0 for k in (1, 3, 5)]))
    white = np.array([1.0, 0.0, 0.0])
    weight = PALE + (1.0 - PALE) * np.clip(share, 0.0, 1.0)
    return _from_oklab(white + weight[..., None] * (full - white))


def equalise(counts: npt.ArrayLike) -> FloatArray:
    """Replace counts by their rank among those that are not zero, so that all shades are used."""
    array = np.asarray(counts, np.float64)
    some = np.sort(array[array > 0.0])
    if not len(some):
        return np.zeros(array.shape)
    return np.searchsorted(some, array, 'right') / len(some)


def widened(share: FloatArray) -> FloatArray:
    """Widen lines one pixel thick, which are hard to see."""
    halo, wide = HALO * share, share.copy()
    wide[1:] = np.maximum(wide[1:], halo[:-1])
    wide[:-1] = np.maximum(wide[:-1], halo[1:])
    return wide


_MIX = np.array([[0.4122214708, 0.5363325363, 0.0514459929],
                 [0.2119034982, 0.6806995451, 0.1073969566],
                 [0.0883024619, 0.2817188376, 0.6299787005]])
_LAB = np.array([[0.2104542553, 0.7936177850, -0.0040720468],
                 [1.9779984951, -2.4285922050, 0.4505937099],
                 [0.0259040371, 0.7827717662, -0.8086757660]])


def _to_oklab(colour: FloatArray) -> FloatArray:
    linear = np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055)**2.4)
    return np.asarray(_LAB @ np.cbrt(_MIX @ linear))


def _from_oklab(lab: FloatArray) -> FloatArray:
    linear = (lab @ np.linalg.inv(_LAB).T)**3 @ np.linalg.inv(_MIX).T
    linear = np.clip(linear, 0.0, 1.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear**(1.0 / 2.4) - 0.055)
