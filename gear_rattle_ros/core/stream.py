"""Whether a stream of events is whole: holes by index and epoch, and restarts."""

import dataclasses

import numpy as np

from .model import EventArray, EventKind



@dataclasses.dataclass(frozen=True)
class Piece:
    """
    A stretch of events without a hole.

    Attributes
    ----------
    events : ndarray of EVENT, shape (n,)
        The records, n > 0.
    follows : bool
        Whether the first record follows from the last one seen before it.
    lost : int
        Impacts missing before the first record; 0 where it follows, where only other records
        are missing, at the very beginning and at a restart.
    reason : str
        Why it does not follow: 'start', 'gap', 'restart'; empty where it does.

    """

    events: EventArray
    follows: bool
    lost: int
    reason: str


class StreamGuard:
    """
    Cut a stream, given in batches of any size, where it has a hole.

    Attributes
    ----------
    lost : int
        Impacts that were never seen.
    gaps : int
        Holes found.
    restarts : int
        Times the numbering began anew.
    first_index : int or None
        Number of the last impact in or before the first record seen.

    """

    def __init__(self) -> None:
        self.first_index: int | None = None
        self.lost = 0
        self.gaps = 0
        self.restarts = 0
        self._last: EventArray | None = None

    def split(self, events: EventArray) -> list[Piece]:
        """
        Take the next batch.

        Parameters
        ----------
        events : ndarray of EVENT, shape (n,)
            The records.

        Returns
        -------
        list of Piece
            The batch, cut at every hole.

        """
        if not len(events):
            return []
        if self._last is None:
            self.first_index = int(events['index'][0])
            chain = events
            follows = np.empty(len(events), bool)
            follows[0] = False
            first = 1
        else:
            chain = np.concatenate([self._last, events])
            follows = np.empty(len(events), bool)
            first = 0
        before, after = chain[:-1], chain[1:]
        counted = after['kind'] <= EventKind.STICK
        begins = after['kind'] >= EventKind.RETUNE
        # A mass that sticks hits nothing before it is released.
        lone = (before['kind'] == EventKind.STICK) & counted
        expected = before['index'] + counted.astype(np.uint32)
        jump = (after['index'] - expected).astype(np.int32)
        follows[first:] = (jump == 0) & ~lone & (
            after['epoch'] == before['epoch'] + begins.astype(np.uint32))
        pieces = []
        cuts = [0, *(int(i) for i in np.flatnonzero(~follows) if i > 0), len(events)]
        for start, stop in zip(cuts[:-1], cuts[1:], strict=True):
            piece = events[start:stop]
            if follows[start]:
                pieces.append(Piece(piece, True, 0, ''))
            elif self._last is None and start == 0:
                pieces.append(Piece(piece, False, 0, 'start'))
            else:
                pieces.append(self._hole(piece, int(jump[start - first])))
        self._last = events[-1:].copy()
        return pieces

    def _hole(self, piece: EventArray, jump: int) -> Piece:
        is_new = piece['kind'][0] == EventKind.RESET and piece['index'][0] == 0
        if jump < 0 or is_new:
            self.restarts += 1
            return Piece(piece, False, 0, 'restart')
        self.gaps += 1
        self.lost += jump
        return Piece(piece, False, jump, 'gap')
