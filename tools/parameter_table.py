"""Write the table of parameters into README.md, from the table the nodes declare."""

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
    parts = []
    for node, table in TABLES.items():
        parts.append(
            f'\n**{node}**\n\n| parameter | default | range | live | what |\n'
            '|---|---|---|---|---|\n' + '\n'.join(map(row, table)) + '\n')
    return ''.join(parts) + '\n'


def updated(text: str) -> str:
    """Return a README with fresh tables."""
    head, rest = text.split(BEGIN)
    return head + BEGIN + tables() + END + rest.split(END)[1]


if __name__ == '__main__':
    readme = Path(sys.argv[1] if len(sys.argv) > 1 else 'README.md')
    readme.write_text(updated(readme.read_text(encoding='utf-8')), encoding='utf-8')
