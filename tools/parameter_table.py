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

"""Write the tables of parameters into doc/ros.md, from the tables that the nodes declare."""

from pathlib import Path
import sys

from gear_rattle_ros.parameters import Specification, TABLES

BEGIN = '<!-- parameters: written by tools/parameter_table.py -->\n'
END = '<!-- end of parameters -->\n'


def row(specification: Specification) -> str:
    """Return one row."""
    name, *cells = specification.cells()
    return f'| `{name}` | {" | ".join(cells)} |'


def tables() -> str:
    """Return the tables of all nodes."""
    return ''.join(
        f'\n### {node}\n\n| parameter | default | range | live | meaning |\n'
        '|---|---|---|---|---|\n' + '\n'.join(map(row, table)) + '\n'
        for node, table in TABLES.items()) + '\n'


def updated(text: str) -> str:
    """Return a page with fresh tables."""
    head, rest = text.split(BEGIN)
    return head + BEGIN + tables() + END + rest.split(END)[1]


if __name__ == '__main__':
    page = Path(sys.argv[1] if len(sys.argv) > 1 else 'doc/ros.md')
    page.write_text(updated(page.read_text(encoding='utf-8')), encoding='utf-8')
