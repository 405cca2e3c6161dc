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

"""What Ubuntu 24.04 has: Python 3.12, and versions of libraries."""

import os
from pathlib import Path
import shutil
import subprocess

# numba 0.59 is the first release for Python 3.12; Ubuntu patched its 0.58.
VERSIONS = ('numpy==1.26.4', 'numba==0.59.1', 'scipy==1.11.4')


def python_3_12() -> str | None:
    """Find a Python 3.12 that can make environments."""
    builds = Path(os.environ.get('PYENV_ROOT', Path.home() / '.pyenv'), 'versions')
    candidates = [shutil.which('python3.12'), *builds.glob('3.12.*/bin/python3.12')]
    for candidate in filter(None, candidates):
        check = subprocess.run(
            [candidate, '-c', 'import ensurepip'], capture_output=True, check=False)
        if check.returncode == 0:
            return str(candidate)
    return None
