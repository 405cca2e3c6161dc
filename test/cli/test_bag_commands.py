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

"""The commands for bags start quickly."""

import subprocess
import sys

import pytest

from gear_rattle_ros.places import program
from gear_rattle_ros.start import EXECUTABLES


@pytest.mark.parametrize('name', ['export', 'recover', 'summary', 'verify'])
def test_help_needs_nothing_heavy(name: str) -> None:
    """Neither numba nor matplotlib nor a reader of bags is loaded for it."""
    code = (f'import sys\nfrom gear_rattle_ros.{EXECUTABLES[name]} import main\n'
            'try:\n    main(["--help"])\nfinally:\n'
            '    assert not {"numba", "numpy", "matplotlib", "mcap"} & set(sys.modules)')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, '')
    assert done.stdout.startswith(f'usage: {program(name)} ')
