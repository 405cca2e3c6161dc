"""The tool `attractors`: every attractor at given parameters, and its share of random starts."""

import argparse
from collections.abc import Mapping
import dataclasses
import json
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ..attractors.catalogue import Attractor, Catalogue, HOLD, Kind, TOLERANCE
from ..attractors.finding import find_attractors, STARTS
from ..attractors.plane import Plane
from ..cli import options, run as cli
from ..cli.listing import listed
from ..core.model import Parameters
from ..store.layout import Layout
from ..store.making import make_store
from ..store.store import Store

NAME: Final = 'attractors'
TITLE: Final = 'Attractors of the gear-rattling model'
TableOfArrays = dict[str, tuple[tuple[str, ...], npt.ArrayLike, Mapping[str, Any]]]


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
    table: TableOfArrays = {}
    for name, words in (
        ('key', 'name of the attractor'),
        ('kind', 'periodic, chaotic, resting, floating or unsettled'),
        ('label', 'number in the grid'), ('impacts', 'impacts of a period'),
        ('drive_periods', 'drive periods of a period'),
        ('pieces', 'parts visited in turn on one wall'),
        ('exact_sum', 'exact sum of the exponents'),
        ('settled', 'random initial conditions settled on it'),
        ('share', 'share of the random initial conditions'),
        ('share_error', 'standard error of the share'),
    ):
        column = [getattr(each, name) for each in attractors]
        table[f'attractor_{name}'] = (
            one, np.array([value.value if isinstance(value, Kind) else value for value in column]),
            {'long_name': words, 'units': '' if name in ('key', 'kind') else '1'})
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
    orbits = [each for each in attractors if each.orbit]
    points = np.concatenate([np.zeros((0, 4)), *(np.column_stack(
        [each.points(), each.orbit.flight_times]) for each in orbits if each.orbit)])
    owners = [each.label for each in orbits for _ in range(each.impacts)]
    for index, (name, words, units) in enumerate((
        ('wall', 'wall: 0 upper, 1 lower', '1'), ('phase', 'drive phase of the impact', 'rad'),
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


def write_attractors(store: Store, catalogue: Catalogue) -> None:
    """
    Put the table of attractors into a store.

    Parameters
    ----------
    store : Store
        The store.
    catalogue : Catalogue
        The attractors.

    """
    store.write_table(table_of(catalogue.attractors))
    store.set_attributes({
        'labels': json.dumps({each.key: each.label for each in catalogue.attractors}),
        'random_starts': len(catalogue.labels),
        'stay': catalogue.stay,
    })


def main(arguments: list[str] | None = None) -> int:
    """Run the command `attractors`."""
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
        write_attractors(store, catalogue)
        store.mark(0)
        print(listed(catalogue))

        def draw() -> cli.Figure:
            from ..figures.grids import draw_section
            return draw_section(catalogue)

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
