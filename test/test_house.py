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

"""The house rules that a program can check."""

from pathlib import Path

import importlinter.cli
import pytest

ROOT = Path(__file__).parents[1]


def test_imports_keep_to_the_layers(
        monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Every contract of pyproject.toml is kept."""
    monkeypatch.chdir(ROOT)
    monkeypatch.syspath_prepend(str(ROOT))
    status = importlinter.cli.lint_imports(no_cache=True)
    assert status == importlinter.cli.EXIT_STATUS_SUCCESS, capsys.readouterr().out


def test_no_room_is_a_flat_hall() -> None:
    """Whoever opens a folder sees what is in it."""
    rooms = {str(path.parent) for path in (ROOT / 'gear_rattle_ros').rglob('*.py')}
    assert not [room for room in rooms if len([*Path(room).glob('*.py')]) > 16]
