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

"""The command `figures`: the figures of the paper from their recipes, with a page."""

from collections.abc import Sequence
import contextlib
import io
import itertools
import json
from pathlib import Path
import shlex
from typing import TYPE_CHECKING

from . import draw
from ..refusal import attempt, INTERRUPTED, Parser
from ..run import module_of

if TYPE_CHECKING:
    from ...figures.paper import Recipe


def make(recipe: 'Recipe', folder: Path) -> int:
    """Make a figure; returns the exit status of the tool."""
    (folder / 'data').mkdir(parents=True, exist_ok=True)
    store, record = recipe.data(folder, '.zarr'), recipe.data(folder, '.json')
    words, printed = [*recipe.command], io.StringIO()
    if recipe.drawing:
        (folder / recipe.drawing.name).write_bytes(recipe.drawing.read_bytes())
    else:
        words += ['--output', str(store)]
        tool = module_of(words[0], 'cli')
        with contextlib.redirect_stdout(printed):
            status = int(tool.main(words[1:]) or 0)
        if status:
            return status
        with contextlib.redirect_stdout(io.StringIO()):
            for (name, looks), ending in itertools.product(
                    recipe.pictures.items(), ('.png', '.pdf')):
                status = draw.main([str(store), '--picture', str(folder / f'{name}{ending}'),
                                    *recipe.views(folder), *looks])
                if status:
                    return status
    record.write_text(json.dumps({'command': shlex.join(['gear_rattle', *words]),
                                  'printed': printed.getvalue()}, indent=1), encoding='utf-8')
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return the exit status of what it runs."""
    return attempt('figures', lambda: _run(arguments))


def _run(arguments: Sequence[str] | None) -> int:
    parser = Parser('figures', description='Redraw the figures of de Souza & Caldas, with a page '
                    'that compares them.')
    parser.add_argument('figures', nargs='*', metavar='NUMBER', help='such as 4, 8a or '
                        'lifetime-law; all by default')
    parser.add_argument('--output', type=Path, default=Path('figures'), metavar='DIR',
                        help='folder of pictures, data and index.html; figures by default')
    parser.add_argument('--recipes', type=Path, metavar='DIR',
                        help='folder of recipes; those of the package by default')
    parser.add_argument('--page', type=Path, metavar='FILE.md',
                        help='write all as a page of the documents, too')
    given = parser.parse_args(arguments)
    from ...figures.paper import load_recipes, write_index, write_page
    from ...places import config_folder
    recipes = load_recipes(given.recipes or config_folder('figures'))
    chosen = given.figures or list(recipes)
    for name in chosen:
        if name not in recipes:
            raise ValueError(f'no figure {name}; there are {", ".join(recipes)}')
    # What others need comes before them.
    chosen = list(dict.fromkeys(itertools.chain.from_iterable(
        filter(None, (recipes[name].needs, name)) for name in chosen)))
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
