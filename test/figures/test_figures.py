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

"""Recipes, and the pictures and the page that they make."""

import json

from matplotlib.image import imread
import numpy as np
import pytest

from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.cli.pictures.figures import main
from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.figures.draw import draw
from gear_rattle_ros.figures.paper import load_recipes
from gear_rattle_ros.figures.style import equalise, in_pi, shade
from gear_rattle_ros.places import config_folder
from gear_rattle_ros.studies.grids.exponents import exponents

PAPER = ['1', '2', '3a', '3b', '4', '5a', '5b', '6a', '6b', '7', '8a', '8b', '9a', '9b', '10',
         '11', '12', 'jumps', 'lifetime-law', 'shares', 'transitions-2', 'transitions-8']
RECIPE = """
figure: '{figure}'
title: Small & quick
paper: What it shows.
agrees: 'yes'
ours: <none>
command: {command}
view: {view}
store: '{store}'
"""
DIAGRAM = ('orbit_diagram --alpha 1.3 1.37 --columns 100 --bins 400 --trajectories 1 --keep 256 '
           '--skip 300 --sweep random')
SECTION = 'section --alpha 1.244 --initial 0 -0.5 0 --skip 0 --keep 900 --bins 300 200'
COMMANDS = {
    '1': ('section --alpha 0.57 --trajectories 8 --skip 500 --keep 1000 --bins 300 200', '', ''),
    '2a': (DIAGRAM, '--draw velocity', '2'), '2b': (DIAGRAM, '--draw exponent', '2'),
    '3': ('basins --alpha 0.48 --size 40', '--mark 1 2 -1 1', ''),
    '4a': (SECTION, '', '4'), '4b': (SECTION, '--draw impacts', '4'),
    'table': ('transitions --alpha 0.10 0.101 --columns 2 --trajectories 4 --hold 500', '', ''),
}


@pytest.fixture(scope='module')
def drawn(tmp_path_factory):
    """Figures of four small recipes."""
    folder = tmp_path_factory.mktemp('figures')
    recipes = folder / 'recipes'
    recipes.mkdir()
    for figure, (command, view, store) in COMMANDS.items():
        (recipes / f'{figure}.yaml').write_text(RECIPE.format(
            figure=figure, command=command, view=f"'{view}'", store=store))
    assert main(['--recipes', str(recipes), '--output', str(folder / 'out')]) == 0
    return folder / 'out'


def test_every_figure_of_the_paper_has_a_recipe():
    recipes = load_recipes(config_folder('figures'))
    assert list(recipes) == PAPER
    for recipe in recipes.values():
        assert recipe.ours and bool(recipe.paper) == (recipe.agrees != 'ours')
        assert recipe.drawing is None or recipe.drawing.exists()


@pytest.mark.parametrize(('figure', 'size'), [
    ('1', (420, 354)), ('2a', (930, 530)), ('2b', (930, None)), ('3', (920, 932)), ('4b', None)])
def test_pictures_are_not_blank_and_have_their_size(drawn, figure, size):
    picture = imread(drawn / f'figure-{figure}.png')[..., :3]
    if size is not None:
        assert picture.shape[1] == size[0]
        assert size[1] is None or picture.shape[0] == size[1]
    ink = np.mean(np.any(picture < 0.97, axis=2))
    assert ink > 0.01
    assert len(np.unique((picture * 255).astype(int).reshape(-1, 3), axis=0)) > 8


def test_a_raster_has_a_pixel_for_each_alpha_and_bin(drawn):
    from gear_rattle_ros.store.store import Store
    store = Store(drawn / 'data' / 'figure-2.zarr')
    picture = imread(drawn / 'figure-2a.png')[..., :3]
    # Inside of the axes: 100 columns eight pixels wide, 400 bins one pixel high.
    inside = picture[64:464, 100:900]
    counts = store.read_all('count')[0].sum(axis=1).T[::-1]
    drawn_here = np.any(inside[:, 4::8] < 0.999, axis=2)
    assert inside.shape == (400, 800, 3)
    # Away from the frame; a bin widens by its neighbours.
    assert np.all(drawn_here[4:-4, 4:-4][counts[4:-4, 4:-4] > 0])
    assert np.mean(drawn_here[4:-4, 4:-4]) < 3.2 * np.mean(counts[4:-4, 4:-4] > 0)


def test_the_page_shows_every_figure_with_its_command(drawn):
    page = (drawn / 'index.html').read_text()
    for figure in COMMANDS:
        assert (f'figure-{figure}.png' in page) == (figure != 'table')
        record = json.loads((drawn / 'data' / f'figure-{figure}.json').read_text())
        assert record['command'].startswith('gear_rattle ')
    assert 'Small &amp; quick' in page and '&lt;none&gt;' in page


def test_the_page_of_the_documents_has_the_pictures_as_they_are(drawn, tmp_path):
    page = tmp_path / 'figures.md'
    assert main(['table', '--recipes', str(drawn.parent / 'recipes'), '--output', str(drawn),
                 '--page', str(page)]) == 0
    text = page.read_text()
    assert f'--page {page}' in text and 'orbit-3-1-U4.0915+0.6273' in text
    assert max(map(len, text.splitlines())) < 200
    for figure, (command, _, _) in COMMANDS.items():
        assert command in text.replace(' \\\n    ', ' ')
        if figure == 'table':
            assert '0.04921892967 +- ' in text
            continue
        for name in (f'figure-{figure}', f'figure-{figure}-paper'):
            assert f'(figures/{name}.png)' in text
            assert (drawn / f'{name}.pdf').read_bytes()[:5] == b'%PDF-'
            packed, whole = (imread(folder / f'{name}.png')[..., :3] for folder in (
                tmp_path / 'figures', drawn))
            assert np.array_equal(packed, whole)


def test_a_cell_of_a_grid_is_a_whole_number_of_pixels(drawn):
    """Grey for A and black for B, as in the paper; the frame and its halo apart."""
    from gear_rattle_ros.store.store import open_dataset
    dataset = open_dataset(drawn / 'data' / 'figure-3.zarr')
    letters = dict(zip(dataset['attractor_label'].values, dataset['attractor_letter'].values,
                       strict=True))
    inside = imread(drawn / 'figure-3-paper.png')[44:844, 90:890, :3]
    cells = inside.reshape(40, 20, 40, 20, 3)[::-1].transpose(0, 2, 1, 3, 4).reshape(1600, 400, 3)
    is_plain = np.all(cells == cells[:, :1], axis=(1, 2))
    assert np.mean(is_plain) > 0.75
    expected = np.array([{'A': 191, 'B': 0}[letters[label]] for label in
                         dataset['label'].values.ravel()]) / 255.0
    assert np.abs(cells[is_plain, 0, 0] - expected[is_plain]).max() < 1e-6


def test_the_impacts_of_one_trajectory_are_drawn_in_turn(drawn):
    """The same numbers as the section's, and those of a simulation by itself."""
    from gear_rattle_ros import Parameters, Simulation, State
    from gear_rattle_ros.store.store import open_dataset
    dataset = open_dataset(drawn / 'data' / 'figure-4.zarr')
    events = Simulation(Parameters(alpha=1.244), State(velocity=-0.5)).advance(2000, 0.0, 601)
    assert np.allclose(dataset['impact_velocity'].values[:60], events['velocity'][1:61],
                       rtol=0.0, atol=1e-9)
    # The orbit of four impacts, from where the transient is over.
    late = dataset['impact_velocity'].values[dataset.attrs['lifetime']:]
    assert np.abs(late[4:] - late[:-4]).max() < 2e-3
    assert dataset['count'].values[1].sum() == dataset.attrs['lifetime'] < 900


def test_a_page_of_figures_that_were_not_made_is_refused(tmp_path, drawn, capsys):
    recipes = str(drawn.parent / 'recipes')
    assert main(['table', '--recipes', recipes, '--output', str(tmp_path / 'none'), '--page',
                 str(tmp_path / 'y.md')]) == 2
    assert 'has not been made' in capsys.readouterr().err


def test_equalised_counts_use_all_shades_in_order():
    counts = np.array([0, 5, 1, 1, 100, 0])
    assert list(equalise(counts)) == [0.0, 0.75, 0.5, 0.5, 1.0, 0.0]
    assert np.all(equalise(np.zeros(3)) == 0.0)


def test_shades_grow_darker_evenly():
    rgb = shade('#0a5a9c', np.linspace(0.0, 1.0, 11))
    assert rgb[-1] == pytest.approx([10 / 255, 90 / 255, 156 / 255], abs=2e-3)
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055)**2.4)
    lightness = np.cbrt(linear @ [0.2126, 0.7152, 0.0722])
    steps = -np.diff(lightness)
    assert np.all(steps > 0.0) and steps.max() / steps.min() < 1.4


def test_ticks_are_in_pi():
    assert [in_pi(k * np.pi / 2, 2) for k in range(-1, 5)] == [
        '−π/2', '0', 'π/2', 'π', '3π/2', '2π']
    assert in_pi(5 * np.pi / 4, 4) == '5π/4'


@pytest.mark.parametrize('plane', [
    Plane(-0.25, (1.0, 4.0), (-1.0, 0.5), 12, 10),
    Plane(None, (1.0, 4.0), (-1.0, 0.5), 12, 10, 'section'),
    Plane(None, (1.0, 4.0), (-1.0, 0.5), 12, 10, 'impact'),
    Plane((-0.75, -0.5), 2.0, (-1.0, 0.5), 12, 10, 'strobe')], ids=lambda plane: plane.kind)
def test_a_grid_of_any_plane_has_its_axes(plane):
    """Each cell is drawn where it is, and the label names what is across."""
    dataset = exponents(Parameters(), plane, impacts=5)
    assert dataset['exponent'].dims == ('velocity', plane.across)
    axes = draw(dataset).axes[0]
    assert axes.get_xlim() == plane.window and axes.get_ylim() == plane.velocity
    assert {'phase': 'drive phase', 'displacement': 'initial displacement [1]'}[
        plane.across] in axes.get_xlabel()
    assert axes.get_ylabel().split(',')[0] == {
        'section': 'velocity after impact', 'impact': 'velocity before impact'}.get(
            plane.kind, 'initial velocity [1]')
    assert np.array_equal(axes.images[0].get_array(), dataset['exponent'].values)


@pytest.mark.parametrize(('words', 'named'), [
    (['99'], 'no figure 99'), (['--recipes', '/nonexistent'], 'holds no recipes')])
def test_bad_input_is_refused_in_one_line(words, named, capsys):
    assert main(words) == 2
    error = capsys.readouterr().err
    assert named in error and error.count('\n') == 1


def test_a_recipe_that_is_not_whole_is_refused(tmp_path, capsys):
    (tmp_path / 'x.yaml').write_text('figure: 3\n')
    assert main(['--recipes', str(tmp_path)]) == 2
    assert 'missing' in capsys.readouterr().err
