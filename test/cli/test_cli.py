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

"""Bad input is refused in one line; Ctrl-C keeps what is done and shows how to resume."""

import inspect
import io
import json
import re
import shlex
import signal
import subprocess
import sys
import time

from grids import files_of
from matplotlib.image import imread
from numba.core import event
import numpy as np
import pytest

from gear_rattle_ros.cli import attractors
from gear_rattle_ros.cli.compilation import reporting_compilation
from gear_rattle_ros.cli.grids import basins, exponents, lifetimes
from gear_rattle_ros.cli.options import number, Parser
from gear_rattle_ros.cli.robustness import stability
from gear_rattle_ros.cli.run import module_of
from gear_rattle_ros.places import typed
from gear_rattle_ros.store.store import open_dataset, Store, StoreError
from gear_rattle_ros.studies.progress import in_words, Progress

TOOLS = {'attractors': attractors.main, 'basins': basins.main, 'lifetimes': lifetimes.main,
         'stability': stability.main}


@pytest.mark.parametrize(('tool', 'options', 'words'), [
    ('basins', '--phase 2 1', 'phase window 2 to 1 is empty or reversed'),
    ('basins', '--velocity 1 1', 'velocity window'),
    ('basins', '--phase 0 7', 'wider than 2 pi'),
    ('basins', '--velocity nan 1', "'nan' is not a finite number"),
    ('basins', '--alpha nan', "'nan' is not a finite number"),
    ('lifetimes', '--alpha inf', "'inf' is not a finite number"),
    ('basins', '--alpha=-1', 'alpha = -1.0 is outside'),
    ('attractors', '--restitution 1.5', 'restitution = 1.5 is outside'),
    ('basins', '--size 0', "'0' is not a whole number from 1 on"),
    ('basins', '--size 3 0', "'0' is not a whole number from 1 on"),
    ('basins', '--size 3 4 5', '--size takes one or two numbers'),
    ('basins', '--size 2.5', "'2.5' is not a whole number"),
    ('basins', '--displacement 0.5', 'displacement = 0.5 is outside [-1, 0]'),
    ('basins', '--plane section --displacement 0', 'impacts have that of their walls; leave'),
    ('basins', '--plane strobe --displacement -0.5', 'give a window, two numbers'),
    ('attractors', '--plane strobe --phase 0 1', 'give one number'),
    ('lifetimes', '--phase 1', 'give a window, two numbers'),
    ('basins', '--cap 3e9', "'3e9' is more than 2,147,483,647"),
    ('basins', '--threads 0', "'0' is not a whole number from 1 on"),
    ('basins', '--cap 0', "'0' is not a whole number from 1 on"),
    ('basins', '--tolerance 0', 'tolerance = 0 is not between'),
    ('basins', '--picture /nowhere/at/all/a.png', 'cannot be written'),
    ('basins', '--picture a.xyz', 'does not end in one of .png'),
    ('basins', '--output /proc/nothing/a.zarr', 'cannot be written'),
    ('basins', '--zoom-levels 2 --zoom-at 1 9', 'velocity 9 is outside'),
    ('basins', '--zoom-levels 2 --zoom-factor 1', '--zoom-factor 1 is not'),
    ('lifetimes', '--cap 100 --tail 100', 'does not lie below the cap'),
    ('attractors', '--initial-conditions 0', "'0' is not a whole number from 1 on"),
    ('attractors', '--sizes 3', 'unrecognized arguments'),
    ('stability', '--reach 0', 'reach = 0.0 is outside'),
    ('stability', '--omega=-1', 'omega = -1.0 is outside'),
    ('stability', '--to=-1', 'alpha = -1.0 is outside'),
    ('stability', '--to delta=1', "'delta=1' is not one of alpha, beta, gamma, restitution"),
    ('stability', '--to gamma=0.1 beta=0.1', 'a jump to the same parameters changes nothing'),
    ('stability', '--erosion 0.5 0.4', 'alpha window 0.5 to 0.4 is empty or reversed'),
    ('stability', '--erosion 0.5 0.6', 'alpha 0.48 is not in the window'),
])
def test_bad_input_is_refused_in_one_line(tool, options, words, capsys, tmp_path, monkeypatch):
    """The line names the value, the status is 2, and nothing is written."""
    monkeypatch.chdir(tmp_path)
    try:
        status = TOOLS[tool](shlex.split(options))
    except SystemExit as end:
        status = end.code
    said = capsys.readouterr()
    assert status == 2
    assert said.out == ''
    assert len(said.err.splitlines()) == 1
    assert said.err.startswith(f'{tool}: ')
    assert words in said.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize('name', [
    'attractors', 'basins', 'boundary', 'continuation', 'crisis', 'exponents', 'lifetimes',
    'manifolds', 'motion', 'orbit_diagram', 'orbits', 'rattle', 'saddle', 'section',
    'stability', 'transitions'])
def test_options_and_functions_have_the_same_defaults(name):
    """The command without options does what the function without arguments does."""
    parser = Parser(name)
    module_of(name, 'cli').main.add_options(parser)
    given = vars(parser.parse_args([]))
    study = getattr(module_of(name), name)
    takes = inspect.signature(study).parameters
    shared = set(takes) & set(given) - {'plane'}
    assert shared
    assert {key: given[key] for key in shared} == {key: takes[key].default for key in shared}


def test_a_command_imports_what_it_needs(tmp_path):
    """Whatever is installed beside it; half of the time of a small grid would be other imports."""
    done = subprocess.run(
        [sys.executable, '-X', 'importtime', '-m', 'gear_rattle_ros.start', 'basins', '--output',
         str(tmp_path / 'a.zarr'), '--size', '6', '--initial-conditions', '20'],
        check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    found = set(re.findall(r'^import time:.*\| +([\w.]+)$', done.stderr, re.MULTILINE))
    assert {'numba', 'zarr'} <= found
    assert not {'dask', 'matplotlib', 'pandas', 'scipy._lib', 'xarray'} & found


def test_a_store_of_other_parameters_is_refused(tmp_path, capsys):
    """The same question goes on, or is drawn again; another one is refused at once."""
    path = tmp_path / 'a.zarr'
    common = ['--size', '6', '--initial-conditions', '20', '--output', str(path)]
    assert basins.main(common) == 0
    assert 'same question' not in capsys.readouterr().err
    picture = tmp_path / 'a.png'
    assert basins.main([*common, '--picture', str(picture)]) == 0
    assert picture.exists()
    assert f'{path} answers the same question: 1 of 1 tile done already\n' in (
        capsys.readouterr().err)
    assert basins.main([*common, '--alpha', '0.5']) == 2
    assert (f'{path} answers another question, with alpha = 0.48, not 0.5; choose another'
            in capsys.readouterr().err)


@pytest.mark.parametrize(('tool', 'options', 'name'), [
    ('basins', '', 'basins-0.48'),
    ('basins', '--alpha 1.2347058 --beta 0.1 --size 400', 'basins-1.2347058'),
    ('basins', '--beta 0.2 --size 6 4 --velocity -1 2pi --threads 2 --dpi 50 --picture a.png',
     'basins-0.48-beta-0.2-velocity--1_6.283185307179586-size-6_4'),
    ('basins', '--plane strobe --phase pi', 'basins-0.48-plane-strobe-phase-3.141592653589793'),
    ('stability', '--plane impact --displacement 0', 'stability-0.48'),
    ('orbit_diagram', '--sweep up down', 'orbit_diagram-sweeps-up_down'),
    ('orbit_diagram', '--alpha 1 1.75', 'orbit_diagram-alpha-1_1.75'),
    ('orbit_diagram', '--beta 0.05 0.2 --alpha 0.5', 'orbit_diagram-0.5-beta-0.05_0.2'),
    ('transitions', '--alpha 0.5 0.6', 'transitions-alpha-0.5_0.6'),
    ('lifetimes', '--grey', 'lifetimes-1.244'),
    ('section', '--compare /some/other.zarr', 'section-1.23-compare-other'),
    ('motion', '--attractor A --initial 0 -1 0', 'motion-0.48-attractor-A-initial-0_-1_0')])
def test_a_store_is_named_after_its_question(tool, options, name, monkeypatch):
    """The tool, alpha, and everything that is not the default, as it was given."""
    module = module_of(tool, 'cli')
    found = []
    monkeypatch.setattr(type(module.main), '_run',
                        lambda self, given, words: found.append(str(given.output)) or 0)
    assert module.main(shlex.split(options)) == 0
    assert found == [f'{name}.zarr']


@pytest.mark.parametrize(('tool', 'options', 'grids'), [
    ('basins', '--alpha 1.244 --cap 1000 --initial-conditions 16 --hold 1000',
     ('label', 'lifetime')),
    pytest.param('lifetimes', '--cap 4000 --initial-conditions 64 --hold 4000',
                 ('label', 'lifetime', 'survival'), marks=pytest.mark.long),
    pytest.param('stability', '--initial-conditions 64 --hold 4000 --to 0.5',
                 ('label', 'attractor_kick_size', 'attractor_tipped'), marks=pytest.mark.long)])
def test_ctrl_c_keeps_finished_tiles(tmp_path, tool, options, grids):
    """A real process is interrupted, and the command it prints finishes the store."""
    def command(path):
        return [sys.executable, '-m', 'gear_rattle_ros.start', tool, '--size', '60', '--tile',
                '12', '--threads', '1', *shlex.split(options), '--output', str(path)]

    path = tmp_path / 'a.zarr'
    process = subprocess.Popen(command(path), stderr=subprocess.PIPE, stdout=subprocess.PIPE,
                               text=True)
    deadline = time.monotonic() + 120.0
    while time.monotonic() < deadline:
        try:
            if len(Store(path).pending()) < 24:
                break
        except (StoreError, ValueError):
            pass
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=20)
    assert process.returncode == 130
    line, = (one for one in said.splitlines() if 'stopped; ' in one)
    assert 'Traceback' not in said
    pending = Store(path).pending()
    assert f'{path} keeps {25 - len(pending)} of 25 tiles; go on with' in line
    assert 0 < len(pending) < 25
    resume = shlex.split(line.split('go on with: ')[1])
    begin = typed(tool)
    assert resume[:len(begin)] == begin
    assert TOOLS[tool](resume[len(begin):]) == 0
    assert TOOLS[tool](command(tmp_path / 'b.zarr')[4:]) == 0
    resumed, whole = Store(path), Store(tmp_path / 'b.zarr')
    assert files_of(resumed) == files_of(whole)
    for name in grids:
        assert np.array_equal(resumed.read_all(name), whole.read_all(name))


@pytest.mark.long
def test_exponents_are_drawn(tmp_path):
    """The tool writes a picture beside the store."""
    picture = tmp_path / 'a.png'
    assert exponents.main(['--size', '12', '9', '--impacts', '20', '--output',
                           str(tmp_path / 'a.zarr'), '--picture', str(picture)]) == 0
    # A cell is a whole number of pixels, 67 and 89 here.
    height, width, _ = imread(picture).shape
    assert (width, height) == (12 * 67 + 200, 9 * 89 + 110)


@pytest.mark.parametrize('tool', sorted(TOOLS))
def test_every_dataset_describes_itself(tmp_path, tool):
    """Names and units of all arrays, coordinates of the grid, parameters, versions, command."""
    path = tmp_path / 'a.zarr'
    grid = [] if tool == 'attractors' else ['--size', '5', '4', '--cap', '900']
    options = ['--beta', '0.11', '--initial-conditions', '30', '--hold', '1000', *grid,
               '--output', str(path)]
    assert TOOLS[tool](options) == 0
    dataset = open_dataset(path)
    for name, array in dataset.variables.items():
        assert array.attrs['long_name'], name
        # Names of attractors have no unit.
        assert array.attrs['units'] or array.dtype.kind in 'UOT', name
    if grid:
        assert dataset['phase'].attrs['units'] == 'rad'
        assert dataset['label'].dims == dataset['lifetime'].dims == ('velocity', 'phase')
        assert dict(dataset['label'].sizes) == {'velocity': 4, 'phase': 5}
        assert {'phase', 'velocity'} <= set(dataset.coords)
    attributes = dataset.attrs
    assert (attributes['tool'], attributes['beta'], attributes['seed']) == (tool, 0.11, 1)
    for name in ('alpha', 'gamma', 'restitution', 'phase_window',
                 'plane' if tool == 'stability' else 'displacement',
                 'velocity_window', 'tolerance', 'hold', 'initial_conditions', 'created', 'title'):
        assert name in attributes
    assert attributes['command'] == shlex.join(['gear_rattle', tool, *options])
    assert json.loads(attributes['versions'])['numpy'] == np.__version__


@pytest.mark.parametrize(('text', 'value'), [
    ('0.48', 0.48), ('-1e-3', -1e-3), ('2pi', 2.0 * np.pi), ('-pi', -np.pi), ('0.5pi', np.pi / 2)])
def test_numbers(text, value):
    """Fractions of pi are read, also as the values of an option."""
    assert number(text) == value
    parser = Parser('name')
    parser.add_argument('--window', nargs=2, type=number)
    assert parser.parse_args(['--window', text, '3']).window == [value, 3.0]


def test_progress_has_rate_and_time_left(capsys, monkeypatch):
    """Half done in ten seconds: ten more, and the impacts by the seconds."""
    now = [100.0]
    monkeypatch.setattr(time, 'monotonic', lambda: now[0])
    progress = Progress('basins', 300, sys.stderr)
    progress.skip(100)
    now[0] = 111.0
    progress.add(100, 33_000_000)
    assert capsys.readouterr().err == (
        'basins: 200 of 300, 3.0 million impacts/s, 11 s left\n')
    # The last line of a log is that all is done.
    progress.add(100, 33_000_000)
    assert not capsys.readouterr().err
    progress.__exit__()
    assert capsys.readouterr().err == (
        'basins: 300 of 300, 6.0 million impacts/s, 0 s left\n')
    assert [in_words(seconds) for seconds in (9.7, 600.0, 7200.0)] == ['10 s', '10 min', '2.0 h']


def test_progress_and_what_is_reported_have_lines_of_their_own():
    """On a terminal, what is compiled while a line of progress stands replaces that line."""
    class Screen(io.StringIO):

        def isatty(self):
            return True

    screen = Screen()
    with Progress('continuation', 9, screen) as progress, reporting_compilation(
            'continuation', screen):
        progress._every = 0.0
        progress.add(4)
        with event.trigger_event('numba:compile'):
            progress.add(5)
    shown = [text.split('\r')[-1].removeprefix('\x1b[K')
             for text in screen.getvalue().split('\n')]
    assert shown[0] == ('continuation: compiling, once on this machine; this takes about a minute '
                        '...')
    assert shown[1].startswith('continuation: compiled 1 kernel in ')
    assert shown[2] == ''
