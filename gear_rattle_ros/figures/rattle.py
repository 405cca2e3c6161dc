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

"""Rattle as a picture, a waterfall of the contact force over the speed, and as a sound."""

import json
import math
from pathlib import Path
from typing import Final, TYPE_CHECKING
import wave

from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
import numpy as np

from .style import add_axes, BOTTOM, LEFT, Looks, new_figure, RIGHT, TOP, write_title
from ..core.gears import Gears
from ..core.stream.rattle import impulse_train
from ..studies.work import Arrays

if TYPE_CHECKING:
    import xarray

WIDTH, BESIDE, GAP, HEIGHT, BAR = 640, 300, 20, 560, 40
# Of the waterfall and of a spectrum, what is below this part of the largest force is not shown.
FLOOR: Final = 1e-3
RATE: Final = 48_000
# Of the largest sample of a sound.
LOUDEST: Final = 0.9 * 32767.0
MARKS: Final = {'none': '_', 'upper': '^', 'lower': 'v', 'both': 'D'}


def draw_rattle(dataset: 'xarray.Dataset', looks: Looks) -> Figure:
    """Draw the spectrum over the speed, and the approach speeds; at one speed the spectra only."""
    gears = Gears.of(json.loads(dataset.attrs['gears']))
    force, orders = dataset['state_force'].values, dataset['order'].values
    points, share = dataset['state_point'].values, dataset['state_share'].values
    speed = dataset['point_speed_rpm' if gears.speed_rpm else 'point_frequency_hz'].values
    unit = 'speed [1/min]' if gears.speed_rpm else 'frequency [Hz]'
    largest = float(force[:, 1:].max(initial=0.0)) or 1.0
    is_one = len(speed) == 1
    figure = new_figure(LEFT + WIDTH + (0 if is_one else GAP + BESIDE) + RIGHT,
                        BOTTOM + HEIGHT + TOP + (0 if is_one else BAR), looks)
    axes = add_axes(figure, LEFT, BOTTOM, WIDTH, HEIGHT)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel('order: frequency over that of the drive [1]', fontsize=12)
    write_title(figure, LEFT, looks.title or 'Contact force, rms in bands of '
                f'{orders[1]:g} order' + (
                    '' if is_one else '; a gear at rest is lifted above the dashed line'))
    if is_one:
        for number, row in enumerate(force):
            axes.semilogy(orders[1:], np.maximum(row[1:], 1e-300), color=looks.hue(number),
                          label=f'{dataset["state_key"].values[number]}, {share[number]:.0%}')
        axes.set_ylim(FLOOR * largest, 2.0 * largest)
        axes.set_ylabel('contact force [N]', fontsize=12)
        axes.legend(loc='upper right', fontsize=10)
        return figure
    # Expected over the initial conditions.
    waterfall = np.zeros((len(speed), len(orders)))
    np.add.at(waterfall, points, share[:, None] * force**2)
    step, band = speed[1] - speed[0], orders[1]
    image = axes.imshow(
        np.sqrt(waterfall), origin='lower', aspect='auto', interpolation='nearest',
        cmap=looks.scale('magma'), norm=LogNorm(FLOOR * largest, largest, clip=True), extent=(
            -0.5 * band, orders[-1] + 0.5 * band, speed[0] - 0.5 * step, speed[-1] + 0.5 * step))
    axes.set_ylabel(unit, fontsize=12)
    bar = figure.colorbar(image, cax=add_axes(
        figure, LEFT, BOTTOM + HEIGHT + 12, WIDTH, 12), orientation='horizontal')
    bar.ax.xaxis.set_ticks_position('top')
    bar.ax.set_title('[N]', loc='right', fontsize=10, x=1.06, y=-0.5)
    beside = add_axes(figure, LEFT + WIDTH + GAP, BOTTOM, BESIDE, HEIGHT)
    modes = dataset['state_mode'].values
    for number, name in enumerate(('peak', 'rms')):
        values = 1e3 * dataset[f'state_speed_{name}_m_per_s'].values
        for mode, mark in MARKS.items():
            mine = (modes == mode) & np.isfinite(values)
            if mine.any():
                beside.plot(values[mine], speed[points[mine]], mark, color=looks.hue(number),
                            markersize=4, label=f'{name}, hits {mode}')
    onset = dataset.attrs['onset_hz'] / dataset['point_frequency_hz'].values[0] * speed[0]
    for each in (axes, beside):
        each.axhline(onset, color='grey', linestyle='--', linewidth=1)
        each.set_ylim(speed[0] - 0.5 * step, speed[-1] + 0.5 * step)
    beside.set_xlim(left=0.0)
    beside.tick_params(labelleft=False)
    beside.set_xlabel('approach speed [mm/s]', fontsize=12)
    if beside.has_data():
        beside.legend(loc='best', fontsize=9)
    return figure


def save_wav(dataset: Arrays, path: Path, seconds: float = 10.0) -> Path:
    """
    Write the sound of the impacts, one point of a run-up after another; return its path.

    At each point it is the motion that most initial conditions reach, repeated. An impact is an
    impulse without the resonances of a housing; the loudest has nine tenths of the full scale.
    """
    points, share, lengths = (dataset[f'state_{name}'].values for name in (
        'point', 'share', 'duration_s'))
    states, times, impulses = (dataset[f'impact_{name}'].values for name in (
        'state', 'time_s', 'impulse_n_s'))
    count = len(dataset['point_share'].values)
    slot = seconds / count
    all_times, all_impulses = [], []
    for number in range(count):
        rows = np.flatnonzero(points == number)
        row = rows[np.argmax(share[rows])]
        again = np.arange(math.ceil(slot / lengths[row]))
        time = (times[states == row] + lengths[row] * again[:, None]).ravel()
        inside = time < slot
        all_times.append(time[inside] + number * slot)
        all_impulses.append(np.tile(impulses[states == row], len(again))[inside])
    samples = impulse_train(np.concatenate(all_times), np.concatenate(all_impulses), RATE,
                            math.ceil(seconds * RATE))
    samples *= LOUDEST / (float(np.max(np.abs(samples), initial=0.0)) or 1.0)
    with wave.open(str(path), 'wb') as file:
        file.setparams((1, 2, RATE, 0, 'NONE', ''))
        file.writeframes(samples.astype('<i2').tobytes())
    return path
