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

"""Starts and ends of a whole suite at random moments: every process ends, and in time."""

import os
from pathlib import Path
import random
import signal
import subprocess
import sys
import time

import pytest

# As many as the time allows; hundreds show what happens once in hundreds.
CYCLES = int(os.environ.get('GEAR_RATTLE_CYCLES', '4'))
ENDS_WITHIN = 5.0
# What a suite may take beside its nodes: three groups of them one after the other, the picture.
SUITE_ENDS_WITHIN = 60.0


def of_run(folder: Path) -> dict[int, str]:
    """Return the processes of a run, and their names."""
    found = {}
    for place in Path('/proc').glob('[0-9]*'):
        try:
            words = (place / 'cmdline').read_bytes().decode(errors='replace').split('\0')
            mine = f'RUN={folder}'.encode() in (place / 'environ').read_bytes().split(b'\0')
        except OSError:
            continue
        if mine and 'gear_rattle_ros.start' in words:
            found[int(place.name)] = words[words.index('gear_rattle_ros.start') + 1]
    return found


def stacks(folder: Path) -> str:
    """Return what every process of a run is doing: it writes that where SIGUSR2 comes."""
    for number in of_run(folder):
        os.kill(number, signal.SIGUSR2)
    time.sleep(1.0)
    return ''.join(f'{path}:\n{path.read_text(errors="replace")}\n'
                   for path in (folder.with_suffix('.log'), *folder.glob('log/*')))


@pytest.mark.long
def test_every_process_ends(domain: int, tmp_path: Path) -> None:
    """Ctrl-C, SIGTERM, or a signal to all at once, from the import to the full run."""
    seed = random.SystemRandom().randrange(2**32)
    chance = random.Random(seed)
    # Python imports it when it begins.
    (tmp_path / 'sitecustomize.py').write_text(
        'import faulthandler, signal\nfaulthandler.register(signal.SIGUSR2)\n')
    path = os.pathsep.join([str(tmp_path), os.environ.get('PYTHONPATH', '')])
    for cycle in range(CYCLES):
        folder = tmp_path / str(cycle)
        how = ('SIGINT', 'SIGTERM', 'all')[cycle % 3]
        # Sooner, the signal meets Python itself, which has not yet come to our first line.
        moment = chance.uniform(0.5, 12.0)
        with open(tmp_path / f'{cycle}.log', 'w+') as log:
            suite = subprocess.Popen(
                [sys.executable, '-m', 'gear_rattle_ros.start', 'suite', '--viewer', 'none',
                 '--duration', '0', '--output', str(folder)],
                env={**os.environ, 'RUN': str(folder), 'PYTHONPATH': path},
                stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True)
            try:
                time.sleep(moment)
                for number in of_run(folder) if how == 'all' else [suite.pid]:
                    os.kill(number, signal.SIGTERM if how == 'SIGTERM' else signal.SIGINT)
                status = suite.wait(SUITE_ENDS_WITHIN)
            except subprocess.TimeoutExpired:
                pytest.fail(f'cycle {cycle}, seed {seed}: {stacks(folder)}')
            finally:
                suite.kill()
                suite.wait()
            log.seek(0)
            said = log.read()
        where = f'cycle {cycle}, seed {seed}, {how} after {moment:.2f} s: {said}'
        deadline = time.monotonic() + ENDS_WITHIN
        while of_run(folder) and time.monotonic() < deadline:
            time.sleep(0.05)
        assert not of_run(folder), f'{where}{stacks(folder)}'
        # All at once, a node may be found ended before the suite knows why.
        assert status in ((0, 2) if how == 'all' else (0,)), where
        assert 'Traceback' not in said and 'was killed' not in said, where
