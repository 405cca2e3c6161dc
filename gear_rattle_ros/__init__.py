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

"""
Gear rattling: the impact oscillator of de Souza & Caldas, live on ROS 2 and as a library.

What programs need stands here; each name is imported when it is used first.
"""

import importlib
from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
    from .attractors.catalogue import Catalogue as Catalogue
    from .attractors.finding import find_attractors as find_attractors
    from .attractors.plane import Plane as Plane
    from .bags.reader import Bag as Bag, EVENT_UNITS as EVENT_UNITS, read_bag as read_bag
    from .core.flight.simulation import Simulation as Simulation
    from .core.gears import Gears as Gears
    from .core.model import (
        EVENT as EVENT,
        EventKind as EventKind,
        Parameters as Parameters,
        State as State,
        Wall as Wall,
    )
    from .core.path import Path as Path
    from .core.stream.lyapunov import RunningLyapunov as RunningLyapunov
    from .core.stream.reconstruction import rebuild as rebuild
    from .core.stream.transients import TransientDetector as TransientDetector
    from .figures.draw import draw as draw, save as save
    from .store.store import open_dataset as open_dataset
    from .studies.grids.basins import basins as basins
    from .studies.grids.exponents import exponents as exponents
    from .studies.grids.lifetimes import lifetimes as lifetimes
    from .studies.robustness.drift import drift as drift
    from .studies.robustness.hopping import hopping as hopping
    from .studies.robustness.probability_basins import probability_basins as probability_basins
    from .studies.robustness.stability import stability as stability
    from .studies.skeleton.boundary import boundary as boundary
    from .studies.skeleton.manifolds import manifolds as manifolds
    from .studies.skeleton.orbits import orbits as orbits, read_orbits as read_orbits
    from .studies.skeleton.saddle import saddle as saddle
    from .studies.sweeps.orbit_diagram import orbit_diagram as orbit_diagram
    from .studies.sweeps.parameter_plane import parameter_plane as parameter_plane
    from .studies.trajectories.motion import motion as motion
    from .studies.trajectories.rattle import rattle as rattle
    from .studies.trajectories.section import section as section
    from .studies.transitions.continuation import continuation as continuation
    from .studies.transitions.crisis import crisis as crisis
    from .studies.transitions.transitions import transitions as transitions

__all__ = [
    'Bag', 'Catalogue', 'EVENT', 'EVENT_UNITS', 'EventKind', 'Gears', 'Parameters', 'Path',
    'Plane', 'RunningLyapunov', 'Simulation', 'State', 'TransientDetector', 'Wall', 'basins',
    'boundary', 'continuation', 'crisis', 'draw', 'drift', 'exponents', 'find_attractors',
    'hopping', 'lifetimes', 'manifolds', 'motion', 'open_dataset', 'orbit_diagram', 'orbits',
    'parameter_plane', 'probability_basins', 'rattle', 'read_bag', 'read_orbits', 'rebuild',
    'saddle', 'save', 'section', 'stability', 'transitions', '__version__',
]
MODULES = {
    'attractors.catalogue': ['Catalogue'],
    'attractors.finding': ['find_attractors'],
    'attractors.plane': ['Plane'],
    'bags.reader': ['Bag', 'EVENT_UNITS', 'read_bag'],
    'core.flight.simulation': ['Simulation'],
    'core.gears': ['Gears'],
    'core.model': ['EVENT', 'EventKind', 'Parameters', 'State', 'Wall'],
    'core.path': ['Path'],
    'core.stream.lyapunov': ['RunningLyapunov'],
    'core.stream.reconstruction': ['rebuild'],
    'core.stream.transients': ['TransientDetector'],
    'figures.draw': ['draw', 'save'],
    'store.store': ['open_dataset'],
    'studies.skeleton.orbits': ['orbits', 'read_orbits'],
    **{f'studies.grids.{name}': [name] for name in ('basins', 'exponents', 'lifetimes')},
    **{f'studies.robustness.{name}': [name] for name in (
        'drift', 'hopping', 'probability_basins', 'stability')},
    **{f'studies.skeleton.{name}': [name] for name in ('boundary', 'manifolds', 'saddle')},
    **{f'studies.sweeps.{name}': [name] for name in ('orbit_diagram', 'parameter_plane')},
    **{f'studies.trajectories.{name}': [name] for name in ('motion', 'rattle', 'section')},
    **{f'studies.transitions.{name}': [name] for name in (
        'continuation', 'crisis', 'transitions')},
}
# Where each name stands.
PLACES = {name: module for module, names in MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Import a name when it is used first."""
    if name == '__version__':
        # Only here: the import takes as long as the options of a command.
        from importlib.metadata import version
        return version(__name__)
    if name not in PLACES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    value = getattr(importlib.import_module(f'.{PLACES[name]}', __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
