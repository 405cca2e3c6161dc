"""Write the reference pages of the site from the code's own tables."""

import contextlib
import importlib
import io
import os
from pathlib import Path
import sys

import parameter_table

from gear_rattle_ros.parameters import TABLES
from gear_rattle_ros.start import EXECUTABLES

COLUMNS = '99'


def first_sentence(module: str) -> str:
    """Return what the docstring of a module begins with."""
    text = (importlib.import_module(f'gear_rattle_ros.{module}').__doc__ or '').strip()
    return ' '.join(text.split('\n\n')[0].split())


def help_text(module: str) -> str:
    """Return what an executable answers to --help."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.suppress(SystemExit):
        importlib.import_module(f'gear_rattle_ros.{module}').main(['--help'])
    return said.getvalue().rstrip()


def nodes_page() -> str:
    """Return the page of the nodes: what each does, and its parameters."""
    parts = [
        '# Nodes\n\n`ros2 run gear_rattle_ros NAME`, or `.venv/bin/NAME` after `make run`. Live '
        'parameters change while the node runs, all or none in one `set`.\n']
    for name, module in EXECUTABLES.items():
        if name in TABLES:
            rows = '\n'.join(map(parameter_table.row, TABLES[name]))
            parts.append(
                f'\n## {name}\n\n{first_sentence(module)}\n\n| parameter | default | range | live '
                f'| what |\n|---|---|---|---|---|\n{rows}\n')
    return ''.join(parts)


def tools_page() -> str:
    """Return the page of the tools: what each answers to --help."""
    parts = ['# Tools\n\nEach line of help is printed by the tool itself, with `NAME --help`.\n']
    for name, module in EXECUTABLES.items():
        if name not in TABLES or name == 'replay':
            parts.append(
                f'\n## {name}\n\n{first_sentence(module)}\n\n```text\n{help_text(module)}\n```\n')
    return ''.join(parts)


def write(folder: Path) -> None:
    """Write all pages into a folder."""
    # argparse wraps at the width of the terminal, wherever the site is built.
    os.environ['COLUMNS'] = COLUMNS
    folder.mkdir(exist_ok=True)
    for name, text in (('nodes', nodes_page()), ('tools', tools_page())):
        (folder / f'{name}.md').write_text(text, encoding='utf-8')


if __name__ == '__main__':
    write(Path(sys.argv[1] if len(sys.argv) > 1 else 'doc/reference'))
