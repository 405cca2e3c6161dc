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

"""A short soak; `python test/system/soak.py` runs the long ones."""

from pathlib import Path
import subprocess
import sys

import pytest


@pytest.mark.long
def test_a_minute_of_the_suite_with_parameters_changing(domain: int, tmp_path: Path) -> None:
    """Nothing lost, diagnostics right, the bag whole; memory may still be filling its pools."""
    soak = subprocess.run(
        [sys.executable, str(Path(__file__).with_name('soak.py')), '--minutes', '1', '--rate',
         '10', '--change', '1', '--slope-limit', '50000', '--folder', str(tmp_path / 'soak')],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=500)
    assert soak.returncode == 0, soak.stdout
    assert '0 gaps' in soak.stdout
