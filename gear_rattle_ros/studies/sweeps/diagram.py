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

"""What an orbit diagram consists of: its columns, its store, attractors laid out as arrays."""

import dataclasses
import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ..attractors import identity_along
from ...attractors.catalogue import Kind
from ...attractors.columns import Branch, Window
from ...attractors.listing import named
from ...attractors.plane import Plane, STATE
from ...core.arrays import FloatArray
from ...core.flight.lanes_step import LANES
from ...core.model import Parameters
from ...core.path import Path
from ...store.layout import Axis, Layout, Variable

# Attractors kept apart in one column; what is beyond is counted with the last of them.
SLOTS: Final = 6
# Columns of a tile.
TILE: Final = 8
SWEEPS: Final = ('random', 'up', 'down')
KINDS: Final = tuple(kind.value for kind in Kind)
# Longest name.
KEY: Final = '<U48'
# Impacts of each attractor that are kept, to know it again in the next column.
POINTS: Final = 64
# What is measured of the boundary between basins, where that is asked for.
BOUNDARY: Final = {
    'boundary_exponent': 'uncertainty exponent of the boundary, nan where there is none',
    'boundary_exponent_error': 'its standard error',
    'boundary_entropy': 'boundary basin entropy S_bb, nan where there is no boundary',
    'boundary_entropy_error': 'its standard error'}
# What stands where there is no attractor; nan in every other array.
NOTHING: Final = {'count': 0, 'key': '', 'letter': '', 'share': 0.0, 'kind': -1,
                  'period_impacts': 0, 'period_drive': 0}


def in_order(sweeps: tuple[str, ...]) -> tuple[str, ...]:
    """Return sweeps in the order of `SWEEPS`, each once; ValueError for none or any other."""
    if not sweeps or not {*sweeps} <= {*SWEEPS}:
        raise ValueError(f'sweeps = {sweeps!r} must name some of {", ".join(SWEEPS)}')
    return tuple(name for name in SWEEPS if name in sweeps)


@dataclasses.dataclass(frozen=True)
class Diagram:
    """What an orbit diagram is made of."""

    path: Path
    columns: int  # equally spaced on it, both ends included
    plane: Plane  # from which initial conditions are drawn
    trajectories: int  # at each column; in sweeps up and down at most `LANES`
    seed: int
    window: Window
    sweeps: tuple[str, ...] = SWEEPS
    boundary: bool = False  # whether the boundary between basins is measured

    def __post_init__(self) -> None:
        if not 2 <= self.columns <= 100_000:
            raise ValueError(f'columns = {self.columns} is not between 2 and 100000')
        if not 1 <= self.trajectories <= 100_000:
            raise ValueError(f'trajectories = {self.trajectories} is not between 1 and 100000')

    @property
    def values(self) -> FloatArray:
        """Coordinates of the columns [1]."""
        return self.path.values(self.columns)

    def draw(self, column: int) -> npt.NDArray[np.void]:
        """Draw the initial conditions of a column, which has a seed of its own."""
        return self.plane.draw(self.at(column), self.trajectories, self.seed * 1_000_003 + column)

    def at(self, column: int) -> Parameters:
        """Return the parameters of a column."""
        return self.path.at(float(self.values[column]))


def layout_of(diagram: Diagram) -> Layout:
    """Return the layout of the store: a tile is `TILE` columns of one sweep."""
    window, plane = diagram.window, diagram.plane
    edges = np.linspace(window.low, window.high, window.bins + 1)
    axis = diagram.path.name
    identity = identity_along(
        'orbit_diagram', [diagram.path], plane, columns=diagram.columns,
        trajectories=diagram.trajectories, seed=diagram.seed,
        initial_velocity_window=list(plane.velocity), hold=window.hold,
        impacts_counted=window.keep, velocity_window=[window.low, window.high], bins=window.bins,
        sweeps=list(diagram.sweeps), **({'boundary': 1} if diagram.boundary else {}))
    if window.kicks:
        identity['kicks'] = 'smallest'
    kinds = ', '.join(f'{k} {name}' for k, name in enumerate(KINDS))
    axes = (
        Axis('sweep', np.array(diagram.sweeps), named(
            f'random: drawn at each {axis}; up, down: followed from the last state', None), 1),
        Axis(axis, diagram.values, named(diagram.path.words), TILE),
        Axis('slot', np.arange(SLOTS), named(f'attractors at one {axis}, largest first', None)),
        Axis('velocity', 0.5 * (edges[1:] + edges[:-1]),
             named('velocity before the impact, centre of the bin')),
        Axis('sample', np.arange(POINTS), named('some impacts of an attractor', None)),
        Axis('coordinate', np.array(['wall', 'phase', 'velocity']), named(
            'wall (0 upper, 1 lower), phase [rad], velocity before the impact [1]', None)),
        Axis('lane', np.arange(LANES), named('trajectory that is followed', None)),
        Axis('state', np.array(STATE), named('phase [rad], displacement, velocity [1]', None)))
    return Layout(axes, tuple(
        Variable(name, ('sweep', axis, *others), dtype, named(words, units))
        for name, others, dtype, words, units in (
            ('count', ('slot', 'velocity'), '<u4', 'impacts counted', '1'),
            ('key', ('slot',), KEY, 'name of the attractor, empty for none', None),
            ('letter', ('slot',), '<U1', 'its letter in the paper, empty for none', None),
            ('point', ('slot', 'sample', 'coordinate'), '<f4', 'some impacts, nan for fewer',
             None),
            ('share', ('slot',), '<f8', 'share of the trajectories', '1'),
            ('kind', ('slot',), '|i1', f'what it is: {kinds}, -1 nothing', None),
            ('period_impacts', ('slot',), '<i4', 'period, 0 off a periodic orbit', 'impacts'),
            ('period_drive', ('slot',), '<i4', 'period, 0 off a periodic orbit', 'drive periods'),
            ('exponent', ('slot',), '<f8', 'largest Lyapunov exponent per impact', '1'),
            ('exponent_error', ('slot',), '<f8', 'standard error; 0 from exact multipliers', '1'),
            ('exact_sum', ('slot',), '<f8', 'exact sum of both exponents, 2 ln r - beta <D>', '1'),
            *((('kick', ('slot',), '<f8', 'smallest kick at an impact that changes the attractor; '
                'nan where none does', '1'),) if window.kicks else ()),
            ('member_state', ('slot', 'state'), '<f8',
             'where one of its trajectories is; of an orbit, at an impact', None),
            ('end_state', ('lane', 'state'), '<f8',
             'last state of the trajectories that are followed', None),
            *((name, (), '<f8', words, '1') for name, words in BOUNDARY.items()
              if diagram.boundary))), identity)


def describe(columns: list[list[Branch]], diagram: Diagram) -> dict[str, npt.NDArray[Any]]:
    """Lay out the attractors of some columns as an array (column, slot ...) by variable."""
    layout = layout_of(diagram)
    sizes = {axis.name: len(axis.values) for axis in layout.axes} | {
        diagram.path.name: len(columns)}
    values = {each.name: np.full([sizes[name] for name in each.dimensions[1:]],
                                 NOTHING.get(each.name, math.nan), each.dtype)
              for each in layout.variables}
    for c, found in enumerate(columns):
        for k, one in enumerate(found):
            slot = c, min(k, SLOTS - 1)
            values['count'][slot] += one.counts.astype(np.uint32)
            values['share'][slot] += one.attractor.share
            if k >= SLOTS:
                continue
            values['key'][slot], values['letter'][slot] = one.attractor.key, one.attractor.letter
            points = one.attractor.points(POINTS)[:POINTS]
            values['point'][slot][:len(points)] = points
            values['kind'][slot] = KINDS.index(one.attractor.kind.value)
            for name in {'exponent', 'exponent_error', 'exact_sum', 'kick'} & values.keys():
                values[name][slot] = getattr(one, name)
            orbit = one.attractor.orbit
            if orbit:
                values['member_state'][slot] = (orbit.phases[0], -float(orbit.walls[0]),
                                                orbit.velocities[0])
            elif len(one.states):
                values['member_state'][slot] = [one.states[0][name] for name in STATE]
            values['period_impacts'][slot] = one.attractor.impacts
            values['period_drive'][slot] = one.attractor.drive_periods
    return values
