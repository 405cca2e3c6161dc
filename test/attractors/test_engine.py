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

"""Threads and a cluster of processes compute the same; failures are reported."""

import os
import signal
import threading
import time

from grids import basin, files_of
import numpy as np
import pytest

from gear_rattle_ros.attractors import engine
from gear_rattle_ros.attractors.engine import EngineError, run_tiles
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.cli import attractors
from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.store.store import open_dataset
from gear_rattle_ros.studies.grids import grid as tiles_module


@pytest.mark.parametrize('threads', [1, 2, 5])
def test_every_tile_is_done_once(threads):
    """All results come back in the calling thread."""
    results = {}

    def finished(tile, result):
        assert threading.current_thread() is threading.main_thread()
        assert tile not in results
        results[tile] = result

    run_tiles(lambda tile: tile * tile, range(40), finished, threads=threads)
    assert results == {tile: tile * tile for tile in range(40)}


def test_what_a_tile_raises_is_raised():
    """A failure ends the run; what was finished before it was reported."""
    def work(tile):
        if tile == 5:
            raise ValueError('tile 5')
        return tile

    told = []
    with pytest.raises(ValueError, match='tile 5'):
        run_tiles(work, range(100), lambda tile, result: told.append(tile), threads=1)
    assert told == [0, 1, 2, 3, 4]


def test_a_missing_scheduler_is_reported_in_one_line(monkeypatch):
    """An address at which nothing listens."""
    pytest.importorskip('distributed')
    monkeypatch.setattr(engine, 'PATIENCE', 0.5)
    with pytest.raises(EngineError, match='no Dask scheduler answers at tcp://127.0.0.1:9'):
        run_tiles(str, [0], lambda tile, result: None, cluster='tcp://127.0.0.1:9')


@pytest.mark.long
def test_a_cluster_with_a_killed_worker_gives_the_same_store(tmp_path, monkeypatch):
    """Worker processes write the tiles; one is killed in mid-run and its tiles are done again."""
    distributed = pytest.importorskip('distributed')
    plane, parameters = Plane(phases=140, velocities=140), Parameters(alpha=0.53)
    here, *_ = basin(tmp_path / 'here', plane, parameters, tile=20)
    with distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, host='127.0.0.1',
            dashboard_address='127.0.0.1:0', silence_logs=50) as cluster:
        killed = []
        ask = distributed.Client(cluster)
        victim = next(iter(ask.run(os.getpid).values()))
        ask.close()
        mark = tiles_module.Store.mark

        def mark_and_kill(store, tile, done=True):
            mark(store, tile, done)
            if len(store.pending()) < 45 and not killed:
                os.kill(victim, signal.SIGKILL)
                killed.append(time.monotonic())

        monkeypatch.setattr(tiles_module.Store, 'mark', mark_and_kill)
        there, *_ = basin(tmp_path / 'there', plane, parameters, tile=20,
                          cluster=cluster.scheduler_address)
    assert killed
    assert there.pending() == []
    assert files_of(there) == files_of(here)


@pytest.mark.long
def test_a_cluster_finds_the_same_attractors(tmp_path):
    """What `attractors` writes with --cluster is what it writes without."""
    distributed = pytest.importorskip('distributed')
    common = ['--alpha', '0.57', '--initial-conditions', '200', '--hold', '4000']
    with distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, host='127.0.0.1',
            dashboard_address='127.0.0.1:0', silence_logs=50) as cluster:
        assert attractors.main([*common, '--output', str(tmp_path / 'there.zarr'), '--cluster',
                                cluster.scheduler_address]) == 0
    assert attractors.main([*common, '--output', str(tmp_path / 'here.zarr')]) == 0
    here, there = open_dataset(tmp_path / 'here.zarr'), open_dataset(tmp_path / 'there.zarr')
    assert set(here.variables) == set(there.variables)
    assert len(here['attractor_key']) == 2
    for name in here.variables:
        np.testing.assert_array_equal(here[name].values, there[name].values)
