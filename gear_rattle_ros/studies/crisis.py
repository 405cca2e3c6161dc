"""
The critical alpha of a boundary crisis, by two methods that share nothing but the flight.

The tangency of the manifolds of the saddle gives it to many digits; the rates at which
trajectories escape beyond it, fitted by a law in which it is free, check that and give the
exponent of the lifetimes.
"""

import argparse
import dataclasses
import math
import sys
from typing import Any, Final

import numpy as np

from .escape_rates import fit_exponent, fit_law, LifetimeLaw
from .escapes import compute, Escapes, rates_of
from .tangency import Boundary, find_boundary, find_tangency, radius_of, SEARCHES, Tangency
from ..cli.options import (
    add_alpha_window,
    add_plane,
    add_seed,
    alpha_window_of,
    model_of,
    number,
    Parser,
    plane_of,
    whole,
)
from ..cli.progress import Progress
from ..cli.run import Figure, Run, run_tool
from ..core.model import Parameters
from ..core.words import counted, in_columns
from ..store.store import Store

# What the paper prints, and the amplitudes of its figures on either side.
PAPER: Final = 1.2347058
PAPER_BRACKET: Final = (1.230, 1.244)
# Before the crisis trajectories last for ever; they are watched over so many impacts each.
BEFORE: Final = 100_000


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


def locate(parameters: Parameters, low: float, high: float, seed: int
           ) -> tuple[Boundary, Tangency]:
    """
    Find the saddle and the tangency of its manifolds, and tell how it goes.

    Parameters
    ----------
    parameters : Parameters
        Beyond the crisis.
    low, high : float
        Before and beyond it [1].
    seed : int
        Of the starts from which the captor is found.

    Returns
    -------
    boundary : Boundary
        Captor and saddle.
    tangency : Tangency
        The crisis.

    Raises
    ------
    ValueError
        If there is none.

    """
    boundary = find_boundary(parameters, low, seed)
    progress = Progress('crisis, searches of the manifold', SEARCHES, sys.stderr)
    try:
        return boundary, find_tangency(boundary, low, high, lambda *_: progress.add(1))
    finally:
        progress.end()


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
    # Weighed by their counts: the errors of few escapes scatter themselves.
    data = (store.read_all('alpha')[some], [rates[k].rate for k in some],
            [rates[k].rate / math.sqrt(rates[k].escapes) for k in some])
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
                          'exponent_at_tangency_error': exponent_error, 'paper_alpha': PAPER})
    return law


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
        f'captor and saddle of {counted(a["saddle_impacts"], "impact")} in '
        f'{counted(a["saddle_drive_periods"], "drive period")}, born in a fold at alpha = '
        f'{a["fold_alpha"]:.9f}',
        in_columns(['found from', 'alpha_c [1]', 'exponent of the lifetime [1]'], [
            ['tangency of its manifolds', f'{alpha:.10f} +- {a["tangency_uncertainty"]:.1g}',
             f'{a["tangency_exponent"]:.4f} for a homoclinic one'],
            ['escape rates', f'{law.alpha_c:.7f} +- {law.alpha_c_error:.1g}',
             f'{law.exponent:.3f} +- {law.exponent_error:.3f}, chi^2 per degree of freedom '
             f'{law.chi_square:.1f}'],
            ['escape rates, alpha_c given', f'{alpha:.10f}',
             f'{a["exponent_at_tangency"]:.3f} +- {a["exponent_at_tangency_error"]:.3f}']]),
        f'both places differ by {apart:.1g}, {abs(apart) / law.alpha_c_error:.1f} standard errors',
        f'before it, at alpha = {store.read_all("alpha")[0]:.7f}: '
        f'{counted(before.escapes, "escape")} in {before.at_risk:.3g} impacts',
        f'the paper prints alpha_c = {PAPER}; the difference is {alpha - PAPER:+.7f}, and its '
        f'bracket {PAPER_BRACKET[0]:.3f} to {PAPER_BRACKET[1]:.3f} '
        f'{"holds" if inside else "does not hold"} what is found here']
    return '\n'.join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Run the command `crisis`."""
    parser = Parser('crisis', description='Locate a boundary crisis, by the tangency of manifolds '
                    'and by escape rates, and fit the law of the lifetimes.')
    add_alpha_window(parser, 1.23, 1.25, 'before and beyond the crisis')
    parser.add_argument('--beyond', type=number, nargs=2, default=[4e-6, 4e-4],
                        metavar=('A', 'B'), help='distances from the crisis at which escapes are '
                        'timed [1]; 4e-6 4e-4 by default')
    parser.add_argument('--rates', type=whole(4), default=20, metavar='N',
                        help='amplitudes at which they are; 20 by default')
    parser.add_argument('--escapes', type=whole(16), default=80, metavar='N',
                        help='timed at each; 80 by default')
    parser.add_argument('--skip', type=whole(0), default=300, metavar='N',
                        help='escapes before this say nothing [impacts]; 300 by default')
    parser.add_argument('--limit', type=whole(1000), default=50_000_000, metavar='N',
                        help='impacts after which one is given up; 5e7 by default')
    # Off the walls hardly a start sticks: those that do all go on as one trajectory.
    add_plane(parser, size=None, displacement=-0.5)
    add_seed(parser)

    def work(given: argparse.Namespace, run: Run) -> int:
        low, high = alpha_window_of(given)
        nearest, farthest = given.beyond
        if not 0.0 < nearest < farthest:
            raise ValueError(f'--beyond {nearest:g} {farthest:g} must be positive and rising')
        parameters = model_of(given)
        boundary, tangency = locate(parameters, low, high, given.seed)
        print(f'crisis: the manifolds touch at alpha = {tangency.alpha:.10f}; timing escapes ...',
              flush=True)
        alphas = amplitudes(tangency, nearest, farthest, given.rates)
        boundaries = [boundary.at(alpha) for alpha in alphas]
        store = compute(Escapes(
            alphas, parameters, plane_of(given), given.escapes, given.seed, given.skip,
            given.limit, min(given.limit, BEFORE), tuple(one.captor.points for one in boundaries),
            min(radius_of(one) for one in boundaries)), tangency, run)
        print(report(store, law_of(store)))

        def draw() -> Figure:
            # Only here: matplotlib takes a second to import.
            from ..figures.crisis import draw_law
            return draw_law(store)

        return run.finish(draw)

    return run_tool(parser, arguments, 'crisis.zarr', work)
