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

"""
The figures of de Souza & Caldas from recipes, in the paper's looks and in ours, with a page.

A recipe is a YAML file with the fields of `Recipe`. What its command prints is kept for the page.
"""

import dataclasses
import html
import json
from pathlib import Path
import re
import shlex
import shutil
import textwrap
from typing import Any, Final

from .style import pack
from ..places import typed
from ..plain_yaml import read_yaml

FIELDS: Final = ('figure', 'title', 'paper', 'agrees', 'ours', 'command')
AGREES: Final = {'yes': 'Agrees', 'partly': 'Partly', 'no': 'Disagrees', 'ours': 'New'}
# Tools that a recipe may run.
TOOLS: Final = ('basins', 'continuation', 'crisis', 'lifetimes', 'motion', 'orbit_diagram',
                'section', 'transitions')
# Of these, the tools whose result is a table alone.
TABLES: Final = ('transitions',)


@dataclasses.dataclass(frozen=True)
class Recipe:
    """
    How a figure is made, and what it is compared with.

    `paper` is what the paper's text says of its figure, `ours` what is found here, `agrees` a word
    of `AGREES`. `command` is a tool with options, or the name of a drawing beside the recipe;
    figures of the same `store` are drawn from one dataset, with the options in `view`, where
    {data} is the folder of the datasets. The figure that it `needs` is made first.
    """

    figure: str
    title: str
    paper: str
    agrees: str
    ours: str
    command: tuple[str, ...]
    path: Path
    store: str = ''
    view: tuple[str, ...] = ()
    needs: str = ''

    @property
    def drawing(self) -> Path | None:
        """Return the drawing, where there is nothing to compute."""
        is_drawing = self.command[0].endswith('.svg')
        return self.path.with_name(self.command[0]) if is_drawing else None

    @property
    def pictures(self) -> dict[str, tuple[str, ...]]:
        """Return the pictures, without an ending, and the options of their looks."""
        name = f'figure-{self.figure}'
        paper = {f'{name}-paper': ('--colours', 'paper')} if self.agrees != 'ours' else {}
        return {} if self.drawing or self.is_table else paper | {name: ()}

    @property
    def is_table(self) -> bool:
        return self.command[0] in TABLES

    def views(self, folder: Path) -> tuple[str, ...]:
        """Return the options of what the pictures show, with the datasets below a folder."""
        return tuple(word.format(data=folder / 'data') for word in self.view)

    @property
    def files(self) -> list[str]:
        """Return the files of the page."""
        drawing = [self.command[0]] if self.drawing else []
        return [f'{name}.png' for name in self.pictures] or drawing

    def data(self, folder: Path, ending: str) -> Path:
        """Return the file of the store, .zarr, or of what was printed, .json."""
        name = self.store if self.store and ending == '.zarr' else self.figure
        return folder / 'data' / f'figure-{name}{ending}'


def load_recipes(folder: Path) -> dict[str, Recipe]:
    """Read all recipes, in the order of the paper; ValueError where one is not whole."""
    recipes = [_recipe(path) for path in folder.glob('*.yaml')]
    if not recipes:
        raise ValueError(f'{folder} holds no recipes; name their folder with --recipes')
    recipes.sort(key=lambda recipe: (int(re.split(r'\D', recipe.figure)[0] or 99), recipe.figure))
    return {recipe.figure: recipe for recipe in recipes}


def _recipe(path: Path) -> Recipe:
    try:
        content = read_yaml(path.read_text(encoding='utf-8'))
    except ValueError as error:
        raise ValueError(f'{path} {error}') from error
    missing = [name for name in FIELDS if not isinstance(content, dict) or name not in content]
    if missing:
        raise ValueError(f'{path}: {", ".join(missing)} missing')
    values: dict[str, Any] = {name: ' '.join(str(text).split()) for name, text in content.items()}
    try:
        for name in ('command', 'view'):
            values[name] = tuple(shlex.split(values.get(name, '')))
        recipe = Recipe(path=path, **values)
    except (TypeError, ValueError) as error:
        raise ValueError(f'{path} cannot be read: {error}') from error
    if recipe.agrees not in AGREES:
        raise ValueError(f'{path}: agrees = {recipe.agrees!r} is not one of {", ".join(AGREES)}')
    if not recipe.command or not recipe.drawing and recipe.command[0] not in TOOLS:
        raise ValueError(f'{path}: the command does not begin with one of {", ".join(TOOLS)}')
    return recipe


def write_index(recipes: dict[str, Recipe], folder: Path) -> Path:
    """Write the page of all figures made so far, beside the pictures as they are."""
    text = html.escape('\n'.join(_part(recipe, folder, '') for recipe in recipes.values()
                                 if recipe.data(folder, '.json').exists()))
    for mark, tag in ((r'!\[(.*?)\]\((.*?)\)', r'<img src="\2" alt="\1" style="max-width: 49%">'),
                      ('^## (.*)$', r'<b style="font-size: 150%">\1</b>'),
                      (r'\*\*(.+?)\*\*', r'<b>\1</b>'), (r'^(```.*|\|[- |]+)\n', ''),
                      (r' ?\| ?', ' ')):
        text = re.sub(mark, tag, text, flags=re.MULTILINE)
    page = folder / 'index.html'
    page.write_text('<!doctype html><meta charset="utf-8"><title>Figures of de Souza &amp; Caldas'
                    '</title><body style="white-space: pre-wrap; font-family: monospace">'
                    + text, encoding='utf-8')
    return page


def write_page(recipes: dict[str, Recipe], folder: Path, page: Path) -> Path:
    """Write all figures as a page of the documents, with the pictures in a folder beside it."""
    beside = page.with_suffix('')
    beside.mkdir(parents=True, exist_ok=True)
    for recipe in recipes.values():
        if not recipe.data(folder, '.json').exists():
            raise ValueError(f'figure {recipe.figure} has not been made; run: '
                             f'{shlex.join([*typed("figures"), recipe.figure])}')
        for name in recipe.files:
            if recipe.drawing:
                shutil.copyfile(recipe.drawing, beside / name)
            else:
                pack(folder / name, beside / name)
    page.write_text('\n'.join([PAGE.format(page=page), *(
        _part(recipe, folder, f'{beside.name}/') for recipe in recipes.values())]),
        encoding='utf-8')
    return page


def _part(recipe: Recipe, folder: Path, place: str) -> str:
    # What the page says of a figure, in Markdown, with the pictures at a place.
    record = json.loads(recipe.data(folder, '.json').read_text(encoding='utf-8'))
    name = (f'Figure {recipe.figure}' if recipe.figure[0].isdigit()
            else 'Text of the paper' if recipe.paper else 'Beyond the paper')
    images = [f'![{recipe.title}]({place}{file})' for file in recipe.files]
    lines = [f'## {name}: {recipe.title}', '', *(images if len(images) < 2 else [
        '| in the looks of the paper | with what is found here |', '|---|---|',
        f'| {" | ".join(images)} |']), '']
    for text in (f'**The paper.** {recipe.paper}' if recipe.paper else '',
                 f'**{AGREES[recipe.agrees]}.** {recipe.ours}'):
        if text:
            lines += [*textwrap.wrap(text, 99, break_on_hyphens=False, break_long_words=False), '']
    if not recipe.drawing:
        lines += ['```sh', ' \\\n'.join(textwrap.wrap(shlex.join(
            ['gear_rattle', *recipe.command, *recipe.views(Path('figures')), *(
                () if recipe.is_table else ('--picture', f'figure-{recipe.figure}.png'))]), 95,
            break_on_hyphens=False, subsequent_indent='    ')), '```', '', '```text', *(
                line.rstrip() for line in record['printed'].strip('\n').splitlines()
                if f'{folder}/' not in line), '```', '']
    return '\n'.join(lines)


PAGE: Final = """# Figures of the paper, redrawn

This page redraws the figures of de Souza & Caldas, *Basins of attraction and transient chaos in a
gear-rattling model* (2001). Each is drawn twice from one dataset: in the looks of the paper, as
far as its text describes them, and with colours and what is found here. For each it says what the
paper shows, whether that agrees, the command, and what this prints; with `--colours paper` the
command draws the first of both pictures.

The text does not state the displacement of the plane of initial conditions; it is s = 0 here. From
there a gear that moves up hits the wall at once and goes on with r times the velocity downwards:
the upper half of these pictures is the lower half, mirrored and stretched by 1/r.

```sh
make figures ARGS="--page {page}"
```

writes this page and its pictures, and each picture as PDF.
"""
