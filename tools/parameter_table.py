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
