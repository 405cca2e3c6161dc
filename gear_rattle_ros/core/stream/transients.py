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

"""Recognising periodic orbits and rest in a stream of events: where a transient ends."""

import dataclasses
import enum
import functools
import math
from typing import Any, Final

import numpy as np

from .guard import StreamGuard
from .hops import (
    AGAIN,
    AWAY,
    Hops,
    LOOKS,
    mean_round,
    RARELY,
    SOUGHT,
    sought,
    visited,
    visits,
)
from .lyapunov import RunningLyapunov
from ..arrays import FloatArray, Record, RecordArray
from ..compiled import kernel
from ..flight.closed_form import elapsed, LOWER, model_of, NO_WALL, release_delay, rests, UPPER
from ..flight.elementary import TWO_PI
from ..model import EventArray, EventKind, Parameters
from ..orbits.letters import letter_of
from ..orbits.orbit import close_orbit, Orbit
from ..orbits.section import distance, distances
from ..words import counted

IMPACT, STICK, RELEASE, RETUNE, RESET = (int(kind) for kind in EventKind)
# Longest periods [impacts]: counted at every impact, and looked for now and then.
LONGEST_ORBIT: Final = 64
LONGEST_SOUGHT: Final = 1024
# Twelve recurrences happen by chance near unstable orbits; this many more must follow.
HOLD: Final = 200
# Impacts until a candidate that still approaches is looked at again, or an eighth of those for
# which it has recurred.
PATIENCE: Final = 64
# Impacts kept: a lifetime can be counted back that far from where an orbit is recognised, and an
# orbit that sticks may have half as many.
HISTORY: Final = 65536
# Share of the tolerance that may be left of the approach.
APPROACHED: Final = 0.25
# Recurrences smaller than this share of the tolerance need no orbit by Newton's method.
RECURRED: Final = 1e-6
# Last impacts that give the mean orbit and the spread about it.
MEANT: Final = HOLD // 2
# A transient is reported again after this many impacts, and whenever they have doubled.
FIRST_REPORT: Final = 1000

# Kicks beyond this share of the tolerance hide how impacts recur. The share of impacts with such
# ones is remembered for this many impacts; below the last number noise has ended.
LOUD: Final = 0.1
REMEMBERED: Final = 32.0
CALM: Final = 0.01

# Jitter is what changes alpha, and nothing else, at the end of each of this many drive periods,
# and turns round in a quarter of them, as no ramp does. They give its mean and its deviation, of
# which one draw is never this multiple from the mean.
DRAWS: Final = 64
TURNS: Final = DRAWS // 4
FARTHEST: Final = 8.0
# The end of a period, as rounding has it [rad].
PERIOD_END: Final = 1e-9

NOTHING, CANDIDATE, LEFT, BEGUN, RESTED, JUMPED, GROWN, NOISY, HOPPED, CALMED = range(10)

SECTION: Final = np.dtype([
    ('wall', np.int64), ('phase', np.float64), ('velocity', np.float64),
    ('flight_time', np.float64), ('sticks', np.int64), ('kicked', np.int64),
], align=True)
WATCH: Final = np.dtype([
    ('impacts', np.int64), ('time', np.float64), ('locked', np.int64), ('base', np.int64),
    ('next_look', np.int64), ('next_report', np.int64), ('quiet', np.int64), ('resting', np.int64),
    ('retunes', np.int64), ('retune_index', np.int64), ('since_retune', np.int64),
    ('jumped', np.int64), ('kicked', np.int64), ('loud', np.float64),
    ('hopping', np.int64), ('home', np.int64), ('visited', np.int64), ('next_seek', np.int64),
    ('looks', np.int64), ('draws', np.int64), ('drawn', np.uint32), ('turns', np.int64),
    ('step', np.float64), ('mean', np.float64), ('squares', np.float64), ('stick_at', np.int64, 2),
    ('stick_lag', np.int64, 2), ('recurrences', np.int64, LONGEST_ORBIT + 1),
], align=True)


class Regime(enum.Enum):
    """What a trajectory is doing."""

    TRANSIENT = 'transient'
    ORBIT = 'orbit'
    REST = 'rest'


@dataclasses.dataclass(frozen=True)
class TransientReport:
    """What a trajectory is doing, and since when."""

    regime: Regime  #: Transient, on a periodic orbit, or permanently at rest on a wall.
    epoch: int = 0  #: Epoch of the stream at `index`.
    index: int = 0  #: Number of the impact at which this was found.
    #: Number of the impact after which this transient began, at a reset, at the beginning of the
    #: stream or after a hole; at the last retune by more than the tolerance, if it was a
    #: transient already; where an orbit was left, and at the last retune if that took it off.
    start: int = 0
    impacts: int = 0  #: Impacts of the transient that were seen; 0 where it is over.
    retunes: int = 0  #: Retunes since `start`.
    kicked: bool = False  #: Whether noise has kicked a transient.
    #: Impacts from `start` to the first from which the trajectory stays within the tolerance of
    #: its orbit, flight times too, or to the last at rest; None while it is transient. At least 2
    #: for an orbit at the beginning of a stream: the first impact has no flight before it.
    lifetime: int | None = None
    #: The orbit, beginning with the least (wall, phase), at the parameters of `epoch`, refined by
    #: Newton's method where that finds it, else the mean of the last impacts, whose multipliers
    #: are not known; multipliers are 0 where it sticks.
    orbit: Orbit | None = None
    spread_largest: float = math.nan  #: Distance of impacts kicked by noise from their mean orbit.
    spread_rms: float = math.nan  #: Its root mean square [1].
    #: Name of the orbit on which the trajectory was before, if it was on another and came here by
    #: noise, or by retunes no larger than the tolerance.
    previous: str = ''
    residence: int = 0  #: Impacts from the first on that orbit to the first on this one.
    #: Largest exponent of a transient per impact since `start` or the last retune [1]; where that
    #: is not known the finite-time exponent, without an error.
    exponent: float = math.nan
    exponent_error: float = math.nan  #: Its standard error [1].

    @property
    def period_impacts(self) -> int:
        """Period of the orbit in impacts; 0 off an orbit."""
        return 0 if self.orbit is None else self.orbit.impacts

    @property
    def period_drive(self) -> int:
        """Period of the orbit in drive periods; 0 off an orbit."""
        return 0 if self.orbit is None else self.orbit.drive_periods

    @property
    def multiplier(self) -> float:
        """Modulus of the orbit's leading multiplier [1]; nan where it is not known."""
        return math.nan if self.orbit is None else float(abs(self.orbit.multipliers[0]))

    @property
    def key(self) -> str:
        """Name of the orbit, the same in every tool; empty off an orbit."""
        return '' if self.orbit is None else self.orbit.key

    @functools.cached_property
    def letter(self) -> str:
        """Letter of the attractor in the paper; empty for none."""
        return '' if self.orbit is None else letter_of(self.orbit)

    def describe_attractor(self) -> str:
        """Return the report in one line of words that begins with the letter, if it has one."""
        return f'attractor {self.letter}: ' * bool(self.letter) + self.describe()

    def describe(self) -> str:
        """Return the report in one line of words."""
        after = f'after {counted(self.lifetime or 0, "impact")}'
        if self.regime is Regime.REST:
            return f'permanently at rest on a wall, {after}'
        if self.regime is Regime.TRANSIENT:
            if self.impacts < FIRST_REPORT:
                return f'transient since impact {self.start}'
            through = f' and {counted(self.retunes, "retune")}' if self.retunes else ''
            noise = 'noise beyond the tolerance, ' if self.kicked else ''
            return (f'no orbit in {counted(self.impacts, "impact")}{through} ({noise}chaos or a '
                    f'long transient){self._exponent_in_words()}')
        words = (f'orbit of {counted(self.period_impacts, "impact")} in '
                 f'{counted(self.period_drive, "drive period")}, {after}')
        if self.retunes:
            words += f', through {counted(self.retunes, "retune")}'
        if self.orbit is not None and self.orbit.sticks != NO_WALL:
            words += ', sticks in every period'
        if not math.isnan(self.spread_rms):
            words += (f', spread by noise {self.spread_rms:.1e} rms, '
                      f'{self.spread_largest:.1e} at the most')
        if self.previous:
            words += f', from {self.previous} after {counted(self.residence, "impact")}'
        return words

    def _exponent_in_words(self) -> str:
        if math.isnan(self.exponent):
            return ''
        if math.isinf(self.exponent):
            return ', largest exponent -inf: the gear has stuck and lost all memory'
        if math.isnan(self.exponent_error):
            return f', finite-time exponent {self.exponent:+.3f}'
        return f', largest exponent {self.exponent:+.4f} ± {self.exponent_error:.4f}'


@kernel
def rests_permanently(event: Record) -> bool:
    """Whether the gear is, after an event, permanently at rest on a wall."""
    model = model_of(event)
    return (rests(event.displacement, event.velocity_after, event.phase, model)
            and release_delay(event.displacement, event.phase, model) == math.inf)


@kernel
def is_small_step(a: Record, b: Record, tolerance: float) -> bool:
    """Whether no parameter of two events differs by more than the tolerance."""
    return (abs(a.alpha - b.alpha) <= tolerance and abs(a.beta - b.beta) <= tolerance
            and abs(a.gamma - b.gamma) <= tolerance
            and abs(a.restitution - b.restitution) <= tolerance)


@kernel
def is_jitter(watch: Record, a: Record, b: Record) -> bool:
    """Take a retune to `b` from `a`, records of a stream; return whether it is one of jitter."""
    w = watch
    step = b.alpha - a.alpha
    if b.phase > PERIOD_END or (a.beta != b.beta or a.gamma != b.gamma
                                or a.restitution != b.restitution):
        w.draws = 0
        return False
    if w.draws >= DRAWS:
        away = b.alpha - w.mean
        if away * away <= FARTHEST * FARTHEST * w.squares / DRAWS:
            return True
        w.draws = 0
    if w.draws == 0 or np.uint32(b.cycle - w.drawn) != 1:
        w.draws, w.turns, w.step, w.mean, w.squares = 0, 0, 0.0, 0.0, 0.0
    w.draws += 1
    w.drawn = b.cycle
    w.turns += 1 if step * w.step < 0.0 else 0
    w.step = step
    away = b.alpha - w.mean
    w.mean += away / w.draws
    w.squares += away * (b.alpha - w.mean)
    if w.draws == DRAWS and w.turns < TURNS:
        w.draws = 0
    return w.draws == DRAWS


@kernel
def begin_transient(watch: Record) -> None:
    """Leave any orbit and count from here; what recurs goes on recurring."""
    watch.locked = watch.resting = watch.next_look = watch.quiet = watch.retunes = 0
    watch.next_report = FIRST_REPORT
    watch.hopping = 0
    watch.next_seek = watch.impacts + SOUGHT
    watch.looks = 0


@kernel
def restart(watch: Record) -> None:
    """Forget all impacts."""
    watch.impacts = 0
    begin_transient(watch)
    watch.since_retune = watch.jumped = watch.kicked = 0
    watch.time = watch.loud = 0.0
    watch.draws = 0
    watch.retune_index = watch.stick_at[:] = -1
    watch.stick_lag[:] = watch.recurrences[:] = 0


@kernel
def watch_events(watch: Record, history: RecordArray, orbit: RecordArray, last: RecordArray,
                 events: RecordArray, tolerance: float, balls: RecordArray, tallies: RecordArray
                 ) -> tuple[int, int, int]:
    """Look at events, a stretch without a hole, until there is something to report."""
    # Returns how many were looked at, what to report (NOTHING to CALMED), and the period of a
    # candidate, also of one that holds where an orbit is left, or the orbit that was hopped to.
    # `last` becomes the last one looked at; `orbit` is the one that the trajectory is on, if any,
    # from impact `base` on; `balls` are the cores between which it hops.
    w = watch
    for i in range(len(events)):
        event = events[i]
        p = last[0]
        cycles = np.int64(np.int32(np.uint32(event.cycle) - np.uint32(p.cycle)))
        w.time += elapsed(cycles, p.phase, event.phase)
        is_small = is_small_step(p, event, tolerance)
        is_drawn = event.kind == RETUNE and is_jitter(w, p, event)
        last[0] = event
        if event.kind == RESET:
            return i + 1, BEGUN, 0
        if event.kind == RETUNE:
            w.retunes += 1
            if is_drawn:
                w.kicked = 1
            else:
                w.retune_index = event.index
                w.since_retune = 0
                w.jumped = 0 if is_small else 1
                w.kicked = 0
                w.next_seek = w.impacts + SOUGHT
                w.looks = 0
                if w.hopping == 1:
                    return i + 1, BEGUN, 0
                if w.locked > 0:
                    # Looked at anew when the parameters have stayed for a while.
                    w.next_look = w.impacts + 2 * w.locked + HOLD
            if rests_permanently(event):
                if w.resting == 0:
                    return i + 1, RESTED, 0
            elif w.resting == 1:
                return i + 1, BEGUN, 0
            elif w.locked == 0 and w.jumped and not is_drawn:
                return i + 1, JUMPED, 0
            continue
        if event.kind > STICK:
            continue
        n = w.impacts
        here = history[n % HISTORY]
        here.wall = UPPER if event.displacement == 0.0 else LOWER
        here.phase = event.phase
        here.velocity = event.velocity
        here.flight_time = w.time
        here.sticks = 1 if event.kind == STICK else 0
        here.kicked = 0
        is_loud = 0.0
        if event.kind == IMPACT and event.velocity_after != -event.restitution * event.velocity:
            here.kicked = w.kicked = 1
            if abs(event.velocity_after + event.restitution * event.velocity) > LOUD * tolerance:
                is_loud = 1.0
        w.loud += (is_loud - w.loud) / REMEMBERED
        w.time = 0.0
        w.impacts = n + 1
        w.since_retune += 1
        if w.hopping == 1:
            if event.kind == STICK and rests_permanently(event):
                return i + 1, RESTED, 0
            core = visited(balls, tallies, here)
            if core >= 0 and core != w.home:
                return i + 1, HOPPED, core
            if core >= 0:
                w.visited = n
                w.next_seek = n + SOUGHT
            elif w.home >= 0 and n - w.visited >= AWAY:
                return i + 1, HOPPED, -1
            elif n >= w.next_seek and w.looks < LOOKS + w.since_retune // RARELY:
                w.next_seek = n + max(AGAIN, (n - w.visited) // 8)
                w.looks += 1
                return i + 1, NOISY, 0
            if w.loud < CALM and w.draws < DRAWS:
                return i + 1, CALMED, 0
            continue
        # The flight to the first impact began anywhere: it recurs with nothing.
        longest = min(LONGEST_ORBIT, n - 1)
        found = 0
        for q in range(1, longest + 1):
            before = history[(n - q) % HISTORY]
            if distance(here.velocity, here.phase, before.velocity, before.phase) <= tolerance:
                w.recurrences[q] += 1
                if found == 0 and w.recurrences[q] >= 2 * q + HOLD:
                    found = q
            else:
                w.recurrences[q] = 0
        if event.kind == STICK:
            if rests_permanently(event):
                return i + 1, RESTED, 0
            # What follows a release depends on its wall and phase alone, however long it is.
            lag = n - w.stick_at[here.wall]
            if w.stick_at[here.wall] > 0 and 2 * lag < HISTORY:
                before = history[(n - lag) % HISTORY]
                if distance(here.velocity, here.phase, before.velocity, before.phase) > tolerance:
                    lag = 0
                elif lag == w.stick_lag[here.wall]:
                    found = lag
            w.stick_at[here.wall] = n
            w.stick_lag[here.wall] = lag
        if w.locked > 0:
            # In a ramp the orbit moves, with noise each impact alone is off it.
            before, point = history[(n - w.locked) % HISTORY], orbit[(n - w.base) % w.locked]
            if (distance(here.velocity, here.phase, before.velocity, before.phase) > tolerance
                    and distance(here.velocity, here.phase, point.velocity, point.phase)
                    > tolerance):
                return i + 1, LEFT, found
            if w.next_look > 0 and n >= w.next_look:
                w.next_look = n + w.since_retune
                return i + 1, CANDIDATE, w.locked
            continue
        w.quiet += 1
        if n >= w.next_seek and w.resting == 0:
            w.next_seek = n + max(AGAIN, w.quiet // 8)
            if w.loud > 0.5 or w.draws >= DRAWS:
                return i + 1, NOISY, 0
        if found > 0 and n >= w.next_look:
            held = w.recurrences[found] if found <= LONGEST_ORBIT else 0
            w.next_look = n + max(PATIENCE, held // 8)
            return i + 1, CANDIDATE, found
        if w.quiet >= w.next_report and w.resting == 0:
            w.next_report *= 2
            return i + 1, GROWN, 0
    return len(events), NOTHING, 0


@kernel
def long_recurrence(history: RecordArray, impacts: int, tolerance: float) -> int:
    """Find the smallest lag beyond `LONGEST_ORBIT` at which impacts have long recurred, or 0."""
    kept = min(impacts - 1, HISTORY)
    for q in range(LONGEST_ORBIT + 1, min(LONGEST_SOUGHT, (kept - HOLD) // 2) + 1):
        k = 0
        while k < q + HOLD:
            here = history[(impacts - 1 - k) % HISTORY]
            before = history[(impacts - 1 - k - q) % HISTORY]
            if distance(here.velocity, here.phase, before.velocity, before.phase) > tolerance:
                break
            k += 1
        if k == q + HOLD:
            return q
    return 0


class TransientDetector:
    """
    Find where a stream of events settles on a periodic orbit or comes to rest.

    Takes batches of any size; the result does not depend on how the stream was cut, to the bit.

    An orbit of q <= 64 impacts is recognised when every one of `HOLD` impacts, after two periods,
    lies within the tolerance of the one q before, at the same wall, in phase and velocity; when
    the flight times add up to whole drive periods, at least one (chatter's do not); and when
    Newton's method finds a stable orbit within a quarter of the tolerance of the last period.
    Where noise kicks the impacts, recurrence is enough; through kicks that are not far below the
    tolerance an orbit is recognised as `hops` describes, and the trajectory is on it until it
    visits the core of another, or none for long: a hop is a report of its own. Jitter of alpha is
    noise, too, once 64 drive periods have shown its mean, at which the orbits are then. Longer
    orbits, of at most 1024 impacts, are looked for whenever a transient is reported. An orbit that
    sticks is recognised, whatever its number of impacts, when two rounds from stick to stick are
    the same.

    An orbit is left when an impact is off it and does not recur. A retune does not end it, nor
    does a ramp: it is reported once more when the parameters have stayed for a while. A transient
    goes on through retunes by no more than the tolerance; a larger one begins a new transient. It
    is reported again whenever its impacts have doubled, from `FIRST_REPORT` on.

    Parameters
    ----------
    tolerance : float
        Largest distance from an orbit [1], between 0 and 1, else ValueError.

    """

    def __init__(self, tolerance: float = 1e-3) -> None:
        if not 0.0 < tolerance < 1.0:
            raise ValueError(f'tolerance = {tolerance!r} is outside (0, 1)')
        self.guard = StreamGuard()  #: What was lost.
        self._tolerance = tolerance
        self._watch = np.zeros(1, WATCH)
        self._history = np.zeros(HISTORY, SECTION)
        self._last: EventArray | None = None
        self._report = TransientReport(Regime.TRANSIENT)
        self._running = RunningLyapunov()
        # The orbit on which the trajectory was last: its impacts, name, and first impact there.
        self._home: tuple[RecordArray, str, int] | None = None
        self._orbit = np.zeros(1, SECTION)
        self.hops = Hops()  #: Orbits known through noise since the last retune, reset or hole.

    @property
    def report(self) -> TransientReport:
        """Return what the trajectory is doing now."""
        if self._report.regime is not Regime.TRANSIENT or self._last is None:
            return self._report
        now = self._running.report
        is_known = math.isfinite(now.lambda_1_error) or math.isinf(now.lambda_1)
        return dataclasses.replace(
            self._report, epoch=int(self._last['epoch'][0]), index=self._index(),
            impacts=int(self._watch[0]['quiet']),
            kicked=bool(self._watch[0]['kicked']), retunes=int(self._watch[0]['retunes']),
            exponent=now.lambda_1 if is_known else now.lambda_1_finite,
            exponent_error=now.lambda_1_error)

    @property
    def index(self) -> int:
        """Return the number of the last impact."""
        return self._index()

    @property
    def impacts(self) -> int:
        """Return the impacts since the present transient began."""
        return (self._index() - self._report.start) % 2**32

    def update(self, events: EventArray) -> list[TransientReport]:
        """Take the next batch, an array of EVENT, and return every change, in order."""
        changes: list[TransientReport] = []
        for piece in self.guard.split(events):
            stretch = piece.events
            if not piece.follows or self._last is None:
                self._last = stretch[:1].copy()
                stretch = stretch[1:]
                changes.append(self._restart())
            while len(stretch):
                done, what, period = watch_events(
                    self._watch[0], self._history, self._orbit, self._last, stretch,
                    self._tolerance, self.hops.balls, self.hops.tallies)
                if self._report.regime is Regime.TRANSIENT:
                    self._running.update(stretch[:done])
                stretch = stretch[done:]
                if what:
                    changes += self._answer(what, period)
        return changes

    def _answer(self, what: int, period: int) -> list[TransientReport]:
        assert self._last is not None
        watch: Any = self._watch[0]
        if what == BEGUN and self._last['kind'][0] == RESET:
            return [self._restart()]
        if what == GROWN:
            lag = long_recurrence(self._history, watch['impacts'], self._tolerance)
            return [(self._confirm(lag) if lag else None) or self.report]
        if what == NOISY:
            found = self._seek()
            return [found] if found else []
        if what == HOPPED:
            return [self._hop(period, watch['impacts'] - 1, watch['impacts'] - 1)]
        if what == CANDIDATE:
            settled = self._confirm(period)
            return [settled] if settled else []
        was_reported = self._report.regime is not Regime.TRANSIENT or watch['quiet'] >= HOLD
        self._depart(LEFT if what == CALMED else what)
        if what == RESTED:
            return [self._rest()]
        settled = self._confirm(period) if period else None
        if settled:
            return [settled]
        return [self._report] if was_reported else []

    def _index(self) -> int:
        return 0 if self._last is None else int(self._last['index'][0])

    def _restart(self) -> TransientReport:
        restart(self._watch[0])
        self.hops, self._home = Hops(), None
        self._begin(self._index())
        assert self._last is not None
        return self._rest() if rests_permanently(self._last[0]) else self._report

    def _depart(self, what: int) -> None:
        # Where the transient began that ends what was before, if anything was.
        watch: Any = self._watch[0]
        period, retune = int(watch['locked']), int(watch['retune_index'])
        if (what == RESTED and self._report.regime is Regime.TRANSIENT
                and watch['since_retune'] > 0):
            return
        by_retune = what != LEFT or not watch['kicked'] or watch['since_retune'] <= period + 1
        if by_retune and watch['jumped']:
            self._home = None
        elif period and self._home:
            # A ramp may have moved the orbit since it was recognised.
            self._home = (self._past(period + 1)[:-1], *self._home[1:])
        begin_transient(watch)
        self.hops = Hops()
        self._begin(retune if by_retune and retune >= 0 else self._index())

    def _seek(self) -> TransientReport | None:
        # An orbit through noise; its first visit may be long ago.
        assert self._last is not None
        watch: Any = self._watch[0]
        past, hops = self._past(SOUGHT), self.hops
        parameters = Parameters.of(self._last[0])
        if watch['draws'] >= DRAWS:
            parameters = dataclasses.replace(parameters, alpha=float(watch['mean']))
        found = sought(past, parameters)
        if found is None or not hops.learn(found[0].canonical(), found[1], past, self._tolerance):
            return None
        now = int(watch['impacts']) - 1
        alone = now - int(watch['visited']) if watch['hopping'] else int(watch['quiet'])
        first, last = visits(hops.balls, hops.tallies, self._past(min(alone, now, HISTORY)))
        if not watch['hopping']:
            watch['hopping'] = 1
            watch['stick_at'] = -1
            watch['stick_lag'] = watch['recurrences'] = 0
        return self._hop(len(hops.known) - 1, now - first, now - last)

    def _hop(self, owner: int, first: int, last: int) -> TransientReport:
        # To an orbit whose core impacts are in from the first to the last, or to none.
        assert self._last is not None
        watch: Any = self._watch[0]
        hops, left = self.hops, self._report.start
        if hops.home >= 0:
            left = self._number(watch['visited'])
        number = self._number(first)
        hops.enter(owner, number)
        watch['home'], watch['visited'] = owner, last
        if owner < 0:
            self._begin(left)
            return self._report
        known, (largest, rms) = hops.known[owner], hops.spread(owner)
        report = TransientReport(
            Regime.ORBIT, epoch=int(self._last['epoch'][0]), index=self._index(), start=left,
            lifetime=(number - left) % 2**32, orbit=known.orbit, spread_largest=largest,
            spread_rms=rms)
        self._report = self._at_home(report, known.points, number)
        return self._report

    def _at_home(self, report: TransientReport, impacts: RecordArray, first: int
                 ) -> TransientReport:
        # On an orbit from an impact on: where from, if that was another one.
        if self._home is None or not self._is_same(self._home[0], impacts):
            if self._home is not None:
                report = dataclasses.replace(report, previous=self._home[1], residence=(
                    first - self._home[2]) % 2**32)
            self._home = (impacts, report.key, first)
        return report

    def _number(self, place: int) -> int:
        # Of an impact of the history.
        return (self._index() - int(self._watch[0]['impacts']) + 1 + int(place)) % 2**32

    def _begin(self, start: int) -> None:
        assert self._last is not None
        self._report = TransientReport(
            Regime.TRANSIENT, epoch=int(self._last['epoch'][0]), index=self._index(), start=start)
        self._running = RunningLyapunov()
        self._running.update(self._last)

    def _rest(self) -> TransientReport:
        assert self._last is not None
        begin_transient(self._watch[0])
        self.hops = Hops()
        self._watch[0]['resting'] = 1
        self._report = TransientReport(
            Regime.REST, epoch=int(self._last['epoch'][0]), index=self._index(),
            start=self._report.start, lifetime=self.impacts)
        return self._report

    def _confirm(self, candidate: int) -> TransientReport | None:
        watch: Any = self._watch[0]
        n = int(watch['impacts'])
        past = self._past(min(n - 1, 2 * max(candidate, HOLD)))
        # A slow approach from alternating sides recurs at a multiple of the period first, and
        # next to a period doubling at half of it.
        periods = [p for p in range(1, candidate + 1)
                   if candidate % p == 0 and self._is_period(past, p, candidate)]
        if periods and 2 * candidate <= LONGEST_ORBIT and 4 * candidate < n:
            periods.append(2 * candidate)
        for period in periods:
            found = self._orbit_of(past, period)
            if found:
                return self._settle(*found, past)
        return None

    def _is_period(self, past: RecordArray, period: int, over: int) -> bool:
        apart = _distances(past[-over:], past[-over - period:-period])
        drive_periods = float(np.sum(past['flight_time'][-period:])) / TWO_PI
        turns = round(drive_periods)
        return (float(np.max(apart)) <= self._tolerance and turns >= 1
                and abs(drive_periods - turns) * TWO_PI <= period * self._tolerance)

    def _orbit_of(self, past: RecordArray, period: int) -> tuple[Orbit, RecordArray] | None:
        # The orbit that the last impacts are on, and its impacts, the last one last.
        assert self._last is not None
        event = self._last[0]
        parameters = Parameters.of(event)
        impacts = past[-period:].copy()
        turns = round(float(np.sum(impacts['flight_time'])) / TWO_PI)
        is_kicked = bool(np.any(past['kicked']))
        orbit = None
        sticks = impacts['wall'][impacts['sticks'] > 0]
        if not len(sticks):
            if is_kicked:
                impacts = _mean(past, period)
            refined = close_orbit(
                impacts['wall'], np.column_stack([impacts['phase'], impacts['velocity']]),
                parameters)
            if refined is not None and refined.impacts < period:
                return None
            if refined is not None and refined.is_stable and refined.drive_periods == turns:
                exact = impacts.copy()
                exact['phase'], exact['velocity'] = refined.points.T
                exact['flight_time'] = refined.flight_times
                left = float(np.max(_distances(impacts, exact)))
                if left > (1.0 if is_kicked else APPROACHED) * self._tolerance:
                    return None
                impacts, orbit = exact, refined
            elif not is_kicked and (refined is not None or float(np.max(_distances(
                    impacts, past[-2 * period:-period]))) > RECURRED * self._tolerance):
                return None
        if orbit is None:
            orbit = Orbit(
                parameters, impacts['wall'].copy(), np.column_stack(
                    [impacts['phase'], impacts['velocity']]), impacts['flight_time'].copy(), turns,
                np.full(2, 0.0 if len(sticks) else math.nan, np.complex128),
                int(sticks[0]) if len(sticks) else NO_WALL)
        return orbit.canonical(), impacts

    def _settle(self, orbit: Orbit, impacts: RecordArray, past: RecordArray) -> TransientReport:
        assert self._last is not None
        watch: Any = self._watch[0]
        was, period, n = self._report, orbit.impacts, int(watch['impacts'])
        self._orbit, watch['base'] = impacts, n
        largest = rms = math.nan
        if np.any(past['kicked']):
            apart = _distances(*_laid_along(past[-max(MEANT, period):], _mean(past, period)))
            largest, rms = float(np.max(apart)), math.sqrt(float(np.mean(apart * apart)))
        report = TransientReport(
            Regime.ORBIT, epoch=int(self._last['epoch'][0]), index=self._index(), start=was.start,
            retunes=int(watch['retunes']), lifetime=was.lifetime, orbit=orbit,
            spread_largest=largest, spread_rms=rms)
        if was.regime is Regime.ORBIT:
            # Followed through retunes, and reported again.
            report = dataclasses.replace(report, previous=was.previous, residence=was.residence)
            watch['next_look'] = 0
            if self._home:
                self._home = (impacts, report.key, self._home[2])
        else:
            kept = min(n - 1, HISTORY)
            all_past, along = _laid_along(self._past(kept), impacts)
            apart = np.maximum(_distances(all_past, along), np.abs(
                all_past['flight_time'] - along['flight_time']))
            outside = np.flatnonzero(apart > self._tolerance)
            first = self._index() - (kept - 1 - (int(outside[-1]) + 1 if len(outside) else 0))
            lifetime = (first - was.start + 2**31) % 2**32 - 2**31
            report = self._at_home(
                dataclasses.replace(report, lifetime=max(lifetime, 0)), impacts, first)
            watch['locked'], watch['next_look'], watch['resting'] = period, 0, 0
        self._report = report
        return report

    def _is_same(self, a: RecordArray, b: RecordArray) -> bool:
        if len(a) != len(b):
            return False
        # Each may be off the orbit by the tolerance.
        near = 2.0 * self._tolerance
        lags = np.flatnonzero(_distances(b, np.repeat(a[:1], len(b))) <= near)
        return any(float(np.max(_distances(a, np.roll(b, -k)))) <= near for k in lags)

    def _past(self, count: int) -> RecordArray:
        # Oldest first; the very first impact of a stretch has no flight time.
        n = int(self._watch[0]['impacts'])
        return self._history[np.arange(n - count, n) % HISTORY]


def _distances(a: RecordArray, b: RecordArray) -> FloatArray:
    return distances(a['velocity'], a['phase'], b['velocity'], b['phase'])


def _laid_along(past: RecordArray, impacts: RecordArray) -> tuple[RecordArray, RecordArray]:
    # An orbit beside the impacts that end with its last one.
    return past, impacts[np.arange(-len(past), 0) % len(impacts)]


def _mean(past: RecordArray, period: int) -> RecordArray:
    return mean_round(past[-max(MEANT // period, 1) * period:].reshape(-1, period))
