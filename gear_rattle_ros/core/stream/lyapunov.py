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

"""Running Lyapunov exponents of a stream of events."""

import dataclasses
import math
from typing import Any, Final

import numpy as np

from .guard import StreamGuard
from ..arrays import FloatArray, IntArray, Record, RecordArray
from ..compiled import kernel
from ..flight.closed_form import elapsed, model_of
from ..flight.elementary import length, logarithm, sine_cosine
from ..flight.tangent import flight_matrix, impact_matrix, log_determinant
from ..model import EventArray, EventKind

IMPACT, STICK, RELEASE, RETUNE, RESET = (int(kind) for kind in EventKind)
# Standard errors: block means over blocks that double in length when this many are full.
BLOCKS: Final = 64
FIRST_BLOCK: Final = 16
FEWEST_BLOCKS: Final = 16

ESTIMATE: Final = np.dtype([
    ('basis', np.float64, 4), ('impacts', np.int64), ('sticks', np.int64), ('ringed', np.int64),
    ('retunes', np.int64), ('retunes_before', np.int64), ('carried', np.float64),
    ('origin', np.float64), ('impulse', np.float64, 2), ('exact_impulse', np.float64, 2),
    ('duration', np.float64, 2), ('sum_1', np.float64, 2), ('sum_2', np.float64, 2),
    ('exact', np.float64, 2), ('time', np.float64, 2), ('pending_exact', np.float64),
    ('pending_time', np.float64), ('block_length', np.int64), ('blocks', np.int64),
    ('in_block', np.int64), ('block_1', np.float64, BLOCKS + 1),
    ('block_2', np.float64, BLOCKS + 1),
], align=True)


@dataclasses.dataclass(frozen=True)
class LyapunovReport:
    """Exponents per impact, averaged over one epoch."""

    epoch: int  #: The epoch averaged over; parameters are constant in it.
    index: int  #: Number of the last impact seen.
    impacts: int  #: Impacts averaged over.
    sticks: int  #: Impacts of these at which the gear stuck.
    lambda_1: float  #: Exponent per impact [1]; nan without impacts, -inf if the gear has stuck.
    lambda_2: float  #: The smaller exponent per impact [1].
    lambda_1_error: float  #: Standard error by block means [1]; nan with too few impacts.
    lambda_2_error: float  #: Standard error of lambda_2 [1].
    exact_sum: float  #: lambda_1 + lambda_2 by eq. (11), ``2 ln r - beta <D>`` [1].
    #: Largest exponent over the last `window` impacts [1], also across retunes, at which the
    #: tangent is continuous; nan until there are that many.
    lambda_1_finite: float
    window: int  #: Impacts in the finite-time exponent.
    finite_retunes: int  #: Retunes among these impacts.
    mean_flight_time: float  #: Time per impact [1]; divide by it for exponents per unit of tau.
    #: Mean force of the walls since the last reset [1], from velocity changes at impacts and the
    #: force on the gear while it sticks. It tends to gamma, off by a bounded amount over the time.
    impulse_balance: float
    exact_impulse_balance: float  #: What it must be, from the states at both ends [1].

    @property
    def exponent_sum(self) -> float:
        """Return the sum of both exponents [1]."""
        return self.lambda_1 + self.lambda_2


@kernel
def add(total: FloatArray, x: float) -> None:
    """Add to a compensated sum (Neumaier 1974), a pair with what rounding has taken from it."""
    fresh = total[0] + x
    if abs(total[0]) >= abs(x):
        total[1] += (total[0] - fresh) + x
    else:
        total[1] += (x - fresh) + total[0]
    total[0] = fresh


@kernel
def momentum(event: Record, at: Record) -> float:
    """Return what gamma and the walls alone change, with the parameters of another event."""
    sine, cosine = sine_cosine(event.phase)
    return (event.velocity_after + at.beta * event.displacement
            - at.alpha * (cosine + at.beta * sine))


@kernel
def has_stuck(before: Record, event: Record) -> bool:
    """Whether the gear has been at rest on a wall from one event to the next."""
    if event.kind == RELEASE or before.kind == STICK:
        return True
    on_wall = before.displacement == 0.0 or before.displacement == -1.0
    return (before.kind != RELEASE and on_wall and before.velocity_after == 0.0
            and event.velocity == 0.0 and event.displacement == before.displacement)


@kernel
def weigh(estimate: Record, before: Record, event: Record, d: float) -> None:
    """Add the impulse of the walls from one event to the next, and what it must be."""
    add(estimate.duration, d)
    add(estimate.exact_impulse, before.gamma * d)
    if event.kind <= STICK:
        add(estimate.impulse, event.velocity - event.velocity_after)
    elif has_stuck(before, event):
        # The wall has held the gear against all other forces.
        add(estimate.impulse,
            before.gamma * d - (momentum(event, before) - momentum(before, before)))
    if event.kind == RETUNE:
        add(estimate.exact_impulse, estimate.origin - momentum(event, before))
        estimate.origin = momentum(event, event)


@kernel
def begin(estimate: Record) -> None:
    """Begin a new average, keeping the tangent vectors and all that crosses retunes."""
    e = estimate
    e.impacts = e.sticks = e.blocks = e.in_block = 0
    e.block_length = FIRST_BLOCK
    e.pending_exact = e.pending_time = 0.0
    e.sum_1[:] = e.sum_2[:] = e.exact[:] = e.time[:] = e.block_1[:] = e.block_2[:] = 0.0


@kernel
def restart(estimate: Record, event: Record) -> None:
    """Begin anew at an event: what was before is not known, or does not matter."""
    begin(estimate)
    set_identity(estimate.basis)
    estimate.ringed = estimate.retunes = estimate.retunes_before = 0
    estimate.carried = 0.0
    estimate.impulse[:] = estimate.exact_impulse[:] = estimate.duration[:] = 0.0
    estimate.origin = momentum(event, event)


@kernel
def set_identity(basis: FloatArray) -> None:
    """Forget the tangent vectors."""
    basis[0] = basis[3] = 1.0
    basis[1] = basis[2] = 0.0


@kernel
def orthonormalise(basis: FloatArray) -> tuple[float, float]:
    """QR-decompose two tangent vectors in place; return the diagonal of R (Gram-Schmidt)."""
    first = length(basis[0], basis[1])
    if not 0.0 < first < math.inf:
        # What a record with absurd velocities has spoilt must not outlive its epoch.
        set_identity(basis)
        return first, 0.0 if first == 0.0 else math.nan
    x, y = basis[0] / first, basis[1] / first
    second = abs(x * basis[3] - y * basis[2])
    basis[0] = basis[3] = x
    basis[1], basis[2] = y, -y
    return first, second


@kernel
def count_impact(estimate: Record, ring: FloatArray, marks: IntArray, growth_1: float,
                 growth_2: float, exact: float) -> None:
    """Enter the growth of both vectors over one impact: ln of R's diagonal, and the exact sum."""
    e = estimate
    place = e.ringed % len(ring)
    ring[place] = e.carried + growth_1
    marks[place] = e.retunes_before
    e.carried = 0.0
    e.retunes_before = e.retunes
    e.ringed += 1
    e.impacts += 1
    add(e.sum_1, growth_1)
    add(e.sum_2, growth_2)
    add(e.exact, exact + e.pending_exact)
    add(e.time, e.pending_time)
    e.pending_exact = e.pending_time = 0.0
    e.block_1[e.blocks] += growth_1
    e.block_2[e.blocks] += growth_2
    e.in_block += 1
    if e.in_block < e.block_length:
        return
    e.in_block = 0
    e.blocks += 1
    if e.blocks == BLOCKS:
        for i in range(BLOCKS // 2):
            e.block_1[i] = e.block_1[2 * i] + e.block_1[2 * i + 1]
            e.block_2[i] = e.block_2[2 * i] + e.block_2[2 * i + 1]
        e.blocks = BLOCKS // 2
        e.block_length *= 2
    e.block_1[e.blocks] = e.block_2[e.blocks] = 0.0


@kernel
def follow(estimate: Record, ring: FloatArray, marks: IntArray, last: RecordArray,
           events: RecordArray) -> None:
    """Carry the tangent vectors through a stretch of events without a hole."""
    # `last` is the event before and becomes the last of these; `ring` and `marks` keep the last
    # growth rates and the retunes before the flight of each.
    e = estimate
    basis = e.basis
    restitution = math.nan
    contraction = math.nan
    for i in range(len(events)):
        p = events[i - 1] if i else last[0]
        event = events[i]
        cycles = np.int64(np.int32(np.uint32(event.cycle) - np.uint32(p.cycle)))
        d = elapsed(cycles, p.phase, event.phase)
        weigh(e, p, event, d)
        if event.kind == RESET:
            restart(e, event)
        elif event.kind == RELEASE:
            # No flight, and nothing is remembered of what was before it.
            e.pending_time += d
            e.carried = 0.0
            set_identity(basis)
        else:
            integral, decay = flight_matrix(d, p.beta)
            basis[0] += integral * basis[1]
            basis[2] += integral * basis[3]
            basis[1] *= decay
            basis[3] *= decay
            e.pending_time += d
            e.pending_exact -= p.beta * d
            if event.kind == RETUNE:
                first, _ = orthonormalise(basis)
                e.carried += logarithm(first)
                e.retunes += 1
                begin(e)
            elif event.kind == STICK:
                e.sticks += 1
                count_impact(e, ring, marks, -math.inf, -math.inf, -math.inf)
                set_identity(basis)
            else:
                s11, s21, s22 = impact_matrix(
                    event.phase, event.velocity, event.velocity_after, model_of(p))
                basis[1] = s21 * basis[0] + s22 * basis[1]
                basis[3] = s21 * basis[2] + s22 * basis[3]
                basis[0] *= s11
                basis[2] *= s11
                first, second = orthonormalise(basis)
                if p.restitution != restitution:
                    restitution = p.restitution
                    contraction = 2.0 * logarithm(restitution)
                count_impact(
                    e, ring, marks, logarithm(first), logarithm(second), log_determinant(
                        event.velocity, event.velocity_after, restitution, contraction))
    if len(events):
        last[0] = events[len(events) - 1]


class RunningLyapunov:
    """
    Lyapunov exponents per impact of a stream of events, by QR re-orthonormalisation.

    Takes batches of any size; the result does not depend on how the stream was cut, to the bit.
    A new average begins at every retune and reset and after every hole; the finite-time exponent
    and the impulse balance cross retunes.

    Parameters
    ----------
    window : int
        Impacts in the finite-time exponent, positive, else ValueError.

    References
    ----------
    de Souza & Caldas 2001, eqs. (9)-(11); Eckmann & Ruelle 1985, section V.

    """

    def __init__(self, window: int = 1000) -> None:
        if window < 1:
            raise ValueError(f'window = {window!r} must be positive')
        self.guard = StreamGuard()  #: What was lost.
        self._estimate = np.zeros(1, ESTIMATE)
        self._ring = np.zeros(window)
        self._marks = np.zeros(window, np.int64)
        self._last: EventArray | None = None

    def update(self, events: EventArray) -> None:
        """Take the next batch, an array of EVENT."""
        estimate: Any = self._estimate[0]
        for piece in self.guard.split(events):
            stretch = piece.events
            if not piece.follows or self._last is None:
                self._last = stretch[:1].copy()
                stretch = stretch[1:]
                restart(estimate, self._last[0])
            follow(estimate, self._ring, self._marks, self._last, stretch)

    @property
    def report(self) -> LyapunovReport:
        """Averages over the present epoch, as far as it was seen."""
        e = self._estimate[0]
        n = int(e['impacts'])
        window, ringed = len(self._ring), int(e['ringed'])
        recent = np.roll(self._ring, -(ringed % window))
        is_full = ringed >= window
        last = self._last
        time, impulse, exact = (
            float(np.sum(e[name])) for name in ('duration', 'impulse', 'exact_impulse'))
        if last is not None:
            exact += float(e['origin'] - momentum(last[0], last[0]))
        return LyapunovReport(
            epoch=0 if last is None else int(last['epoch'][0]),
            index=0 if last is None else int(last['index'][0]),
            impacts=n, sticks=int(e['sticks']), exact_sum=self._mean('exact'),
            lambda_1=self._mean('sum_1'), lambda_2=self._mean('sum_2'),
            lambda_1_error=self._error('block_1'), lambda_2_error=self._error('block_2'),
            lambda_1_finite=float(np.sum(recent)) / window if is_full else math.nan,
            window=window,
            finite_retunes=int(e['retunes_before'] - self._marks[ringed % window])
            if is_full else int(e['retunes_before']),
            mean_flight_time=float(np.sum(e['time'])) / n if n else math.nan,
            impulse_balance=impulse / time if time > 0.0 else math.nan,
            exact_impulse_balance=exact / time if time > 0.0 else math.nan,
        )

    def _mean(self, name: str) -> float:
        e = self._estimate[0]
        if not e['impacts']:
            return math.nan
        if math.isinf(e[name][0]):
            # Sticking gives -inf; inf comes from records that no simulator writes.
            return float(e[name][0])
        return float(e[name][0] + e[name][1]) / int(e['impacts'])

    def _error(self, name: str) -> float:
        e = self._estimate[0]
        full = int(e['blocks'])
        means = e[name][:full] / e['block_length']
        if full < FEWEST_BLOCKS or not np.isfinite(means).all():
            return math.nan
        return float(np.std(means, ddof=1)) / math.sqrt(full)
