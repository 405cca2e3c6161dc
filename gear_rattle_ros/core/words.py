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

from collections.abc import Sequence


def counted(count: float, noun: str) -> str:
    """Put a count, rounded, in words: '1 drive period', '2 trajectories' or '1,234 impacts'."""
    number = round(count)
    if number != 1 and noun[-1] == 'y':
        noun = f'{noun[:-1]}ies'
    elif number != 1:
        noun += 'es' if noun.endswith(('ch', 's', 'x')) and noun[-3:] != 'och' else 's'
    return f'{number:,} {noun}'


def shown(value: object) -> str:
    """Show a value, or the words of an error, on part of a line: the beginning if it is long."""
    text = ' '.join((str if isinstance(value, Exception) else repr)(value).split())
    return text if len(text) <= 80 else f'{text[:77]}...'


def in_columns(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Lay out a plain text table; a heading that begins with a space aligns its column right."""
    table = [[heading.strip() for heading in headings], *rows]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return '\n'.join('  '.join(
        cell.rjust(width) if heading[:1] == ' ' else cell.ljust(width)
        for cell, width, heading in zip(row, widths, headings, strict=True)).rstrip()
        for row in table)
