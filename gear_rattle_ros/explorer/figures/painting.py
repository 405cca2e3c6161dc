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

"""Pictures of a view as pixels, and their legend."""

from collections.abc import Sequence
import dataclasses
import html
import math
from typing import Final

from bokeh.palettes import Inferno256
import numpy as np
import numpy.typing as npt

from ..computing.catalogues import Known
from ..computing.computing import Picture
from ..computing.skeleton import EDGE, KICK, Layers, MANIFOLDS, ORBITS
from ..view import CAP, LIFETIMES, SPAN
from ...attractors.finding import CONSERVES, conserves_areas
from ...attractors.matching import recognise, Trace
from ...core.many.settling import FLOATING, RESTS_LOWER, RESTS_UPPER, UNSETTLED
from ...palette import (
    AMBER,
    colours_of,
    ENDS,
    EXPONENTS,
    FORGOTTEN,
    MARK,
    painted,
    reach,
    rgb,
    STABLE,
    UNSTABLE,
)

NAMES: Final = {
    UNSETTLED: f'unsettled after {CAP:,} impacts', RESTS_UPPER: 'at rest, upper wall',
    RESTS_LOWER: 'at rest, lower wall', FLOATING: 'floating between the walls'}
# How much darker the cells that settle slowly are in a picture of basins.
DARKEST: Final = 0.42

SWATCHES: Final = {ORBITS: (), MANIFOLDS: (UNSTABLE, STABLE), EDGE: (AMBER,), KICK: (MARK,)}

Pixels = npt.NDArray[np.uint8]


@dataclasses.dataclass(frozen=True)
class Colours:
    """The colours and names of labels on one page, which stay while parameters change."""

    traces: tuple[Trace, ...] = ()
    by_label: dict[int, str] = dataclasses.field(default_factory=lambda: dict(ENDS))
    names: dict[int, str] = dataclasses.field(default_factory=lambda: dict(NAMES))

    def followed(self, known: Known) -> 'Colours':
        """Return the colours of the attractors at other parameters."""
        traces, hues = recognise(self.traces, known.catalogue, is_complete=known.is_complete)
        titles = [each.title for each in known.catalogue.attractors if each.label >= 0]
        names = NAMES | dict(enumerate(titles))
        if conserves_areas(known.catalogue.parameters):
            names[UNSETTLED] = f'unsettled: {CONSERVES}'
        return Colours(traces, colours_of(hues), names)


def paint(picture: Picture, colours: Colours) -> Pixels:
    """Return red, green, blue and opacity of every cell, the lowest velocity first."""
    slowness = np.log(np.maximum(picture.lifetimes, 1)) / math.log(CAP)
    if picture.exponents is not None:
        return _paint_exponents(picture.exponents)
    if picture.view.kind == LIFETIMES:
        shades = np.where(picture.labels == UNSETTLED, -1, (slowness * 255.0).clip(0.0, 255.0))
        return painted(shades.astype(np.int64),
                       {-1: ENDS[UNSETTLED]} | dict(enumerate(Inferno256)))
    pixels = painted(picture.labels, colours.by_label)
    shade = np.where(picture.labels == UNSETTLED, 1.0, 1.0 - DARKEST * np.clip(
        1.6 * (slowness - 0.2), 0.0, 1.0))
    pixels[..., :3] = pixels[..., :3] * shade[..., None]
    return pixels


def legend(picture: Picture, colours: Colours) -> str:
    """Return the meaning of the colours, in HTML."""
    if picture.exponents is not None:
        bound = reach(picture.exponents)
        lost = float(np.mean(np.isneginf(picture.exponents)))
        words = (f'finite-time exponent over {SPAN} impacts [1]&ensp;−{bound:.2f} '
                 f'{_bar(EXPONENTS)} +{bound:.2f}')
        return words + (f'&emsp;{_swatch(FORGOTTEN)} sticks {lost:.1%}' if lost else '')
    shares = {int(label): count / picture.labels.size for label, count in zip(
        *np.unique(picture.labels, return_counts=True), strict=True)}
    if picture.view.kind == LIFETIMES:
        bar = _bar(list(Inferno256[::32]) + [Inferno256[-1]])
        return f'lifetime [impacts]&ensp;1 {bar} {CAP:,}' + (
            f'&emsp;{_swatch(ENDS[UNSETTLED])} {colours.names[UNSETTLED]} {shares[UNSETTLED]:.1%}'
            if UNSETTLED in shares else '')
    ordered, most = sorted(shares, key=lambda label: -shares[label]), 6
    words = '&emsp;'.join(
        f'{_swatch(colours.by_label[label])} {html.escape(colours.names[label])} '
        f'<b>{100.0 * shares[label]:.1f} %</b>' for label in ordered[:most])
    return words + (f'&emsp;and {len(ordered) - most} more' if len(ordered) > most else '')


def legend_of_layers(layers: Layers) -> str:
    """Return what there is to say about layers, in HTML, as the words are."""
    return '&emsp;'.join(
        ' '.join([*map(_swatch, SWATCHES.get(name, ())), layers.words.get(name, '...')])
        for name in ([''] if '' in layers.words else layers.asked.names))


def _paint_exponents(exponents: npt.NDArray[np.float32]) -> Pixels:
    share = np.nan_to_num(exponents / reach(exponents), nan=0.0, posinf=1.0, neginf=-1.0)
    share = np.clip(share, -1.0, 1.0)[..., None]
    falling, middle, growing = (np.array(rgb(colour)) for colour in EXPONENTS)
    towards = np.where(share > 0.0, growing, falling)
    pixels = np.full((*exponents.shape, 4), 255, np.uint8)
    pixels[..., :3] = middle + (towards - middle) * np.abs(share)
    pixels[~np.isfinite(exponents), :3] = rgb(FORGOTTEN)
    return pixels


def _swatch(colour: str) -> str:
    return (f'<span style="display:inline-block;width:11px;height:11px;border-radius:2px;'
            f'background:{colour}"></span>')


def _bar(colours: Sequence[str]) -> str:
    return ('<span style="display:inline-block;width:170px;height:11px;border-radius:2px;'
            f'vertical-align:-1px;background:linear-gradient(90deg,{",".join(colours)})"></span>')
