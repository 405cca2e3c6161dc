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

"""The core on the versions that Ubuntu 24.04 has: Python 3.12, numpy 1.26."""

import os
from pathlib import Path
import subprocess

import pytest
from ubuntu import python_3_12, VERSIONS

ROOT = Path(__file__).parents[2]
TESTED_BY = ('mpmath==1.3.0', 'hypothesis', 'pytest<9')


@pytest.mark.long
@pytest.mark.skipif(python_3_12() is None, reason='no python3.12 here')
def test_core_passes_its_tests_there(tmp_path: Path) -> None:
    """All the tests of core/ pass, with kernels compiled by that numba."""
    python = tmp_path / 'bin' / 'python'
    subprocess.run([python_3_12(), '-m', 'venv', tmp_path], check=True)
    subprocess.run([python, '-m', 'pip', 'install', '--quiet', *VERSIONS, *TESTED_BY], check=True)
    kept = {name: os.environ[name] for name in ('HOME', 'PATH') if name in os.environ}
    done = subprocess.run(
        [python, '-m', 'pytest', '--override-ini', 'addopts=', '-m', 'not long', '-q',
         '-p', 'no:cacheprovider', 'test/core'],
        cwd=ROOT, env=kept | {'NUMBA_CACHE_DIR': str(tmp_path / 'cache')}, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
    assert done.returncode == 0, done.stdout
    assert ' passed' in done.stdout
