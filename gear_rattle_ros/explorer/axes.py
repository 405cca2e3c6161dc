"""Ticks and read-outs with as many digits as the window needs; they run in the browser."""

from typing import Final

from bokeh.models import CustomJSHover, CustomJSTicker, CustomJSTickFormatter, Range1d

# Multiples of a fraction of pi in a wide window, round numbers in a narrow one.
_STEP: Final = """
    const width = Math.abs(range.end - range.start);
    let step = 0, parts = 0;
    for (const n of [1, 2, 4, 8])
        if (step == 0 && width >= 2.5 * Math.PI / n) { step = Math.PI / n; parts = n; }
    if (step == 0) {
        const power = Math.pow(10, Math.floor(Math.log10(width / 4)));
        step = power * [1, 2, 5, 10].find((m) => width / (m * power) <= 5.5);
    }
    const digits = Math.max(0, Math.min(17, Math.ceil(-Math.log10(step) - 1e-9)));
"""
_TICKS: Final = _STEP + """
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
_PLAIN: Final = """
    const width = Math.abs(range.end - range.start);
    const power = Math.pow(10, Math.floor(Math.log10(width / 4)));
    const step = power * [1, 2, 5, 10].find((m) => width / (m * power) <= 5.5);
    const digits = Math.max(0, Math.min(17, Math.ceil(-Math.log10(step) - 1e-9)));
"""
_PLAIN_TICKS: Final = _PLAIN + """
    const low = Math.min(range.start, range.end), high = Math.max(range.start, range.end);
    const ticks = [];
    for (let n = Math.ceil(low / step); n * step <= high && ticks.length < 20; n++)
        ticks.push(n * step);
    return ticks;
"""
_PLAIN_LABEL: Final = _PLAIN + """
    return tick.toFixed(digits).replace('-', '\u2212');
"""
_READ: Final = _PLAIN + """
    return value.toFixed(Math.min(17, digits + 2)).replace('-', '\u2212');
"""


def phase_ticker(range_: Range1d) -> CustomJSTicker:
    """Mark phases."""
    return CustomJSTicker(args={'range': range_}, major_code=_TICKS)


def phase_formatter(range_: Range1d) -> CustomJSTickFormatter:
    """Write phases, in fractions of pi where the window is wide."""
    return CustomJSTickFormatter(args={'range': range_}, code=_PHASE)


def plain_ticker(range_: Range1d) -> CustomJSTicker:
    """Mark other quantities."""
    return CustomJSTicker(args={'range': range_}, major_code=_PLAIN_TICKS)


def plain_formatter(range_: Range1d) -> CustomJSTickFormatter:
    """Write other quantities."""
    return CustomJSTickFormatter(args={'range': range_}, code=_PLAIN_LABEL)


def read_out(range_: Range1d) -> CustomJSHover:
    """Write a coordinate under the pointer."""
    return CustomJSHover(args={'range': range_}, code=_READ)
