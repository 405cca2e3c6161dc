"""What an orbit diagram consists of: its columns, its store, attractors laid out as arrays."""

import dataclasses
import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from .attractors import require_window
from ..attractors.catalogue import Kind
from ..attractors.columns import Branch, Window
from ..attractors.plane import Plane
from ..core.arrays import FloatArray
from ..core.flight.lanes_step import LANES
from ..core.model import Parameters
from ..store.layout import Axis, Layout, Variable

# Attractors kept apart at one alpha; what is beyond is counted with the last of them.
SLOTS: Final = 6
# Columns of a tile.
TILE: Final = 8
SWEEPS: Final = ('starts', 'up', 'down')
KINDS: Final = tuple(kind.value for kind in Kind)
# Longest name.
KEY: Final = '<U48'
# Impacts of each attractor that are kept, to know it again at the next alpha.
POINTS: Final = 64
STATE: Final = ('phase', 'displacement', 'velocity')


@dataclasses.dataclass(frozen=True)
class Diagram:
    """
    What an orbit diagram is made of.

    `columns` amplitudes are equally spaced between the two `alphas` [1], both included, whatever
    the alpha of `parameters`. Each has `trajectories` initial conditions, drawn from `plane` with
    `seed`; the sweeps up and down, which go on from the neighbouring column, follow at most
    `LANES`.
    """

    parameters: Parameters
    alphas: tuple[float, float]
    columns: int
    plane: Plane
    trajectories: int
    seed: int
    window: Window
    sweeps: tuple[str, ...] = SWEEPS

    def __post_init__(self) -> None:
        """Validate."""
        require_window(self.alphas)
        if not 2 <= self.columns <= 100_000:
            raise ValueError(f'columns = {self.columns} is not between 2 and 100000')
        if not 1 <= self.trajectories <= 100_000:
            raise ValueError(f'trajectories = {self.trajectories} is not between 1 and 100000')

    @property
    def values(self) -> FloatArray:
        """Amplitudes [1]."""
        return np.linspace(*self.alphas, self.columns)

    def draw(self, column: int) -> npt.NDArray[np.void]:
        """Draw the initial conditions of a column, which has a seed of its own."""
        return self.plane.draw(self.at(column), self.trajectories,
                                        self.seed * 1_000_003 + column)

    def at(self, column: int) -> Parameters:
        """Return the parameters of a column, with its alpha."""
        return dataclasses.replace(self.parameters, alpha=float(self.values[column]))


def layout_of(diagram: Diagram) -> Layout:
    """Return the layout of the store: a tile is `TILE` columns of one sweep."""
    window, one = diagram.window, {'units': '1'}
    edges = np.linspace(window.low, window.high, window.bins + 1)
    slot = ('sweep', 'alpha', 'slot')
    identity: dict[str, Any] = {
        'tool': 'orbit_diagram', 'beta': diagram.parameters.beta,
        'gamma': diagram.parameters.gamma, 'restitution': diagram.parameters.restitution,
        'alpha_window': list(diagram.alphas), 'columns': diagram.columns,
        'trajectories': diagram.trajectories, 'seed': diagram.seed,
        'displacement': diagram.plane.displacement, 'phase_window': list(diagram.plane.phase),
        'initial_velocity_window': list(diagram.plane.velocity),
        'hold': window.hold, 'impacts_counted': window.keep,
        'velocity_window': [window.low, window.high], 'bins': window.bins,
        'sweeps': list(diagram.sweeps)}
    return Layout(
        (Axis('sweep', np.array(diagram.sweeps), {
            'long_name': 'starts: many at each alpha; up, down: followed from the last state'}, 1),
         Axis('alpha', diagram.values, {'long_name': 'amplitude of the drive', **one}, TILE),
         Axis('slot', np.arange(SLOTS), {'long_name': 'attractors at one alpha, largest first'}),
         Axis('velocity', 0.5 * (edges[1:] + edges[:-1]), {
             'long_name': 'velocity before the impact, centre of the bin', **one}),
         Axis('sample', np.arange(POINTS), {'long_name': 'some impacts of an attractor'}),
         Axis('coordinate', np.array(['wall', 'phase', 'velocity']), {
             'long_name': 'wall (0 upper, 1 lower), phase [rad], velocity before the impact [1]'}),
         Axis('lane', np.arange(LANES), {'long_name': 'trajectory that is followed'}),
         Axis('state', np.array(STATE), {'long_name': 'phase [rad], displacement, velocity [1]'})),
        (Variable('count', (*slot, 'velocity'), '<u4', {
            'long_name': 'impacts counted', **one}),
         Variable('key', slot, KEY, {'long_name': 'name of the attractor, empty for none'}),
         Variable('point', (*slot, 'sample', 'coordinate'), '<f4', {
             'long_name': 'some impacts, nan for fewer'}),
         Variable('share', slot, '<f8', {'long_name': 'share of the trajectories', **one}),
         Variable('kind', slot, '|i1', {
             'long_name': 'what it is: ' + ', '.join(
                 f'{k} {name}' for k, name in enumerate(KINDS)) + ', -1 nothing'}),
         Variable('period_impacts', slot, '<i4', {
             'long_name': 'period, 0 off a periodic orbit', 'units': 'impacts'}),
         Variable('period_drive', slot, '<i4', {
             'long_name': 'period, 0 off a periodic orbit', 'units': 'drive periods'}),
         Variable('exponent', slot, '<f8', {
             'long_name': 'largest Lyapunov exponent per impact', **one}),
         Variable('exponent_error', slot, '<f8', {
             'long_name': 'standard error; 0 from exact multipliers', **one}),
         Variable('exact_sum', slot, '<f8', {
             'long_name': 'exact sum of both exponents, 2 ln r - beta <D>', **one}),
         Variable('member_state', (*slot, 'state'), '<f8', {
             'long_name': 'where one of its trajectories is; of an orbit, at an impact'}),
         Variable('end_state', ('sweep', 'alpha', 'lane', 'state'), '<f8', {
             'long_name': 'last state of the trajectories that are followed'})),
        identity)


def describe(columns: list[list[Branch]], diagram: Diagram) -> dict[str, npt.NDArray[Any]]:
    """Lay out the attractors of some columns as an array (alpha, slot ...) by variable."""
    shape = (len(columns), SLOTS)
    values: dict[str, npt.NDArray[Any]] = {
        'count': np.zeros((*shape, diagram.window.bins), np.uint32), 'key': np.zeros(shape, KEY),
        'point': np.full((*shape, POINTS, 3), math.nan, np.float32),
        'share': np.zeros(shape), 'kind': np.full(shape, -1, np.int8),
        'period_impacts': np.zeros(shape, np.int32), 'period_drive': np.zeros(shape, np.int32),
        'exponent': np.full(shape, math.nan), 'exponent_error': np.full(shape, math.nan),
        'exact_sum': np.full(shape, math.nan),
        'member_state': np.full((*shape, len(STATE)), math.nan)}
    for c, found in enumerate(columns):
        for k, one in enumerate(found):
            slot = c, min(k, SLOTS - 1)
            values['count'][slot] += one.counts.astype(np.uint32)
            values['share'][slot] += one.attractor.share
            if k >= SLOTS:
                continue
            values['key'][slot] = one.attractor.key
            points = one.attractor.points(POINTS)[:POINTS]
            values['point'][slot][:len(points)] = points
            values['kind'][slot] = KINDS.index(one.attractor.kind.value)
            values['exponent'][slot] = one.exponent
            values['exponent_error'][slot] = one.exponent_error
            values['exact_sum'][slot] = one.exact_sum
            orbit = one.attractor.orbit
            if orbit:
                values['member_state'][slot] = (orbit.phases[0], -float(orbit.walls[0]),
                                                orbit.velocities[0])
            elif len(one.states):
                values['member_state'][slot] = [one.states[0][name] for name in STATE]
            values['period_impacts'][slot] = one.attractor.impacts
            values['period_drive'][slot] = one.attractor.drive_periods
    return values
