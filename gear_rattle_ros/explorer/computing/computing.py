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

"""Computes a view from coarse to fine, in steps short enough to be abandoned at any time."""

from collections.abc import Callable, Iterator
import dataclasses
import time
from typing import Final

import numpy as np
import numpy.typing as npt

from .catalogues import Catalogues, Known
from ..view import CAP, COARSEST, EXPONENTS, following, SPAN, View
from ...attractors.catalogue import Catalogue
from ...attractors.refining import FIRST_CAP, Level, refine
from ...studies.grids.exponents import finite_time_exponents

# Interval at which a level is shown while it is computed [s].
SHOWN_EVERY: Final = 0.4
# Time for which a view must be left alone before a thorough search begins [s].
SETTLED_AFTER: Final = 0.15


@dataclasses.dataclass(frozen=True)
class Picture:
    """A view as far as it is computed; arrays have the shape (cells, cells), velocity first."""

    view: View
    cells: int
    # Share of the cells that is computed; the others are from the level before [1].
    done: float
    # What the labels mean.
    known: Known
    labels: npt.NDArray[np.int16]
    # Impacts until the trajectory has settled.
    lifetimes: npt.NDArray[np.int32]
    # Finite-time exponents where the view is of them [1].
    exponents: npt.NDArray[np.float32] | None
    # Since the computation began [s].
    seconds: float
    is_last: bool = False


def pictures(catalogues: Catalogues, view: View, check: Callable[[], None]) -> Iterator[Picture]:
    """Compute a view, finer and finer; `check` is called often and raises to abandon it."""
    begin = time.monotonic()
    known = catalogues.quick(view)

    def is_provisional(level: Level) -> bool:
        return level.cap < CAP and (len(level.left) > 0 or not known.is_complete)

    def level_of(cells: int, cap: int, begun: Level | None = None) -> Level:
        initial = view.plane(cells).cells(view.parameters, slice(0, cells), slice(0, cells))
        return Level(initial, (cells, cells), cap, seconds=SHOWN_EVERY, begun=begun)

    def levels() -> Iterator[tuple[Level, Catalogue]]:
        nonlocal known
        cells = min(COARSEST, view.finest())
        level = level_of(cells, FIRST_CAP)
        yield level, known.catalogue
        if is_provisional(level):
            settled = time.monotonic() + SETTLED_AFTER
            while time.monotonic() < settled:
                check()
                time.sleep(0.01)
            known = catalogues.complete(view, check)
            level = level_of(cells, CAP)
            yield level, known.catalogue
        while cells := following(cells, level.spent, view):
            level = level_of(cells, CAP, level)
            yield level, known.catalogue

    exponents, grown = np.zeros((1, 1), np.float32), 0
    for level, catalogue, is_done in refine(levels(), check=check):
        if catalogue is not known.catalogue:
            known = dataclasses.replace(known, catalogue=catalogue)
            catalogues.add(view, catalogue)
        cells = len(level.labels)
        if view.kind == EXPONENTS:
            since = time.monotonic()
            if len(exponents) != cells:
                # The level before is shown until the finer one is computed.
                rows = np.arange(cells) * len(exponents) // cells
                exponents, grown = exponents[np.ix_(rows, rows)], 0
            last = cells if is_done else level.due[0] // cells
            initial = view.plane(cells).cells(view.parameters, slice(grown, last), slice(0, cells))
            exponents[grown:last] = finite_time_exponents(
                initial, SPAN, check=check).reshape(-1, cells)
            grown = last
            level.spent += time.monotonic() - since
        yield Picture(
            view, cells, 1.0 if is_done else 1.0 - len(level.due) / cells**2, known,
            level.labels.copy(), level.lifetimes.copy(),
            exponents.copy() if view.kind == EXPONENTS else None, time.monotonic() - begin,
            is_done and not is_provisional(level) and not following(cells, level.spent, view))
