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

"""One picture of a bag: section, velocities, alpha, exponents, the last motion, in words."""

from collections.abc import Callable
import io
import math
import textwrap
from typing import Any, Final, TypeAlias

from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator
import numpy as np

from .digest import Digest, digest_of, in_words, RowArray
from .style import Looks, name_walls, new_figure, phase_ticks, thousands, VELOCITY_LABEL
from ..core.arrays import FloatArray
from ..core.flight.simulation import Simulation
from ..core.model import Parameters, State
from ..core.stream.reconstruction import rebuild
from ..core.words import counted
from ..palette import GREY

WIDTH, HEIGHT = 1600, 1000
TWO_PI = 2.0 * math.pi
# Drive periods over which s(tau) is drawn.
PERIODS: Final = 6
# The running exponent is not drawn before this many impacts.
IMPACTS_LEAST: Final = 30
# More retunes than this are a ramp: no line for each.
LINES_MOST: Final = 20
# More values of alpha than this have a bar of colours instead of a legend.
LEGEND_MOST: Final = 8
# Lines of words that fit below the section.
WORDS_ROWS: Final = 8
MAP: Final = 'plasma'
# Its bright end is hard to see on white.
MAP_END: Final = 0.75

Colour: TypeAlias = Callable[[FloatArray], FloatArray]


def draw(digest: Digest, name: str, **options: Any) -> Figure:
    """Draw a run; the options are those of `Looks`."""
    looks = Looks(**options)
    figure = new_figure(WIDTH, HEIGHT, looks, layout='constrained')
    figure.suptitle(looks.title or title_of(digest, name), fontsize=14)
    left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=(1.0, 1.15))[0]
    section, words = left.subplots(2, 1, height_ratios=(5.0, 1.0))
    velocity, alpha, exponents, motion = right.subplots(4, 1, height_ratios=(1.0, 0.6, 1.3, 0.8))
    # One scale of colour for both pictures of the impacts.
    norm = Normalize(*_spread(digest.points.rows['alpha']))

    def colour(alphas: FloatArray) -> FloatArray:
        share = MAP_END * norm(alphas)
        return np.asarray(looks.scale(MAP)(1.0 - share if looks.is_paper else share), np.float64)

    draw_section(section, digest, colour)
    if len(np.unique(digest.points.rows['alpha'])) > LEGEND_MOST:
        shades = ListedColormap(colour(np.linspace(norm.vmin or 0.0, norm.vmax or 1.0, 256)))
        figure.colorbar(ScalarMappable(norm, shades), ax=section, label='alpha [1]',
                        location='bottom', aspect=40, shrink=0.9)
    draw_words(words, digest)
    draw_velocity(velocity, digest, colour)
    draw_alpha(alpha, digest, looks)
    draw_exponents(exponents, digest, looks)
    draw_motion(motion, digest, looks)
    for axes in (velocity, alpha):
        axes.sharex(exponents)
        axes.set_xlabel('')
        axes.tick_params(labelbottom=False)
    low, high = _spread(digest.points.rows['impact'])
    exponents.set_xlim(low - 0.01 * (high - low), high + 0.01 * (high - low))
    return figure


def title_of(digest: Digest, name: str) -> str:
    """Return the name, length and parameters of a run in one line."""
    assert digest.place is not None
    first, event = digest.changes.rows[0], digest.place.event
    periods = digest.place.drive_time - first['drive_time']
    lost = f', {digest.guard.lost:,} lost' if digest.guard.lost else ''
    return (f'{name}: {counted(digest.impacts, "impact")}{lost} in '
            f'{counted(periods, "drive period")}, '
            f'beta {event["beta"]:g}, gamma {event["gamma"]:g}, r {event["restitution"]:g}')


def draw_section(axes: Axes, digest: Digest, colour: Colour) -> None:
    points = digest.points.rows
    _scatter(axes, 'phase', points, colour)
    share = 'every impact' if len(points) == digest.impacts else counted(len(points), 'impact')
    axes.set_title(f'Section: {share}, coloured by alpha')
    axes.set(xlim=(0.0, TWO_PI), ylabel=VELOCITY_LABEL)
    phase_ticks(axes, (0.0, TWO_PI), size=10)
    name_walls(axes)
    # Room for the legend above the points.
    low, high = _spread(points['velocity'])
    axes.set_ylim(low - 0.06 * (high - low), high + 0.16 * (high - low))
    values = np.unique(points['alpha'])
    # More are a ramp, which has a bar of its own.
    if len(values) <= LEGEND_MOST:
        for value in values:
            axes.scatter([], [], s=30, color=colour(value), label=f'alpha {value:g}')
        axes.legend(loc='upper right', framealpha=0.9)


def draw_words(axes: Axes, digest: Digest) -> None:
    """Write the orbits and transients that were found."""
    axes.axis('off')
    first, *lines = [textwrap.fill(in_words(word), 100, subsequent_indent='    ')
                     for word in digest.words]
    # The first and the last lines matter most.
    if len('\n'.join([first, *lines]).splitlines()) > WORDS_ROWS:
        while len('\n'.join([first, '...', *lines]).splitlines()) > WORDS_ROWS:
            del lines[0]
        lines.insert(0, '...')
    text = axes.text(0.0, 1.0, '\n'.join([first, *lines]), transform=axes.transAxes, va='top',
                     fontsize=9, linespacing=1.4)
    # A long line must not narrow the picture above it.
    text.set_in_layout(False)


def draw_velocity(axes: Axes, digest: Digest, colour: Colour) -> None:
    """Draw velocities in the order of the impacts, with the retunes."""
    points, changes = digest.points.rows, digest.changes.rows[1:]
    _scatter(axes, 'impact', points, colour)
    if len(changes) <= LINES_MOST:
        for row in changes:
            axes.axvline(row['impact'], color=GREY, linewidth=0.8, linestyle='--')
            axes.annotate(f'alpha {row["alpha"]:g}', (row['impact'], 1.0), (3, -3),
                          xycoords=('data', 'axes fraction'), textcoords='offset points',
                          va='top', fontsize=9, color=GREY,
                          bbox={'facecolor': 'white', 'alpha': 0.7, 'linewidth': 0, 'pad': 1})
    axes.set(title='Velocity before the impact', xlabel='impact number', ylabel="s' [1]")
    _count_axis(axes)


def draw_alpha(axes: Axes, digest: Digest, looks: Looks) -> None:
    assert digest.place is not None
    changes = digest.changes.rows
    # Until the next impact all changes have the same number.
    marker = '' if changes['impact'][0] < digest.place.impact else '.'
    axes.step([*changes['impact'], digest.place.impact],
              [*changes['alpha'], digest.place.event['alpha']], where='post', color=looks.hue(1),
              marker=marker)
    axes.set(title='Amplitude of the drive', xlabel='impact number', ylabel='alpha [1]')
    axes.margins(x=0.0, y=0.2)
    _count_axis(axes)


def draw_exponents(axes: Axes, digest: Digest, looks: Looks) -> None:
    """Draw the running and finite-time exponents, with the error and the exact sum."""
    rows = digest.estimates.rows.copy()
    # Where an epoch has just begun, as in a ramp, only the finite-time exponent is known.
    for name in ('lambda_1', 'lambda_1_error', 'lambda_2', 'sum', 'exact_sum'):
        rows[name][rows['impacts'] < IMPACTS_LEAST] = math.nan
    axes.set(title='Lyapunov exponents per impact, averaged since the last retune',
             xlabel='impact number', ylabel='exponent [1]')
    axes.axhline(0.0, color='black', linewidth=0.8)
    _count_axis(axes)
    why = digest.infinite or (
        '' if np.any(np.isfinite(rows['lambda_1']) | np.isfinite(rows['lambda_1_finite']))
        else f'fewer than {IMPACTS_LEAST} impacts in every epoch')
    if why:
        _explain(axes, why)
    if not len(rows):
        return
    x = _broken(rows, 'impact')
    middle, error = _broken(rows, 'lambda_1'), _broken(rows, 'lambda_1_error')
    axes.fill_between(x, middle - error, middle + error, color=looks.hue(0), alpha=0.25,
                      linewidth=0)
    for name, label, hue, width in (
        ('lambda_1_finite', 'λ1, last 1,000 impacts', looks.hue(2), 1.2),
        ('lambda_1', 'λ1 ± standard error', looks.hue(0), 1.8),
        ('lambda_2', 'λ2', looks.hue(3), 1.4),
        ('exact_sum', '2 ln r − beta <D>, exact', GREY, 4.0),
        ('sum', 'λ1 + λ2', looks.hue(1), 1.4),
    ):
        # The finite-time exponent crosses retunes: its line is not broken there.
        line = (rows['impact'], rows[name]) if name == 'lambda_1_finite' else (
            x, _broken(rows, name))
        axes.plot(*line, color=hue, linewidth=width, label=label)
    # The legend has a strip of its own below.
    axes.legend(loc='upper center', bbox_to_anchor=(0.5, -0.22), ncols=5, fontsize=9,
                frameon=False, columnspacing=1.2, handlelength=1.5)


def draw_motion(axes: Axes, digest: Digest, looks: Looks) -> None:
    """Draw the motion between the walls over the last drive periods."""
    motion = rebuild(digest.tail, TWO_PI / 200.0, PERIODS)
    if len(digest.tail) < 2:
        _explain(axes, 'the last event has none before it from which the gear came')
    for wall in (0.0, -1.0):
        axes.axhline(wall, color=looks.hue(1), linewidth=2.0)
    axes.plot(motion.tau / TWO_PI, motion.displacement, color=looks.hue(0), linewidth=1.2)
    axes.set(title=f'Displacement over the last {PERIODS} drive periods, between both walls',
             xlabel="time from the beginning of the last event's drive period [drive periods]",
             ylabel='s [1]', ylim=(-1.08, 0.08))
    axes.margins(x=0.0)


def prepare() -> None:
    """Load kernels, fonts and layouts by drawing a short trajectory to nowhere."""
    events = Simulation(Parameters(), State()).advance(100, 0.0, 1000)
    draw(digest_of([events]), 'nothing').savefig(io.BytesIO(), dpi=10)


def _spread(values: FloatArray) -> tuple[float, float]:
    low, high = float(values.min()), float(values.max())
    return (low, high) if high > low else (low - 1.0, high + 1.0)


def _scatter(axes: Axes, x: str, points: RowArray, colour: Colour) -> None:
    axes.scatter(points[x], points['velocity'], c=colour(points['alpha']), linewidths=0,
                 s=min(12.0, max(1.2, 40_000.0 / max(len(points), 1))), rasterized=True)


def _broken(rows: RowArray, name: str) -> FloatArray:
    # A gap where a new average begins, and where a value is infinite.
    values = rows[name].astype(np.float64)
    values[~np.isfinite(values)] = math.nan
    return np.insert(values, np.flatnonzero(np.diff(rows['epoch'])) + 1, math.nan)


def _explain(axes: Axes, why: str) -> None:
    axes.text(0.5, 0.9, why, transform=axes.transAxes, ha='center', va='top', color=GREY)


def _count_axis(axes: Axes) -> None:
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.xaxis.set_major_formatter(FuncFormatter(thousands))
