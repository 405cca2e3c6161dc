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

"""Attractors as a table in plain text, from the arrays in which a dataset keeps them."""

from collections.abc import Mapping, Sequence
import types
from typing import Any, Final

import numpy as np

from ..core.arrays import FloatArray, IntArray
from ..core.flight.elementary import TWO_PI
from ..core.words import counted, in_columns


def named(long_name: str, units: str | None = '1') -> dict[str, str]:
    """Return the attributes of an array of a dataset."""
    return {'long_name': long_name} | ({} if units is None else {'units': units})


def table(owner: str, **columns: tuple[Any, ...]) -> dict[str, Any]:
    """Return arrays for `Store.write_table`: of each its values, words, unit, more dimensions."""
    def laid(values: Any, words: str, units: str | None = '1', *others: str) -> tuple[Any, ...]:
        return (owner, *others), np.asarray(values), named(words, units)

    return {f'{owner}_{name}': laid(*column) for name, column in columns.items()}


def impact_table(owner: str, parts: Sequence[tuple[IntArray, FloatArray]], number: str = '',
                 **columns: tuple[Any, ...]) -> dict[str, Any]:
    """Return the arrays of impacts: walls and points of the section, and the numbers of parts."""
    walls = np.concatenate([np.zeros(0, np.int64), *(walls for walls, _ in parts)])
    points = np.concatenate([np.zeros((0, 2)), *(points for _, points in parts)])
    if number:
        columns['number'] = np.repeat(np.arange(len(parts)), np.array(
            [len(walls) for walls, _ in parts], np.int64)), number
    return table(owner, wall=(walls, 'wall: 0 upper, 1 lower'), phase=(
        np.mod(points[:, 0], TWO_PI), 'drive phase of the impact', 'rad'), velocity=(
            points[:, 1], 'velocity before the impact'), **columns)


# What a table needs of a dataset.
COLUMNS: Final = tuple(f'attractor_{name}' for name in (
    'label', 'letter', 'key', 'kind', 'share', 'share_error', 'impacts', 'drive_periods',
    'multiplier_real', 'multiplier_imaginary', 'pieces', 'exponent', 'exponent_error'))


def listed(columns: Mapping[str, Any], hold: int, cells: Mapping[int, int] | None = None,
           beside: Mapping[str, Sequence[str]] = types.MappingProxyType({})) -> str:
    """List attractors, numbered as in the dataset and in every picture."""
    # `columns` are the arrays of `table_of`, by name; `hold` is the number of impacts after which
    # what has not settled is unsettled, and `cells` counts the cells of a grid by label. Columns
    # `beside` follow the shares.
    headings = [' label', 'key', 'kind', ' random initial conditions [%]', *beside,
                'period or exponents']
    has_letters, rows = any(columns['attractor_letter']), []
    for k, label in enumerate(columns['attractor_label']):
        one = {name.removeprefix('attractor_'): values[k] for name, values in columns.items()
               if name.startswith('attractor_')}
        row = [str(label), str(one['key']), str(one['kind']),
               f'{100.0 * one["share"]:.2f} +- {100.0 * one["share_error"]:.2f}',
               *(column[k] for column in beside.values()), _detail(one, hold)]
        if cells is not None:
            row.insert(3, f'{100.0 * cells.get(int(label), 0) / sum(cells.values()):.3f}')
        if has_letters:
            row.insert(1, str(one['letter']))
        rows.append(row)
    if cells is not None:
        headings.insert(3, ' grid [%]')
    if has_letters:
        headings.insert(1, 'letter')
    return in_columns(headings, rows)


def _detail(one: Mapping[str, Any], hold: int) -> str:
    if one['kind'] == 'unsettled':
        return f'no orbit within {counted(hold, "impact")}'
    if one['kind'] == 'periodic':
        largest = max(map(abs, one['multiplier_real'] + 1j * one['multiplier_imaginary']))
        return (f'{counted(one["impacts"], "impact")} in '
                f'{counted(one["drive_periods"], "drive period")}, largest multiplier '
                f'{largest:.6f}')
    if one['kind'] == 'chaotic':
        return f'{counted(one["pieces"], "piece")}, exponents ' + ', '.join(
            f'{value:.5f} +- {error:.5f}'
            for value, error in zip(one['exponent'], one['exponent_error'], strict=True))
    return ''
