"""Computing a view coarse to fine, in steps so short that it can be given up at any time."""

from collections.abc import Callable, Iterator
import dataclasses
import time
from typing import Final

import numpy as np
import numpy.typing as npt

from .catalogues import Catalogues, Known
from .view import CAP, COARSEST, EXPONENTS, following, SPAN, View
from ..core.chaos import GLANCE
from ..core.classify import UNRESOLVED
from ..offline.catalogue import BATCH, moved
from ..offline.exponents import finite_time_exponents
from ..offline.search import orbits_among

# The first picture gives up starts after so many impacts: it has to be quick.
FIRST_CAP: Final = 400
# A level is shown anew so often while it is computed, and given up within about this time [s].
SHOWN_EVERY: Final = 0.4
STRIP: Final = 0.12
# A thorough search begins when the view has been left alone for so long [s].
SETTLED_AFTER: Final = 0.15
# Unresolved starts that are looked at for orbits which the search has missed.
LOOKED_AT: Final = 250


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
    """
    Compute a view, coarse to fine.

    Parameters
    ----------
    view : View
        What to compute.
    catalogues : Catalogues
        Known attractors.
    check : callable
        Called often; raises to give up.

    Yields
    ------
    Picture
        Finer and finer; also while a level is under way.

    """
    begin = time.monotonic()
    known = catalogues.quick(view)
    cells = min(COARSEST, view.finest())
    picture = _blank(view, known, cells, begin)
    for level in _level(picture, FIRST_CAP, begin, check, STRIP / COARSEST**2):
        picture = level
    spent = time.monotonic() - begin
    yield picture
    if np.any(picture.labels == UNRESOLVED) or not known.is_complete:
        _leave_alone(SETTLED_AFTER, check)
        known = catalogues.complete(view, check)
        known = _with_late(view, catalogues, known, picture)
        picture = _blank(view, known, cells, begin)
        since = time.monotonic()
        for level in _level(picture, CAP, begin, check, STRIP):
            picture = level
        spent = time.monotonic() - since
        yield picture
    while cells := following(cells, spent, view):
        # What is known of the level before stands in until the finer one is computed.
        rows = np.arange(cells) * picture.cells // cells
        picture = dataclasses.replace(
            picture, cells=cells, labels=picture.labels[np.ix_(rows, rows)],
            lifetimes=picture.lifetimes[np.ix_(rows, rows)],
            exponents=None if picture.exponents is None else picture.exponents[np.ix_(rows, rows)])
        since = shown = time.monotonic()
        for level in _level(picture, CAP, begin, check, spent / picture.cells**2):
            picture = level
            if time.monotonic() - shown > SHOWN_EVERY and picture.done < 1.0:
                shown = time.monotonic()
                yield picture
        spent = time.monotonic() - since
        yield dataclasses.replace(picture, is_last=not following(cells, spent, view))


def _blank(view: View, known: Known, cells: int, begin: float) -> Picture:
    return Picture(
        view, cells, 0.0, known, np.full((cells, cells), UNRESOLVED, np.int16),
        np.zeros((cells, cells), np.int32),
        np.zeros((cells, cells), np.float32) if view.kind == EXPONENTS else None,
        time.monotonic() - begin)


def _level(picture: Picture, cap: int, begin: float, check: Callable[[], None],
           per_cell: float) -> Iterator[Picture]:
    view, cells = picture.view, picture.cells
    plane = view.plane(cells)
    labels, lifetimes = picture.labels.copy(), picture.lifetimes.copy()
    exponents = None if picture.exponents is None else picture.exponents.copy()
    row = 0
    while row < cells:
        check()
        # As many as the threads take at once, or more where it is quick.
        rows = max(-(-2 * BATCH // cells), int(STRIP / (per_cell * cells)))
        last = min(cells, row + rows)
        starts = plane.starts(view.parameters, slice(row, last), slice(0, cells))
        results = picture.known.catalogue.label(starts, cap)
        labels[row:last] = results['label'].reshape(-1, cells)
        lifetimes[row:last] = results['lifetime'].reshape(-1, cells)
        if exponents is not None:
            exponents[row:last] = finite_time_exponents(starts, SPAN).reshape(-1, cells)
        row = last
        yield dataclasses.replace(
            picture, labels=labels, lifetimes=lifetimes, exponents=exponents, done=row / cells,
            seconds=time.monotonic() - begin)


def _with_late(view: View, catalogues: Catalogues, known: Known, picture: Picture) -> Known:
    """Look for orbits among the starts that the first picture has left unresolved."""
    left = np.flatnonzero(picture.labels == UNRESOLVED)
    if not len(left):
        return known
    starts = view.plane(picture.cells).starts(
        view.parameters, slice(0, picture.cells), slice(0, picture.cells))
    chosen = starts[left[::max(1, len(left) // LOOKED_AT)][:LOOKED_AT]]
    results = known.catalogue.label(chosen, CAP)
    states = moved(chosen, results)[results['label'] == UNRESOLVED]
    orbits = orbits_among(view.parameters, states, *GLANCE[1:], known.catalogue.tolerance)
    return catalogues.add(view, orbits) if orbits else known


def _leave_alone(seconds: float, check: Callable[[], None]) -> None:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        check()
        time.sleep(0.01)
