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

"""Counts and tables in words."""

import ast
from pathlib import Path

import pytest

from gear_rattle_ros.core.words import counted, in_columns

PACKAGE = Path(__file__).parents[2] / 'gear_rattle_ros'
NOUNS = ('drive periods', 'impacts', 'attractors', 'initial conditions', 'cells', 'trajectories',
         'pieces', 'gaps', 'messages', 'events', 'tiles', 'batches', 'readers', 'times', 'escapes',
         'kernels', 'estimates', 'reports', 'flights', 'epochs', 'runs', 'holes', 'retunes')


@pytest.mark.parametrize(('count', 'noun', 'words'), [
    (0, 'impact', '0 impacts'), (1, 'drive period', '1 drive period'),
    (2, 'trajectory', '2 trajectories'), (1, 'trajectory', '1 trajectory'),
    (3, 'batch', '3 batches'), (2, 'epoch', '2 epochs'), (12345.0, 'cell', '12,345 cells')])
def test_one_is_singular(count, noun, words):
    assert counted(count, noun) == words


def test_columns_are_aligned_below_their_headings():
    text = in_columns([' label', 'key', ' share [%]'], [['0', 'a', '65.00'], ['-1', 'bcd', '3.1']])
    assert text.split('\n') == ['label  key  share [%]',
                                '    0  a        65.00',
                                '   -1  bcd        3.1']
    assert in_columns(['a', 'b'], []) == 'a  b'


def pasted(text):
    """Yield line and number of every text that has a number pasted before a plural."""
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, ast.JoinedStr):
            continue
        for part, behind in zip(node.values, node.values[1:], strict=False):
            if not isinstance(part, ast.FormattedValue) or not isinstance(behind, ast.Constant):
                continue
            name = ast.unparse(part.value)
            form = ast.unparse(part.format_spec) if part.format_spec else ''
            # Constants, and measures that are no counts, are never one.
            if not name.isupper() and '.' not in form and any(
                    f'{behind.value} '.startswith((f' {noun} ', f' {noun},', f' {noun}:'))
                    for noun in NOUNS):
                yield node.lineno, name


def test_no_number_is_pasted_before_a_plural():
    """All texts of the package write counts with the one function, so that one is singular."""
    assert list(pasted("f'{n:,} impacts and {N} impacts in {t:.1f} impacts'")) == [(1, 'n')]
    # A hole of one impact is worded differently.
    assert [f'{file.name} {line}: {name}' for file in sorted(PACKAGE.rglob('*.py'))
            for line, name in pasted(file.read_text()) if file.name != 'guard.py'] == []
