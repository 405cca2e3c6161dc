"""Write the tables of parameters into doc/ros.md, from the tables that the nodes declare."""

from pathlib import Path
import sys

from gear_rattle_ros.parameters import Specification, TABLES

BEGIN = '<!-- parameters: written by tools/parameter_table.py -->\n'
END = '<!-- end of parameters -->\n'


def row(specification: Specification) -> str:
    """Return one row."""
    span = (
        f'{specification.low:g} to {specification.high:g}'
        if specification.low is not None and specification.high is not None else '')
    default = specification.default
    shown = f'{default:g}' if isinstance(default, float) else str(default).lower()
    unit = f' [{specification.unit}]' if specification.unit else ''
    live = '' if specification.read_only else 'yes'
    return (f'| `{specification.name}` | {shown} | {span} | {live} | '
            f'{specification.description}{unit} |')


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
