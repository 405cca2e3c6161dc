"""
The critical alpha of a boundary crisis, by two methods that share nothing but the flight.

The tangency of the manifolds of the saddle gives it to many digits; the rates at which
trajectories escape beyond it, fitted by a law in which it is free, check that and give the
exponent of the lifetimes.
"""

import dataclasses
import math
from typing import Final, Unpack

import numpy as np

from .attractors import require_window
from .escape_rates import fit_exponent, fit_law
from .escapes import compute, Escapes, rates_of
from .tangency import find_boundary, find_tangency, radius_of, SEARCHES, Tangency
from .work import Arrays, Study, Work, WorkOptions
from ..attractors.listing import named
from ..attractors.plane import Plane
from ..core.defaults import SEED
from ..core.model import Parameters
from ..core.words import counted, in_columns
from ..store.store import Store

# What the paper prints, and the amplitudes of its figures on either side.
PAPER: Final = 1.2347058
PAPER_BRACKET: Final = (1.230, 1.244)
# Before the crisis nothing escapes; trajectories are watched over this number of impacts.
BEFORE: Final = 100_000


@Study
def crisis(parameters: Parameters, alphas: tuple[float, float] = (1.23, 1.25),
           plane: Plane | None = None, *, beyond: tuple[float, float] = (4e-6, 4e-4),
           rates: int = 20, escapes: int = 80, skip: int = 300, limit: int = 50_000_000,
           seed: int = SEED, **options: Unpack[WorkOptions]) -> Store:
    """
    Locate a boundary crisis, by the tangency of manifolds and by escape rates.

    The dataset has lifetimes and escape rates by alpha; the crisis and its law as attributes.

    Parameters
    ----------
    parameters, alphas
        The model, and its amplitudes before and beyond the crisis [1].
    plane, seed
        The window from which initial conditions are drawn, and their seed; by default it lies at
        s = -0.5, because off the walls hardly any sticks: those that do go on as one trajectory.
    beyond : tuple of float
        Distances from the crisis at which escapes are timed [1].
    rates, escapes : int
        Amplitudes at which they are, and how many at each.
    skip, limit : int
        Escapes before this do not count, and after this a trajectory is given up [impacts].

    """
    work, plane = Work(**options), plane or Plane(displacement=-0.5)
    require_window(alphas)
    low, high = alphas
    if not 0.0 < beyond[0] < beyond[1]:
        raise ValueError(f'--beyond {beyond[0]:g} {beyond[1]:g} must be positive and rising')
    parameters = dataclasses.replace(parameters, alpha=high)
    boundary = find_boundary(parameters, low, seed)
    with work.report('crisis, searches of the manifold', SEARCHES) as progress:
        tangency = find_tangency(boundary, low, high, progress.add)
    places = amplitudes(tangency, *beyond, rates)
    boundaries = [boundary.at(alpha) for alpha in places]
    store = compute(Escapes(
        places, parameters, plane, escapes, seed, skip, limit, min(limit, BEFORE),
        tuple(one.captor.points for one in boundaries),
        min(radius_of(one) for one in boundaries)), tangency, work)
    write_law(store)
    return store


def amplitudes(tangency: Tangency, nearest: float, farthest: float, count: int
               ) -> tuple[float, ...]:
    """Choose where escapes are timed: the tangency gives where, the law is fitted without it."""
    # One alpha before the crisis, then equal steps of the logarithm.
    beyond = np.geomspace(nearest, farthest, count)
    return tuple(float(round(tangency.alpha + d, 9)) for d in (-2.0 * nearest, *beyond))


def write_law(store: Store) -> None:
    """Fit the law of the lifetimes to a complete store, the place of the crisis free; write it."""
    rates = rates_of(store.read_all('lifetime'), store.read_all('fate'),
                     store.attrs['impacts_skipped'])
    some = [k for k, rate in enumerate(rates) if k > 0 and rate.escapes >= 10]
    # Weighed by their counts: the errors of few escapes scatter themselves.
    data = (store.read_all('alpha')[some], [rates[k].rate for k in some],
            [rates[k].rate / math.sqrt(rates[k].escapes) for k in some])
    law = fit_law(*data)
    exponent, exponent_error = fit_exponent(*data, store.attrs['tangency_alpha'])
    store.write_table({name: (('alpha',), np.array([getattr(rate, field) for rate in rates]),
                              named(words, units)) for name, field, words, units in (
        ('escape_rate', 'rate', 'escape rate, from escapes over impacts at risk', '1/impact'),
        ('escape_rate_error', 'error', 'its standard error', '1/impact'),
        ('escapes', 'escapes', 'trajectories that escaped', '1'),
        ('at_risk', 'at_risk', 'impacts at risk', 'impacts'))})
    store.set_attributes({f'law_{name}': float(value)
                          for name, value in dataclasses.asdict(law).items()})
    store.set_attributes({'exponent_at_tangency': exponent,
                          'exponent_at_tangency_error': exponent_error, 'paper_alpha': PAPER})


def describe(dataset: Arrays) -> str:
    a = dataset.attrs
    alpha, apart = a['tangency_alpha'], a['law_alpha_c'] - a['tangency_alpha']
    inside = PAPER_BRACKET[0] < alpha < PAPER_BRACKET[1]
    lines = [
        f'captor and saddle of {counted(a["saddle_impacts"], "impact")} in '
        f'{counted(a["saddle_drive_periods"], "drive period")}, born in a fold at alpha = '
        f'{a["fold_alpha"]:.9f}',
        in_columns(['found from', 'alpha_c [1]', 'exponent of the lifetime [1]'], [
            ['tangency of its manifolds', f'{alpha:.10f} +- {a["tangency_uncertainty"]:.1g}',
             f'{a["tangency_exponent"]:.4f} for a homoclinic one'],
            ['escape rates', f'{a["law_alpha_c"]:.7f} +- {a["law_alpha_c_error"]:.1g}',
             f'{a["law_exponent"]:.3f} +- {a["law_exponent_error"]:.3f}, chi^2 per degree of '
             f'freedom {a["law_chi_square"]:.1f}'],
            ['escape rates, alpha_c given', f'{alpha:.10f}',
             f'{a["exponent_at_tangency"]:.3f} +- {a["exponent_at_tangency_error"]:.3f}']]),
        f'both places differ by {apart:.1g}, {abs(apart) / a["law_alpha_c_error"]:.1f} standard '
        'errors',
        f'before it, at alpha = {dataset["alpha"].values[0]:.7f}: '
        f'{counted(dataset["escapes"].values[0], "escape")} in '
        f'{dataset["at_risk"].values[0]:.3g} impacts',
        f'the paper prints alpha_c = {PAPER}; the difference is {alpha - PAPER:+.7f}, and its '
        f'bracket {PAPER_BRACKET[0]:.3f} to {PAPER_BRACKET[1]:.3f} '
        f'{"holds" if inside else "does not hold"} what is found here']
    return '\n'.join(lines)
