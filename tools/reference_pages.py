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

"""Write the page with the options of every tool, as `NAME --help` prints them."""

import contextlib
import importlib
import io
import os
from pathlib import Path
import sys

from gear_rattle_ros.parameters import TABLES
from gear_rattle_ros.start import EXECUTABLES

COLUMNS = '88'


def help_text(place: str) -> str:
    """Return what an executable prints with --help."""
    printed = io.StringIO()
    module, *words = place.split()
    with contextlib.redirect_stdout(printed), contextlib.suppress(SystemExit):
        importlib.import_module(f'gear_rattle_ros.{module}').main([*words, '--help'])
    return printed.getvalue().rstrip()


def tools_page() -> str:
    """Return the page; the other nodes have parameters instead of options."""
    return '# Options\n' + ''.join(
        f'\n## {name}\n\n```text\n{help_text(place)}\n```\n'
        for name, place in EXECUTABLES.items() if name not in TABLES or name == 'replay')


def write(folder: Path) -> None:
    """Write the page into a folder."""
    # argparse wraps at the width of the terminal, wherever the site is built.
    os.environ['COLUMNS'] = COLUMNS
    folder.mkdir(exist_ok=True)
    (folder / 'tools.md').write_text(tools_page(), encoding='utf-8')


if __name__ == '__main__':
    write(Path(sys.argv[1] if len(sys.argv) > 1 else 'doc/reference'))
