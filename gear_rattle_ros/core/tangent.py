"""Flight and impact matrices of the tangent map at fixed time, (ds, dv)."""

from .compiled import kernel
from .elementary import logarithm, relaxation, sine_cosine
from .flight import acceleration


@kernel
def flight_matrix(d: float, beta: float) -> tuple[float, float]:
    """
    Tangent of a free flight, ``F = [[1, B], [0, E]]``.

    Parameters
    ----------
    d : float
        Duration [1].
    beta : float
        Damping [1].

    Returns
    -------
    tuple of float
        ``B = (1 - E)/beta`` and ``E = exp(-beta d)`` [1]; ``det F = E``.

    """
    decay, integral, _ = relaxation(d, beta)
    return integral, decay


@kernel
def impact_matrix(phase: float, velocity: float, velocity_after: float, alpha: float, beta: float,
                  gamma: float, restitution: float) -> tuple[float, float, float]:
    """
    Tangent of an impact, ``S = [[v+/v-, 0], [(r a- + a+)/v-, -r]]``.

    A perturbed trajectory meets the wall ``-ds/v-`` later; both are compared at the same time.
    Without a kick ``v+/v- = -r`` and ``det S = r^2``. A contact without speed changes nothing.

    Parameters
    ----------
    phase : float
        Drive phase of the impact [rad].
    velocity, velocity_after : float
        Just before and after [1].
    alpha, beta, gamma, restitution : float
        Parameters [1].

    Returns
    -------
    tuple of float
        ``S11``, ``S21`` and ``S22`` [1].

    """
    if velocity == 0.0:
        return 1.0, 0.0, 1.0
    sin_p, cos_p = sine_cosine(phase)
    before = acceleration(sin_p, cos_p, velocity, alpha, beta, gamma)
    after = acceleration(sin_p, cos_p, velocity_after, alpha, beta, gamma)
    return velocity_after / velocity, (restitution * before + after) / velocity, -restitution


@kernel
def log_determinant(velocity: float, velocity_after: float, restitution: float,
                    contraction: float) -> float:
    """
    Logarithm of ``|det S|``.

    Parameters
    ----------
    velocity, velocity_after : float
        Just before and after the impact [1].
    restitution, contraction : float
        Coefficient of restitution r and ``2 ln r`` [1].

    Returns
    -------
    float
        ``2 ln r``, or ``ln(r |v+/v-|)`` where a kick has changed v+ [1].

    """
    if velocity == 0.0:
        return 0.0
    if velocity_after == -restitution * velocity:
        return contraction
    return logarithm(abs(restitution * velocity_after / velocity))
