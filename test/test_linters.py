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

"""The linters of ament, where they are installed, as ROS packages run them."""

import importlib
from pathlib import Path
import shutil

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = ['gear_rattle_ros', 'test', 'tools', 'benchmark', 'config', 'doc']
LINTERS = {
    'copyright': [*SOURCES, 'CONTRIBUTING.md', 'LICENSE'],
    'flake8': ['--config', 'setup.cfg', *SOURCES, 'setup.py'],
    'pep257': ['gear_rattle_ros', 'config'],
    'xmllint': ['package.xml', 'config'],
}


# What `make lint` runs, too, is not run twice by every build.
@pytest.mark.parametrize('name', [
    pytest.param(name, marks=pytest.mark.long if name in ('flake8', 'pep257') else ())
    for name in LINTERS])
def test_linter_has_no_complaint(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its status is 0."""
    pytest.importorskip(f'ament_{name}')
    if name == 'xmllint' and shutil.which('xmllint') is None:
        pytest.skip('no xmllint here')
    monkeypatch.chdir(ROOT)
    assert importlib.import_module(f'ament_{name}.main').main(argv=LINTERS[name]) == 0
