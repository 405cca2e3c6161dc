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

"""A gear pair in tools, datasets, pictures, the suite and the explorer."""

import argparse
import json
import math
from pathlib import Path
import shlex

from matplotlib.image import imread
import numpy as np
import pytest
import xarray

from gear_rattle_ros import draw, Gears, open_dataset, Plane
from gear_rattle_ros.cli import attractors
from gear_rattle_ros.cli.grids import basins
from gear_rattle_ros.cli.options import add_model, add_plane, path_of, plane_of
from gear_rattle_ros.cli.refusal import Parser
from gear_rattle_ros.cli.robustness import stability
from gear_rattle_ros.cli.trajectories import motion
from gear_rattle_ros.core.defaults import QUANTITIES
from gear_rattle_ros.explorer import server
from gear_rattle_ros.gear_pairs import parse, read_gears
from gear_rattle_ros.nodes.suite.node import _parse
from gear_rattle_ros.places import config_folder
from gear_rattle_ros.studies.attractors import attractors as find

EXAMPLE = config_folder('gears') / 'example.yaml'
FILE = """
inertia_kg_m2: 2e-4
driver_radius_m: 0.04
driven_radius_m: 0.05
backlash_m: 1e-4
drag_n_m_s_per_rad: 4e-3
torque_n_m: 0.001
drive_rad: 0.002
frequency_hz: 30
restitution: 0.8
"""
OMEGA = 2.0 * math.pi * 30.0
MODEL = {'alpha': 0.002 * 0.04 / 1e-4, 'beta': 4e-3 / (2e-4 * OMEGA),
         'gamma': 0.001 * 0.05 / (2e-4 * 1e-4 * OMEGA**2), 'restitution': 0.8}
SMALL = '--size 6 --initial-conditions 20 --threads 1'


@pytest.fixture
def pair(tmp_path: Path) -> Path:
    """Write a file of a gear pair."""
    path = tmp_path / 'pair.yaml'
    path.write_text(FILE)
    return path


def test_the_example_of_the_package_is_plausible() -> None:
    """It rattles from rest, and nothing in it looks wrong."""
    gears = read_gears(EXAMPLE)
    assert gears.warnings() == () and gears.given.keys() <= QUANTITIES.keys()


def test_a_tool_keeps_both_units(pair: Path, tmp_path: Path, capsys) -> None:
    """The model is that of the file; the store has both, as plain xarray reads it, too."""
    store = tmp_path / 'a.zarr'
    words = [*shlex.split(SMALL), '--gears', str(pair), '--output', str(store)]
    assert basins.main([*words, '--picture', str(tmp_path / 'a.png')]) == 0
    printed = capsys.readouterr().out
    assert 'gear pair at 30 Hz' in printed and ' fastest impact [mm/s]' in printed
    for data in (open_dataset(store), xarray.open_zarr(store)):
        for name, value in MODEL.items():
            assert data.attrs[name] == pytest.approx(value, rel=1e-14)
        assert json.loads(data.attrs['gears'])['backlash_m'] == 1e-4
        assert data.attrs['omega'] == pytest.approx(OMEGA, rel=1e-15)
        assert data['velocity_m_per_s'].attrs['units'] == 'm/s'
        for name in ('velocity', 'point_velocity'):
            assert f'{name}_m_per_s' in data.coords
            np.testing.assert_allclose(data[f'{name}_m_per_s'], data[name] * 1e-4 * OMEGA,
                                       rtol=1e-14)
    data.to_netcdf(tmp_path / 'a.nc')
    # The axis in SI units lies outside of what the picture has without.
    assert basins.main([*words[:-4], *(f'--{name}={value!r}' for name, value in MODEL.items()),
                        '--output', str(tmp_path / 'b.zarr'),
                        '--picture', str(tmp_path / 'b.png')]) == 0
    plain = open_dataset(tmp_path / 'b.zarr')
    assert 'gears' not in plain.attrs and not any('_m_per_s' in str(name) for name in plain)
    np.testing.assert_array_equal(data['label'], plain['label'])
    assert imread(tmp_path / 'a.png').shape[1] > imread(tmp_path / 'b.png').shape[1]


def test_second_axes_are_scaled(pair: Path) -> None:
    """A velocity of 1 is the backlash times omega, on the axis beside."""
    gears = read_gears(pair)
    data = find(gears.parameters, Plane(), initial_conditions=8, threads=1, gears=gears)
    axes = draw(data).axes[0]
    beside, = axes.child_axes
    axes.figure.draw_without_rendering()
    assert beside.get_ylabel() == '[mm/s]'
    np.testing.assert_allclose(beside.get_ylim(), 0.1 * OMEGA * np.array(axes.get_ylim()),
                               rtol=1e-12)


def test_options_replace_what_the_file_has(pair: Path, tmp_path: Path, monkeypatch) -> None:
    """Single quantities, those of the model, and the name of the store."""
    monkeypatch.chdir(tmp_path)
    options = shlex.split('--initial 0 -1 0 --periods 1')
    assert motion.main([*options, '--gears', 'pair.yaml', '--order', '2', '--speed-rpm', '1800',
                        '--beta', '0.1']) == 0
    data = open_dataset('motion-beta-0.1-gears-pair-order-2-speed-rpm-1800-initial-0_-1_0-'
                        'periods-1.zarr')
    assert data.attrs['gamma'] == pytest.approx(MODEL['gamma'] / 4.0, rel=1e-14)
    kept = json.loads(data.attrs['gears'])
    assert 'frequency_hz' not in kept
    assert kept['drag_n_m_s_per_rad'] == pytest.approx(0.1 * 2e-4 * 2.0 * OMEGA, rel=1e-14)
    np.testing.assert_allclose(data['time_s'], data['tau'] / (2.0 * OMEGA), rtol=1e-14)
    np.testing.assert_allclose(data['displacement_m'], data['displacement'] * 1e-4, rtol=1e-14)
    # All without a file.
    words = [word for name, value in kept.items()
             for word in (f'--{name.replace("_", "-")}', repr(value))]
    assert motion.main([*options, *words, '--output', 'b.zarr']) == 0
    np.testing.assert_allclose(open_dataset('b.zarr')['velocity'], data['velocity'], rtol=1e-9)


def test_settling_times_and_kicks_in_si(pair: Path, tmp_path: Path, capsys) -> None:
    """Seconds come from the gear pair; the kick is in m/s, too."""
    assert stability.main([*shlex.split(SMALL), '--gears', str(pair), '--reach', '0.5',
                           '--output', str(tmp_path / 'a.zarr')]) == 0
    printed = capsys.readouterr().out
    assert ' mean [s]' in printed and ' [mm/s]' in printed
    data = open_dataset(tmp_path / 'a.zarr')
    np.testing.assert_allclose(data['attractor_kick_size_m_per_s'],
                               data['attractor_kick_size'] * 1e-4 * OMEGA, rtol=1e-14)


@pytest.mark.parametrize(('content', 'options', 'words'), [
    ('', '', 'must give quantities by name'),
    ('a: [', '', 'is not YAML'),
    (FILE.replace('inertia_kg_m2', 'inertia'), '', "unknown quantity 'inertia'; known are iner"),
    (FILE.replace('backlash_m: 1e-4', ''), '', 'backlash_m is missing: backlash, along'),
    (FILE.replace('0.001', ''), '', 'torque_n_m is missing: constant load torque'),
    (FILE.replace('30', 'fast'), '', "frequency_hz = 'fast' is not a number"),
    (FILE.replace('30', 'yes'), '', 'frequency_hz = True is not a number'),
    (FILE, '--backlash-m 0', 'backlash_m = 0.0 must be positive'),
    (FILE, '--order 2', 'give either frequency_hz or order and speed_rpm, not part of it'),
    (FILE, '--drive-m 1e-4 --drive-rad 0.1', 'give either drive_rad or drive_m, not both'),
    (FILE, '--torque-n-m 1e3', 'the load holds the flanks together'),
    (None, '', 'No such file or directory; name a YAML file of a gear pair'),
])
def test_bad_gear_pairs_are_refused_in_one_line(content, options, words, tmp_path, capsys):
    """By tools, the suite and the explorer: file and quantity are named, the status is 2."""
    path = tmp_path / 'bad.yaml'
    if content is not None:
        path.write_text(content)
    given = ['--gears', str(path), *shlex.split(options)]
    assert attractors.main(given) == 2
    lines = [capsys.readouterr().err]
    for command in (_parse, server.main):
        with pytest.raises(SystemExit) as end:
            command(given)
        assert end.value.code == 2
        lines.append(capsys.readouterr().err)
    for name, line in zip(('attractors', 'suite', 'explorer'), lines, strict=True):
        assert line.startswith(f'{name}: {path}') and words in line and line.count('\n') == 1


def test_the_library_refuses_another_gear_pair(pair: Path) -> None:
    """The parameters must be those of the gear pair."""
    gears = read_gears(pair)
    with pytest.raises(ValueError, match='gamma = .* but that of the gear pair is'):
        find(gears.at(torque_n_m=0.002).parameters, gears=gears)


def test_what_looks_wrong_is_said_once(pair: Path, tmp_path: Path, capsys) -> None:
    """A line on stderr, and the tool goes on."""
    assert motion.main(['--gears', str(pair), '--torque-n-m', '0.1', '--initial', '0', '0', '-0.5',
                        '--periods', '1', '--output', str(tmp_path / 'a.zarr')]) == 0
    said = [line for line in capsys.readouterr().err.splitlines() if 'at rest' in line]
    assert len(said) == 1 and said[0].startswith('motion: a gear at rest stays at rest')


def swept(*words: str) -> argparse.Namespace:
    """Parse the options of a sweep."""
    parser = Parser('sweep')
    add_model(parser, windows=((0.47, 0.6),))
    add_plane(parser)
    return parse(parser, list(words))


def test_windows_in_si_are_those_of_the_model(pair: Path) -> None:
    """A drive, a torque or a drag has two values where its parameter takes them."""
    gears = '--gears', str(pair)
    path = path_of(swept(*gears, '--drive-rad', '0.001', '0.003', '--torque-n-m', '0', '0.001'))
    scale = MODEL['alpha'] / 0.002
    assert path.first.alpha == pytest.approx(0.001 * scale, rel=1e-14)
    assert path.last.alpha == pytest.approx(0.003 * scale, rel=1e-14)
    assert (path.first.gamma, path.last.gamma) == (0.0, pytest.approx(MODEL['gamma'], rel=1e-14))
    assert path.first.beta == path.last.beta == pytest.approx(MODEL['beta'], rel=1e-14)
    # One value is that of the gear pair, and the window of alpha stays.
    path = path_of(swept(*gears, '--drag-n-m-s-per-rad', '8e-3'))
    assert path.ends == (0.47, 0.6) and path.first.beta == pytest.approx(2.0 * MODEL['beta'])
    plane = plane_of(swept(*gears, '--velocity-m-per-s', '-0.01', '0.02'))
    assert plane.velocity == pytest.approx((-0.01 / (1e-4 * OMEGA), 0.02 / (1e-4 * OMEGA)))


@pytest.mark.parametrize(('words', 'said'), [
    ('--velocity-m-per-s 0 1', 'is of a gear pair; give its file with --gears'),
    ('--drive-rad 1e-3 2e-3 --alpha 0.4 0.5', '--alpha and --drive-rad are windows of the same')])
def test_windows_that_cannot_be_are_refused(pair: Path, words: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        swept(*shlex.split(words), *['--gears', str(pair)] * ('drive' in words))


def test_the_suite_hands_the_gear_pair_on(pair: Path) -> None:
    """Its options have the numbers of the gear pair, unless one is given."""
    options = _parse(['--gears', str(pair), '--gamma', '0.2', '--drive-rad', '0.003'])
    assert options.alpha == pytest.approx(1.5 * MODEL['alpha'], rel=1e-14)
    assert options.gamma == 0.2 and options.then is None
    assert options.pair == Gears.of(read_gears(pair).given, drive_rad=0.003)
