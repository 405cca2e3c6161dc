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


"""The search for all periodic orbits, stable or not, on threads."""

from collections.abc import Callable
import functools
from typing import Final, TypeAlias

from ..engine import run_tiles
from ...core.arrays import IntArray
from ...core.model import Model, Parameters
from ...core.orbits.listing import join, OrbitList, Rings, seek, splice

# Points of the section in the first round and at the most; those of one call of the kernel, which
# cannot be stopped.
FIRST: Final = 2048
MOST: Final = 16_384
BATCH: Final = 32
# Seeds of what is known, and what is new.
Found: TypeAlias = tuple[IntArray, Rings]


def find_orbits(parameters: Parameters, longest: int, *, first: int = FIRST, most: int = MOST,
                known: OrbitList | None = None, threads: int | None = None,
                cluster: str | None = None,
                reached: Callable[[int, OrbitList | None], None] = lambda points, found: None
                ) -> OrbitList:
    """
    Find all periodic orbits up to a number of impacts, stable or not, but those that stick.

    Seeds are pieces of trajectories that come nearly back, from points spread evenly over the
    section: many lie where trajectories stay long. Two known orbits that come near each other are
    seeds, too, one after the other. Newton's method closes them. The number of points, `first` in
    the first round, is doubled until a doubling adds no orbit, or to the `most`. `known` is what
    an earlier search of the same orbits has found, to go on from. `reached` is called with the
    points that are done just now, and after each round with the list, too; it raises to give up.
    """
    parts: dict[int, Found] = {}
    found = known or OrbitList(parameters, longest)
    while not found.is_complete and found.points < most:
        begin = found.points
        end = min(2 * begin, most) or min(first, most)
        tiles = range(begin, end, BATCH)

        def keep(tile: int, part: Found) -> None:
            parts[tile] = part
            reached(min(BATCH, most - tile), None)

        rings = found.rings
        run_tiles(functools.partial(_seek, rings, found.fastest, parameters.model, end), tiles,
                  keep, threads=threads, cluster=cluster)
        # In their order, so that the result does not depend on the threads.
        for tile in tiles:
            rings = join(rings, *parts.pop(tile))
        found = found.after(end, splice(rings, parameters.model))
        reached(0, found)
    return found


def _seek(rings: Rings, fastest: float, model: Model, end: int, tile: int) -> Found:
    return seek(tile, min(tile + BATCH, end), fastest, rings, model)
