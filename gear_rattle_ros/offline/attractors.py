"""The tool `attractors`: every attractor at given parameters, and its share of random starts."""

import argparse
from collections.abc import Mapping
import dataclasses
import json
import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from . import cli, options
from .grid import Plane
from .layout import Layout
from .search import Catalogue, find_attractors, HOLD, STARTS, TOLERANCE
from .store import Store
from .store_making import make_store
from ..core.classify import FLOATING, RESTS_LOWER, RESTS_UPPER, UNRESOLVED
from ..core.elementary import TWO_PI
from ..core.model import Parameters
from ..core.periodic import Orbit

NAME: Final = 'attractors'
TITLE: Final = 'Attractors of the gear-rattling model'
ENDS: Final = {RESTS_UPPER: 'rest-upper', RESTS_LOWER: 'rest-lower', FLOATING: 'floating'}
TableOfArrays = dict[str, tuple[tuple[str, ...], npt.ArrayLike, Mapping[str, Any]]]


@dataclasses.dataclass(frozen=True)
class Attractor:
    """
    One attractor.

    Attributes
    ----------
    key : str
        Its name, the same in every run: that of a periodic orbit is made of its period and its
        first point, that of a chaotic one of the shortest periodic orbit on it.
    kind : str
        'periodic', 'chaotic', 'resting' on a wall or 'floating' between them for ever.
    label : int
        Its number in grids.
    impacts, drive_periods : int
        Period of an orbit; 0 for others.
    pieces : int
        Connected parts on the section; the points of an orbit; 0 at rest.
    multipliers : tuple of complex
        Eigenvalues of the tangent over a period; nan off orbits.
    exponents, errors : tuple of float
        Lyapunov exponents per impact and their standard errors [1]; errors of an orbit are zero.
    exact_sum : float
        What their sum must be [1].
    starts : int
        Random starts that have settled on it.
    share, share_error : float
        Their part of all, with the standard error of a binomial share [1].
    points : ndarray of float, shape (q, 4)
        Wall (0 upper, 1 lower), phase [rad], velocity and time since the impact before [1] of an
        orbit.

    """

    key: str
    kind: str
    label: int
    impacts: int = 0
    drive_periods: int = 0
    pieces: int = 0
    multipliers: tuple[complex, complex] = (complex(math.nan), complex(math.nan))
    exponents: tuple[float, float] = (math.nan, math.nan)
    errors: tuple[float, float] = (math.nan, math.nan)
    exact_sum: float = math.nan
    starts: int = 0
    share: float = 0.0
    share_error: float = 0.0
    points: npt.NDArray[np.float64] = dataclasses.field(
        default_factory=lambda: np.zeros((0, 4)))

    def describe(self) -> str:
        """
        Put it in words.

        Returns
        -------
        str
            One line.

        """
        share = f'{100.0 * self.share:.2f} +- {100.0 * self.share_error:.2f} %'
        words = f'{self.label:3d}  {self.key:32s} {share:>18s}  {self.kind}'
        if self.kind == 'periodic':
            largest = max(abs(value) for value in self.multipliers)
            words += (f': {self.impacts} impacts in {self.drive_periods} drive periods, '
                      f'largest multiplier {largest:.6f}')
        if self.kind == 'chaotic':
            words += (f': {self.pieces} pieces, exponents {self.exponents[0]:.5f} +- '
                      f'{self.errors[0]:.5f}, {self.exponents[1]:.5f} +- {self.errors[1]:.5f}')
        return words


def attractors_of(catalogue: Catalogue, late: tuple[Orbit, ...] = ()) -> tuple[Attractor, ...]:
    """
    List the attractors of a catalogue.

    Parameters
    ----------
    catalogue : Catalogue
        What a search has found.
    late : tuple of Orbit
        Orbits that it had missed.

    Returns
    -------
    tuple of Attractor
        In the order of their labels: periodic, chaotic, late, at rest, floating.

    """
    found = [_of_orbit(orbit, number, catalogue.parameters)
             for number, orbit in enumerate(catalogue.orbits)]
    for chaotic in catalogue.chaotic:
        report = chaotic.exponents
        found.append(Attractor(
            chaotic.key, 'chaotic', len(found), pieces=chaotic.pieces,
            exponents=(report.lambda_1, report.lambda_2),
            errors=(report.lambda_1_error, report.lambda_2_error), exact_sum=report.exact_sum))
    for orbit in late:
        found.append(_of_orbit(orbit, len(found), catalogue.parameters))
    for label, key in ENDS.items():
        if np.any(catalogue.labels == label):
            found.append(Attractor(key, 'floating' if label == FLOATING else 'resting', label))
    return tuple(_with_share(each, catalogue.labels) for each in found)


def table_of(attractors: tuple[Attractor, ...]) -> TableOfArrays:
    """
    Lay the attractors out as arrays for a store.

    Parameters
    ----------
    attractors : tuple of Attractor
        The attractors.

    Returns
    -------
    dict
        Dimensions, values and attributes by name.

    """
    one = ('attractor',)

    def column(name: str, words: str, units: str = '1') -> None:
        table[f'attractor_{name}'] = (one, np.array([getattr(each, name) for each in attractors]),
                                      {'long_name': words, 'units': units})

    table: TableOfArrays = {}
    for name, words in (
        ('key', 'name of the attractor'), ('kind', 'periodic, chaotic, resting or floating'),
        ('label', 'number in the grid'), ('impacts', 'impacts of a period'),
        ('drive_periods', 'drive periods of a period'), ('pieces', 'parts on the section'),
        ('exact_sum', 'exact sum of the exponents'), ('starts', 'random starts settled on it'),
        ('share', 'share of the random starts'), ('share_error', 'standard error of the share'),
    ):
        column(name, words, '' if name in ('key', 'kind') else '1')
    multipliers = np.array([each.multipliers for each in attractors]).reshape(-1, 2)
    pair = ('attractor', 'pair')
    for name, values, words in (
        ('multiplier_real', multipliers.real, 'multipliers of a period, real part'),
        ('multiplier_imaginary', multipliers.imag, 'multipliers of a period, imaginary part'),
        ('exponent', np.array([each.exponents for each in attractors]).reshape(-1, 2),
         'Lyapunov exponents per impact'),
        ('exponent_error', np.array([each.errors for each in attractors]).reshape(-1, 2),
         'standard errors of the exponents'),
    ):
        table[f'attractor_{name}'] = (pair, values, {'long_name': words, 'units': '1'})
    points = np.concatenate([np.zeros((0, 4)), *(each.points for each in attractors)])
    owners = [each.label for each in attractors for _ in each.points]
    for index, (name, words, units) in enumerate((
        ('side', 'wall: 0 upper, 1 lower', '1'), ('phase', 'drive phase of the impact', 'rad'),
        ('velocity', 'velocity before the impact', '1'),
        ('flight_time', 'time since the impact before', '1'),
    )):
        table[f'point_{name}'] = (('point',), points[:, index],
                                  {'long_name': words, 'units': units})
    table['point_label'] = (('point',), np.array(owners, np.int64),
                            {'long_name': 'attractor of the point', 'units': '1'})
    return table


def identity_of(name: str, parameters: Parameters, plane: Plane, **others: Any) -> dict[str, Any]:
    """
    List what makes a result what it is.

    Parameters
    ----------
    name : str
        The tool.
    parameters : Parameters
        Of the model.
    plane : Plane
        Of initial conditions.
    **others
        Further numbers and strings.

    Returns
    -------
    dict
        Plain values for `Layout`.

    """
    return {
        'tool': name,
        **dataclasses.asdict(parameters),
        'displacement': plane.displacement,
        'phase_window': list(plane.phase),
        'velocity_window': list(plane.velocity),
        **others,
    }


def write_attractors(store: Store, attractors: tuple[Attractor, ...], catalogue: Catalogue
                     ) -> None:
    """
    Put the table of attractors into a store.

    Parameters
    ----------
    store : Store
        The store.
    attractors : tuple of Attractor
        The attractors.
    catalogue : Catalogue
        Where they come from.

    """
    store.write_table(table_of(attractors))
    store.set_attributes({
        'labels': json.dumps({each.key: each.label for each in attractors}),
        'random_starts': len(catalogue.labels),
        'random_starts_unresolved': int(np.sum(catalogue.labels == UNRESOLVED)),
        'stay': catalogue.stay,
    })


def main(arguments: list[str] | None = None) -> int:
    """
    Run the command `attractors`.

    Parameters
    ----------
    arguments : list of str, optional
        Without the program's name; by default those of the process.

    Returns
    -------
    int
        Exit status: 0, 2 with one line that says why, 130 after Ctrl-C.

    """
    parser = options.Parser(NAME, description='Find every attractor at given parameters.')
    options.add_model(parser)
    options.add_plane(parser, size=None)
    options.add_seed(parser)
    parser.add_argument('--starts', type=options.whole(1), default=STARTS, metavar='N',
                        help=f'random starts; {STARTS} by default')
    parser.add_argument('--hold', type=options.whole(1000), default=HOLD, metavar='N',
                        help='impacts for which nothing may leave a chaotic attractor; '
                             f'{HOLD} by default')
    parser.add_argument('--tolerance', type=options.number, default=TOLERANCE, metavar='X',
                        help=f'distance within which an orbit is reached [1]; {TOLERANCE:g} by '
                             'default')

    def work(given: argparse.Namespace, run: cli.Run) -> int:
        parameters, plane = options.model_of(given), options.plane_of(given)
        require_tolerance(given.tolerance)
        identity = identity_of(NAME, parameters, plane, tolerance=given.tolerance,
                               hold=given.hold, starts=given.starts, seed=given.seed)
        store = make_store(run.output, Layout((), (), identity, {'title': TITLE}), run.command,
                           resume=run.resume)
        catalogue = find_attractors(
            parameters, plane.random_starts(parameters, given.starts, given.seed),
            tolerance=given.tolerance, hold=given.hold, threads=run.threads, cluster=run.cluster)
        found = attractors_of(catalogue)
        write_attractors(store, found, catalogue)
        store.mark(0)
        for each in found:
            print(each.describe())
        unresolved = int(np.sum(catalogue.labels == UNRESOLVED))
        print(f'     unresolved: {unresolved:,} of {given.starts:,} starts after {given.hold:,} '
              'impacts')

        def draw() -> cli.Figure:
            from .pictures import draw_section
            return draw_section(catalogue, found)

        return run.finish(draw)

    return cli.run_tool(parser, arguments, 'attractors-{alpha:g}.zarr', work)


def require_tolerance(tolerance: float) -> None:
    """
    Refuse a tolerance that makes no sense.

    Parameters
    ----------
    tolerance : float
        Largest distance from an orbit [1].

    Raises
    ------
    ValueError
        If it is not between 1e-7 and 0.1.

    """
    if not 1e-7 <= tolerance <= 0.1:
        raise ValueError(f'tolerance = {tolerance:g} is not between 1e-7 and 0.1')


def _of_orbit(orbit: Orbit, label: int, parameters: Parameters) -> Attractor:
    q = len(orbit.sides)
    exponents = sorted((math.log(abs(value)) / q if value else -math.inf
                        for value in orbit.multipliers), reverse=True)
    contraction = math.log(parameters.restitution) if parameters.restitution else -math.inf
    exact = 2.0 * contraction - parameters.beta * TWO_PI * orbit.drive_periods / q
    return Attractor(
        orbit.key, 'periodic', label, q, orbit.drive_periods, q, orbit.multipliers,
        (exponents[0], exponents[1]), (0.0, 0.0), exact if orbit.sticks < 0 else -math.inf,
        points=np.stack([orbit.sides.astype(np.float64), orbit.phases, orbit.velocities,
                         orbit.flight_times], axis=1))


def _with_share(attractor: Attractor, labels: npt.NDArray[np.int64]) -> Attractor:
    starts, total = int(np.sum(labels == attractor.label)), len(labels)
    # As if two more had settled on it and two elsewhere: a share of none or all has an error too.
    share = (starts + 2.0) / (total + 4.0)
    return dataclasses.replace(
        attractor, starts=starts, share=starts / total,
        share_error=math.sqrt(share * (1.0 - share) / (total + 4.0)))
