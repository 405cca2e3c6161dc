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

"""Values that options and functions have by default; only the standard library here."""

from collections.abc import Mapping
import types
from typing import Final

# The model of the paper [1].
ALPHA: Final = 0.48
BETA: Final = 0.1
GAMMA: Final = 0.1
RESTITUTION: Final = 0.9

# Windows of alpha of figures 2 and 8 of the paper [1].
WINDOWS: Final = ((0.47, 0.60), (1.00, 1.75))

# The search for attractors: the largest distance from an orbit [1], the impacts for which nothing
# may leave a chaotic attractor, the random initial conditions and their seed.
TOLERANCE: Final = 1e-3
HOLD: Final = 100_000
INITIAL_CONDITIONS: Final = 1000
SEED: Final = 1

# Impacts after which a grid of basins and of lifetimes gives a cell up; the latter is the paper's.
BASINS_CAP: Final = 20_000
LIFETIMES_CAP: Final = 5_000
# Lifetimes need the orbits only, which few initial conditions find.
LIFETIMES_INITIAL_CONDITIONS: Final = 256
LIFETIMES_HOLD: Final = 20_000
# Impacts of a finite-time exponent.
EXPONENT_IMPACTS: Final = 50

# Quantities of a gear pair: what each is, and its unit, in the order of a data sheet.
QUANTITIES: Final[Mapping[str, tuple[str, str]]] = types.MappingProxyType({
    'inertia_kg_m2': ('moment of inertia of the driven gear', 'kg m^2'),
    'driver_radius_m': ('pitch radius of the driver', 'm'),
    'driven_radius_m': ('pitch radius of the driven gear', 'm'),
    'backlash_m': ('backlash, along the pitch circle', 'm'),
    'drag_n_m_s_per_rad': ('drag torque of the driven gear per angular velocity', 'N m s/rad'),
    'torque_n_m': ('constant load torque of the driven gear', 'N m'),
    'drive_rad': ("amplitude of the driver's angular vibration", 'rad'),
    'drive_m': ("amplitude of the driver's vibration along the pitch circle", 'm'),
    'frequency_hz': ('frequency of the vibration', 'Hz'),
    'order': ('periods of the vibration per revolution at speed_rpm', '1'),
    'speed_rpm': ('speed of the shaft that order counts by', '1/min'),
    'restitution': ('coefficient of restitution', '1'),
})
