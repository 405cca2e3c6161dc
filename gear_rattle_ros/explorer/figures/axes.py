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

"""Ticks and read-outs with as many digits as the window needs; they run in the browser."""

from typing import Final

from bokeh.models import (
    CustomJSHover,
    CustomJSTicker,
    CustomJSTickFormatter,
    LinearAxis,
    Range1d,
)

# Round numbers, also after multiplication by a scale; for phases in a wide window, multiples of a
# fraction of pi.
_ROUND: Final = """
    const width = scale * Math.abs(range.end - range.start);
    const power = Math.pow(10, Math.floor(Math.log10(width / 4)));
    let step = power * [1, 2, 5, 10].find((m) => width / (m * power) <= 5.5), parts = 0;
    const digits = Math.max(0, Math.min(17, Math.ceil(-Math.log10(step) - 1e-9)));
"""
_STEP: Final = _ROUND + """
    for (const n of [1, 2, 4, 8])
        if (parts == 0 && width >= 2.5 * Math.PI / n) { step = Math.PI / n; parts = n; }
"""
_TICKS: Final = """
    const ends = [scale * range.start, scale * range.end], ticks = [];
    const low = Math.min(...ends), high = Math.max(...ends);
    for (let n = Math.ceil(low / step); n * step <= high && ticks.length < 20; n++)
        ticks.push(n * step / scale);
    return ticks;
"""
_PHASE: Final = _STEP + """
    if (parts == 0) return tick.toFixed(digits);
    let top = Math.round(tick / step), bottom = parts;
    while (top % 2 == 0 && bottom > 1) { top /= 2; bottom /= 2; }
    const sign = top < 0 ? '\u2212' : '', size = Math.abs(top);
    if (size == 0) return '0';
    return sign + (size == 1 ? '' : size) + '\u03c0' + (bottom == 1 ? '' : '/' + bottom);
"""
_LABEL: Final = _ROUND + """
    return (scale * tick).toFixed(digits).replace('-', '\u2212');
"""
_READ: Final = _ROUND + """
    const words = (number) => number.replace('-', '\u2212');
    return words(value.toFixed(Math.min(17, digits + 2)))
        + (unit ? ` (${words((value * factor).toPrecision(4))} ${unit})` : '');
"""


def ticker(range_: Range1d, is_phase: bool, scale: float = 1.0) -> CustomJSTicker:
    return CustomJSTicker(args={'range': range_, 'scale': scale},
                          major_code=(_STEP if is_phase else _ROUND) + _TICKS)


def formatter(range_: Range1d, is_phase: bool, scale: float = 1.0) -> CustomJSTickFormatter:
    """Return the labels of an axis; phases are fractions of pi where the window is wide."""
    return CustomJSTickFormatter(args={'range': range_, 'scale': scale},
                                 code=_PHASE if is_phase else _LABEL)


def si_axis(range_: Range1d, scale: float, words: str) -> LinearAxis:
    """Return a second axis, in a unit in which 1 is the `scale`."""
    return LinearAxis(ticker=ticker(range_, False, scale), axis_label=words,
                      formatter=formatter(range_, False, scale),
                      axis_label_text_font_style='normal')


def read_out(range_: Range1d, factor: float = 1.0, unit: str = '') -> CustomJSHover:
    """Return the format of a coordinate under the pointer, and beside it in a `unit`."""
    return CustomJSHover(
        args={'range': range_, 'scale': 1.0, 'factor': factor, 'unit': unit}, code=_READ)
