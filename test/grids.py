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

"""What the tests of the grids share."""

from pathlib import Path

import numpy as np

from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.core.defaults import BASINS_CAP, SEED, TOLERANCE
from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.store.store import Store
from gear_rattle_ros.studies.grids.basins import compute_basins
from gear_rattle_ros.studies.work import Work

SEARCH = {'cap': BASINS_CAP, 'tolerance': TOLERANCE, 'seed': SEED, 'initial_conditions': 150,
          'hold': 3000}
PARAMETERS = Parameters()


def basin(path: Path, plane: Plane, parameters: Parameters = PARAMETERS, *,
          resume: bool = False, threads: int | None = None, cluster: str | None = None, **search):
    """Compute a basin; returns store, labels, lifetimes and attractors."""
    store, catalogue = compute_basins(
        parameters, plane, Work(path, resume, threads, cluster), **SEARCH | search)
    return store, store.read_all('label'), store.read_all('lifetime'), catalogue.attractors


def files_of(store: Store) -> dict[str, bytes]:
    """Return the chunks of both grids."""
    return {str(path.relative_to(store.path)): path.read_bytes()
            for name in ('label', 'lifetime') for path in sorted((store.path / name).iterdir())}


def same(a: np.ndarray, b: np.ndarray) -> float:
    """Return the share of equal cells."""
    return float(np.mean(a == b))
