"""How long many trajectories last before a periodic orbit captures them, and at which rate."""

import dataclasses
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from ..compiled import kernel
from ..flight.lanes import advance, is_busy, refill, release, RUNS
from ..flight.lanes_step import LANES
from ..orbits.section import distance

STEPS: Final = 256
# What has become of a trajectory: captured; neither captured nor ended when its time was up; at
# rest or floating for ever; never begun, as enough had escaped.
CAPTURED: Final = 1
SURVIVED: Final = 0
ENDED: Final = -1
UNUSED: Final = -2


@dataclasses.dataclass(frozen=True)
class EscapeRate:
    """
    Rate of a geometric law, from lifetimes of which some are censored.

    Attributes
    ----------
    rate, error : float
        Per impact [1], and its standard error.
    escapes : int
        Lifetimes that were seen to end.
    at_risk : float
        Impacts made by all trajectories while the law was counted [1].

    """

    rate: float
    error: float
    escapes: int
    at_risk: float

    @property
    def mean(self) -> float:
        """Mean lifetime [impacts], inf where nothing escaped."""
        return 1.0 / self.rate if self.rate > 0.0 else math.inf

    @property
    def mean_error(self) -> float:
        """Its standard error [impacts]."""
        return self.error / self.rate**2 if self.rate > 0.0 else math.inf


def escape_rate(lifetimes: npt.ArrayLike, censored: npt.ArrayLike, skip: float,
                numbers: npt.ArrayLike = 1) -> EscapeRate:
    """
    Estimate an escape rate: the maximum of the likelihood of a geometric law.

    Of the impacts that are made after `skip` each is the last with the same probability: escapes
    over impacts at risk, whatever the censoring.

    Parameters
    ----------
    lifetimes : array_like
        Impacts until each trajectory escaped or was given up [1].
    censored : array_like of bool
        Which were given up.
    skip : float
        The law holds from so many impacts on; what escapes earlier says nothing [1].
    numbers : array_like of int
        Independent trajectories with each of these lifetimes.

    Returns
    -------
    EscapeRate
        Its error is the scatter of independent trajectories, whether the law holds or not, and
        at least that of one escape.

    """
    life = np.asarray(lifetimes, np.float64)
    late = np.where(life > skip, numbers, 0)
    escaped = np.where(censored, 0, 1)
    at_risk = float(np.sum(late * (life - skip)))
    escapes = int(np.sum(late * escaped))
    if at_risk <= 0.0:
        return EscapeRate(math.nan, math.nan, 0, 0.0)
    rate = escapes / at_risk
    scatter = math.sqrt(float(np.sum(late * (escaped - rate * (life - skip))**2)))
    return EscapeRate(rate, max(scatter, 1.0) / at_risk, escapes, at_risk)


@kernel
def last_until_captured(  # type: ignore[no-untyped-def]
        tile, impacts, starts, points, radius, skip, wanted, limit, lifetimes, fates, ends):
    """
    Follow trajectories until enough of them are captured.

    All lanes stay in use to the end, so no time is lost on a last long transient; for rates it
    is as good, as they need only the escapes and the impacts at risk.

    Parameters
    ----------
    tile : TILE record
        All lanes free.
    impacts : ndarray of IMPACT, shape (LANES, STEPS + 1)
        Room to work in.
    starts : ndarray of START, shape (n,)
        The starts.
    points : ndarray of float, shape (q, 2)
        Phases and velocities of the orbit [rad, 1].
    radius : float
        A trajectory is captured when each of q + 1 impacts in a row lies so near to its point of
        the orbit [rad, 1].
    skip, wanted : int
        All stop when so many (wanted) were captured after more impacts than these (skip).
    limit : int
        Impacts after which a trajectory is given up.
    lifetimes : ndarray of int, shape (n,)
        Receives the impacts before the capture, or before the end.
    fates : ndarray of int, shape (n,)
        Receives CAPTURED, SURVIVED, ENDED or UNUSED.
    ends : ndarray of float, shape (n, 3)
        Receives phase, displacement and velocity of those that survive [rad, 1, 1].

    """
    q = len(points)
    # Impacts in a row that were near the orbit, and the point that the last was near.
    row = np.zeros(LANES, np.int64)
    where = np.zeros(LANES, np.int64)
    made = np.zeros(LANES, np.int64)
    late = 0
    fates[:] = UNUSED
    lifetimes[:] = 0
    following = refill(tile, starts, 0, math.inf)
    while late < wanted and (following < len(starts) or is_busy(tile)):
        advance(tile, impacts, STEPS)
        for i in range(LANES):
            start = tile.start[i]
            if start < 0:
                continue
            done = False
            for k in range(tile.count[i]):
                one = impacts[i, k]
                made[i] += 1
                first, last = 0, q
                if row[i] > 0:
                    first = (where[i] + 1) % q
                    last = first + 1
                near = -1
                for j in range(first, last):
                    if distance(one.velocity, one.phase, points[j, 1], points[j, 0]) < radius:
                        near = j
                if near >= 0:
                    row[i] += 1
                    where[i] = near
                else:
                    row[i] = 0
                if row[i] > q or made[i] >= limit:
                    fates[start] = CAPTURED if row[i] > q else SURVIVED
                    lifetimes[start] = made[i] - (row[i] if row[i] > q else 0)
                    if row[i] > q and lifetimes[start] > skip:
                        late += 1
                    done = True
                    break
            if not done and tile.end[i] != RUNS:
                fates[start] = ENDED
                lifetimes[start] = made[i]
                done = True
            if not done:
                fates[start] = SURVIVED
                lifetimes[start] = made[i]
            ends[start, 0] = tile.phase[i]
            ends[start, 1] = tile.displacement[i]
            ends[start, 2] = tile.velocity[i]
            if done:
                release(tile, i)
                row[i] = 0
                made[i] = 0
        following = refill(tile, starts, following, math.inf)
