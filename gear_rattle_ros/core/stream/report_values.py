"""Reports of the analyses as named values: what is published live and recomputed from a bag."""

from collections.abc import Mapping
import itertools
import math
from typing import Final

from .lyapunov import LyapunovReport
from .transients import TransientReport
from ..model import Wall

# Points of an orbit that are written down; one that sticks may have thousands.
POINTS_MOST: Final = 256


def lyapunov_values(report: LyapunovReport) -> dict[str, float]:
    """
    Name the values of an estimate.

    Parameters
    ----------
    report : LyapunovReport
        The estimate.

    Returns
    -------
    dict of str to float
        Exponents per impact, their errors and sums [1], and where they belong.

    """
    return {
        'lambda_1': report.lambda_1,
        'lambda_2': report.lambda_2,
        'lambda_1_error': report.lambda_1_error,
        'lambda_2_error': report.lambda_2_error,
        'sum': report.exponent_sum,
        'exact_sum': report.exact_sum,
        'lambda_1_finite': report.lambda_1_finite,
        'window': report.window,
        'finite_retunes': report.finite_retunes,
        'mean_flight_time': report.mean_flight_time,
        'impulse_balance': report.impulse_balance,
        'exact_impulse_balance': report.exact_impulse_balance,
        'epoch': report.epoch,
        'sticks': report.sticks,
        'impacts': report.impacts,
        'index': report.index,
    }


def infinite_in_words(values: Mapping[str, float]) -> str:
    """
    Say why an exponent is infinite.

    Parameters
    ----------
    values : mapping of str to float
        Those of an estimate.

    Returns
    -------
    str
        One sentence; empty where both exponents are finite or not known.

    """
    sticks = values.get('sticks', 0.0)
    if values.get('lambda_1') == -math.inf and sticks > 0.0:
        return (f'-inf: the mass stuck at {sticks:,.0f} of {values.get("impacts", 0.0):,.0f} '
                'impacts and forgot all that was before (superstable)')
    if values.get('lambda_2') == -math.inf:
        return '-inf: without restitution an impact forgets the velocity before it (r = 0)'
    return ''


def transient_values(report: TransientReport) -> dict[str, object]:
    """
    Name the values of what a trajectory does; an orbit's points are numbered from 0.

    Parameters
    ----------
    report : TransientReport
        What it does.

    Returns
    -------
    dict of str to object
        Text, whole numbers and floats [1].

    """
    values: dict[str, object] = {
        'state': report.regime.value,
        'epoch': report.epoch,
        'index': report.index,
        'start': report.start,
        'retunes': report.retunes,
    }
    if report.lifetime is None:
        values['impacts'] = report.impacts
        values['kicked'] = report.kicked
        values['exponent'] = report.exponent
        values['exponent_error'] = report.exponent_error
    else:
        values['lifetime'] = report.lifetime
    if report.orbit is None:
        return values
    values['orbit'] = report.key
    values['period_impacts'] = report.period_impacts
    values['period_drive'] = report.period_drive
    values['multiplier'] = report.multiplier
    values['multipliers'] = ' '.join(str(complex(value)) for value in report.orbit.multipliers)
    if not math.isnan(report.spread_rms):
        values['spread_largest'] = report.spread_largest
        values['spread_rms'] = report.spread_rms
    if report.previous:
        values['previous'] = report.previous
        values['residence'] = report.residence
    points = zip(report.orbit.walls, report.orbit.points.tolist(), strict=True)
    for number, (wall, (phase, velocity)) in enumerate(itertools.islice(points, POINTS_MOST)):
        values[f'point_{number}'] = (
            f'{Wall(wall).label} wall, phase {phase!r}, velocity {velocity!r}')
    return values


def texts(values: Mapping[str, object]) -> dict[str, str]:
    """
    Write values down, floats with all their digits.

    Parameters
    ----------
    values : mapping of str to object
        The values.

    Returns
    -------
    dict of str to str
        Their texts.

    """
    return {key: repr(float(value)) if isinstance(value, float) else str(value)
            for key, value in values.items()}
