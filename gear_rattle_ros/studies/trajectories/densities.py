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

"""How far the densities of two sections are apart: of what is on no periodic orbit."""

import math

import numpy as np

from ..work import Arrays


def compare_densities(mine: Arrays, other: Arrays) -> str:
    """Put the distance of two densities in words, with its error and what chance gives."""
    # The distance is the total variation: half of the sum of the differences, which is the share
    # that has to move to make one density of the other. Impacts count as independent.
    a, b = mine.attrs, other.attrs
    if b.get('tool') != 'section' or any(a[name] != list(b[name]) for name in (
            'bins', 'velocity_window')):
        raise ValueError('--compare needs a section of the same --bins and --bin-window')
    counts = np.stack([each['count'].values[1].ravel().astype(float) for each in (mine, other)])
    totals = counts.sum(axis=1)
    if not np.all(totals):
        raise ValueError('--compare needs impacts on no periodic orbit in both sections')
    p, q = counts / totals[:, None]
    sign, common = np.sign(p - q), counts.sum(axis=0) / totals.sum()
    error = 0.5 * math.sqrt((1.0 - np.sum(sign * p)**2) / totals[0]
                            + (1.0 - np.sum(sign * q)**2) / totals[1])
    chance = 0.5 * np.sum(np.sqrt(
        2.0 / math.pi * common * (1.0 - common) * np.sum(1.0 / totals)))
    return (f'distance of the densities at alpha = {a["alpha"]:g} and {b["alpha"]:g}: '
            f'{0.5 * np.sum(np.abs(p - q)):.4f} +- {error:.4f} of 1; equal ones would give '
            f'{chance:.4f}\n'
            f'{np.sum(p[q == 0.0]):.2%} of the impacts lie where the other has none, and '
            f'{np.sum(q[p == 0.0]):.2%} of those of the other')
