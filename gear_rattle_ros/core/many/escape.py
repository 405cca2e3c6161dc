"""How long many trajectories last before a periodic orbit captures them, and at which rate."""

import dataclasses
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from ..arrays import FloatArray, IntArray, Record, RecordArray
from ..compiled import kernel
from ..flight.lanes import advance, is_busy, refill, release, RUNS
from ..flight.lanes_step import LANES
from ..orbits.section import distance

STEPS: Final = 256
# What has become of a trajectory: captured; neither captured nor ended when its time was up;
# permanently at rest or floating; never begun, as enough had escaped.
CAPTURED: Final = 1
SURVIVED: Final = 0
ENDED: Final = -1
UNUSED: Final = -2


@dataclasses.dataclass(frozen=True)
class EscapeRate:
    """Rate of a geometric law, from lifetimes some of which are censored."""

    rate: float  # per impact [1]
    error: float  # its standard error [1]
    escapes: int  # lifetimes that were seen to end
    at_risk: float  # impacts of all trajectories while the law was counted [1]

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
    Estimate an escape rate per impact, the maximum likelihood of a geometric law after `skip`.

    It is escapes over impacts at risk, whatever the censoring. `numbers` counts the independent
    trajectories of each lifetime. The error is their scatter, whether the law holds or not, and at
    least that of one escape.
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
def last_until_captured(tile: Record, impacts: RecordArray, starts: RecordArray,
                        points: FloatArray, radius: float, skip: int, wanted: int, limit: int,
                        lifetimes: IntArray, fates: IntArray, ends: FloatArray) -> None:
    """
    Follow trajectories until `wanted` of them are captured after more than `skip` impacts.

    One is captured when q + 1 impacts in a row lie within `radius` [rad, 1] of an orbit's `points`
    (phases and velocities, shape (q, 2)), and given up after `limit` impacts. `lifetimes` receives
    the impacts until then, `fates` CAPTURED, SURVIVED, ENDED or UNUSED, and `ends` phase,
    displacement and velocity [rad, 1, 1]. No time goes into waiting for a last long transient.
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
                row[i] = made[i] = 0
        following = refill(tile, starts, following, math.inf)
