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

"""Where the files of config/ are, and how programs are started here."""

import contextlib
import os
from pathlib import Path
import shutil
import sys

PACKAGE = 'gear_rattle_ros'


def config_folder(name: str) -> Path:
    """Return a folder of config/: in the checkout, else where the package is installed."""
    prefixes = [*os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep), sys.prefix]
    places = [Path(__file__).parents[1] / 'config' / name,
              *(Path(p) / 'share' / PACKAGE / 'config' / name for p in prefixes if p)]
    return next((place for place in places if place.is_dir()), places[0])


def typed(name: str) -> list[str]:
    """Return the words that start a program from here: of pip's one command, else of ROS."""
    if Path(sys.argv[0]).parts[-3:-1] == ('lib', PACKAGE):
        # Of a workspace, whatever else there is beside its Python.
        return ['ros2', 'run', PACKAGE, name]
    beside, found = Path(sys.executable).with_name('gear_rattle'), shutil.which('gear_rattle')
    if beside.exists() and found != str(beside):
        with contextlib.suppress(ValueError):
            beside = beside.relative_to(Path.cwd())
        return [str(beside), name]
    return ['gear_rattle', name] if found else ['ros2', 'run', PACKAGE, name]


def program(name: str) -> str:
    """Return what a program is called in its usage: `typed`, without the path."""
    command, *words = typed(name)
    return ' '.join([Path(command).name, *words])
