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

"""Both kinds of install are real ROS 2 packages, and their executables run."""

from collections.abc import Callable
import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys
import sysconfig
import venv

from ament_index_python.packages import get_package_prefix, get_package_share_directory
from catkin_pkg.package import parse_package
from diagnostic_msgs.msg import DiagnosticArray
import pytest
from rclpy.node import Node

from gear_rattle_ros.start import EXECUTABLES

PACKAGE = 'gear_rattle_ros'
ROOT = Path(__file__).parents[2]
# They run until they are stopped; the others need a bag first.
NODES: dict[str, list[str]] = {
    'basin': [],
    'control': [],
    'lyapunov': [],
    'recorder': [],
    'simulator': [],
    'transients': [],
    'viewer': ['--ros-args', '-p', 'mode:=none', '-p', 'save:=run.rrd'],
}
NEED_A_BAG = ('replay', 'summary')
LEFT_OUT = shutil.ignore_patterns(
    '.*', '__pycache__', '*.egg-info', 'build', 'install', 'log', 'runs')


def run(command: list[str], **options: object) -> str:
    """Run a command and return what it printed; fail with all of it if the command fails."""
    done = subprocess.run(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=120,
        check=False, **options)
    assert done.returncode == 0, done.stdout
    return done.stdout


def install_with_pip(source: Path, folder: Path, *options: str) -> Path:
    """Install into a new environment that borrows everything else from this one."""
    prefix = folder / 'env'
    venv.create(prefix, symlinks=True)
    version = sysconfig.get_python_version()
    site = prefix / 'lib' / f'python{version}' / 'site-packages'
    (site / 'borrowed.pth').write_text(sysconfig.get_path('purelib') + '\n')
    run([
        sys.executable, '-m', 'pip', '--python', str(prefix / 'bin' / 'python'), 'install',
        '--quiet', '--no-deps', '--no-build-isolation', '--no-index', '--ignore-installed',
        *options, str(source)])
    return prefix


def install_with_colcon(source: Path, folder: Path, *options: str) -> Path:
    """Build a workspace that has this one package."""
    workspace = folder / 'workspace'
    workspace.mkdir()
    (workspace / 'src').symlink_to(source)
    run(
        [sys.executable, '-m', 'colcon', '--log-base', 'log', 'build', *options],
        cwd=workspace, env=os.environ | {'COLCON_LOG_LEVEL': 'error'})
    return workspace / 'install' / PACKAGE


INSTALLS = {
    'pip': (install_with_pip,),
    'pip-editable': (install_with_pip, '--editable'),
    'colcon': (install_with_colcon,),
    'colcon-symlink': (install_with_colcon, '--symlink-install'),
}


@pytest.fixture(scope='module', params=[
    # make has installed in the second way what the other tests run.
    pytest.param('pip', marks=pytest.mark.long),
    pytest.param('pip-editable', marks=pytest.mark.long), 'colcon',
    pytest.param('colcon-symlink', marks=pytest.mark.long)])
def kind(request: pytest.FixtureRequest) -> str:
    """Name one of the ways to install."""
    return str(request.param)


@pytest.fixture(scope='module')
def prefix(kind: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install a copy of the sources in one of the ways."""
    folder = tmp_path_factory.mktemp(kind)
    source = folder / PACKAGE
    shutil.copytree(ROOT, source, ignore=LEFT_OUT)
    install, *options = INSTALLS[kind]
    return install(source, folder, *options)


@pytest.fixture
def index(prefix: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Let the ament index know this prefix alone."""
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(prefix))
    return prefix


def command(prefix: Path, name: str) -> list[str]:
    """Start an executable as `ros2 run` does, after the workspace's own set-up if there is one."""
    executable = str(prefix / 'lib' / PACKAGE / name)
    setup = prefix.parent / 'local_setup.sh'
    if setup.exists():
        return ['sh', '-c', f'cd {setup.parent} && . ./local_setup.sh && cd - >/dev/null && '
                'exec "$@"', 'sh', executable]
    return [executable]


def test_table_has_the_suite() -> None:
    """The suite's executables are in the table."""
    assert {*NODES, *NEED_A_BAG, 'suite'} <= EXECUTABLES.keys()


def test_ros_finds_the_package(index: Path) -> None:
    """The ament index knows package, manifest and the files of config/."""
    assert Path(get_package_prefix(PACKAGE)) == index
    share = Path(get_package_share_directory(PACKAGE))
    assert parse_package(share / 'package.xml').name == PACKAGE
    for path in (ROOT / 'config').rglob('*'):
        if path.is_file():
            below = path.relative_to(ROOT / 'config')
            kept = share / (below if below.parts[0] == 'launch' else Path('config') / below)
            assert kept.read_bytes() == path.read_bytes()


def test_ros_finds_the_executables(prefix: Path) -> None:
    """lib/<package> holds exactly the executables, each with its run bit."""
    found = list((prefix / 'lib' / PACKAGE).iterdir())
    assert {path.name for path in found} == EXECUTABLES.keys()
    assert all(path.is_file() and os.access(path, os.X_OK) for path in found)


def test_only_one_name_is_put_on_the_path(kind: str, prefix: Path) -> None:
    """Of pip comes the one command; colcon leaves bin/ alone."""
    there = prefix / 'bin'
    made = {path.name for path in there.iterdir()} if there.exists() else set()
    assert made & {*EXECUTABLES, 'gear_rattle'} == ({'gear_rattle'} if 'pip' in kind else set())


def test_texts_name_the_command_that_exists(
        kind: str, prefix: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A usage begins with words that can be typed there."""
    monkeypatch.delenv('PYTHONPATH', raising=False)
    usage = run([*command(prefix, 'recover'), '--help'], cwd=tmp_path).split(' [-h]')[0]
    if 'pip' not in kind:
        assert usage == 'usage: ros2 run gear_rattle_ros recover'
        return
    assert usage == 'usage: gear_rattle recover'
    monkeypatch.setenv('PATH', f'{prefix}/bin', prepend=os.pathsep)
    assert run(['gear_rattle', 'recover', '--help']).startswith('usage: gear_rattle recover [-h]')
    # In messages, with the path where it has to be typed.
    monkeypatch.chdir(prefix)
    code = 'from gear_rattle_ros.places import typed; print(*typed("draw"))'
    assert run(['bin/python', '-c', code]) == 'gear_rattle draw\n'
    monkeypatch.setenv('PATH', '/usr/bin')
    assert run(['bin/python', '-c', code]) == 'bin/gear_rattle draw\n'
    listed = run(['bin/gear_rattle', '--help'])
    assert all(f'\n  {name} ' in listed for name in EXECUTABLES)


def test_tools_ask_for_their_bag(
        prefix: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the bag it needs, an executable ends with one line and status 2."""
    monkeypatch.delenv('PYTHONPATH', raising=False)
    for name in NEED_A_BAG:
        done = subprocess.run(
            command(prefix, name), cwd=tmp_path, capture_output=True, text=True, timeout=60,
            check=False)
        assert done.returncode == 2, done.stderr
        assert 'bag' in done.stderr.lower()
        assert 'Traceback' not in done.stderr


@pytest.mark.parametrize('every', [False, pytest.param(True, marks=pytest.mark.long)])
def test_nodes_run(
        prefix: Path, kind: str, every: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        rclpy_node: Node, spin: Callable[..., None]) -> None:
    """Each node comes up on real DDS, and ends with 0 on SIGINT."""
    monkeypatch.delenv('PYTHONPATH', raising=False)
    below = os.environ.get('AMENT_PREFIX_PATH') or sys.prefix
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'{prefix}{os.pathsep}{below}')
    if every and kind not in ('pip', 'colcon'):
        pytest.skip('kernels are compiled anew for every place: once for each tool is enough')
    names = NODES if every else {'recorder': []}
    heard: set[str] = set()
    rclpy_node.create_subscription(
        DiagnosticArray, '/diagnostics',
        lambda array: heard.update(status.hardware_id for status in array.status), 100)
    running: dict[str, subprocess.Popen[bytes]] = {}
    try:
        for name, arguments in names.items():
            with open(tmp_path / f'{name}.log', 'wb') as log:
                running[name] = subprocess.Popen(
                    [*command(prefix, name), *arguments], cwd=tmp_path, stdout=log, stderr=log)

        def all_heard_or_one_ended() -> bool:
            ended = [name for name, process in running.items() if process.poll() is not None]
            return bool(ended) or heard >= {f'/{name}' for name in names}

        spin(all_heard_or_one_ended, within=180.0)
        for process in running.values():
            process.send_signal(signal.SIGINT)
        statuses = {name: process.wait(20.0) for name, process in running.items()}
    finally:
        for process in running.values():
            process.kill()
            process.wait()
    logs = '\n'.join(log.read_text() for log in sorted(tmp_path.glob('*.log')))
    assert heard == {f'/{name}' for name in names}, logs
    assert statuses == dict.fromkeys(names, 0), logs


def test_colcon_takes_it_for_a_ros_package() -> None:
    """The package is an ament_python one for colcon, without a warning of catkin_pkg's."""
    listed = run([sys.executable, '-m', 'colcon', '--log-base', os.devnull, 'list'], cwd=ROOT)
    assert listed.split() == [PACKAGE, '.', '(ros.ament_python)']
    warnings: list[str] = []
    package = parse_package(ROOT / 'package.xml', warnings=warnings)
    assert package.get_build_type() == 'ament_python'
    assert warnings == []
