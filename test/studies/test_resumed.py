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

"""Diagrams, continuation, the crisis and saddles are the same after Ctrl-C, and from a cluster."""

from pathlib import Path
import shlex
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from gear_rattle_ros.cli.robustness import stability
from gear_rattle_ros.cli.skeleton import boundary, manifolds, orbits, saddle
from gear_rattle_ros.cli.sweeps import orbit_diagram, parameter_plane
from gear_rattle_ros.cli.trajectories import rattle
from gear_rattle_ros.cli.transitions import continuation, crisis, transitions
from gear_rattle_ros.places import config_folder, typed
from gear_rattle_ros.store.store import Store, StoreError

MAINS = {'boundary': boundary.main, 'continuation': continuation.main, 'crisis': crisis.main,
         'manifolds': manifolds.main, 'orbit_diagram': orbit_diagram.main, 'orbits': orbits.main,
         'parameter_plane': parameter_plane.main, 'rattle': rattle.main, 'saddle': saddle.main,
         'stability': stability.main, 'transitions': transitions.main}
# Options, tiles, and what is compared.
TOOLS = {
    'boundary': ('--distances 1e-7 1e-1 --error 0.1 --size 400', 16,
                 ('cut', 'exponent', 'label', 'entropy_mean', 'merging')),
    'orbit_diagram': ('--alpha 0.48 0.52 --columns 64 --bins 300 --trajectories 32 --skip 3000 '
                      '--keep 512', 24, ('count', 'exponent', 'end_state', 'attractor')),
    'continuation': ('--alpha 0.5 0.54 --columns 64 --trajectories 32 --hold 1000 --tolerance '
                     '1e-3', 8, ('count', 'share', 'event_alpha')),
    'saddle': ('--initial-conditions 100 --straddled 1600 --sprinkled 16000', 8,
               ('phase', 'estimate', 'rate_value', 'orbit_near')),
    'crisis': ('--beyond 2e-4 2e-3 --rates 5 --escapes 64', 48,
               ('lifetime', 'fate', 'escape_rate')),
    'manifolds': ('--orbit orbit-2-1-U5.4554+0.8585 --length 20 --size 400', 16,
                  ('label', 'curve_phase', 'crossing_velocity')),
    'parameter_plane': ('--size 120 --curves 1', 9,
                        ('exponent', 'kind', 'share', 'vertex_alpha', 'mark_gamma')),
    'rattle': (f'--gears {config_folder("gears") / "example.yaml"} --run-up 600 900 --points 13 '
               '--initial-conditions 40 --periods 50', 4,
               ('point_share', 'point_kick_m_per_s', 'state_force', 'state_point', 'impact_state',
                'impact_time_s')),
    'orbits': ('--impacts 6 --points 4096 --size 200', 16, ('label', 'cycle_point_phase')),
    'transitions': ('--alpha 0.10 0.101 --alpha 0.48 0.54 --columns 8 --trajectories 32 --hold '
                    '1000', 2, ('alpha', 'alpha_error', 'kind', 'ratio')),
}


def same_contents(name, one, other):
    """Compare what two stores hold."""
    for variable in TOOLS[name][2]:
        a, b = (Store(path).read_all(variable) for path in (one, other))
        assert np.array_equal(a, b, equal_nan=a.dtype.kind == 'f'), variable


def interrupted(command, path, tiles):
    """Run a process until some tiles are done, press Ctrl-C, return its last line."""
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL,
                               text=True)
    deadline = time.monotonic() + 300.0
    while time.monotonic() < deadline and process.poll() is None:
        try:
            if len(Store(path).pending()) < tiles:
                break
        except (StoreError, ValueError):
            pass
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130, said
    assert 'Traceback' not in said
    return said.strip().splitlines()[-1]


@pytest.mark.long
@pytest.mark.parametrize('name', list(TOOLS))
def test_ctrl_c_and_resume_change_nothing(name, tmp_path, capsys):
    """A real process is interrupted; the command that it prints finishes the same store."""
    options, tiles, _ = TOOLS[name]
    path, whole = tmp_path / 'a.zarr', tmp_path / 'b.zarr'
    line = interrupted([sys.executable, '-m', 'gear_rattle_ros.start', name,
                        *shlex.split(options), '--threads', '1', '--output', str(path)],
                       path, tiles)
    pending = Store(path).pending()
    assert 0 < len(pending) < tiles
    assert f'{name}: stopped; {path} keeps {tiles - len(pending)} of {tiles} tiles;' in line
    words = shlex.split(line.split('go on with: ')[1])
    assert words[:len(typed(name))] == typed(name)
    assert MAINS[name](words[len(typed(name)):]) == 0
    assert MAINS[name]([*shlex.split(options), '--output', str(whole)]) == 0
    same_contents(name, path, whole)


@pytest.mark.long
def test_a_cluster_gives_the_same(tmp_path):
    """Two worker processes of a real cluster do the tiles of the tools."""
    distributed = pytest.importorskip('distributed')
    with distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, host='127.0.0.1',
            dashboard_address='127.0.0.1:0', silence_logs=50) as cluster:
        for name in ('boundary', 'orbit_diagram', 'continuation', 'crisis', 'parameter_plane',
                     'rattle'):
            options, _, _ = TOOLS[name]
            here, there = (Path(tmp_path / f'{name}-{place}.zarr') for place in ('a', 'b'))
            words = shlex.split(options)
            assert MAINS[name]([*words, '--output', str(here)]) == 0
            assert MAINS[name]([*words, '--output', str(there), '--cluster',
                                cluster.scheduler_address]) == 0
            same_contents(name, here, there)
