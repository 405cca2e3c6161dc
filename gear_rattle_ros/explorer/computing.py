"""Computing a view coarse to fine, in steps so short that it can be given up at any time."""

from collections.abc import Callable, Iterator
import dataclasses
import time
from typing import Final

import numpy as np
import numpy.typing as npt

from .catalogues import Catalogues, Known
from .view import CAP, COARSEST, EXPONENTS, following, SPAN, View
from ..attractors.catalogue import Catalogue
from ..attractors.refining import FIRST_CAP, Level, refine
from ..studies.exponents import finite_time_exponents

# A level is shown anew so often while it is computed [s].
SHOWN_EVERY: Final = 0.4
# A thorough search begins when the view has been left alone for so long [s].
SETTLED_AFTER: Final = 0.15


@dataclasses.dataclass(frozen=True)
class Picture:
    """
    A view as far as it is known.

    Attributes
    ----------
    view : View
        What was asked for.
    cells : int
        Cells along an edge.
    done : float
        Share of them that is computed; the rest is from the level before [1].
    known : Known
        What the labels mean.
    labels : ndarray of int16, shape (cells, cells)
        Attractor of every start, velocity first.
    lifetimes : ndarray of int32, shape (cells, cells)
        Impacts until it has settled.
    exponents : ndarray of float32, shape (cells, cells), or None
        Finite-time exponent [1], where it is asked for.
    seconds : float
        Since the computing began [s].
    is_last : bool
        Whether nothing finer follows.

    """

    view: View
    cells: int
    done: float
    known: Known
    labels: npt.NDArray[np.int16]
    lifetimes: npt.NDArray[np.int32]
    exponents: npt.NDArray[np.float32] | None
    seconds: float
    is_last: bool = False


def pictures(view: View, catalogues: Catalogues, check: Callable[[], None]) -> Iterator[Picture]:
    """Compute a view, finer and finer; `check` is called often and raises to give up."""
    begin = time.monotonic()
    known = catalogues.quick(view)

    def is_provisional(level: Level) -> bool:
        return level.cap < CAP and (len(level.left) > 0 or not known.is_complete)

    def level_of(cells: int, cap: int, begun: Level | None = None) -> Level:
        starts = view.plane(cells).cells(view.parameters, slice(0, cells), slice(0, cells))
        return Level(starts, (cells, cells), cap, seconds=SHOWN_EVERY, begun=begun)

    def levels() -> Iterator[tuple[Level, Catalogue]]:
        nonlocal known
        cells = min(COARSEST, view.finest())
        level = level_of(cells, FIRST_CAP)
        yield level, known.catalogue
        if is_provisional(level):
            _leave_alone(SETTLED_AFTER, check)
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
                # What is known of the level before stands in until the finer one is computed.
                rows = np.arange(cells) * len(exponents) // cells
                exponents, grown = exponents[np.ix_(rows, rows)], 0
            last = cells if is_done else level.due[0] // cells
            starts = view.plane(cells).cells(
                view.parameters, slice(grown, last), slice(0, cells))
            exponents[grown:last] = finite_time_exponents(
                starts, SPAN, check=check).reshape(-1, cells)
            grown = last
            level.spent += time.monotonic() - since
        yield Picture(
            view, cells, 1.0 if is_done else 1.0 - len(level.due) / cells**2, known,
            level.labels.copy(), level.lifetimes.copy(),
            exponents.copy() if view.kind == EXPONENTS else None, time.monotonic() - begin,
            is_done and not is_provisional(level) and not following(cells, level.spent, view))


def _leave_alone(seconds: float, check: Callable[[], None]) -> None:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        check()
        time.sleep(0.01)
