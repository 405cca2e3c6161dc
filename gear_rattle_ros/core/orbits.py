"""Recognising periodic orbits and rest in a stream of events: where a transient ends."""

import dataclasses
import enum
import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from .compiled import kernel
from .elementary import sine_cosine, TWO_PI
from .flight import elapsed, is_pressed, LOWER, release_delay, UPPER
from .model import EventArray, EventKind, Wall
from .stream import StreamGuard

IMPACT, STICK, RELEASE, RETUNE, RESET = (int(kind) for kind in EventKind)
LONGEST_ORBIT: Final = 64
# Twelve recurrences happen by chance near unstable orbits; so many more must follow.
HOLD: Final = 200
# A candidate that is still approaching is looked at again after so many impacts, or an eighth of
# those for which it has recurred ...
PATIENCE: Final = 64
# ... over so many of the last impacts.
LOOK: Final = 1024
# Impacts kept: a lifetime is counted back so far from where an orbit is recognised.
HISTORY: Final = 65536
# So much of the tolerance may be left of the approach.
APPROACHED: Final = 0.25
# Recurrences smaller than this are rounding [1].
ROUNDING_FLOOR: Final = 1e-11

NOTHING, CANDIDATE, LEFT, BEGUN, RESTED = range(5)

SECTION: Final = np.dtype(
    [
        ('wall', np.int64),
        ('phase', np.float64),
        ('velocity', np.float64),
        ('flight_time', np.float64),
        ('sticks', np.int64),
    ],
    align=True,
)
WATCH: Final = np.dtype(
    [
        ('impacts', np.int64),
        ('time', np.float64),
        ('locked', np.int64),
        ('next_look', np.int64),
        ('recurrences', np.int64, LONGEST_ORBIT + 1),
    ],
    align=True,
)


class Regime(enum.Enum):
    """What a trajectory is doing."""

    TRANSIENT = 'transient'
    ORBIT = 'orbit'
    REST = 'rest'


@dataclasses.dataclass(frozen=True)
class OrbitPoint:
    """
    One impact of a periodic orbit.

    Attributes
    ----------
    wall : Wall
        Which.
    phase : float
        Drive phase [rad].
    velocity : float
        Just before the impact [1].
    flight_time : float
        Since the impact before [1].

    """

    wall: Wall
    phase: float
    velocity: float
    flight_time: float


@dataclasses.dataclass(frozen=True)
class TransientReport:
    """
    What a trajectory is doing, since when.

    Attributes
    ----------
    regime : Regime
        Transient, on a periodic orbit, or at rest on a wall for ever.
    epoch : int
        Epoch of the stream.
    index : int
        Number of the impact at which this was found.
    start : int
        Number of the impact after which this transient began: at a retune, reset or kick, at
        the beginning of the stream, or after a hole.
    lifetime : int or None
        Impacts from there to the first from which the trajectory stays within the tolerance of
        its orbit, or to the last at rest; None while it is transient. At least 2 for an orbit:
        the first impact has no flight before it to compare.
    period_impacts, period_drive : int
        Period of the orbit in impacts and in drive periods; 0 off an orbit.
    multiplier : float
        Modulus of the orbit's leading multiplier per period, from the rate of approach [1]; 0
        where the orbit sticks, nan where the approach was too fast to see.
    points : tuple of OrbitPoint
        The orbit, beginning with the least (wall, phase).

    """

    regime: Regime
    epoch: int = 0
    index: int = 0
    start: int = 0
    lifetime: int | None = None
    period_impacts: int = 0
    period_drive: int = 0
    multiplier: float = math.nan
    points: tuple[OrbitPoint, ...] = ()

    def describe(self) -> str:
        """
        Put the report in words.

        Returns
        -------
        str
            One line.

        """
        if self.regime is Regime.ORBIT:
            impacts = 'impact' if self.period_impacts == 1 else 'impacts'
            periods = 'period' if self.period_drive == 1 else 'periods'
            return (f'orbit of {self.period_impacts} {impacts} in {self.period_drive} drive '
                    f'{periods}, after {self.lifetime} impacts')
        if self.regime is Regime.REST:
            return f'at rest on a wall for ever, after {self.lifetime} impacts'
        return f'transient since impact {self.start}'


@kernel
def distance(a, b):  # type: ignore[no-untyped-def]
    """
    Compare two impacts.

    Parameters
    ----------
    a, b : SECTION record
        The impacts.

    Returns
    -------
    float
        Largest difference in phase (around the circle), velocity and flight time [1]; inf at
        different walls.

    """
    if a.wall != b.wall:
        return math.inf
    turn = abs(a.phase - b.phase)
    turn = min(turn, TWO_PI - turn)
    return max(turn, max(abs(a.velocity - b.velocity), abs(a.flight_time - b.flight_time)))


@kernel
def rests_for_ever(event):  # type: ignore[no-untyped-def]
    """
    Tell whether the mass will stay where it is after an event.

    Parameters
    ----------
    event : EVENT record
        The event.

    Returns
    -------
    bool
        Whether it is at rest on a wall that it is never released from.

    """
    upper = event.displacement == 0.0
    if event.velocity_after != 0.0 or not (upper or event.displacement == -1.0):
        return False
    towards = 1.0 if upper else -1.0
    sin_p, cos_p = sine_cosine(event.phase)
    if not is_pressed(towards, sin_p, cos_p, event.alpha, event.beta, event.gamma):
        return False
    return release_delay(towards, event.phase, event.alpha, event.beta, event.gamma) == math.inf


@kernel
def restart(watch):  # type: ignore[no-untyped-def]
    """
    Forget all impacts.

    Parameters
    ----------
    watch : WATCH record
        Changed in place.

    """
    watch.impacts = 0
    watch.locked = 0
    watch.next_look = 0
    watch.recurrences[:] = 0


@kernel
def watch_events(watch, history, last, events, tolerance):  # type: ignore[no-untyped-def]
    """
    Look at events until something is to be said.

    Parameters
    ----------
    watch : WATCH record
        Changed in place.
    history : ndarray of SECTION, shape (HISTORY,)
        The last impacts; changed in place.
    last : ndarray of EVENT, shape (1,)
        The event before; changed in place to the last one looked at.
    events : ndarray of EVENT, shape (n,)
        A stretch without a hole.
    tolerance : float
        Largest distance of a recurrence [1].

    Returns
    -------
    tuple of int
        How many events were looked at, what is to be said (NOTHING, CANDIDATE, LEFT, BEGUN or
        RESTED), and the period of a candidate.

    """
    w = watch
    for i in range(len(events)):
        event = events[i]
        p = last[0]
        cycles = np.int64(np.int32(np.uint32(event.cycle) - np.uint32(p.cycle)))
        w.time += elapsed(cycles, p.phase, event.phase)
        last[0] = event
        if event.kind == RETUNE or event.kind == RESET:
            restart(w)
            w.time = 0.0
            return i + 1, BEGUN, 0
        if event.kind > STICK:
            continue
        n = w.impacts
        here = history[n % HISTORY]
        here.wall = UPPER if event.displacement == 0.0 else LOWER
        here.phase = event.phase
        here.velocity = event.velocity
        here.flight_time = w.time
        here.sticks = 1 if event.kind == STICK else 0
        w.time = 0.0
        w.impacts = n + 1
        # The flight to the first impact began anywhere: it recurs with nothing.
        longest = min(LONGEST_ORBIT, n - 1)
        found = 0
        for q in range(1, longest + 1):
            if distance(here, history[(n - q) % HISTORY]) <= tolerance:
                w.recurrences[q] += 1
                if found == 0 and w.recurrences[q] >= 2 * q + HOLD:
                    found = q
            else:
                w.recurrences[q] = 0
        if event.kind == STICK and rests_for_ever(event):
            w.locked = 0
            return i + 1, RESTED, 0
        if w.locked > 0:
            if w.recurrences[w.locked] == 0:
                restart(w)
                return i + 1, LEFT, 0
        elif found > 0 and w.impacts >= w.next_look:
            w.next_look = w.impacts + max(PATIENCE, w.recurrences[found] // 8)
            return i + 1, CANDIDATE, found
    return len(events), NOTHING, 0


class TransientDetector:
    """
    Find where a stream of events settles on a periodic orbit or comes to rest.

    Takes batches of any size; the result does not depend on how the stream was cut, to the bit.

    An orbit of q impacts is recognised when every one of `HOLD` impacts, after two periods, lies
    within the tolerance of the one q before, at the same wall, in phase, velocity and flight
    time; when the flight times add up to whole drive periods, at least one (chatter's do not);
    and when what is left of the approach, judged by its rate, is within a quarter of
    the tolerance.

    Parameters
    ----------
    tolerance : float
        Largest distance from an orbit [1].

    Attributes
    ----------
    guard : StreamGuard
        What was lost.

    Raises
    ------
    ValueError
        If the tolerance is not between 0 and 1.

    """

    def __init__(self, tolerance: float = 1e-3) -> None:
        if not 0.0 < tolerance < 1.0:
            raise ValueError(f'tolerance = {tolerance!r} is outside (0, 1)')
        self.guard = StreamGuard()
        self._tolerance = tolerance
        self._watch = np.zeros(1, WATCH)
        self._history = np.zeros(HISTORY, SECTION)
        self._last: EventArray | None = None
        self._report = TransientReport(Regime.TRANSIENT)

    @property
    def report(self) -> TransientReport:
        """Return what the trajectory is doing now."""
        return self._report

    @property
    def impacts(self) -> int:
        """Return the impacts since the present transient began."""
        return (int(self._index()) - self._report.start) % 2**32

    def update(self, events: EventArray) -> list[TransientReport]:
        """
        Take the next batch.

        Parameters
        ----------
        events : ndarray of EVENT, shape (n,)
            The records.

        Returns
        -------
        list of TransientReport
            Every change, in order.

        """
        changes: list[TransientReport] = []
        for piece in self.guard.split(events):
            stretch = piece.events
            if not piece.follows or self._last is None:
                self._last = stretch[:1].copy()
                stretch = stretch[1:]
                restart(self._watch[0])
                self._watch[0]['time'] = 0.0
                changes.append(self._begin())
            while len(stretch):
                done, what, period = watch_events(
                    self._watch[0], self._history, self._last, stretch, self._tolerance)
                stretch = stretch[done:]
                if what == CANDIDATE:
                    orbit = self._confirm(period)
                    if orbit is not None:
                        self._report = orbit
                        changes.append(orbit)
                elif what == RESTED:
                    changes.append(self._rest())
                elif what in (BEGUN, LEFT):
                    changes.append(self._begin())
        return changes

    def _index(self) -> int:
        return 0 if self._last is None else int(self._last['index'][0])

    def _begin(self) -> TransientReport:
        assert self._last is not None
        epoch = int(self._last['epoch'][0])
        self._report = TransientReport(
            Regime.TRANSIENT, epoch=epoch, index=self._index(), start=self._index())
        return self._rest() if rests_for_ever(self._last[0]) else self._report

    def _rest(self) -> TransientReport:
        self._report = TransientReport(
            Regime.REST, epoch=self._report.epoch, index=self._index(), start=self._report.start,
            lifetime=self.impacts)
        return self._report

    def _confirm(self, period: int) -> TransientReport | None:
        watch: Any = self._watch[0]
        n = int(watch['impacts'])
        past = self._past(min(n - 1, LOOK))
        # A slow approach from alternating sides recurs at a multiple of the period first.
        found = next(
            (p for p in range(1, period + 1)
             if period % p == 0 and self._is_period(past, p, period)), None)
        if found is None:
            return None
        period = found
        turns = round(float(np.sum(past['flight_time'][-period:])) / TWO_PI)
        run = min(int(watch['recurrences'][period]), len(past) - period)
        recurrences = _distances(past[-run:], past[-run - period:-period])
        multiplier, remaining = _approach(recurrences, period)
        if remaining > APPROACHED * self._tolerance:
            return None
        orbit = past[-period:]
        if np.any(orbit['sticks']):
            multiplier = 0.0
        kept = min(n - 1, HISTORY)
        past = self._past(kept)
        aligned = orbit[np.arange(-kept, 0) % period]
        outside = np.flatnonzero(_distances(past, aligned) > self._tolerance)
        first = n - kept + (int(outside[-1]) + 1 if len(outside) else 0)
        watch['locked'] = period
        start = self._report.start
        points = [OrbitPoint(Wall(point['wall']), *point.item()[1:4]) for point in orbit]
        least = min(range(period), key=lambda k: (points[k].wall, points[k].phase))
        return TransientReport(
            Regime.ORBIT,
            epoch=self._report.epoch,
            index=self._index(),
            start=start,
            lifetime=(self._index() - (n - 1 - first) - start) % 2**32,
            period_impacts=period,
            period_drive=turns,
            multiplier=multiplier,
            points=tuple(points[least:] + points[:least]),
        )

    def _past(self, count: int) -> npt.NDArray[np.void]:
        # Oldest first; the very first impact of a transient has no flight time.
        n = int(self._watch[0]['impacts'])
        return self._history[np.arange(n - count, n) % HISTORY]

    def _is_period(self, past: npt.NDArray[np.void], period: int, over: int) -> bool:
        apart = _distances(past[-over:], past[-over - period:-period])
        drive_periods = float(np.sum(past['flight_time'][-period:])) / TWO_PI
        turns = round(drive_periods)
        return (float(np.max(apart)) <= self._tolerance and turns >= 1
                and abs(drive_periods - turns) * TWO_PI <= period * self._tolerance)


def _distances(a: npt.NDArray[np.void], b: npt.NDArray[np.void]) -> npt.NDArray[np.float64]:
    turn = np.abs(a['phase'] - b['phase'])
    turn = np.minimum(turn, TWO_PI - turn)
    apart = np.maximum(turn, np.abs(a['velocity'] - b['velocity']))
    apart = np.maximum(apart, np.abs(a['flight_time'] - b['flight_time']))
    return np.where(a['wall'] == b['wall'], apart, np.inf)


def _approach(recurrences: npt.NDArray[np.float64], period: int) -> tuple[float, float]:
    # Modulus of the leading multiplier per period, and how far the orbit still is.
    nearest = float(np.max(recurrences[-period:]))
    seen = np.flatnonzero(recurrences > ROUNDING_FLOOR)
    if len(seen) < max(2 * period, 8):
        return math.nan, nearest
    slope = np.polyfit(seen.astype(float), np.log(recurrences[seen]), 1)[0]
    multiplier = math.exp(float(slope) * period)
    if nearest <= ROUNDING_FLOOR:
        return multiplier, nearest
    return multiplier, nearest * multiplier / (1.0 - multiplier) if multiplier < 1.0 else math.inf
