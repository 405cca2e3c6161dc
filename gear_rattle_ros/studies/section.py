"""Impacts counted on the section (phase, velocity): attractors and chaotic transients."""

import argparse
import dataclasses
from typing import Final

import numpy as np

from ..attractors.finding import find_attractors
from ..attractors.plane import Plane, TWO_PI
from ..cli.listing import listed
from ..cli.options import add_model, add_plane, add_seed, model_of, number, Parser, plane_of, whole
from ..cli.run import Figure, Run, run_tool
from ..core.arrays import FloatArray
from ..core.many.recorded import record_impacts
from ..core.model import Parameters
from ..store.layout import Axis, Layout, Variable
from ..store.making import make_store
from ..store.store import Store

# Trajectories followed at once.
BATCH: Final = 64
SETTLED, WANDERING = 0, 1
TABLES: Final = ('orbit_phase', 'orbit_velocity')


@dataclasses.dataclass(frozen=True)
class Section:
    """
    What is counted on the section.

    Random initial conditions in `plane` are followed for `skip` impacts, then `keep` are counted
    in `phases` times `velocities` bins, the latter over the window `velocity` [1].
    """

    parameters: Parameters
    plane: Plane
    trajectories: int
    seed: int
    skip: int
    keep: int
    velocity: tuple[float, float]
    phases: int
    velocities: int

    def __post_init__(self) -> None:
        """Validate."""
        if not self.velocity[0] < self.velocity[1]:
            raise ValueError(f'velocity window {self.velocity[0]:g} to {self.velocity[1]:g} is '
                             'empty or reversed; give the lower end first')


def compute(section: Section, run: Run) -> tuple[Store, str]:
    """Count impacts; return the store and what was seen, as a table."""
    store = make_store(run.output, _layout(section), run.command, resume=run.resume)
    if not store.pending() and all(store.has_table(name) for name in TABLES):
        return store, str(store.attributes['seen'])
    progress = run.progress(section.trajectories)
    starts = section.plane.random_starts(section.parameters, section.trajectories, section.seed)
    catalogue = find_attractors(section.parameters, starts, hold=section.skip + section.keep,
                                threads=run.threads)
    counts = np.zeros((2, section.velocities, section.phases))

    def count(kind: int, phases: FloatArray, velocities: FloatArray, times: int) -> None:
        counts[kind] += times * np.histogram2d(
            velocities, phases, (section.velocities, section.phases),
            (section.velocity, (0.0, TWO_PI)))[0]

    points = [np.zeros((0, 2))]
    for each in catalogue.attractors:
        if each.orbit and each.settled:
            count(SETTLED, each.orbit.phases, each.orbit.velocities, each.settled)
            points.append(each.orbit.points)
    on_orbit = np.isin(catalogue.labels, [each.label for each in catalogue.attractors
                                          if each.orbit])
    progress.add(int(np.count_nonzero(on_orbit)))
    wandering = starts[~on_orbit]
    for first in range(0, len(wandering), BATCH):
        rows, made = record_impacts(wandering[first:first + BATCH], section.skip, section.keep)
        for row, length in zip(rows, made, strict=True):
            count(WANDERING, row['phase'][:length], row['velocity'][:length], 1)
        progress.add(len(rows), int(made.sum()) + len(rows) * section.skip)
    progress.end()
    for kind in (SETTLED, WANDERING):
        store.write(kind, {'count': counts[kind][None].astype(np.uint32)})
    found = np.concatenate(points)
    store.write_table({
        TABLES[0]: (('point',), found[:, 0], {
            'long_name': 'phase of the impacts of periodic orbits', 'units': 'rad'}),
        TABLES[1]: (('point',), found[:, 1], {
            'long_name': 'velocity just before them', 'units': '1'})})
    words = listed(catalogue)
    store.set_attributes({'seen': words})
    # Last, as nothing of this is computed again once both are done.
    for kind in (SETTLED, WANDERING):
        store.mark(kind)
    return store, words


def _layout(section: Section) -> Layout:
    edges = np.linspace(*section.velocity, section.velocities + 1)
    phases = (np.arange(section.phases) + 0.5) * TWO_PI / section.phases
    identity = {
        'tool': 'section', **dataclasses.asdict(section.parameters),
        'trajectories': section.trajectories, 'seed': section.seed,
        'displacement': section.plane.displacement, 'phase_window': list(section.plane.phase),
        'start_velocity_window': list(section.plane.velocity), 'impacts_skipped': section.skip,
        'impacts_counted': section.keep, 'velocity_window': list(section.velocity),
        'bins': [section.phases, section.velocities]}
    return Layout(
        (Axis('kind', np.array(['settled', 'wandering']), {
            'long_name': 'on a periodic orbit at the end, or not'}, 1),
         Axis('velocity', 0.5 * (edges[1:] + edges[:-1]), {
             'long_name': 'velocity before the impact', 'units': '1'}),
         Axis('phase', phases, {'long_name': 'drive phase', 'units': 'rad'})),
        (Variable('count', ('kind', 'velocity', 'phase'), '<u4', {
            'long_name': 'impacts counted', 'units': '1'}),), identity)


def main(arguments: list[str] | None = None) -> int:
    """Run the command `section`."""
    parser = Parser('section', description='Count impacts on the section of phase and velocity.')
    add_model(parser, alpha=1.23)
    parser.add_argument('--trajectories', type=whole(1), default=64, metavar='N',
                        help='random starts; 64 by default')
    parser.add_argument('--skip', type=whole(0), default=1000, metavar='N',
                        help='impacts passed over; 1000 by default')
    parser.add_argument('--keep', type=whole(1), default=20_000, metavar='N',
                        help='impacts counted then; 20000 by default')
    parser.add_argument('--bins', type=whole(1), nargs=2, default=[720, 540], metavar=('N', 'M'),
                        help='along phase and velocity; 720 540 by default')
    parser.add_argument('--bin-window', type=number, nargs=2, default=[-2.0, 2.0],
                        metavar=('A', 'B'), help='velocities counted [1]; -2 2 by default')
    add_plane(parser, size=None)
    add_seed(parser)

    def work(given: argparse.Namespace, run: Run) -> int:
        section = Section(model_of(given), plane_of(given), given.trajectories, given.seed,
                          given.skip, given.keep, (given.bin_window[0], given.bin_window[1]),
                          *given.bins)
        store, words = compute(section, run)
        print(words)

        def draw() -> Figure:
            # Only here: matplotlib takes a second to import.
            from ..figures.section import draw_section
            return draw_section(store)

        return run.finish(draw)

    return run_tool(parser, arguments, 'section-{alpha:g}.zarr', work)
