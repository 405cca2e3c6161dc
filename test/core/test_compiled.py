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

"""The cache of compiled kernels: what was compiled from other sources is never used again."""

import os
from pathlib import Path
import subprocess
import sys

import gear_rattle_ros.core.compiled as compiled
import gear_rattle_ros.core.many.settling as settling

CALLER = 'from .compiled import kernel\nfrom .room.called import called\n\n\n@kernel\n' \
    'def calls(x):\n    return called(x) + 1.0\n'
CALLED = 'from ..compiled import kernel\n\n\n@kernel\ndef called(x):\n    return {value} * x\n'


def run(folder: Path) -> float:
    """Import the package anew, as the next process would, with the same cache."""
    # The bytes may change within the second that Python's own cache of sources tells apart.
    environment = os.environ | {'NUMBA_CACHE_DIR': str(folder / 'cache'),
                                'PYTHONDONTWRITEBYTECODE': '1'}
    return float(subprocess.run(
        [sys.executable, '-c', 'from house.caller import calls; print(calls(1.0))'],
        cwd=folder, env=environment, check=True, capture_output=True, text=True).stdout)


def test_an_edited_kernel_of_a_sub_folder_is_compiled_again(tmp_path):
    """The kernel that calls it stands in another file, which has not changed."""
    house = tmp_path / 'house'
    (house / 'room').mkdir(parents=True)
    for folder in (house, house / 'room'):
        (folder / '__init__.py').touch()
    for name in ('compiled.py', 'private.py'):
        (house / name).write_text(Path(compiled.__file__).with_name(name).read_text())
    (house / 'caller.py').write_text(CALLER)
    # Two files, and two versions of what both are compiled from.
    for value in (2.0, 3.0, 2.0):
        (house / 'room' / 'called.py').write_text(CALLED.format(value=value))
        assert run(tmp_path) == value + 1.0
    assert len(list((tmp_path / 'cache' / 'gear_rattle_ros').iterdir())) == 4


def test_what_a_module_imports_is_what_python_imports() -> None:
    """Imported alone, without what other modules bring in, it brings in these files of core."""
    core = Path(compiled.__file__).parent
    code = ('import sys, types\n'
            'for name in ("gear_rattle_ros", "gear_rattle_ros.attractors"):\n'
            '    module = sys.modules[name] = types.ModuleType(name)\n'
            f'    module.__path__ = [{str(core.parent)!r}]\n'
            f'import {settling.__name__}\n'
            'print(*(m.__file__ for m in sys.modules.values() if getattr(m, "__file__", None)\n'
            f'        and m.__file__.startswith({str(core)!r})))')
    answer = subprocess.run([sys.executable, '-c', code], check=True, capture_output=True,
                            text=True).stdout.split()
    files = {Path(name) for name in answer}
    assert compiled.sources(Path(settling.__file__)) == {
        each for each in files if each.name != '__init__.py'}
    assert len(files) > 12 and core / 'many' / 'escape.py' not in files
