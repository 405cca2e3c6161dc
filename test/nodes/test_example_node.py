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

"""The node of the ROS interface page: it prints events, and ends quietly."""

import functools
from pathlib import Path
import re
import signal
import subprocess
import sys
import time

PAGE = Path(__file__).parents[2] / 'doc' / 'ros.md'


def test_it_runs_and_ends_quietly(start, tmp_path: Path) -> None:
    """As it stands on the page, beside a simulator; Ctrl-C leaves no traceback."""
    start('simulator').wait_for('ready')
    program, = re.findall(r'```python\n((?:(?!```).)*?rclpy\.spin.*?)```', PAGE.read_text(),
                          re.DOTALL)
    (tmp_path / 'mine.py').write_text(program)
    with (tmp_path / 'said').open('w') as said:
        # Where the tests run in the background of a shell, it would ignore Ctrl-C as they do.
        process = subprocess.Popen(
            [sys.executable, '-u', str(tmp_path / 'mine.py')], stdout=said,
            stderr=subprocess.PIPE, text=True,
            preexec_fn=functools.partial(signal.signal, signal.SIGINT, signal.SIG_DFL))
    try:
        deadline = time.monotonic() + 60.0
        while not (tmp_path / 'said').read_text():
            assert process.poll() is None and time.monotonic() < deadline
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=30)
    finally:
        process.kill()
    assert errors == ''
    assert process.returncode == 0
