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

"""Executables start, or explain in one line why not."""

from pathlib import Path
import re
import subprocess
import sys

import pytest

from gear_rattle_ros.start import EXECUTABLES, GROUPS


@pytest.mark.parametrize(('name', 'missing'), [
    ('explorer', 'bokeh'), ('simulator', 'rclpy'), ('basins', 'zarr'), ('viewer', 'rerun')])
def test_a_missing_package_is_named(name: str, missing: str) -> None:
    """One line and exit status 2, however deep the import is."""
    code = (f'import sys; sys.modules[{missing!r}] = None; sys.argv = [{name!r}]; '
            f'from gear_rattle_ros.start import start; start({name!r})')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True)
    assert name in EXECUTABLES and done.returncode == 2
    assert done.stderr == (
        f'{name}: the Python package {missing} is not installed; see doc/install.md\n')


@pytest.mark.parametrize('then', [
    'pass', 'raise ImportError("initialization failed") from None',
    'raise ModuleNotFoundError(name="rclpy") from None'])
def test_a_signal_that_an_import_swallows_ends_the_program(tmp_path: Path, then: str) -> None:
    """Libraries pass over the interrupt, or make another error of it."""
    (tmp_path / 'deaf.py').write_text(
        'import os, signal\n'
        'try:\n    os.kill(os.getpid(), signal.SIGINT)\n    import this\nexcept BaseException:\n'
        f'    {then}\n'
        'def main():\n    print("goes on")\n')
    code = (f'import gear_rattle_ros; from gear_rattle_ros import start; '
            f'gear_rattle_ros.__path__.append({str(tmp_path)!r}); '
            f'start.EXECUTABLES["deaf"] = "deaf"; start.start("deaf")')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (130, '', '')


@pytest.mark.parametrize('place', [
    'ctypes.CFUNCTYPE(None)(interrupted)()', 'type("A", (), {"__del__": interrupted})()'])
def test_a_signal_in_a_callback_is_not_lost(tmp_path: Path, place: str) -> None:
    """Nothing can be raised there, as where numba loads a kernel; nothing is printed of it."""
    (tmp_path / 'busy.py').write_text(
        'import ctypes, os, signal, time\n'
        'def interrupted(*_):\n    os.kill(os.getpid(), signal.SIGINT)\n    time.sleep(9)\n'
        f'def main():\n    {place}\n    time.sleep(9)\n    print("goes on")\n')
    code = (f'import gear_rattle_ros; from gear_rattle_ros import start; '
            f'gear_rattle_ros.__path__.append({str(tmp_path)!r}); '
            f'start.EXECUTABLES["busy"] = "busy"; start.start("busy")')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (130, '', '')


def begun(*words: str, **options: object) -> subprocess.CompletedProcess[str]:
    """Run the one command."""
    return subprocess.run([sys.executable, '-m', 'gear_rattle_ros.start', *words], text=True,
                          capture_output=True, **options)


@pytest.mark.parametrize('words', [(), ('--help',)])
def test_all_programs_are_listed(words: tuple[str, ...]) -> None:
    """By group, one line each, within the width of a terminal, without heavy imports."""
    done = begun(*words)
    lines = done.stdout.splitlines()
    assert (done.returncode, done.stderr) == (0, '')
    assert [line.split()[0] for line in lines if line.startswith('  ')] == list(EXECUTABLES)
    assert len([line for line in lines if line.endswith(':')]) == len(GROUPS) == 4
    assert max(map(len, lines)) < 80


def test_an_unknown_program_is_one_line() -> None:
    done = begun('frobs')
    assert (done.returncode, done.stdout, done.stderr) == (
        2, '', "gear_rattle: there is no program 'frobs'; gear_rattle --help lists all\n")


@pytest.mark.parametrize('words', [
    '--help', 'verify --help', 'verify doc/bag doc/bag',
    pytest.param('attractors --initial-conditions 16', marks=pytest.mark.long)])
def test_a_reader_that_has_read_enough_is_no_error(words: str, tmp_path: Path) -> None:
    """A pipe that is closed, or no stdout at all: not a word on stderr."""
    root = Path(__file__).parents[1]
    program = f'{sys.executable} -m gear_rattle_ros.start {words}'.replace('doc/', f'{root}/doc/')
    # Without a stdout argparse helps on stderr.
    for line in (f'({program}; echo $? >status) | :', f'{program} >&-; echo $? >status')[
            :1 if 'help' in words else 2]:
        done = subprocess.run(['sh', '-c', line], cwd=tmp_path, stderr=subprocess.PIPE, text=True)
        assert not [one for one in done.stderr.splitlines()
                    if not re.search('compil|same question', one)]
        assert int((tmp_path / 'status').read_text()) in (0, 141)
