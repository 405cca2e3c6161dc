"""
How far the unstable manifold of a saddle orbit stays from its stable manifold.

A boundary crisis is their tangency (Grebogi, Ott & Yorke 1983): the attractor is bounded by the
one, its basin by the other. Points of the unstable manifold are mapped until they come back near
the saddle; there the unstable coordinate, pulled back to where they came in, is the signed
distance across the stable manifold.
"""

import dataclasses
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from .impact_map import next_impact
from .orbit import fire, Orbit
from .section import distances
from ..arrays import FloatArray, IntArray
from ..compiled import kernel
from ..flight.closed_form import NO_WALL
from ..flight.elementary import exp_minus, logarithm, TWO_PI
from ..model import Model

# The unstable manifold is straight this far from the saddle [1], to the square of this.
SEED_DISTANCE: Final = 1e-6
# A return is seen this near to the saddle, across the stable manifold and along it [1].
ACROSS: Final = 0.03
ALONG: Final = 0.3
# Turns near the saddle after which a return counts: the coordinate is then exact.
TURNS: Final = 2
NEVER: Final = -1e9
# Refining a maximum: samples of a bracket, the factor by which it shrinks, and how often.
SAMPLES: Final = 17
SHRINK: Final = 5.0
ROUNDS: Final = 10


@dataclasses.dataclass(frozen=True)
class Saddle:
    """A saddle orbit (one real multiplier outside the unit circle) with its unstable direction."""

    orbit: Orbit
    unstable: FloatArray  # unit vector (phase, velocity) at the first impact
    rows: FloatArray  # give the unstable and the stable coordinate, shape (2, 2)

    @property
    def expansion(self) -> float:
        """Multiplier outside the unit circle [1]."""
        return float(self.orbit.multipliers[0].real)

    @property
    def contraction(self) -> float:
        """Multiplier inside it [1]."""
        return float(self.orbit.multipliers[1].real)

    @property
    def lifetime_exponent(self) -> float:
        """Exponent of the lifetime law at a homoclinic tangency (Grebogi, Ott & Yorke 1986)."""
        along = math.log(abs(self.contraction))
        return along / (2.0 * (math.log(abs(self.expansion)) + along))


@dataclasses.dataclass(frozen=True)
class Edge:
    """The return of the unstable manifold that comes nearest to crossing the stable one."""

    distance: float  # across the stable manifold [1]; positive beyond it: trajectories escape
    place: float  # on the unstable manifold, in periods of the saddle from `SEED_DISTANCE` on [1]
    impacts: int  # from there to the return


def saddle_of(orbit: Orbit, captor: Orbit) -> Saddle:
    """Find the directions of a saddle, the unstable one away from the captor (as many impacts)."""
    shot = fire(orbit.walls, orbit.points, orbit.parameters)
    first, second = orbit.multipliers
    if shot is None or first.imag != 0.0 or not first.real > 1.0 > second.real > 0.0:
        raise ValueError(f'alpha = {orbit.parameters.alpha:g}: the orbit is not a saddle with '
                         'positive multipliers')
    values, vectors = np.linalg.eig(shot.derivative())
    vectors = np.real(vectors[:, np.argsort(-np.abs(values))])
    rows = np.linalg.inv(vectors)
    shift = min(range(len(captor.points)), key=lambda k: _apart(captor, k, orbit))
    aside = captor.points[shift] - orbit.points[0]
    aside[0] -= TWO_PI * math.floor(aside[0] / TWO_PI + 0.5)
    if rows[0] @ aside > 0.0:
        vectors[:, 0] *= -1.0
        rows[0] *= -1.0
    return Saddle(orbit, vectors[:, 0], rows)


def _apart(captor: Orbit, shift: int, orbit: Orbit) -> float:
    points = np.roll(captor.points, -shift, axis=0)
    return float(np.max(distances(points[:, 1], points[:, 0], orbit.velocities, orbit.phases)))


@kernel
def returns(places: FloatArray, seed: float, wall: int, period: int, point: FloatArray,
            unstable: FloatArray, rows: FloatArray, expansion: float, impacts: int,
            model: Model) -> tuple[FloatArray, IntArray]:
    """Map points of the unstable manifold on and find their farthest return."""
    # Places are in periods of the saddle [1] from the distance `seed` on. Returns how far beyond
    # the stable manifold they come [1] (NEVER without a return), and after how many impacts.
    distances = np.full(len(places), NEVER)
    numbers = np.full(len(places), -1)
    entered = np.empty(period, np.int64)
    crossed = np.empty(period)
    rate = logarithm(expansion)
    for i in range(len(places)):
        entered[:] = -1
        aside = seed * exp_minus(-places[i] * rate)
        phase = point[0] + aside * unstable[0]
        velocity = point[1] + aside * unstable[1]
        here = wall
        away = False
        for n in range(1, impacts + 1):
            here, _, phase, velocity, _ = next_impact(here, phase, velocity, model)
            if here == NO_WALL:
                break
            turn = phase - point[0]
            turn -= TWO_PI * math.floor(turn / TWO_PI + 0.5)
            climb = velocity - point[1]
            across = rows[0, 0] * turn + rows[0, 1] * climb
            along = rows[1, 0] * turn + rows[1, 1] * climb
            near = here == wall and abs(across) < ACROSS and abs(along) < ALONG
            c = n % period
            if not away:
                away = c == 0 and not near
            elif near:
                if entered[c] < 0:
                    entered[c] = n
                crossed[c] = -across * exp_minus((n - entered[c]) / period * rate)
            elif entered[c] >= 0:
                if n - entered[c] > TURNS * period and crossed[c] > distances[i]:
                    distances[i] = crossed[c]
                    numbers[i] = entered[c]
                entered[c] = -1
        # What is still near lies so close to the stable manifold that it stays for long.
        for c in range(period):
            if entered[c] >= 0 and impacts - entered[c] > (TURNS + 1) * period:
                if crossed[c] > distances[i]:
                    distances[i] = crossed[c]
                    numbers[i] = entered[c]
    return distances, numbers


def find_edge(saddle: Saddle, *, samples: int = 20_000, impacts: int = 80, candidates: int = 12,
              near: float | None = None, seed: float = SEED_DISTANCE,
              offset: float = 0.0) -> Edge:
    """Find the return that comes nearest to the stable manifold, or farthest beyond it."""
    # `samples` points over one period of the unstable manifold, from the distance `seed` on [1]
    # and shifted by `offset` of their spacing, are mapped for `impacts`; the `candidates` largest
    # maxima are refined. With `near`, only a hundredth of a period about this place is searched.
    def look(places: FloatArray) -> tuple[FloatArray, npt.NDArray[np.int64]]:
        orbit = saddle.orbit
        return returns(places, seed, int(orbit.walls[0]), orbit.impacts, orbit.points[0],
                       saddle.unstable, saddle.rows, saddle.expansion, impacts,
                       orbit.parameters.model)

    places = (np.arange(samples) + offset) / samples
    if near is not None:
        places = near + np.linspace(-0.005, 0.005, samples // 10)
    spacing = float(places[1] - places[0])
    distances, _ = look(places)
    tops = np.flatnonzero((distances >= np.roll(distances, 1))
                          & (distances >= np.roll(distances, -1)) & (distances > NEVER))
    best = Edge(NEVER, 0.0, -1)
    for top in tops[np.argsort(-distances[tops])][:candidates]:
        place, width = float(places[top]), spacing
        for _ in range(ROUNDS):
            closer = place + np.linspace(-width, width, SAMPLES)
            distances, numbers = look(closer)
            k = int(np.argmax(distances))
            place, width = float(closer[k]), width / SHRINK
            if distances[k] > best.distance:
                best = Edge(float(distances[k]), place, int(numbers[k]))
    return best
