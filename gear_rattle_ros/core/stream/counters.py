"""Axes on which a stream is drawn: impact numbers and drive times that never go back."""

import dataclasses

import numpy as np
import numpy.typing as npt

from .guard import Piece
from ..arrays import FloatArray
from ..flight.elementary import TWO_PI
from ..model import EventArray


@dataclasses.dataclass(frozen=True)
class Place:
    """
    Where a stream stands on its axes.

    Attributes
    ----------
    impact : int
        Number of the last impact, counted on where the record's index is full or begins anew.
    cycle : int
        Completed drive periods, counted on in the same way.
    event : EVENT record
        The last event.

    """

    impact: int
    cycle: int
    event: np.void

    @property
    def drive_time(self) -> float:
        """Drive periods [1]."""
        return self.cycle + float(self.event['phase']) / TWO_PI


def ahead(event: np.void, before: np.void, name: str) -> int:
    """Return how far a counter, 'index' or 'cycle' modulo 2^32, has gone since `before`."""
    return (int(event[name]) - int(before[name])) % 2**32


def advanced(place: Place | None, piece: Piece) -> Place:
    """
    Go on to the end of a piece of the stream.

    Parameters
    ----------
    place : Place or None
        The end of the piece before it; None at the beginning.
    piece : Piece
        The next one; where it begins anew, the axes go on from where they are.

    Returns
    -------
    Place
        Its last event.

    """
    first, last = piece.events[0], piece.events[-1].copy()
    if place is None:
        impact, cycle, base = int(first['index']), int(first['cycle']), first
    elif piece.reason == 'restart':
        impact, cycle, base = place.impact + 1, place.cycle + 1, first
    else:
        impact, cycle, base = place.impact, place.cycle, place.event
    return Place(impact + ahead(last, base, 'index'), cycle + ahead(last, base, 'cycle'), last)


def impact_numbers(events: EventArray, place: Place) -> npt.NDArray[np.int64]:
    """
    Give every event the number of its impact.

    Parameters
    ----------
    events : ndarray of EVENT, shape (n,)
        Records that lead up to a place without a restart.
    place : Place
        The place.

    Returns
    -------
    ndarray of int, shape (n,)
        Number of the last impact at each.

    """
    return np.asarray(
        place.impact - (place.event['index'] - events['index']).astype(np.int64), np.int64)


def drive_times(events: EventArray, place: Place) -> FloatArray:
    """
    Give events their drive time.

    Parameters
    ----------
    events : ndarray of EVENT, shape (n,)
        Records that lead up to a place without a restart.
    place : Place
        The place.

    Returns
    -------
    ndarray of float, shape (n,)
        Drive periods [1].

    """
    cycles = place.cycle - (place.event['cycle'] - events['cycle']).astype(np.int64)
    return np.asarray(cycles + events['phase'] / TWO_PI, np.float64)
