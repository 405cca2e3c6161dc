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

"""Edge states on boundaries of basins, chaotic saddles of transients: where they are, their rates."""

from typing import Final

import numpy as np

from ..attractors.catalogue import Catalogue
from ..attractors.plane import Plane
from ..attractors.saddles import rates_of_orbit, Straddling
from ..core.defaults import SEED
from ..core.many.sprinkler import rates_of, SaddleRates

# Independent batches, whose scatter gives the errors.
PARTS: Final = 8
# Impacts straddled, and initial conditions sprinkled about them, for `boundary_saddle`.
STRADDLED: Final = 1000
SPRINKLED: Final = 40_000


def boundary_saddle(catalogue: Catalogue, plane: Plane | None = None, *, seed: int = SEED,
                    straddled: int = STRADDLED, sprinkled: int = SPRINKLED) -> SaddleRates:
    """
    Estimate the rates of the saddle on the boundary of all basins of a catalogue.

    Parameters
    ----------
    catalogue : Catalogue
        The attractors; two at least, or rest beside one.
    plane : Plane, optional
        From which initial conditions on both sides of the boundary are drawn.
    seed : int
        Of all random choices.
    straddled, sprinkled : int
        Impacts of the straddle trajectory, and initial conditions sprinkled about it.

    Returns
    -------
    SaddleRates
        Escape rate, exponents and what follows from them, exact where the boundary holds one
        orbit; nan where too few trajectories stay long enough.

    Raises
    ------
    ValueError
        Where initial conditions show no boundary.

    """
    straddling = Straddling(catalogue, True, catalogue.hold)
    random = np.random.default_rng(seed)
    points = straddling.follow(plane or Plane(), straddled, random)
    orbit = straddling.orbit_of(points)
    return rates_of_orbit(orbit) if orbit else rates_of(np.stack([
        straddling.sprinkle(points, sprinkled // PARTS, random) for _ in range(PARTS)]))
