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

"""The picture of a scene: section, velocities, exponents or alpha."""

import dataclasses
import io
import math
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
import numpy as np
from PIL import Image

from gear_rattle_ros.core.model import EventArray, EventKind
from gear_rattle_ros.core.orbits.letters import LETTERS
from gear_rattle_ros.figures.style import DPI, Looks, new_figure, phase_ticks
from gear_rattle_ros.palette import GREY, hue
from gear_rattle_ros.scenes import Scene, Step

WIDTH, HEIGHT = 1100, 560
# Most points drawn for a step, taken at random: every n-th would miss points of an orbit.
POINTS = 25_000
# Colours of the picture file: dots on white need no more.
PALETTE = 48


@dataclasses.dataclass(frozen=True)
class Stretch:
    """The events of a step, and what was found in them."""

    step: Step
    events: EventArray
    words: str
    impacts: tuple[int, ...]
    exponents: tuple[float, ...]
    exponent: float
    error: float
    # First impacts on attractors, and the letters of these, where noise makes the gear hop.
    visits: tuple[tuple[int, str], ...] = ()


def draw(scene: Scene, stretches: list[Stretch]) -> Figure:
    """Draw a scene."""
    figure = new_figure(WIDTH, HEIGHT, Looks())
    figure.set_layout_engine('constrained')
    figure.suptitle(scene.title, fontsize=14)
    left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=(1.0, 1.15))[0]
    section = left.subplots()
    upper, lower = right.subplots(2, 1, height_ratios=(1.5, 1.0))
    sweeps = any(stretch.step.ramps_to is not None for stretch in stretches)
    _draw_section(section, stretches)
    if sweeps:
        _draw_diagram(upper, stretches)
        _draw_alpha(lower, stretches)
    else:
        _draw_velocities(upper, stretches)
        _draw_exponents(lower, stretches)
    return figure


def save(figure: Figure, path: Path) -> None:
    """Write a picture with few colours, and so few bytes."""
    raw = io.BytesIO()
    figure.savefig(raw, dpi=DPI)
    Image.open(raw).convert('RGB').quantize(PALETTE, dither=Image.Dither.NONE).save(
        path, optimize=True)


def _impacts(events: EventArray) -> EventArray:
    impacts = events[events['kind'] <= EventKind.STICK]
    if len(impacts) <= POINTS:
        return impacts
    return impacts[np.sort(np.random.default_rng(0).choice(len(impacts), POINTS, replace=False))]


def _dots(axes: Axes, x: np.ndarray, y: np.ndarray, colour: str | list[str]) -> None:
    axes.scatter(x, y, s=float(np.clip(20_000 / max(len(x), 1), 1.5, 16.0)), linewidths=0,
                 color=colour)


def _colours(stretch: Stretch, impacts: EventArray, number: int) -> str | list[str]:
    if not stretch.visits:
        return hue(number)
    first, letters = zip(*stretch.visits, strict=True)
    colours = [GREY, *(hue(LETTERS.index(letter)) for letter in letters)]
    return [colours[k] for k in np.searchsorted(first, impacts['index'], 'right')]


def _draw_section(axes: Axes, stretches: list[Stretch]) -> None:
    for number, stretch in enumerate(stretches):
        impacts = _impacts(stretch.events)
        _dots(axes, impacts['phase'], impacts['velocity'], _colours(stretch, impacts, number))
        for letter in sorted({letter for _, letter in stretch.visits}):
            axes.scatter([], [], s=30, color=hue(LETTERS.index(letter)), label=letter)
        if stretch.visits:
            axes.legend(title='visited last', loc='upper left', bbox_to_anchor=(0.0, 0.95))
        if len(stretches) > 1:
            axes.scatter([], [], s=30, color=hue(number), label=f'step {number + 1}')
    if len(stretches) > 1:
        axes.legend(loc='upper right', framealpha=0.9, ncols=2)
    axes.axhline(0.0, color=GREY, linewidth=0.6)
    axes.set(title='Section', xlim=(0.0, 2.0 * math.pi),
             ylabel="velocity before impact, s' [1]")
    axes.margins(y=0.12)
    axes.text(0.01, 0.985, 'upper wall', transform=axes.transAxes, va='top', color=GREY)
    axes.text(0.01, 0.015, 'lower wall', transform=axes.transAxes, color=GREY)
    phase_ticks(axes, (0.0, 2.0 * math.pi))


def _draw_velocities(axes: Axes, stretches: list[Stretch]) -> None:
    for number, stretch in enumerate(stretches):
        impacts = _impacts(stretch.events)
        first = stretches[number - 1].impacts[-1] if number else 0
        _dots(axes, first + np.linspace(0, stretch.impacts[-1] - first, len(impacts)),
              impacts['velocity'], _colours(stretch, impacts, number))
    axes.set(title='Velocity before the impact', xlabel='impact number', ylabel="s' [1]")
    _count_axis(axes)


def _draw_exponents(axes: Axes, stretches: list[Stretch]) -> None:
    axes.axhline(0.0, color='black', linewidth=0.8)
    for number, stretch in enumerate(stretches):
        axes.plot(stretch.impacts, stretch.exponents, color=hue(number), linewidth=1.4,
                  marker='o', markersize=2.5)
    axes.set(title='Largest exponent per impact, over the last 1,000 impacts',
             xlabel='impact number', ylabel='exponent [1]')
    _count_axis(axes)


def _draw_diagram(axes: Axes, stretches: list[Stretch]) -> None:
    for number, stretch in enumerate(stretches):
        impacts = _impacts(stretch.events)
        impacts = impacts[impacts['velocity'] > 0.0]
        _dots(axes, impacts['alpha'], impacts['velocity'], hue(number))
    axes.set(title='Velocity before impacts on the upper wall', xlabel='alpha [1]',
             ylabel="s' [1]")


def _draw_alpha(axes: Axes, stretches: list[Stretch]) -> None:
    for number, stretch in enumerate(stretches):
        events = _impacts(stretch.events)
        axes.plot(events['cycle'], events['alpha'], color=hue(number), linewidth=2.0)
    axes.set(title='Amplitude of the drive', xlabel='time [drive periods]', ylabel='alpha [1]')
    _count_axis(axes)


def _count_axis(axes: Axes) -> None:
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f'{value:,.0f}'))
    axes.margins(x=0.01)
