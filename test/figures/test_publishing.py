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

"""Every picture, drawn again from its store as a journal wants it."""

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

from matplotlib import rcParams
from matplotlib.image import imread
import numpy as np
import pytest
import xarray

from gear_rattle_ros import open_dataset
from gear_rattle_ros.cli.pictures.draw import main
from gear_rattle_ros.cli.run import module_of
from gear_rattle_ros.figures.draw import draw, PICTURES, save
from gear_rattle_ros.places import config_folder

GEARS = config_folder('gears') / 'example.yaml'
SEARCH = '--initial-conditions 40 --hold 1000'
COMMANDS = {
    'attractors': SEARCH,
    'basins': f'--size 12 {SEARCH}',
    'boundary': f'--size 30 --distances 1e-4 1e-1 --per-decade 1 --error 0.3 {SEARCH}',
    'continuation': '--alpha 0.48 0.5 --columns 3 --trajectories 4 --keep 32 --hold 1000',
    'drift': f'--to 0.512 --rates 1e-4 --window 20 {SEARCH}',
    'exponents': '--size 12 --impacts 5',
    'hopping': f'--noise 0.05 0.1 --impacts 2000 --trajectories 8 {SEARCH}',
    'lifetimes': f'--size 12 --alpha 1.244 {SEARCH}',
    'manifolds': f'--orbit orbit-2-1-U5.4554+0.8585 --length 3 --size 12 {SEARCH}',
    'motion': f'--periods 2 {SEARCH}',
    'orbit_diagram': '--columns 4 --bins 50 --trajectories 2 --keep 64 --skip 100',
    'parameter_plane': '--alpha 0.4 0.6 --gamma 0 0.2 --size 4 --skip 200 --keep 64',
    'probability_basins': f'--size 6 --impacts 20 --trajectories 3 {SEARCH}',
    'rattle': f'--gears {GEARS} --run-up 400 500 --points 2 --periods 5 {SEARCH}',
    'saddle': f'--straddled 160 --sprinkled 400 {SEARCH}',
    'stability': f'--size 12 {SEARCH} --erosion 0.47 0.48 --columns 2 --trajectories 20',
    'orbits': f'--impacts 3 --points 64 --size 12 {SEARCH}',
    'section': '--alpha 0.57 --trajectories 4 --skip 50 --keep 50 --bins 200 200',
}
TITLE = 'Gears & walls, λ < 0'
every_tool = pytest.mark.parametrize('tool', [
    pytest.param(tool, marks=() if tool in ('basins', 'crisis') else pytest.mark.long)
    for tool in PICTURES])


def law() -> xarray.Dataset:
    """Return what a search for a crisis finds, in a few numbers."""
    alphas = 1.2363 + np.array([0.0, 1e-5, 1e-4, 1e-3])
    rates = np.array([0.0, 1e-4, 2e-4, 6e-4])
    numbers = {'tangency_alpha': 1.2363, 'tangency_exponent': 0.5, 'law_alpha_c': 1.23629,
               'law_alpha_c_error': 1e-6, 'law_scale': 0.02, 'law_exponent': 0.5,
               'law_exponent_error': 0.05, 'paper_alpha': 1.2361, 'beta': 0.1, 'gamma': 0.1,
               'restitution': 0.9}
    return xarray.Dataset({'escape_rate': ('alpha', rates),
                           'escape_rate_error': ('alpha', 0.1 * rates)},
                          coords={'alpha': alphas}, attrs={
                              'tool': 'crisis', 'direction': 1.0, 'tangency': 'homoclinic',
                              'attractor': 'chaotic-2-1-U5.0000+1.0000',
                              'saddle': '4-1-U4.0000+1.0000', **numbers})


@pytest.fixture(scope='module')
def again(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., list[Path]]:
    """Return what draws the store of a tool again, with options."""
    folder = tmp_path_factory.mktemp('stores')

    def redraw(tool: str, name: str, **looks: object) -> list[Path]:
        if tool == 'crisis':
            return save(law(), folder / f'{tool}-{name}', **looks)
        store = folder / f'{tool}.zarr'
        if not store.exists():
            command = module_of(tool, 'cli').main
            assert command([*COMMANDS[tool].split(), '--output', str(store)]) == 0
        before = set(folder.iterdir())
        options = [word for key, value in looks.items() for word in (f'--{key}', str(value))]
        assert main([str(store), '--picture', str(folder / f'{tool}-{name}'), *options]) == 0
        return sorted(set(folder.iterdir()) - before)

    return redraw


def test_every_tool_is_among_them() -> None:
    """A picture that is new here is tested, too."""
    assert {*COMMANDS, 'crisis'} == set(PICTURES)


@every_tool
def test_letters_stay_letters(again: Callable[..., list[Path]], tool: str) -> None:
    """Fonts are TrueType in PDF, no font of Type 3; words in SVG, the title among them."""
    for path in again(tool, 'fonts.pdf', title=TITLE):
        content = path.read_bytes()
        assert b'/Type3' not in content and b'/FontFile2' in content
    for path in again(tool, 'fonts.svg', title=TITLE):
        texts = ElementTree.parse(path).iter('{http://www.w3.org/2000/svg}text')
        assert TITLE in [''.join(text.itertext()) for text in texts]


@every_tool
def test_resolution_and_colours_are_as_asked(again: Callable[..., list[Path]], tool: str) -> None:
    """Twice the dots are twice the pixels; the greys of the paper are grey, to a rounding."""
    for small, large in zip(again(tool, 'small.png', dpi=50),
                            again(tool, 'large.png', dpi=100, colours='paper'), strict=True):
        coloured, grey = (imread(path)[..., :3] for path in (small, large))
        assert np.abs(2 * np.array(coloured.shape[:2]) - grey.shape[:2]).max() <= 2
        assert np.ptp(coloured, axis=2).max() > 0.2 and np.ptp(grey, axis=2).max() < 0.01


def test_a_picture_stands_beside_its_store(again: Callable[..., list[Path]], tmp_path: Path,
                                           capsys: pytest.CaptureFixture[str]) -> None:
    """Without a name it has that of the store."""
    store = again('basins', 'here.png')[0].with_name('basins.zarr')
    (tmp_path / 'b.zarr').symlink_to(store)
    capsys.readouterr()
    assert main([str(tmp_path / 'b.zarr')]) == 0
    assert capsys.readouterr().out == f'{tmp_path / "b.png"}\n'
    # 12 cells of 67 pixels along each edge, a row for two attractors below.
    assert imread(tmp_path / 'b.png').shape[:2] == (804 + 132, 804 + 120)
    for words, named in ((['--colours', 'rainbows'], 'rainbows'), (['--dpi', '1'], '--dpi 1'),
                         (['--picture', 'a.txt'], 'a.txt')):
        assert main([str(store), *words]) == 2
        error = capsys.readouterr().err
        assert named in error and error.count('\n') == 1
    assert main([str(tmp_path / 'none.zarr')]) == 2
    assert capsys.readouterr().err.startswith(f'draw: {tmp_path}/none.zarr')


def test_a_figure_in_hand_is_saved_in_the_same_way(again: Callable[..., list[Path]],
                                                   tmp_path: Path) -> None:
    """Whatever the caller's settings are, and without a change to them."""
    store = again('basins', 'hand.png')[0].with_name('basins.zarr')
    settings = dict(rcParams)
    draw(open_dataset(store)).savefig(tmp_path / 'a.pdf')
    assert b'/Type3' not in (tmp_path / 'a.pdf').read_bytes()
    assert dict(rcParams) == settings


def test_a_dataset_without_a_picture_is_refused(tmp_path: Path) -> None:
    """It names those that have one."""
    with pytest.raises(ValueError, match='no picture; there are attractors, basins'):
        save(xarray.Dataset(attrs={'tool': 'verify'}), tmp_path / 'a.png')
