"""How figures look: colours, axes that match pixels, ticks in pi."""

import functools
import math
from pathlib import Path
from typing import Final

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, MultipleLocator
import numpy as np
import numpy.typing as npt
from PIL import Image

FloatArray = npt.NDArray[np.float64]
DPI: Final = 100
# Hues of attractors, told apart by the colour-blind too (Okabe & Ito), as dark as on paper.
HUES: Final = ('#0a5a9c', '#c2410c', '#04724d', '#8a2c76', '#8a6100', '#2f2f2f')
PALE: Final = 0.14
# A line one pixel thick is widened upwards and downwards at this strength.
HALO: Final = 0.45
# Copies of pictures are so wide at the most, smaller where the file would be too long [pixels,
# bytes], in so many colours.
SMALL: Final = (600, 520, 440, 380)
LONGEST: Final = 100_000
COLOURS: Final = 48
GREY: Final = '#606060'
VELOCITY_LABEL: Final = "velocity before impact, s' [1]"
PHASE_LABEL: Final = 'drive phase τ mod 2π [rad]'


def new_figure(width: int, height: int) -> Figure:
    """
    Make an empty figure.

    Parameters
    ----------
    width, height : int
        Size [pixels].

    Returns
    -------
    Figure
        White.

    """
    figure = Figure((width / DPI, height / DPI), dpi=DPI, facecolor='white')
    FigureCanvasAgg(figure)
    return figure


def add_axes(figure: Figure, left: int, bottom: int, width: int, height: int) -> Axes:
    """
    Put axes on whole pixels.

    Parameters
    ----------
    figure : Figure
        Receives them.
    left, bottom, width, height : int
        Of the area inside the axes [pixels].

    Returns
    -------
    Axes
        The axes.

    """
    w, h = (round(side * DPI) for side in figure.get_size_inches())
    axes = figure.add_axes((left / w, bottom / h, width / w, height / h))
    axes.tick_params(direction='out', labelsize=11)
    return axes


def shrink(picture: Path, small: Path) -> None:
    """
    Write a smaller copy of a picture, in few colours.

    Parameters
    ----------
    picture : Path
        The picture.
    small : Path
        The copy, the widest of `SMALL` that has `LONGEST` bytes or fewer.

    Raises
    ------
    OSError
        If one cannot be read or written.

    """
    with Image.open(picture) as whole:
        for width in SMALL:
            copy = whole.convert('RGB')
            copy.thumbnail((width, 2 * width), Image.Resampling.LANCZOS)
            copy.quantize(COLOURS).save(small, optimize=True)
            if small.stat().st_size <= LONGEST:
                break


def phase_ticks(axes: Axes, window: tuple[float, float], size: int = 12) -> None:
    """
    Mark the phase axis in fractions of pi, or in plain numbers where the window is narrow.

    Parameters
    ----------
    axes : Axes
        Whose horizontal axis it is.
    window : tuple of float
        What it shows [rad].
    size : int
        Of the label [points].

    """
    axes.set_xlabel(PHASE_LABEL, fontsize=size)
    for parts in (2, 4, 8, 16):
        if (window[1] - window[0]) >= 2.5 * math.pi / parts:
            axes.xaxis.set_major_locator(MultipleLocator(math.pi / parts))
            axes.xaxis.set_major_formatter(FuncFormatter(
                functools.partial(_tick_in_pi, parts)))
            return
    axes.xaxis.set_major_locator(MaxNLocator(6))


def thousands(value: float, _: int | None = None) -> str:
    """
    Write a count with its thousands apart.

    Parameters
    ----------
    value : float
        The count [1].

    Returns
    -------
    str
        Such as 10,000.

    """
    return f'{value:,.0f}'


def in_pi(value: float, parts: int) -> str:
    """
    Write a multiple of a fraction of pi.

    Parameters
    ----------
    value : float
        The number [rad].
    parts : int
        The fraction is pi over this.

    Returns
    -------
    str
        Such as 3π/2.

    """
    n = round(value / (math.pi / parts))
    if n == 0:
        return '0'
    common = math.gcd(n, parts)
    top, bottom = n // common, parts // common
    text = {1: 'π', -1: '−π'}.get(top, f'{top}π'.replace('-', '−'))
    return text if bottom == 1 else f'{text}/{bottom}'


def _tick_in_pi(parts: int, value: float, _: int | None) -> str:
    return in_pi(value, parts)


def hue(number: int) -> str:
    """
    Give the colour of an attractor.

    Parameters
    ----------
    number : int
        From 0 on.

    Returns
    -------
    str
        As HTML writes it.

    """
    return HUES[number % len(HUES)]


def shade(colour: str, share: FloatArray) -> FloatArray:
    """
    Shade from nearly white to a colour, in steps that look equal (linear in Oklab).

    Parameters
    ----------
    colour : str
        The darkest.
    share : ndarray of float
        0 for pale, 1 for the colour.

    Returns
    -------
    ndarray of float, shape (..., 3)
        Red, green, blue.

    """
    full = _to_oklab(np.array([int(colour[k:k + 2], 16) / 255.0 for k in (1, 3, 5)]))
    white = np.array([1.0, 0.0, 0.0])
    weight = PALE + (1.0 - PALE) * np.clip(share, 0.0, 1.0)
    return _from_oklab(white + weight[..., None] * (full - white))


def equalise(counts: npt.ArrayLike) -> FloatArray:
    """
    Replace counts by their rank among those that are not zero, so that all shades are used.

    Parameters
    ----------
    counts : array_like
        Not negative.

    Returns
    -------
    ndarray of float
        0 where nothing was counted, 1 at the largest.

    """
    array = np.asarray(counts, np.float64)
    some = np.sort(array[array > 0.0])
    if not len(some):
        return np.zeros(array.shape)
    return np.searchsorted(some, array, 'right') / len(some)


def widened(share: FloatArray) -> FloatArray:
    """
    Widen lines one pixel thick, which are hard to see.

    Parameters
    ----------
    share : ndarray of float, shape (rows, columns)
        Shades.

    Returns
    -------
    ndarray of float, shape (rows, columns)
        Each pixel shines on those above and below it.

    """
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
