"""
The figures of de Souza & Caldas, redrawn from recipes, with a page that compares them.

A recipe is a YAML file with the fields of `Recipe`. What its command prints is kept for the page.
"""

import dataclasses
import html
import json
from pathlib import Path
import re
import shlex
import textwrap
from typing import Any, Final

from ..plain_yaml import read_yaml

FIELDS: Final = ('figure', 'title', 'paper', 'known', 'command', 'agrees', 'finding')
AGREES: Final = {'yes': 'Agrees', 'partly': 'Partly agrees', 'no': 'Disagrees',
                 'unknown': 'Cannot be compared'}
# Tools that a recipe may run.
TOOLS: Final = ('basins', 'continuation', 'crisis', 'lifetimes', 'orbit_diagram', 'section')


@dataclasses.dataclass(frozen=True)
class Recipe:
    """
    How a figure is made, and what it is compared with.

    `paper` describes what the paper's figure shows, `known` names the source of that.
    In `command`, {store} and {picture} stand for what it writes. `agrees` is yes, partly, no or
    unknown.
    """

    figure: str
    title: str
    paper: str
    known: str
    command: tuple[str, ...]
    agrees: str
    finding: str

    def words(self, folder: Path) -> list[str]:
        """Return tool and options; what is in the folder already is resumed."""
        def fill(word: str) -> str:
            named = re.fullmatch(r'\{store(?::(\w+))?\}', word)
            if named:
                return str(folder / 'data' / f'figure-{named[1] or self.figure}.zarr')
            return str(folder / f'figure-{self.figure}.png') if word == '{picture}' else word

        return [*(fill(word) for word in self.command), '--resume']


def load_recipes(folder: Path) -> dict[str, Recipe]:
    """Read all recipes, in the order of the paper; ValueError where one is not whole."""
    recipes = [_recipe(path) for path in sorted(folder.glob('*.yaml'))]
    if not recipes:
        raise ValueError(f'{folder} holds no recipes; name their folder with --recipes')
    recipes.sort(key=lambda recipe: (int(re.sub(r'\D', '', recipe.figure) or 0), recipe.figure))
    return {recipe.figure: recipe for recipe in recipes}


def _recipe(path: Path) -> Recipe:
    try:
        content = read_yaml(path.read_text(encoding='utf-8'))
    except ValueError as error:
        raise ValueError(f'{path} {error}') from error
    missing = [name for name in FIELDS if not isinstance(content, dict) or name not in content]
    if missing:
        raise ValueError(f'{path}: {", ".join(missing)} missing')
    values = {name: ' '.join(str(content[name]).split()) for name in FIELDS}
    try:
        command = tuple(shlex.split(values.pop('command')))
    except ValueError as error:
        raise ValueError(f'{path}: the command cannot be read: {error}') from error
    if values['agrees'] not in AGREES:
        raise ValueError(f'{path}: agrees = {values["agrees"]!r} is not one of '
                         f'{", ".join(AGREES)}')
    if not command or command[0] not in TOOLS:
        raise ValueError(f'{path}: the command does not begin with one of {", ".join(TOOLS)}')
    for word in ('{picture}', '--picture', '--output'):
        if word not in command:
            raise ValueError(f'{path}: the command lacks {word}')
    return Recipe(command=command, **values)


def write_index(recipes: dict[str, Recipe], folder: Path) -> Path:
    """Write the page that shows all figures made so far and compares them with the paper's."""
    parts, e = [], html.escape
    for recipe in recipes.values():
        picture, record = _made(recipe, folder)
        if not record:
            continue
        parts.append(
            f'<section id="f{e(recipe.figure)}">'
            f'<h2>Figure {e(recipe.figure)}: {e(recipe.title)} '
            f'<span class="{e(recipe.agrees)}">{AGREES[recipe.agrees]}</span></h2>\n'
            f'<img src="{e(picture.name)}" alt="{e(recipe.title)}">\n'
            f'<p><b>The paper.</b> {e(recipe.paper)} <i>{e(recipe.known)}</i></p>\n'
            f'<p><b>Here.</b> {e(recipe.finding)}</p>\n'
            f'<pre>{e(record["command"])}</pre>\n'
            f'<details open><summary>numbers; {record["seconds"]} s</summary>'
            f'<pre>{e(record["printed"].strip())}</pre></details></section>')
    page = folder / 'index.html'
    page.write_text(PAGE.replace('@', '\n'.join(parts)), encoding='utf-8')
    return page


def write_page(recipes: dict[str, Recipe], folder: Path, page: Path) -> Path:
    """Write the same as a page of the documents, with small pictures in a folder beside it."""
    from .style import shrink
    small = page.with_suffix('')
    parts = [HEAD.format(page=page)]
    for recipe in recipes.values():
        picture, record = _made(recipe, folder)
        if not record:
            raise ValueError(f'{picture} has not been made; run: figures {recipe.figure}')
        small.mkdir(parents=True, exist_ok=True)
        shrink(picture, small / picture.name)
        printed = [line.rstrip() for line in record['printed'].strip('\n').splitlines()
                   if f'{folder}/' not in line]
        numbers = ['```text', *printed, '```', ''] if printed else []
        parts += [
            f'## Figure {recipe.figure}: {recipe.title}', '',
            f'![{recipe.title}]({small.name}/{picture.name})', '',
            *_filled(f'**The paper.** {recipe.paper} *{recipe.known}*'), '',
            *_filled(f'**{AGREES[recipe.agrees]}.** {recipe.finding}'), '',
            f'`figures {recipe.figure}` runs', '',
            '```sh', ' \\\n'.join(textwrap.wrap(
                ' '.join(recipe.command), 95, break_on_hyphens=False,
                subsequent_indent='    ')), '```', '', *numbers]
    page.write_text('\n'.join(parts).rstrip() + '\n', encoding='utf-8')
    return page


def _made(recipe: Recipe, folder: Path) -> tuple[Path, dict[str, Any]]:
    """Return the picture of a figure and the record of its run, empty where it was not made."""
    picture, record = folder / f'figure-{recipe.figure}.png', record_of(recipe, folder)
    is_made = picture.exists() and record.exists()
    return picture, json.loads(record.read_text(encoding='utf-8')) if is_made else {}


def record_of(recipe: Recipe, folder: Path) -> Path:
    return folder / 'data' / f'figure-{recipe.figure}.json'


def _filled(text: str) -> list[str]:
    return textwrap.wrap(text, 99, break_on_hyphens=False, break_long_words=False)


HEAD: Final = """# Figures of the paper, redrawn

This page redraws the figures of de Souza & Caldas, *Basins of attraction and transient chaos in a
gear-rattling model* (2001). For each figure it describes what the paper shows, as far as its text
states it, and what is found here, with the command and what it prints. The text does not state the
displacement of the plane of initial conditions; it is s = 0 here, and -0.5 in figure 10.

This page and its pictures, which are reduced in size, are written by

```sh
make figures ARGS="--page {page}"
```
"""
PAGE: Final = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>Figures of de Souza &amp; Caldas, redrawn</title>
<style>
body { font: 16px/1.5 sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem;
       color: #222; background: #fff }
img { max-width: 100%; border: 1px solid #ddd }
pre { background: #f4f4f4; padding: .6rem; overflow-x: auto; font-size: .8rem }
h2 { margin-top: 3rem }
h2 span { font-size: .8rem; padding: .15rem .5rem; border-radius: .6rem; color: #fff }
.yes { background: #04724d } .partly { background: #8a6100 } .no { background: #a8200d }
.unknown { background: #606060 }
</style>
<h1>Figures of de Souza &amp; Caldas (2001), redrawn</h1>
<p>Basins of attraction and transient chaos in a gear-rattling model, Journal of Vibration and
Control 7. For each figure: what the paper shows, as far as its text states it, what is found here,
the command, and the numbers that it prints. The text does not state the displacement of the plane
of initial conditions; it is s = 0 here, and -0.5 in figure 10.</p>
@
</html>
"""
