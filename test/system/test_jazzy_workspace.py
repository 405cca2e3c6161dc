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

"""The documented way into a workspace, above a Python with the versions of Ubuntu 24.04."""

import os
from pathlib import Path
import shutil
import subprocess

import pytest
from ubuntu import python_3_12, VERSIONS

ROOT = Path(__file__).parents[2]
PACKAGE = 'gear_rattle_ros'
SYSTEM = (
    *VERSIONS, 'matplotlib==3.8.4', 'pillow', 'pyyaml', 'colcon-bash', 'colcon-core',
    'colcon-library-path', 'colcon-package-selection', 'colcon-python-setup-py',
    'colcon-ros', 'setuptools<80', 'ros-jazzy-rclpy', 'ros-jazzy-common-interfaces',
    'ros-jazzy-rmw-fastrtps-cpp')
# They are older there than what we pin.
OLDER = ('contourpy', 'llvmlite', 'matplotlib', 'numba', 'numpy', 'pillow', 'scipy', 'setuptools')
# What a ROS installation and a launch file bring.
LEFT_OUT = ('source /opt/', 'cd ', 'rosdep ', 'ros2 ')
PRINT_VERSIONS = """
import numba, numpy, rclpy, rerun, sensor_msgs.msg, xarray, zarr
print(numpy.__version__, numba.__version__)
"""


def documented() -> list[str]:
    """Return the commands of the page, but those for which there is nothing here."""
    section = (ROOT / 'doc' / 'install.md').read_text().split('## In a ROS 2 Jazzy workspace')[1]
    lines = [line[4:] for line in section.split('\n## ')[0].splitlines()
             if line.startswith('    ')]
    return [line for line in lines if not line.startswith(LEFT_OUT)]


@pytest.mark.long
@pytest.mark.skipif(python_3_12() is None, reason='no python3.12 here')
def test_jazzy_workspace(tmp_path: Path) -> None:
    """A suite with bag and viewer file, a check of the bag, a basin."""
    system, workspace = tmp_path / 'system', tmp_path / 'ws'
    environment = {name: os.environ[name] for name in ('HOME', 'PATH', 'ROS_DOMAIN_ID')
                   if name in os.environ}
    environment |= {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST', 'COLCON_LOG_LEVEL': 'error',
                    'NUMBA_CACHE_DIR': str(tmp_path / 'cache')}

    def run(*command: str) -> str:
        done = subprocess.run(command, cwd=workspace, env=environment, text=True, check=False,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=600)
        assert done.returncode == 0, f'{command}\n{done.stdout}'
        return done.stdout

    shutil.copytree(ROOT, workspace / 'src' / PACKAGE, ignore=shutil.ignore_patterns(
        '.*', '__pycache__', '*.egg-info', 'build', 'install', 'log', 'runs'))
    pins = tmp_path / 'pins.txt'
    pins.write_text('\n'.join(
        line for line in (ROOT / 'constraints.txt').read_text().splitlines()
        if not line.startswith(OLDER)))
    run(str(python_3_12()), '-m', 'venv', str(system))
    run(str(system / 'bin' / 'pip'), 'install', '--quiet', '-c', str(pins), *SYSTEM)
    # As a sourced ROS sets them.
    libraries = [system / 'lib', *(system / 'lib').rglob('*.libs')]
    environment |= {'LD_LIBRARY_PATH': ':'.join(map(str, libraries)),
                    'AMENT_PREFIX_PATH': str(system),
                    'PATH': f'{system / "bin"}:{environment["PATH"]}'}
    make, *others = documented()
    assert make.startswith('python3 -m venv --system-site-packages venv')
    run('bash', '-ec', make)
    # An environment above this one, which is not where Python was built, sees it by a path.
    site = next((workspace / 'venv').glob('lib/python3.*/site-packages'))
    (site / 'system.pth').write_text(
        f'import site; site.addsitedir({str(next(system.glob("lib/python3.*/site-packages")))!r})')
    run('bash', '-ec', '\n'.join(others))
    set_up = 'source venv/bin/activate; source install/setup.bash;'
    numpy, _ = run('bash', '-c', f'{set_up} python -W error -c "{PRINT_VERSIONS}"').split()
    assert numpy.startswith('2.')

    def node(line: str) -> str:
        # As `ros2 run` does, with an environment that is not active.
        return run('bash', '-c', 'source install/setup.bash; exec '
                   f'install/{PACKAGE}/lib/{PACKAGE}/{line}')

    node('suite --duration 5 --output run')
    assert (workspace / 'run' / 'run.rrd').stat().st_size > 10_000
    assert (workspace / 'run' / 'summary.png').stat().st_size > 10_000
    assert 'verified' in node('verify run/bag').lower()
    assert 'orbit-2-1' in node('basins --alpha 0.48 --size 40 --output b.zarr --picture b.png')
