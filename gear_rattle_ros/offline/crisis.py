"""
The critical alpha of a boundary crisis, by two methods that share nothing but the flight.

The tangency of the manifolds of the saddle gives it to many digits; the rates at which
trajectories escape beyond it, fitted by a law in which it is free, check that and give the
exponent of the lifetimes.
"""

import dataclasses
import functools
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from .cli import (
    add_model,
    add_plane,
    add_run,
    add_seed,
    attempt,
    model_of,
    number,
    Parser,
    plane_of,
    Run,
    run_of,
    say_interrupted,
    whole,
)
from .engine import run_tiles
from .escape_rates import escape_rate, EscapeRate, fit_exponent, fit_law, LifetimeLaw
from .grid import Plane
from .store import Axis, Layout, make_store, Store, Variable
from .tangency import Boundary, find_boundary, find_tangency, radius_of, Tangency
from ..core.escape import CAPTURED, last_until_captured, STEPS
from ..core.lanes import new_impacts, new_tiles
from ..core.model import ALPHA_MAXIMUM, Parameters, require_finite

FloatArray = npt.NDArray[np.float64]
# What the paper prints, and the amplitudes of its figures on either side.
PAPER: Final = 1.2347058
PAPER_BRACKET: Final = (1.230, 1.244)
# Before the crisis trajectories last for ever; they are watched over so many impacts each.
BEFORE: Final = 300_000


@dataclasses.dataclass(frozen=True)
class Escapes:
    """
    Trajectories whose escape is timed.

    Attributes
    ----------
    alphas : tuple of float
        Amplitudes [1]; the first lies before the crisis, to see that nothing escapes.
    parameters : Parameters
        Its alpha is not used.
    plane : Plane
        Where starts are drawn from.
    trajectories : int
        At each alpha.
    seed : int
        Of the starts, the same at each alpha.
    skip : int
        Escapes before this say nothing: the start lay in the basin [impacts].
    limit, limit_before : int
        A trajectory is given up then, and at the amplitude before the crisis [impacts].
    points : tuple
        For each alpha the orbit that captures: (phase, velocity) of every impact.
    radius : float
        So near to it a trajectory is captured [rad, 1].

    """

    alphas: tuple[float, ...]
    parameters: Parameters
    plane: Plane
    trajectories: int
    seed: int
    skip: int
    limit: int
    limit_before: int
    points: tuple[FloatArray, ...]
    radius: float


def amplitudes(tangency: Tangency, nearest: float, farthest: float, count: int
               ) -> tuple[float, ...]:
    """
    Choose where escapes are timed.

    Parameters
    ----------
    tangency : Tangency
        The crisis; it only says where to look, the law is fitted without it.
    nearest, farthest : float
        Distances beyond it [1].
    count : int
        How many.

    Returns
    -------
    tuple of float
        One before the crisis, then equal steps of the logarithm of the distance.

    """
    beyond = np.geomspace(nearest, farthest, count)
    return tuple(float(round(tangency.alpha + d, 9)) for d in (-2.0 * nearest, *beyond))


def layout_of(escapes: Escapes, tangency: Tangency) -> Layout:
    """
    Say what the store of a crisis consists of.

    Parameters
    ----------
    escapes : Escapes
        What is timed.
    tangency : Tangency
        Where the crisis was found.

    Returns
    -------
    Layout
        A tile for each alpha.

    """
    p = escapes.parameters
    return Layout(
        (Axis('alpha', np.array(escapes.alphas), {
            'long_name': 'amplitude of the drive', 'units': '1'}, 1),
         Axis('trajectory', np.arange(escapes.trajectories), {
             'long_name': 'number of the start'})),
        (Variable('lifetime', ('alpha', 'trajectory'), '<i8', {
            'long_name': 'impacts before the capture, or before it was given up',
            'units': 'impacts'}),
         Variable('fate', ('alpha', 'trajectory'), '|i1', {
             'long_name': '1 captured, 0 given up, -1 came to rest'})),
        {'tool': 'crisis', 'beta': p.beta, 'gamma': p.gamma, 'restitution': p.restitution,
         'alphas': list(escapes.alphas), 'trajectories': escapes.trajectories,
         'seed': escapes.seed, 'displacement': escapes.plane.displacement,
         'phase_window': list(escapes.plane.phase),
         'start_velocity_window': list(escapes.plane.velocity),
         'impacts_skipped': escapes.skip, 'impacts_limit': escapes.limit,
         'impacts_limit_before': escapes.limit_before,
         'capture_radius': escapes.radius},
        {'tangency_alpha': tangency.alpha, 'tangency_uncertainty': tangency.uncertainty,
         'tangency_exponent': tangency.saddle.lifetime_exponent,
         'saddle_expansion': tangency.saddle.expansion,
         'saddle_contraction': tangency.saddle.contraction,
         'saddle_impacts': tangency.saddle.orbit.period_impacts,
         'saddle_drive_periods': tangency.saddle.orbit.period_drive,
         'fold_alpha': tangency.fold, 'paper_alpha': PAPER})


def time_escapes(escapes: Escapes, output: Path, tile: int) -> int:
    """
    Time the escapes at one alpha.

    Parameters
    ----------
    escapes : Escapes
        What is timed.
    output : Path
        The store.
    tile : int
        Number of the alpha.

    Returns
    -------
    int
        Impacts made.

    """
    parameters = dataclasses.replace(escapes.parameters, alpha=escapes.alphas[tile])
    starts = escapes.plane.random_starts(parameters, escapes.trajectories, escapes.seed)
    lifetimes, fates = np.zeros(len(starts), np.int64), np.zeros(len(starts), np.int64)
    last_until_captured(new_tiles(1)[0], new_impacts(STEPS), starts, escapes.points[tile],
                        escapes.radius, escapes.limit if tile else escapes.limit_before, lifetimes,
                        fates)
    Store(output).write(tile, {'lifetime': lifetimes[None], 'fate': fates[None].astype(np.int8)})
    return int(lifetimes.sum())


def rates_of(store: Store) -> list[EscapeRate]:
    """
    Estimate the escape rate at each alpha.

    Parameters
    ----------
    store : Store
        Complete.

    Returns
    -------
    list of EscapeRate
        In order.

    """
    lifetimes, fates = store.read_all('lifetime'), store.read_all('fate')
    skip = float(store.attributes['impacts_skipped'])
    return [escape_rate(life, fate != CAPTURED, skip)
            for life, fate in zip(lifetimes, fates, strict=True)]


def law_of(store: Store) -> LifetimeLaw:
    """
    Fit the law of the lifetimes to a complete store, and write it there.

    Parameters
    ----------
    store : Store
        The store.

    Returns
    -------
    LifetimeLaw
        With the place of the crisis free.

    """
    rates = rates_of(store)
    some = [k for k, rate in enumerate(rates) if k > 0 and rate.escapes >= 10]
    data = (store.read_all('alpha')[some], [rates[k].rate for k in some],
            [rates[k].error for k in some])
    law = fit_law(*data)
    exponent, exponent_error = fit_exponent(*data, store.attributes['tangency_alpha'])
    per_impact = {'units': '1/impact'}
    store.write_table({
        'escape_rate': (('alpha',), np.array([rate.rate for rate in rates]), {
            'long_name': 'escape rate, from escapes over impacts at risk', **per_impact}),
        'escape_rate_error': (('alpha',), np.array([rate.error for rate in rates]), {
            'long_name': 'its standard error', **per_impact}),
        'escapes': (('alpha',), np.array([rate.escapes for rate in rates]), {
            'long_name': 'trajectories that escaped', 'units': '1'}),
        'at_risk': (('alpha',), np.array([rate.at_risk for rate in rates]), {
            'long_name': 'impacts at risk', 'units': 'impacts'})})
    store.set_attributes({f'law_{name}': float(value)
                          for name, value in dataclasses.asdict(law).items()})
    store.set_attributes({'exponent_at_tangency': exponent,
                          'exponent_at_tangency_error': exponent_error})
    return law


def compute(escapes: Escapes, tangency: Tangency, run: Run) -> tuple[Store, bool]:
    """
    Time the escapes.

    Parameters
    ----------
    escapes : Escapes
        What is timed.
    tangency : Tangency
        Where the crisis was found.
    run : Run
        How and where.

    Returns
    -------
    store : Store
        Its store.
    complete : bool
        False after Ctrl-C.

    """
    store = make_store(run.output, layout_of(escapes, tangency), run.command, resume=run.resume)
    pending = store.pending()
    progress = run.progress(len(escapes.alphas))
    progress.skip(len(escapes.alphas) - len(pending))

    def finished(tile: int, impacts: int) -> None:
        store.mark(tile)
        progress.add(1, impacts)

    try:
        run_tiles(functools.partial(time_escapes, escapes, run.output), pending, finished,
                  cluster=run.cluster, threads=run.threads)
    except KeyboardInterrupt:
        return store, False
    finally:
        progress.end()
    return store, True


def report(store: Store, law: LifetimeLaw) -> str:
    """
    Put a crisis in words.

    Parameters
    ----------
    store : Store
        The store, complete.
    law : LifetimeLaw
        What was fitted.

    Returns
    -------
    str
        Some lines.

    """
    a: dict[str, Any] = store.attributes
    before = rates_of(store)[0]
    alpha, apart = a['tangency_alpha'], law.alpha_c - a['tangency_alpha']
    inside = PAPER_BRACKET[0] < alpha < PAPER_BRACKET[1]
    lines = [
        f'captor and saddle of {a["saddle_impacts"]} impacts in {a["saddle_drive_periods"]} drive '
        f'period, born in a fold at alpha = {a["fold_alpha"]:.9f}',
        f'tangency of its manifolds:  alpha_c = {alpha:.10f} +- '
        f'{a["tangency_uncertainty"]:.1g};  exponent for a homoclinic tangency '
        f'{a["tangency_exponent"]:.4f}',
        f'escape rates, all fitted:   alpha_c = {law.alpha_c:.7f} +- '
        f'{law.alpha_c_error:.1g};  exponent {law.exponent:.3f} +- {law.exponent_error:.3f}  '
        f'(chi^2 per degree of freedom {law.chi_square:.1f})',
        f'escape rates, alpha_c of the tangency: exponent {a["exponent_at_tangency"]:.3f} +- '
        f'{a["exponent_at_tangency_error"]:.3f}',
        f'both places differ by {apart:.1g}, {abs(apart) / law.alpha_c_error:.1f} standard errors',
        f'before it, at alpha = {store.read_all("alpha")[0]:.7f}: {before.escapes} escapes in '
        f'{before.at_risk:.3g} impacts',
        f'the paper prints alpha_c = {PAPER}; the difference is {alpha - PAPER:+.7f}, and its '
        f'bracket {PAPER_BRACKET[0]:.3f} to {PAPER_BRACKET[1]:.3f} '
        f'{"holds" if inside else "does not hold"} what is found here']
    return '\n'.join(lines)


def main(arguments: list[str] | None = None) -> int:
    """
    Run the command `crisis`.

    Parameters
    ----------
    arguments : list of str, optional
        Without the program's name; by default those of the process.

    Returns
    -------
    int
        Exit status.

    """
    return attempt('crisis', lambda: _run(arguments))


def _run(arguments: list[str] | None) -> int:
    parser = Parser('crisis', description='Locate a boundary crisis, by the tangency of manifolds '
                    'and by escape rates, and fit the law of the lifetimes.')
    parser.add_argument('--alpha', type=number, nargs=2, default=[1.23, 1.25],
                        metavar=('A', 'B'),
                        help='before and beyond the crisis [1]; 1.23 1.25 by default')
    add_model(parser, names=('beta', 'gamma', 'restitution'))
    parser.add_argument('--beyond', type=number, nargs=2, default=[4e-6, 4e-4],
                        metavar=('A', 'B'), help='distances from the crisis at which escapes are '
                        'timed [1]; 4e-6 4e-4 by default')
    parser.add_argument('--rates', type=whole(4), default=20, metavar='N',
                        help='amplitudes at which they are; 20 by default')
    parser.add_argument('--trajectories', type=whole(10), default=256, metavar='N',
                        help='timed at each; 256 by default')
    parser.add_argument('--skip', type=whole(0), default=300, metavar='N',
                        help='escapes before this say nothing [impacts]; 300 by default')
    parser.add_argument('--limit', type=whole(1000), default=50_000_000, metavar='N',
                        help='impacts after which one is given up; 5e7 by default')
    add_plane(parser, size=None)
    add_seed(parser)
    add_run(parser)
    given = parser.parse_args(arguments)
    low, high = (require_finite('alpha', a, 0.0, ALPHA_MAXIMUM) for a in given.alpha)
    if not low < high:
        raise ValueError(f'alpha window {low:g} to {high:g} is empty or reversed; give the lower '
                         'end first')
    nearest, farthest = given.beyond
    if not 0.0 < nearest < farthest:
        raise ValueError(f'--beyond {nearest:g} {farthest:g} must be positive and rising')
    given.alpha = high
    parameters = model_of(given)
    run = run_of(parser, given, arguments, 'crisis.zarr')
    boundary = find_boundary(parameters, low, given.seed)
    tangency = find_tangency(boundary, low, high)
    print(f'crisis: the manifolds touch at alpha = {tangency.alpha:.10f}; timing escapes ...')
    alphas = amplitudes(tangency, nearest, farthest, given.rates)
    boundaries: list[Boundary] = [boundary.at(alpha) for alpha in alphas]
    escapes = Escapes(
        alphas, parameters, plane_of(given), given.trajectories, given.seed, given.skip,
        given.limit, min(given.limit, BEFORE), tuple(one.captor.points for one in boundaries),
        min(radius_of(one) for one in boundaries))
    store, complete = compute(escapes, tangency, run)
    if not complete:
        return say_interrupted(run, len(store.tiles) - len(store.pending()), len(store.tiles))
    law = law_of(store)
    print(report(store, law))
    print(f'crisis: {run.output}')
    if run.picture is not None:
        # Only here: matplotlib takes a second to import.
        from .figures_crisis import draw_law
        from .figures_style import save
        save(draw_law(store), run.picture)
        print(f'crisis: {run.picture}')
    return 0
