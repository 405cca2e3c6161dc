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

"""Where the tiles run: threads of this process, or a Dask cluster."""

from collections.abc import Callable, Sequence
import itertools
import os
import queue
import threading
from typing import Any, Final, TypeVar

Result = TypeVar('Result')
# Times that a tile is tried again when its workers die.
RETRIES: Final = 5
# How long a scheduler may take to answer [s].
PATIENCE: Final = 10.0
# Tiles handed to a cluster ahead of time, per thread of it.
AHEAD: Final = 4


class EngineError(ValueError):
    """The cluster cannot be used; the message is one line."""


def threads_here() -> int:
    """Count the processors that this process may use."""
    return len(os.sched_getaffinity(0))


def run_tiles(work: Callable[[int], Result], tiles: Sequence[int],
              finished: Callable[[int, Result], None], *, cluster: str | None = None,
              threads: int | None = None) -> None:
    """Do a piece of work for every tile, on threads of this process or on a Dask cluster."""
    # `work` takes the number of a tile, on which alone it depends, stores what it computes and
    # returns something small; on a cluster it is pickled. `finished` is called for every tile in
    # this thread, in the order in which they end. An exception of `work` or Ctrl-C ends the run:
    # what is still running is abandoned. EngineError where the cluster cannot be reached, or a
    # tile's workers die again and again.
    if not tiles:
        return
    if cluster:
        _run_on_cluster(work, tiles, finished, cluster)
    else:
        _run_here(work, tiles, finished, min(threads or threads_here(), len(tiles)))


def _run_here(work: Callable[[int], Result], tiles: Sequence[int],
              finished: Callable[[int, Result], None], threads: int) -> None:
    waiting = iter(tiles)
    lock = threading.Lock()
    ended: queue.SimpleQueue[tuple[int, Any, BaseException | None]] = queue.SimpleQueue()
    stop = threading.Event()

    def serve() -> None:
        while not stop.is_set():
            with lock:
                tile = next(waiting, None)
            if tile is None:
                return
            try:
                ended.put((tile, work(tile), None))
            except BaseException as error:  # noqa: B902
                ended.put((tile, None, error))

    # Daemons: a tile that is abandoned must not keep the process from ending.
    for _ in range(threads):
        threading.Thread(target=serve, daemon=True).start()
    try:
        for _ in tiles:
            tile, result, error = ended.get()
            if error is not None:
                raise error
            finished(tile, result)
    finally:
        stop.set()


def _run_on_cluster(work: Callable[[int], Result], tiles: Sequence[int],
                    finished: Callable[[int, Result], None], address: str) -> None:
    # Only here: the import takes longer than a small grid.
    from distributed import as_completed, Client
    from distributed.scheduler import KilledWorker
    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise EngineError(f'no Dask scheduler answers at {address}: {error}') from error
    with client:
        waiting = iter(tiles)
        numbers: dict[Any, int] = {}
        deaths: dict[int, int] = {}

        def submit(tile: int) -> Any:
            future = client.submit(work, tile, pure=False, retries=0)
            numbers[future.key] = tile
            return future

        room = AHEAD * max(1, sum(client.nthreads().values()))
        ended = as_completed([submit(tile) for tile in itertools.islice(waiting, room)],
                             loop=client.loop)
        for future in ended:
            tile = numbers.pop(future.key)
            failure = future.exception()
            if isinstance(failure, KilledWorker):
                deaths[tile] = deaths.get(tile, 0) + 1
                if deaths[tile] > RETRIES:
                    raise EngineError(f'workers die at tile {tile}: {failure}')
                ended.add(submit(tile))
                continue
            if failure is not None:
                raise failure
            finished(tile, future.result())
            following = next(waiting, None)
            if following is not None:
                ended.add(submit(following))
