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

from bokeh.models import CustomJSHover, CustomJSTicker, CustomJSTickFormatter, Range1d

# Round numbers; for phases in a wide window, multiples of a fraction of pi.
_ROUND: Final = """
    const width = Math.abs(range.end - range.start);
    const power = Math.pow(10, Math.floor(Math.log10(width / 4)));
    let step = power * [1, 2, 5, 10].find((m) => width / (m * power) <= 5.5), parts = 0;
    const digits = Math.max(0, Math.min(17, Math.ceil(-Math.log10(step) - 1e-9)));
"""
_STEP: Final = _ROUND + """
    for (const n of [1, 2, 4, 8])
        if (parts == 0 && width >= 2.5 * Math.PI / n) { step = Math.PI / n; parts = n; }
"""
_TICKS: Final = """
    const low = Math.min(range.start, range.end), high = Math.max(range.start, range.end);
    const ticks = [];
    for (let n = Math.ceil(low / step); n * step <= high && ticks.length < 20; n++)
        ticks.push(n * step);
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
    return tick.toFixed(digits).replace('-', '\u2212');
"""
_READ: Final = _ROUND + """
    return value.toFixed(Math.min(17, digits + 2)).replace('-', '\u2212');
"""


def ticker(range_: Range1d, is_phase: bool) -> CustomJSTicker:
    return CustomJSTicker(
        args={'range': range_}, major_code=(_STEP if is_phase else _ROUND) + _TICKS)


def formatter(range_: Range1d, is_phase: bool) -> CustomJSTickFormatter:
    """Return the labels of an axis; phases are fractions of pi where the window is wide."""
    return CustomJSTickFormatter(args={'range': range_}, code=_PHASE if is_phase else _LABEL)


def read_out(range_: Range1d) -> CustomJSHover:
    """Return the format of a coordinate under the pointer."""
    return CustomJSHover(args={'range': range_}, code=_READ)
