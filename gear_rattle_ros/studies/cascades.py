"""Where a cascade of period doublings ends."""

from collections.abc import Sequence
import dataclasses
from typing import Final

# The ratio of successive intervals in the limit (Feigenbaum 1978).
DELTA: Final = 4.669201609102990
# Fewer doublings do not show how fast their extrapolations converge.
FEWEST: Final = 4


@dataclasses.dataclass(frozen=True)
class Accumulation:
    """Where the doublings of a cascade accumulate; beyond it there is chaos."""

    alpha: float
    uncertainty: float  # how far apart the last two extrapolations are [1]
    ratios: tuple[float, ...]  # of successive intervals, which tend to `DELTA`


def accumulate(alphas: Sequence[float]) -> Accumulation:
    """Extrapolate successive doublings to where they accumulate, with the ratio of the limit."""
    if len(alphas) < FEWEST:
        raise ValueError(f'{len(alphas)} doublings are not enough to extrapolate; '
                         f'{FEWEST} are the fewest')
    gaps = [b - a for a, b in zip(alphas, alphas[1:], strict=False)]
    before, last = (alphas[k] + gaps[k] / (DELTA - 1.0) for k in (-2, -1))
    return Accumulation(last, abs(last - before),
                        tuple(a / b for a, b in zip(gaps, gaps[1:], strict=False)))
