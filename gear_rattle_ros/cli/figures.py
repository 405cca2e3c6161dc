"""The command `figures`: the figures of the paper from their recipes, with a page."""

from collections.abc import Sequence
import contextlib
import importlib
import io
import json
from pathlib import Path
import shlex
import time
from typing import TYPE_CHECKING

from .refusal import attempt, INTERRUPTED, Parser
from .run import PACKAGE

if TYPE_CHECKING:
    from ..figures.paper import Recipe


def make(recipe: 'Recipe', folder: Path) -> int:
    """Make a figure; returns the exit status of the tool."""
    from ..figures.paper import record_of
    from ..store.making import versions
    (folder / 'data').mkdir(parents=True, exist_ok=True)
    words = recipe.words(folder)
    tool = importlib.import_module(f'.{words[0]}', __package__)
    printed = io.StringIO()
    begin = time.monotonic()
    with contextlib.redirect_stdout(printed):
        status = int(tool.main(words[1:]) or 0)
    if status == 0:
        command, seconds = shlex.join(['ros2', 'run', PACKAGE, *words]), time.monotonic() - begin
        path = record_of(recipe, folder)
        before = json.loads(path.read_text(encoding='utf-8')) if path.exists() else {}
        if before.get('command') == command:
            # It went on with the store of an earlier run.
            seconds += before['seconds']
        path.write_text(json.dumps({
            'command': command, 'printed': printed.getvalue(), 'seconds': round(seconds, 1),
            'versions': versions()}, indent=1), encoding='utf-8')
    return status


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return the exit status of what it runs."""
    return attempt('figures', lambda: _run(arguments))


def _run(arguments: Sequence[str] | None) -> int:
    parser = Parser('figures', description='Redraw the figures of de Souza & Caldas, with a page '
                    'that compares them.')
    parser.add_argument('figures', nargs='*', metavar='NUMBER', help='such as 3 or 8a; all by '
                        'default')
    parser.add_argument('--output', type=Path, default=Path('figures'), metavar='DIR',
                        help='folder of pictures, data and index.html; figures by default')
    parser.add_argument('--recipes', type=Path, metavar='DIR',
                        help='folder of recipes; those of the package by default')
    parser.add_argument('--page', type=Path, metavar='FILE.md',
                        help='write all as a page of the documents too, with smaller pictures')
    given = parser.parse_args(arguments)
    from ..figures.paper import load_recipes, write_index, write_page
    from ..places import config_folder
    recipes = load_recipes(given.recipes or config_folder('figures'))
    chosen = given.figures or list(recipes)
    for name in chosen:
        if name not in recipes:
            raise ValueError(f'no figure {name}; there are {", ".join(recipes)}')
    for number, name in enumerate(chosen, 1):
        print(f'figures: {name}, {recipes[name].title} ({number} of {len(chosen)}) ...',
              flush=True)
        try:
            status = make(recipes[name], given.output)
        except KeyboardInterrupt:
            status = INTERRUPTED
        if status:
            return status
    print(f'figures: {write_index(recipes, given.output)}')
    if given.page is not None:
        print(f'figures: {write_page(recipes, given.output, given.page)}')
    return 0
