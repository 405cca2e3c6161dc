"""Many trajectories at one alpha, and the attractors on which they have settled."""

import dataclasses
import enum
import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ..core.closed_orbits import (
    close_orbit,
    exponents,
    Orbit,
    same_orbit,
    shortest_period,
)
from ..core.elementary import TWO_PI
from ..core.lanes import begin, IMPACT, new_impacts, new_tiles, refill, START
from ..core.lanes_step import LANES
from ..core.model import Parameters
from ..core.raster import BLOCKS, fill, KEPT, STEPS

FloatArray = npt.NDArray[np.float64]
# Two trajectories that settled on a periodic orbit agree to this [rad, 1].
RECURS: Final = 1e-4
# Two orbits are one where their points agree to this [rad, 1].
SAME: Final = 1e-3
# Two chaotic trajectories are on one attractor where their histograms share so much.
SHARES: Final = 0.3


class Kind(enum.Enum):
    """What a trajectory has settled on; unresolved is what neither recurs nor grows."""

    ORBIT = 'orbit'
    CHAOTIC = 'chaotic'
    UNRESOLVED = 'unresolved'
    REST = 'rest'


@dataclasses.dataclass(frozen=True)
class Window:
    """
    What is counted of every trajectory.

    Attributes
    ----------
    skip, keep : int
        Impacts that are passed over, then those that are counted.
    low, high : float
        Range of the velocity bins [1].
    bins : int
        How many.

    Raises
    ------
    ValueError
        If nothing is counted or the range is empty.

    """

    skip: int = 5000
    keep: int = 2048
    low: float = -3.0
    high: float = 3.0
    bins: int = 1200

    def __post_init__(self) -> None:
        """Validate."""
        if self.skip < 1 or self.keep < KEPT:
            raise ValueError(f'impacts to skip {self.skip} and to keep {self.keep} must be at '
                             f'least 1 and {KEPT}')
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise ValueError(f'velocity window {self.low:g} to {self.high:g} is empty or '
                             'reversed; give the lower end first')
        if not 1 <= self.bins <= 100_000:
            raise ValueError(f'{self.bins} bins are not between 1 and 100000')


@dataclasses.dataclass(frozen=True)
class Ensemble:
    """
    What `LANES` trajectories or fewer have done.

    Attributes
    ----------
    parameters : Parameters
        The parameters.
    counts : ndarray of uint32, shape (n, bins)
        Impact velocities counted.
    growth : ndarray of float, shape (n, BLOCKS)
        Mean growth of a tangent vector per impact in each block [1].
    flight_time : ndarray of float, shape (n,)
        Mean time per impact [1].
    made : ndarray of int, shape (n,)
        Impacts made in all.
    last : ndarray of IMPACT, shape (n, KEPT)
        The last impacts of each, oldest first.
    rests : ndarray of bool, shape (n,)
        Which have come to their end.

    """

    parameters: Parameters
    counts: npt.NDArray[np.uint32]
    growth: FloatArray
    flight_time: FloatArray
    made: npt.NDArray[np.int64]
    last: npt.NDArray[np.void]
    rests: npt.NDArray[np.bool_]


@dataclasses.dataclass(frozen=True)
class Settled:
    """
    An attractor as an ensemble shows it.

    Attributes
    ----------
    kind : Kind
        What it is.
    members : ndarray of int
        Which trajectories are on it.
    counts : ndarray of float, shape (bins,)
        Their impact velocities, counted together.
    orbit : Orbit or None
        Where it is one.
    exponent, exponent_error : float
        Largest exponent per impact [1]: of a periodic orbit from its multipliers, with no error;
        else the mean of all blocks and its standard error.
    flight_time : float
        Mean time per impact [1].
    impact : IMPACT record
        The last one of its first member.

    """

    kind: Kind
    members: npt.NDArray[np.int64]
    counts: FloatArray
    orbit: Orbit | None
    exponent: float
    exponent_error: float
    flight_time: float
    impact: np.void


class Followers:
    """
    Trajectories that can go on with other parameters.

    Parameters
    ----------
    starts : ndarray of START, shape (n,)
        At most `LANES`.

    """

    def __init__(self, starts: npt.NDArray[np.void]) -> None:
        if not 1 <= len(starts) <= LANES:
            raise ValueError(f'{len(starts)} starts are not between 1 and {LANES}')
        self.count = len(starts)
        self._tile: Any = new_tiles(1)[0]
        self._impacts = new_impacts(STEPS)
        # A lane that is to make no impact parks where it starts.
        refill(self._tile, starts, 0, 0.0)

    def states(self) -> FloatArray:
        """
        Tell where the trajectories are.

        Returns
        -------
        ndarray of float, shape (n, 3)
            Phase [rad], displacement and velocity [1].

        """
        return np.stack([np.asarray(self._tile[name][:self.count], np.float64)
                         for name in ('phase', 'displacement', 'velocity')], axis=1)

    def run(self, parameters: Parameters, window: Window) -> Ensemble:
        """
        Go on from where the trajectories are.

        Parameters
        ----------
        parameters : Parameters
            From now on.
        window : Window
            What is counted.

        Returns
        -------
        Ensemble
            What they did.

        """
        n, tile = self.count, self._tile
        for name, value in dataclasses.asdict(parameters).items():
            tile[name][:n] = value
        for i in range(n):
            begin(tile, i, 0, tile['phase'][i], tile['displacement'][i], tile['velocity'][i],
                  float(window.skip + window.keep))
        counts = np.zeros((LANES, window.bins), np.uint32)
        growth, times = np.zeros((LANES, BLOCKS)), np.zeros(LANES)
        made, last = np.zeros(LANES, np.int64), np.zeros((LANES, KEPT), IMPACT)
        fill(tile, self._impacts, window.skip, window.keep, window.low, window.high, counts,
             growth, times, made, last)
        order = (made[:n, None] + np.arange(KEPT)) % KEPT
        rests = made[:n] < window.skip + window.keep
        return Ensemble(parameters, counts[:n], growth[:n],
                        times[:n] / np.maximum(1, made[:n] - window.skip), made[:n],
                        np.take_along_axis(last[:n], order, axis=1), rests)


def run_ensemble(starts: npt.NDArray[np.void], parameters: Parameters,
                 window: Window) -> Ensemble:
    """
    Follow any number of starts at one set of parameters.

    Parameters
    ----------
    starts : ndarray of START, shape (n,)
        The starts.
    parameters : Parameters
        The parameters.
    window : Window
        What is counted.

    Returns
    -------
    Ensemble
        What they did, in order.

    """
    assert starts.dtype == START
    parts = [Followers(starts[i:i + LANES]).run(parameters, window)
             for i in range(0, len(starts), LANES)]
    return Ensemble(parameters, *(
        np.concatenate([getattr(part, field.name) for part in parts])
        for field in dataclasses.fields(Ensemble) if field.name != 'parameters'))


def settle(ensemble: Ensemble) -> list[Settled]:
    """
    Find the attractors on which an ensemble has settled.

    Parameters
    ----------
    ensemble : Ensemble
        The trajectories.

    Returns
    -------
    list of Settled
        The one with most members first; periodic orbits by their points, others by how much
        their histograms share.

    """
    groups: list[tuple[list[int], Orbit | None]] = []
    resting = [int(i) for i in np.flatnonzero(ensemble.rests)]
    orbits = [None if rests else orbit_of(impacts, ensemble.parameters)
              for impacts, rests in zip(ensemble.last, ensemble.rests, strict=True)]
    smooth = _smoothed(ensemble.counts)
    # First what is surely periodic; a trajectory that is still on its way belongs there too.
    for i in sorted(range(len(orbits)), key=lambda i: orbits[i] is None):
        orbit = orbits[i]
        if i in resting:
            continue
        for members, first in groups:
            if (_overlap(smooth[i], smooth[members[0]]) > SHARES if orbit is None
                    else first is not None and same_orbit(orbit, first, SAME)):
                members.append(i)
                break
        else:
            groups.append(([i], orbit))
    if resting:
        groups.append((resting, None))
    groups.sort(key=lambda group: -len(group[0]))
    found = []
    for members, orbit in groups:
        mean, error = _exponent(ensemble.growth[members])
        time = float(np.mean(ensemble.flight_time[members]))
        kind = Kind.CHAOTIC if mean > 4.0 * error else Kind.UNRESOLVED
        if orbit is not None:
            # Exact, and free of what is left of the transient.
            kind, mean, error = Kind.ORBIT, exponents(orbit)[0], 0.0
            time = TWO_PI * orbit.drive_periods / orbit.impacts
        elif members is resting:
            kind, mean, error, time = Kind.REST, -math.inf, math.nan, math.nan
        found.append(Settled(
            kind, np.array(members), ensemble.counts[members].sum(axis=0, dtype=np.float64),
            orbit, mean, error, time, ensemble.last[members[0], -1]))
    return found


def orbit_of(impacts: npt.NDArray[np.void], parameters: Parameters) -> Orbit | None:
    """
    Find the stable periodic orbit on which a trajectory has settled.

    Parameters
    ----------
    impacts : ndarray of IMPACT, shape (n,)
        Its last impacts.
    parameters : Parameters
        The parameters.

    Returns
    -------
    Orbit or None
        None where it does not recur, or no stable orbit of half the stretch or less is near.

    """
    walls = np.signbit(impacts['velocity']).astype(np.int64)
    q = shortest_period(walls, impacts['phase'], impacts['velocity'], RECURS)
    if q == 0:
        return None
    points = np.stack([impacts['phase'], impacts['velocity']], axis=1)[-q:]
    orbit = close_orbit(walls[-q:], points, parameters)
    return orbit if orbit is not None and orbit.is_stable else None


def _smoothed(counts: npt.NDArray[Any]) -> FloatArray:
    padded = np.pad(np.asarray(counts, np.float64), ((0, 0), (3, 3)))
    spread = sum(padded[:, k:k + counts.shape[1]] for k in range(7))
    total = np.sum(spread, axis=1, keepdims=True)
    return np.asarray(spread / np.where(total > 0.0, total, 1.0))


def _overlap(a: FloatArray, b: FloatArray) -> float:
    return float(np.sum(np.minimum(a, b)))


def _exponent(growth: FloatArray) -> tuple[float, float]:
    if not np.isfinite(growth).all():
        return -math.inf, math.nan
    return float(np.mean(growth)), float(np.std(growth, ddof=1) / math.sqrt(growth.size))
