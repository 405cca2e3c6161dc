"""Running Lyapunov exponents of a stream of events."""

import dataclasses
import math
from typing import Any, Final

import numpy as np

from .compiled import kernel
from .elementary import length, logarithm
from .flight import elapsed
from .model import EventArray, EventKind
from .stream import StreamGuard
from .tangent import flight_matrix, impact_matrix, log_determinant

IMPACT, STICK, RELEASE, RETUNE, RESET = (int(kind) for kind in EventKind)
# Standard errors: block means over blocks that double in length when this many are full.
BLOCKS: Final = 64
FIRST_BLOCK: Final = 16
FEWEST_BLOCKS: Final = 16

ESTIMATE: Final = np.dtype(
    [
        ('basis', np.float64, 4),
        ('impacts', np.int64),
        ('sticks', np.int64),
        ('sum_1', np.float64, 2),
        ('sum_2', np.float64, 2),
        ('exact', np.float64, 2),
        ('time', np.float64, 2),
        ('pending_exact', np.float64),
        ('pending_time', np.float64),
        ('block_length', np.int64),
        ('blocks', np.int64),
        ('in_block', np.int64),
        ('block_1', np.float64, BLOCKS + 1),
        ('block_2', np.float64, BLOCKS + 1),
    ],
    align=True,
)


@dataclasses.dataclass(frozen=True)
class LyapunovReport:
    """
    Exponents per impact, averaged over one epoch.

    Attributes
    ----------
    epoch : int
        The epoch averaged over; parameters are constant in it.
    index : int
        Number of the last impact seen.
    impacts : int
        Impacts averaged over.
    lambda_1, lambda_2 : float
        Exponents per impact [1]; nan without impacts, -inf where the mass has stuck.
    lambda_1_error, lambda_2_error : float
        Standard errors by block means [1]; nan with too few impacts.
    exact_sum : float
        ``2 ln r - beta <D>`` [1], what ``lambda_1 + lambda_2`` must be (physics, eq. (11)).
    lambda_1_finite : float
        Largest exponent over the last `window` impacts [1]; nan until there are so many.
    window : int
        Impacts in it.
    mean_flight_time : float
        Time per impact [1]; divide by it for exponents per unit of tau.

    """

    epoch: int
    index: int
    impacts: int
    lambda_1: float
    lambda_2: float
    lambda_1_error: float
    lambda_2_error: float
    exact_sum: float
    lambda_1_finite: float
    window: int
    mean_flight_time: float

    @property
    def exponent_sum(self) -> float:
        """Return the sum of both exponents [1]."""
        return self.lambda_1 + self.lambda_2


@kernel
def add(total, x):  # type: ignore[no-untyped-def]
    """
    Add to a compensated sum (Neumaier 1974).

    Parameters
    ----------
    total : ndarray of float, shape (2,)
        Sum and what rounding has taken from it; changed in place.
    x : float
        The summand.

    """
    fresh = total[0] + x
    if abs(total[0]) >= abs(x):
        total[1] += (total[0] - fresh) + x
    else:
        total[1] += (x - fresh) + total[0]
    total[0] = fresh


@kernel
def begin(estimate):  # type: ignore[no-untyped-def]
    """
    Start a new average, keeping the tangent vectors.

    Parameters
    ----------
    estimate : ESTIMATE record
        Changed in place.

    """
    estimate.impacts = 0
    estimate.sticks = 0
    estimate.sum_1[:] = 0.0
    estimate.sum_2[:] = 0.0
    estimate.exact[:] = 0.0
    estimate.time[:] = 0.0
    estimate.pending_exact = 0.0
    estimate.pending_time = 0.0
    estimate.block_length = FIRST_BLOCK
    estimate.blocks = 0
    estimate.in_block = 0
    estimate.block_1[:] = 0.0
    estimate.block_2[:] = 0.0


@kernel
def set_identity(basis):  # type: ignore[no-untyped-def]
    """
    Forget the tangent vectors.

    Parameters
    ----------
    basis : ndarray of float, shape (4,)
        Two orthonormal vectors, one after the other; changed in place.

    """
    basis[0] = 1.0
    basis[1] = 0.0
    basis[2] = 0.0
    basis[3] = 1.0


@kernel
def orthonormalise(basis):  # type: ignore[no-untyped-def]
    """
    QR-decompose the tangent vectors in place (Gram-Schmidt).

    Parameters
    ----------
    basis : ndarray of float, shape (4,)
        Two vectors, one after the other.

    Returns
    -------
    tuple of float
        The diagonal of R, both not negative [1]; no numbers where the vectors are none.

    """
    first = length(basis[0], basis[1])
    if not 0.0 < first < math.inf:
        # What a record with absurd velocities has spoilt must not outlive its epoch.
        set_identity(basis)
        return first, 0.0 if first == 0.0 else math.nan
    x, y = basis[0] / first, basis[1] / first
    second = abs(x * basis[3] - y * basis[2])
    basis[0] = x
    basis[1] = y
    basis[2] = -y
    basis[3] = x
    return first, second


@kernel
def count_impact(estimate, ring, growth_1, growth_2, exact):  # type: ignore[no-untyped-def]
    """
    Enter the growth of both tangent vectors over one impact.

    Parameters
    ----------
    estimate : ESTIMATE record
        Changed in place.
    ring : ndarray of float, shape (window,)
        The last growth rates; changed in place.
    growth_1, growth_2 : float
        Logarithms of the diagonal of R [1].
    exact : float
        Their sum by the determinants [1].

    """
    e = estimate
    ring[e.impacts % len(ring)] = growth_1
    e.impacts += 1
    add(e.sum_1, growth_1)
    add(e.sum_2, growth_2)
    add(e.exact, exact + e.pending_exact)
    add(e.time, e.pending_time)
    e.pending_exact = 0.0
    e.pending_time = 0.0
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
    e.block_1[e.blocks] = 0.0
    e.block_2[e.blocks] = 0.0


@kernel
def follow(estimate, ring, last, events):  # type: ignore[no-untyped-def]
    """
    Carry the tangent vectors through a stretch of events without a hole.

    Parameters
    ----------
    estimate : ESTIMATE record
        Changed in place.
    ring : ndarray of float, shape (window,)
        The last growth rates; changed in place.
    last : ndarray of EVENT, shape (1,)
        The event before; changed in place to the last of these.
    events : ndarray of EVENT, shape (n,)
        The stretch.

    """
    e = estimate
    basis = e.basis
    restitution = math.nan
    contraction = math.nan
    for i in range(len(events)):
        p = events[i - 1] if i else last[0]
        event = events[i]
        cycles = np.int64(np.int32(np.uint32(event.cycle) - np.uint32(p.cycle)))
        d = elapsed(cycles, p.phase, event.phase)
        if event.kind == RESET:
            begin(e)
            set_identity(basis)
        elif event.kind == RELEASE:
            # No flight, and nothing is remembered of what was before it.
            e.pending_time += d
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
                orthonormalise(basis)
                begin(e)
            elif event.kind == STICK:
                e.sticks += 1
                count_impact(e, ring, -math.inf, -math.inf, -math.inf)
                set_identity(basis)
            else:
                s11, s21, s22 = impact_matrix(
                    event.phase, event.velocity, event.velocity_after, p.alpha, p.beta, p.gamma,
                    p.restitution)
                basis[1] = s21 * basis[0] + s22 * basis[1]
                basis[3] = s21 * basis[2] + s22 * basis[3]
                basis[0] *= s11
                basis[2] *= s11
                first, second = orthonormalise(basis)
                if p.restitution != restitution:
                    restitution = p.restitution
                    contraction = 2.0 * logarithm(restitution)
                count_impact(
                    e, ring, logarithm(first), logarithm(second), log_determinant(
                        event.velocity, event.velocity_after, restitution, contraction))
    if len(events):
        last[0] = events[len(events) - 1]


class RunningLyapunov:
    """
    Lyapunov exponents per impact of a stream of events, by QR re-orthonormalisation.

    Takes batches of any size; the result does not depend on how the stream was cut, to the bit.
    A new average starts at every retune and reset and after every hole.

    Parameters
    ----------
    window : int
        Impacts in the finite-time exponent.

    Attributes
    ----------
    guard : StreamGuard
        What was lost.

    Raises
    ------
    ValueError
        If the window is not positive.

    References
    ----------
    de Souza & Caldas 2001, eqs. (9)-(11); Eckmann & Ruelle 1985, section V.

    """

    def __init__(self, window: int = 1000) -> None:
        if window < 1:
            raise ValueError(f'window = {window!r} must be positive')
        self.guard = StreamGuard()
        self._estimate = np.zeros(1, ESTIMATE)
        self._ring = np.zeros(window)
        self._last: EventArray | None = None

    def update(self, events: EventArray) -> None:
        """
        Take the next batch.

        Parameters
        ----------
        events : ndarray of EVENT, shape (n,)
            The records.

        """
        estimate: Any = self._estimate[0]
        for piece in self.guard.split(events):
            stretch = piece.events
            if not piece.follows or self._last is None:
                begin(estimate)
                set_identity(estimate['basis'])
                self._last = stretch[:1].copy()
                stretch = stretch[1:]
            follow(estimate, self._ring, self._last, stretch)

    def report(self) -> LyapunovReport:
        """
        Return the present estimate.

        Returns
        -------
        LyapunovReport
            Averages over the present epoch, as far as it was seen.

        """
        e = self._estimate[0]
        n = int(e['impacts'])
        window = len(self._ring)
        recent = np.roll(self._ring, -(n % window))
        last = self._last
        return LyapunovReport(
            epoch=0 if last is None else int(last['epoch'][0]),
            index=0 if last is None else int(last['index'][0]),
            impacts=n,
            lambda_1=self._mean('sum_1'),
            lambda_2=self._mean('sum_2'),
            lambda_1_error=self._error('block_1'),
            lambda_2_error=self._error('block_2'),
            exact_sum=self._mean('exact'),
            lambda_1_finite=float(np.sum(recent)) / window if n >= window else math.nan,
            window=window,
            mean_flight_time=float(np.sum(e['time'])) / n if n else math.nan,
        )

    def _mean(self, name: str) -> float:
        e = self._estimate[0]
        if not e['impacts']:
            return math.nan
        if math.isinf(e[name][0]):
            # Sticking gives -inf; inf comes of records that no simulator writes.
            return float(e[name][0])
        return float(e[name][0] + e[name][1]) / int(e['impacts'])

    def _error(self, name: str) -> float:
        e = self._estimate[0]
        full = int(e['blocks'])
        means = e[name][:full] / e['block_length']
        if full < FEWEST_BLOCKS or not np.isfinite(means).all():
            return math.nan
        return float(np.std(means, ddof=1)) / math.sqrt(full)
