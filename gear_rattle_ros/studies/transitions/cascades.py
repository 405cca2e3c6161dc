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

"""Where a cascade of period doublings ends."""

from collections.abc import Sequence
import dataclasses
import itertools
from typing import Final

# The ratio of successive intervals in the limit (Feigenbaum 1978).
DELTA: Final = 4.669201609102990
# Fewer doublings do not show how fast their extrapolations converge.
FEWEST: Final = 4
# A doubling located worse than to this part of the interval before it says nothing of a ratio.
KNOWN: Final = 0.01


@dataclasses.dataclass(frozen=True)
class Accumulation:
    """Where the doublings of a cascade accumulate; beyond it there is chaos."""

    value: float  # coordinate of the path [1]
    uncertainty: float  # how far apart the last two extrapolations are, and their own error [1]
    ratios: tuple[float, ...]  # of successive intervals, which tend to `DELTA`


def accumulate(values: Sequence[float], errors: Sequence[float]) -> Accumulation | None:
    """
    Extrapolate successive doublings to where they accumulate, with the ratio of the limit.

    The first that is not located well enough ends them; `None` if fewer than `FEWEST` remain.
    """
    count = next((k for k in range(1, len(values))
                  if errors[k] > KNOWN * abs(values[k] - values[k - 1])), len(values))
    if count < FEWEST:
        return None
    gaps = [b - a for a, b in itertools.pairwise(values[:count])]
    before, last = (values[count + k] + gaps[k] / (DELTA - 1.0) for k in (-2, -1))
    own = max(errors[:count]) * (DELTA + 1.0) / (DELTA - 1.0)
    return Accumulation(last, abs(last - before) + own,
                        tuple(a / b for a, b in itertools.pairwise(gaps)))
