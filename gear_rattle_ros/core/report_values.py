"""Reports of the analyses as named values: what is published live and recomputed from a bag."""

from collections.abc import Mapping

from .lyapunov import LyapunovReport
from .orbits import Regime, TransientReport


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
        'mean_flight_time': report.mean_flight_time,
        'epoch': report.epoch,
        'impacts': report.impacts,
        'index': report.index,
    }


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
    }
    if report.lifetime is not None:
        values['lifetime'] = report.lifetime
    if report.regime is Regime.ORBIT:
        values['period_impacts'] = report.period_impacts
        values['period_drive'] = report.period_drive
        values['multiplier'] = report.multiplier
        for number, point in enumerate(report.points):
            values[f'point_{number}'] = (
                f'{point.wall.label} wall, phase {point.phase!r}, velocity {point.velocity!r}')
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
