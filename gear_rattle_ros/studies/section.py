"""Impacts counted on the section (phase, velocity): attractors and chaotic transients."""

import math
from typing import Any, Final, Unpack

import numpy as np

from .attractors import identity_of
from .work import Arrays, Study, Work, WorkOptions
from ..attractors.finding import find_attractors
from ..attractors.listing import named
from ..attractors.plane import initial_condition, Plane
from ..core.arrays import FloatArray
from ..core.defaults import SEED
from ..core.flight.lanes import IMPACT
from ..core.many.recorded import record_impacts
from ..core.model import Parameters
from ..core.words import counted
from ..store.layout import Axis, Layout, Variable
from ..store.store import Store

NAME: Final = 'section'
# Trajectories followed at once.
BATCH: Final = 64
SETTLED, WANDERING = 0, 1
TABLES: Final = ('orbit_phase', 'orbit_velocity', 'impact_phase', 'impact_velocity')


@Study
def section(parameters: Parameters, plane: Plane | None = None, *, trajectories: int = 64,
            skip: int = 1000, keep: int = 20_000, bins: tuple[int, int] = (720, 540),
            bin_window: tuple[float, float] = (-2.0, 2.0),
            initial: tuple[float, float, float] | None = None, seed: int = SEED,
            **options: Unpack[WorkOptions]) -> Store:
    """
    Count impacts on the section.

    The dataset has `count` over phase and velocity, of what settled on a periodic orbit and of
    what did not, and the periodic orbits. Of one trajectory it has the impacts in turn, too, and
    those before it settles count as not settled.

    Parameters
    ----------
    parameters, plane, seed
        The model, the window from which initial conditions are drawn, and their seed.
    trajectories, skip, keep : int
        Trajectories, and the impacts of each that are passed over and then counted.
    bins : tuple of int
        Along phase and velocity.
    bin_window : tuple of float
        Velocities that are counted [1].
    initial : tuple of float, optional
        Phase [rad], velocity and displacement [1] of the only initial condition.

    """
    if not bin_window[0] < bin_window[1]:
        raise ValueError(f'velocity window {bin_window[0]:g} to {bin_window[1]:g} is empty or '
                         'reversed; give the lower end first')
    work, plane = Work(**options), plane or Plane()
    single = {} if initial is None else {'initial': list(initial)}
    trajectories = 1 if single else trajectories
    store = work.begin(_layout(identity_of(
        NAME, parameters, plane, trajectories=trajectories, seed=seed, **single,
        initial_velocity_window=list(plane.velocity), impacts_skipped=skip, impacts_counted=keep,
        velocity_window=list(bin_window), bins=list(bins))))
    if not store.pending() and all(store.has_table(name) for name in TABLES):
        return store
    drawn = (plane.draw(parameters, trajectories, seed) if initial is None else
             initial_condition(parameters, *initial))
    catalogue = find_attractors(parameters, drawn, hold=skip + keep, threads=work.threads)
    counts = np.zeros((2, bins[1], bins[0]))

    def count(kind: int, phases: FloatArray, velocities: FloatArray, times: int) -> None:
        counts[kind] += times * np.histogram2d(
            velocities, phases, bins[::-1], (bin_window, (0.0, math.tau)))[0]

    points = [np.zeros((0, 2))]
    for each in catalogue.attractors:
        if each.orbit and each.settled:
            count(SETTLED, each.orbit.phases, each.orbit.velocities, each.settled)
            points.append(each.orbit.points)
    # Of one trajectory the impacts before it settles.
    lifetime, impacts = -1, np.zeros(0, IMPACT)
    on_orbit = np.isin(catalogue.labels, [each.label for each in catalogue.attractors
                                          if each.orbit])
    if single:
        (impacts,), (made,) = record_impacts(drawn, skip, keep)
        impacts = impacts[:made]
        if on_orbit.any():
            lifetime = int(catalogue.label(drawn, threads=work.threads)['lifetime'][0])
            transient = impacts[:max(lifetime - skip, 0)]
            count(WANDERING, transient['phase'], transient['velocity'], 1)
    wandering = drawn[~on_orbit]
    with work.report(NAME, trajectories) as progress:
        progress.add(int(np.count_nonzero(on_orbit)))
        for first in range(0, len(wandering), BATCH):
            rows, made = record_impacts(wandering[first:first + BATCH], skip, keep)
            for row, length in zip(rows, made, strict=True):
                count(WANDERING, row['phase'][:length], row['velocity'][:length], 1)
            progress.add(len(rows), int(made.sum()) + len(rows) * skip)
    for kind in (SETTLED, WANDERING):
        store.write(kind, {'count': counts[kind][None].astype(np.uint32)})
    found = np.concatenate(points)
    store.write_table({
        TABLES[0]: (('point',), found[:, 0],
                    named('phase of the impacts of periodic orbits', 'rad')),
        TABLES[1]: (('point',), found[:, 1], named('velocity just before them')),
        TABLES[2]: (('impact',), impacts['phase'],
                    named('phase of the impacts of one trajectory in turn', 'rad')),
        TABLES[3]: (('impact',), impacts['velocity'], named('velocity just before them'))})
    store.set_attributes({'attractors': repr(catalogue), 'lifetime': lifetime})
    # Last, as nothing of this is computed again once both are done.
    for kind in (SETTLED, WANDERING):
        store.mark(kind)
    return store


def describe(dataset: Arrays) -> str:
    """List the attractors that were reached, and of one trajectory its transient."""
    a = dataset.attrs
    return str(a['attractors']) + (
        f'\ntransient of {counted(a["lifetime"], "impact")}' if a['lifetime'] >= 0 else '')


def _layout(identity: dict[str, Any]) -> Layout:
    phases, velocities = identity['bins']
    low, high = identity['velocity_window']
    edges = np.linspace(low, high, velocities + 1)
    return Layout(
        (Axis('kind', np.array(['settled', 'wandering']),
              named('on a periodic orbit at the end, or not', None), 1),
         Axis('velocity', 0.5 * (edges[1:] + edges[:-1]), named('velocity before the impact')),
         Axis('phase', (np.arange(phases) + 0.5) * math.tau / phases,
              named('drive phase', 'rad'))),
        (Variable('count', ('kind', 'velocity', 'phase'), '<u4', named('impacts counted')),),
        identity)
