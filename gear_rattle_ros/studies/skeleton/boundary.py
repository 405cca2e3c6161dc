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

"""The boundary between basins: how uncertain, how fractal, and shared by how many basins."""

import contextlib
import dataclasses
import functools
import math
from pathlib import Path as FilePath
from typing import Any, Final, Unpack

import numpy as np

from .saddle import boundary_saddle
from .. import attractors
from ..attractors import identity_along
from ..grids.basins import compute_basins
from ..work import Arrays, Study, Work, WorkOptions
from ...attractors.catalogue import Catalogue, results_here
from ...attractors.listing import named, table
from ...attractors.plane import IMPACT, Plane
from ...attractors.skeleton.accessible import accessible_orbit
from ...attractors.skeleton.kicks import smallest_kick
from ...core.arrays import FloatArray, IntArray
from ...core.boundaries.entropy import (
    basin_entropies,
    disc_entropy,
    Entropy,
    is_smooth,
    PARTS,
    SMOOTH,
)
from ...core.boundaries.uncertainty import count_cut, fit_power_law, Label, PowerLaw, PROBES
from ...core.boundaries.wada import follow_unstable, merge_basins, refine_boundary
from ...core.defaults import BASINS_CAP, HOLD, INITIAL_CONDITIONS, LIFETIMES_CAP, SEED, TOLERANCE
from ...core.many.settling import UNSETTLED
from ...core.model import Parameters
from ...core.orbits.manifolds import saddle_of
from ...core.path import Path
from ...core.words import counted, in_columns
from ...store.layout import Axis, Layout, Variable
from ...store.store import Store

NAME: Final = 'boundary'
TITLE: Final = 'Basin boundary of the gear-rattling model'
# Distances below it are too near the rounding of a phase to be probed [1]; one of a last digit,
# at which probes show what rounding alone changes.
DECIDED: Final = 1e-12
ROUNDING: Final = 1e-15
MOST: Final = 200_000  # probes at one distance
# Boxes and discs of the grid [cells], and the discs.
EDGES: Final = (5, 10, 15, 20, 25)
RADIUS: Final = 20
DISCS: Final = 5000
# Wada: part of the window within which merged boundaries are one; halvings between neighbouring
# cells, how many of these, and the share that must show all basins.
REACH: Final = 0.05
HALVINGS: Final = 10
PAIRS: Final = 400
SHARED: Final = 0.9
# A coarse measure at each of many alphas: distances, relative error of the shares, cells along the
# edge of the grid and of its boxes.
COARSE: Final = (1e-8, 1e-2)
COARSE_ERROR: Final = 0.1
COARSE_GRID: Final = 150
COARSE_EDGE: Final = 6
# The rates of the saddle in the dataset.
SADDLE: Final = {
    'exponent': 'uncertainty exponent by the saddle on the boundary',
    'exponent_error': 'its standard error', 'kappa': 'escape rate of the saddle per impact',
    'lambda_1': 'its larger Lyapunov exponent per impact'}


# A row of a sweep.
LAWS: Final = {'exponent': 'exponent of the share of probes that are cut',
               'exponent_error': 'standard error of the exponent'}
LIMIT: Final = ('mean', 'mean_error', 'boundary', 'boundary_error')
ROW: Final = {'basins': 'number of basins'} | LAWS | {
    f'entropy_{name}': f'entropy of basins in the limit of large boxes: {name}'
    for name in LIMIT} | {
    'merging': 'least share of a boundary of one basin that has that of each other near',
    'refinement': 'share of neighbouring cells in different basins between which all basins are '
    'found'} | {f'saddle_{name}': words for name, words in SADDLE.items()}


def labels_of(known: Catalogue, plane: Plane, cap: int, across: FloatArray, velocities: FloatArray
              ) -> IntArray:
    """Label points of a plane."""
    initial = plane.at(known.parameters, across, velocities)
    return np.asarray(results_here(initial, cap, known.table)['label'], np.int64)


@Study
def boundary(place: Parameters | Path, plane: Plane | None = None, *,
             distances: tuple[float, float] = (1e-9, 1e-1), per_decade: int = 2,
             error: float = 0.03, cap: int = BASINS_CAP, tolerance: float = TOLERANCE,
             initial_conditions: int = INITIAL_CONDITIONS, seed: int = SEED, hold: int = HOLD,
             columns: int = 14, **options: Unpack[WorkOptions]) -> Store:
    """
    Measure the boundary between basins in a plane.

    The dataset has, by `probe` and `distance`, how many random `probes` there were and how many
    of them are `cut`, as their points differ in their labels; the `exponent` of each probe;
    the entropy of basins in boxes and discs of cells, the three tests of Wada, the rates of the
    saddle on the boundary, and what `basins` has. Along a path it has a row of the results alone
    for each value.

    Parameters
    ----------
    place, plane
        The model, or the path along which it changes, and the window with the cells of the
        entropy.
    distances : tuple of float
        Smallest and largest distance of the probes [1 and rad].
    per_decade : int
        Distances to a factor of ten.
    error : float
        Relative error of the share of probes that are cut.
    cap, tolerance, initial_conditions, seed, hold
        As `basins` takes them.
    columns : int
        Values on a path, evenly spaced.

    """
    sizes = np.append(distances_of(distances, per_decade), ROUNDING)
    if not 0.001 <= error <= 0.3:
        raise ValueError(f'--error {error:g} is not between 0.001 and 0.3')
    work, plane = Work(**options), plane or Plane()
    asked = {'cap': cap, 'tolerance': tolerance, 'seed': seed, 'hold': hold,
             'initial_conditions': initial_conditions, 'error': error, 'per_decade': per_decade,
             'distances': list(distances)}
    if isinstance(place, Parameters):
        return _measured(place, plane, sizes, asked, work)
    store = work.begin(_layout(place, plane, columns, asked))
    with work.pending(NAME, store, lambda tile: 1) as (pending, finished):
        work.run(functools.partial(_fill, store.path, place, plane, sizes, asked), pending,
                 lambda tile, done: finished(tile, 0))
    return store


def _measured(parameters: Parameters, plane: Plane, sizes: FloatArray, asked: dict[str, Any],
              work: Work, is_row: bool = False) -> Store:
    store, known = compute_basins(parameters, plane, work, name=NAME, title=TITLE, **asked)
    # A row of a sweep has nothing of what has no boundary.
    if is_row and len(np.unique(store.read_all('label'))) < 2:
        return store
    label = functools.partial(labels_of, known, plane, asked['cap'])
    _count(store, plane, label, sizes, asked['error'], asked['seed'], work)
    if not store.has_table('saddle_lambda_1'):
        _write_results(store, plane, label, known, asked['seed'], work)
    return store


def _layout(path: Path, plane: Plane, columns: int, asked: dict[str, Any]) -> Layout:
    probes = named('triplet: a point and one on either side; box: the corners of a square', None)
    return Layout(
        (Axis(path.name, path.values(columns), named(path.words), 1),
         Axis('probe', np.array(PROBES), probes)),
        tuple(Variable(name, (path.name, *(('probe',) if name in LAWS else ())), '<f8',
                       named(words)) for name, words in ROW.items()),
        identity_along(NAME, [path], plane, columns=columns, **asked,
                       size=[plane.phases, plane.velocities]), {'title': TITLE})


def _fill(place: FilePath, path: Path, plane: Plane, sizes: FloatArray, asked: dict[str, Any],
          tile: int) -> None:
    """Measure the boundary at one value of a path, and store the row."""
    store = Store(place)
    one = _measured(path.at(float(store.read_all(path.name)[tile])), plane, sizes, asked,
                    Work(threads=1, progress=False), True)
    row: dict[str, Any] = dict.fromkeys(ROW, math.nan) | {
        name: (math.nan,) * len(PROBES) for name in LAWS} | {
        'basins': np.count_nonzero(np.unique(one.read_all('label')) != UNSETTLED)}
    if one.has_table('saddle_lambda_1'):
        row |= {name: one.read_all(name) for name in (*LAWS, *(f'saddle_{s}' for s in SADDLE))}
        row |= {name: values[-1] for name in ('merging', 'refinement')
                if len(values := one.read_all(name))}
        # The last is that in the limit, where it could be extrapolated.
        for each in entropies_of(one)[-1:]:
            row |= {f'entropy_{name}': getattr(each, name) for name in LIMIT}
    store.write(tile, {name: np.asarray(values)[None] for name, values in row.items()})
    one.close()


def measure(known: Catalogue, plane: Plane, seed: int) -> tuple[float, float, float, float]:
    """Return the exponent and S_bb of a boundary, each with its error, coarsely; nan for none."""
    label = functools.partial(labels_of, known, plane, LIFETIMES_CAP)
    cells = dataclasses.replace(plane, phases=COARSE_GRID, velocities=COARSE_GRID)
    grid = known.label(cells.cells(known.parameters, slice(None), slice(None)), LIFETIMES_CAP,
                       threads=1)['label'].reshape(COARSE_GRID, COARSE_GRID)
    if np.ptp(grid) == 0:
        return (math.nan,) * 4
    *_, entropy, entropy_error = basin_entropies(grid, (COARSE_EDGE,))[0]
    random, sizes = np.random.default_rng(seed), distances_of(COARSE, 2)
    counts = np.array([count_cut(label, (plane.window, plane.velocity), PROBES[0], size,
                                 COARSE_ERROR, MOST, random) for size in sizes])
    law = fit_power_law(sizes, *counts.T)
    exponent, error = (law.exponent, law.error) if law else (math.nan, math.nan)
    return exponent, error, entropy, entropy_error


def distances_of(distances: tuple[float, float], per_decade: int) -> FloatArray:
    """List the distances of the probes, the largest first; ValueError where there are few."""
    low, high = distances
    if not DECIDED <= low < high <= 1.0:
        raise ValueError(f'--distances {low:g} {high:g}: give two between {DECIDED:g}, below '
                         'which rounding decides, and 1, the smaller first')
    count = int(per_decade * math.log10(high / low) + 1.0 + 1e-9)
    if count < 4:
        raise ValueError(f'--distances {low:g} {high:g} are {counted(count, "distance")} with '
                         f'--per-decade {per_decade}; a power law takes 4')
    return high * 10.0**(-np.arange(count) / per_decade)


def _count(store: Store, plane: Plane, label: Label, sizes: FloatArray, error: float, seed: int,
           work: Work) -> None:
    """Count the cut probes of each kind at each distance, where that is not done yet."""
    cut, probes = (store.read_all(name) if store.has_table('probes') else np.zeros(
        (len(PROBES), len(sizes)), np.int64) for name in ('cut', 'probes'))
    # Boxes of a last digit have corners that are the same.
    left = [k for k in range(probes.size - 1) if not probes.flat[k]]

    def count(number: int) -> tuple[int, int]:
        probe, size = divmod(number, len(sizes))
        return count_cut(label, (plane.window, plane.velocity), PROBES[probe], sizes[size], error,
                         MOST, np.random.default_rng([seed, number]))

    with work.report(f'{NAME}, probes', probes.size - 1) as progress:
        progress.skip(probes.size - 1 - len(left))

        def finished(number: int, counts: tuple[int, int]) -> None:
            cut.flat[number], probes.flat[number] = counts
            # What says that it is done comes last.
            store.write_table({name: (('probe', 'distance'), values, named(words))
                               for name, values, words in (
                ('cut', cut, 'probes whose points differ in their labels'),
                ('probes', probes, 'all probes'))})
            progress.add(1)

        if not store.has_table('distance'):
            store.write_table({
                'probe': (('probe',), np.array(PROBES), named(
                    'triplet: a point and one on either side; box: the corners of a square',
                    None)),
                'distance': (('distance',), sizes, named(
                    'distance in a triplet, edge of a box'))})
        work.run(count, left, finished)


def law_of(dataset: Arrays, probe: str) -> PowerLaw | None:
    """Fit the power law of a probe over the distances at which rounding does not decide."""
    sizes = dataset['distance'].values
    row, decided = PROBES.index(probe), sizes >= DECIDED
    return fit_power_law(sizes[decided], *(
        dataset[name].values[row][decided] for name in ('cut', 'probes')))


def entropies_of(dataset: Arrays) -> list[Entropy]:
    return [Entropy(*row) for row in zip(*(
        dataset[f'entropy_{name}'].values.tolist() for name in Entropy._fields), strict=True)]


def _write_results(store: Store, plane: Plane, label: Label, known: Catalogue, seed: int,
                   work: Work) -> None:
    """Write what follows from the probes and the cells, and the rates of the saddle."""
    laws = [law_of(store, probe) for probe in PROBES]
    grid = np.asarray(store.read_all('label'), np.int64)
    small = min(grid.shape) // PARTS
    edges = tuple(edge for edge in EDGES if edge <= small)
    entropies = basin_entropies(grid, edges) if edges else []
    radius = min(RADIUS, small)
    basins = [basin for basin in np.unique(grid).tolist() if basin != UNSETTLED]
    saddle = [math.nan] * len(SADDLE)
    # Without a boundary there is none.
    with contextlib.suppress(ValueError):
        rates = boundary_saddle(known, plane, seed=seed)
        saddle = [*rates.exponent, rates.kappa[0], rates.lambda_1[0]]
    columns: tuple[tuple[str, tuple[str, ...], Any, str], ...] = (
        *((name, ('probe',), [getattr(law, what, math.nan) for law in laws], LAWS[name])
          for name, what in zip(LAWS, ('exponent', 'error'), strict=True)),
        ('disc', ('value',), [radius, *disc_entropy(grid, radius, DISCS,
                                                    np.random.default_rng(seed))],
         'radius of random discs [cells], mean entropy of those with several labels, its standard '
         'error'),
        ('merging', ('cells',), merge_basins(grid, basins, int(REACH * min(grid.shape))),
         'least share of a boundary of one basin that has that of each other within so many '
         'cells'),
        ('refinement', ('halving',), refine_boundary(
            label, (plane.window, plane.velocity), grid, basins, HALVINGS, PAIRS,
            np.random.default_rng(seed)),
         'share of neighbouring cells in different basins between which all basins are found '
         'after so many halvings'))
    # Of each box size: S_b, S_bb and their errors; 0 cells for infinitely many, by extrapolation.
    store.write_table({name: (dimensions, values, named(words))
                       for name, dimensions, values, words in columns} | table(
        'entropy', **{name: ([getattr(each, name) for each in entropies],
                             f'entropy of basins in boxes: {name}') for name in Entropy._fields}
        ) | _accessible(known, basins, store.attrs['cap'], work) | {
            f'saddle_{name}': ((), value, named(words))
            for (name, words), value in zip(SADDLE.items(), saddle, strict=True)})


def _accessible(known: Catalogue, basins: list[int], cap: int, work: Work) -> dict[str, Any]:
    """Find the orbit accessible from each of three basins or more; where its manifold leads."""
    keys, shares = [''] * len(basins), np.zeros((len(basins), len(basins)))
    for each in known.attractors if len(basins) > 2 else ():
        if each.label in basins and (orbit := accessible_orbit(known, each, smallest_kick(
                known, each, cap=cap, threads=work.threads), cap)):
            keys[k := basins.index(each.label)] = orbit.key
            shares[k] = follow_unstable(
                functools.partial(labels_of, known, Plane(kind=IMPACT), cap), orbit.points[0],
                saddle_of(orbit).unstable, orbit.multipliers[0].real, basins)
    return table('accessible', label=(basins, 'basin from which an orbit is accessible'),
                 key=(keys, 'name of the orbit, empty for none found', None),
                 share=(shares, 'share of its unstable manifold in each basin', '1', 'basin'))


def describe(dataset: Arrays) -> str:
    """Put a boundary in words: exponents, entropies, and whether it is one of Wada."""
    if 'columns' in dataset.attrs:
        return _describe_rows(dataset)
    labels, numbers = np.unique(dataset['label'].values, return_counts=True)
    cells = dict(zip(labels.tolist(), numbers.tolist(), strict=True))
    if len(cells) < 2:
        return attractors.describe(dataset, cells, 'no boundary: all cells have one label')
    lines = []
    for name, law in zip(('triplets', 'box counting'), (law_of(dataset, p) for p in PROBES),
                         strict=True):
        lines.append(
            f'{name}: exponent {law.exponent:.4f} +- {law.error:.4f}, dimension of the boundary '
            f'{2.0 - law.exponent:.4f}, from {law.low:.1e} to {law.high:.1e} (chi^2 '
            f'{law.chi_squared:.1f} for {counted(law.freedom, "degree")} of freedom)' if law else
            f'{name}: too few are cut for an exponent; give larger --distances')
    value, error, kappa, growth = (float(dataset[f'saddle_{name}'].values) for name in SADDLE)
    if math.isfinite(value):
        lines.append(f'saddle on the boundary: exponent {value:.4f} +- {error:.4f}, dimension of '
                     f'the boundary {2.0 - value:.4f}, from kappa {kappa:.4f} and lambda_1 '
                     f'{growth:.4f} per impact')
    cut, probes = (int(dataset[name].values[0, -1]) for name in ('cut', 'probes'))
    lines.append(f'rounding: {cut / probes:.2%} of the triplets are cut at {ROUNDING:g}, a last '
                 'digit: up to as many single labels are beyond double precision')
    entropies = entropies_of(dataset)
    lines += [f'{f"boxes of {each.edge} by {each.edge}" if each.edge else "in the limit"}: S_b '
              f'{each.mean:.4f} +- {each.mean_error:.4f}, S_bb {each.boundary:.4f} +- '
              f'{each.boundary_error:.4f}' for each in entropies]
    if any(each.exceeds_ln_2 for each in entropies):
        lines.append('S_bb exceeds ln 2: the boundary is fractal')
    radius, mean, error = dataset['disc'].values.tolist()
    if math.isfinite(mean):
        lines.append(f'in discs of radius {radius:g}: {mean:.4f} +- {error:.4f}, one smooth '
                     f'line has {SMOOTH:.4f}: the boundary in a disc '
                     f'{"may be" if is_smooth(mean, error, radius) else "is not"} that')
    merging, refinement = (dataset[name].values for name in ('merging', 'refinement'))
    if not len(merging):
        lines.append('Wada: needs three basins')
    else:
        within = f'within {counted(len(merging) - 1, "cell")}'
        lines += [
            'Wada by merging: ' + (
                f'passed, the boundaries of all basins are {within} of each other'
                if merging[-1] >= 1.0 else 'failed, the boundaries of all basins are not, only '
                f'{merging[-1]:.1%} of one are {within}'),
            f'Wada by grid refinement: {"passed" if refinement[-1] >= SHARED else "failed"}, all '
            f'basins lie between {refinement[-1]:.1%} of the pairs of neighbouring cells in two '
            'basins',
            *_wada_by_manifolds(dataset)]
    return attractors.describe(dataset, cells, '\n'.join(lines))


def _describe_rows(dataset: Arrays) -> str:
    axis = attractors.swept(dataset.attrs)

    def measured(values: FloatArray, errors: FloatArray) -> list[str]:
        return ['-' if math.isnan(value) else f'{value:.4f} +- {error:.4f}'
                for value, error in zip(values, errors, strict=True)]

    laws = (dataset[name].values.T for name in LAWS)
    columns = [[f'{value:.9g}' for value in dataset[axis].values],
               [f'{value:.0f}' for value in dataset['basins'].values],
               *map(measured, *laws), *(
        measured(*(dataset[name + end].values for end in ('', '_error')))
        for name in ('saddle_exponent', 'entropy_mean', 'entropy_boundary')), *(
        ['-' if math.isnan(value) else f'{100.0 * value:.1f}' for value in dataset[name].values]
        for name in ('merging', 'refinement'))]
    return in_columns([
        f' {axis}', ' basins', ' exponent by triplets', ' by boxes', ' by the saddle', ' S_b',
        ' S_bb', ' merging [%]', ' refinement [%]'], [*zip(*columns, strict=True)])


def _wada_by_manifolds(dataset: Arrays) -> list[str]:
    names = {label: str(letter or key) for label, letter, key in zip(*(
        dataset[f'attractor_{name}'].values.tolist() for name in ('label', 'letter', 'key')),
        strict=True)}
    labels, keys, shares = (dataset[f'accessible_{name}'].values
                            for name in ('label', 'key', 'share'))
    basins = [names.get(label, str(label)) for label in labels.tolist()]
    found = keys != ''
    verdict = ('failed' if np.any(shares[found] == 0.0) else
               'passed' if found.all() else 'undecided')
    return [f'Wada by unstable manifolds: {verdict}, where those of the orbits accessible from '
            'each basin lead:',
            in_columns(['accessible from', 'orbit', *(f' {name} [%]' for name in basins)], [
                [name, str(key or 'none found'), *(f'{100.0 * share:.1f}' for share in row)]
                for name, key, row in zip(basins, keys, shares, strict=True)])]
