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

"""The noise at impacts: drawn from the seed and the number of the impact alone."""

import enum
import math
from typing import Final

import numpy as np

from .elementary import logarithm, sine_cosine, TWO_PI
from ..arrays import Whole
from ..compiled import kernel
from ..model import ALPHA_MAXIMUM

# Kicks of unit standard deviation reach to this where they are uniform.
BOUND: Final = math.sqrt(3.0)


class Noise(enum.IntEnum):
    """What is random: the kicks at impacts, or the amplitude of each drive period."""

    GAUSSIAN = 0
    UNIFORM = 1  # between -sqrt(3) and sqrt(3) standard deviations
    JITTER = 2  # of alpha, Gaussian


UNIFORM, JITTER = int(Noise.UNIFORM), int(Noise.JITTER)


@kernel
def mixed(word: Whole) -> Whole:
    """Mix the bits of a counter (the finaliser of SplitMix64, Steele et al. 2014)."""
    word = np.uint64(word)
    word = (word ^ (word >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return word ^ (word >> np.uint64(31))


@kernel
def gaussian(seed: int, index: int) -> float:
    """Draw the standard normal number of a seed and an impact's number alone (Box-Muller)."""
    golden = np.uint64(0x9E3779B97F4A7C15)
    counter = mixed(np.uint64(seed) + golden) + np.uint64(2 * index) * golden
    first = mixed(counter)
    second = mixed(counter + golden)
    uniform = (np.float64(first >> np.uint64(11)) + 1.0) * 2.0**-53
    angle = np.float64(second >> np.uint64(11)) * 2.0**-53 * TWO_PI
    return math.sqrt(-2.0 * logarithm(uniform)) * sine_cosine(angle)[1]


@kernel
def uniform(seed: int, index: int) -> float:
    """Draw the number of unit variance, within `BOUND` of 0, of a seed and an impact's number."""
    golden = np.uint64(0x9E3779B97F4A7C15)
    word = mixed(mixed(np.uint64(seed) + golden) + np.uint64(2 * index) * golden)
    return BOUND * (np.float64(word >> np.uint64(11)) * 2.0**-52 - 1.0)


@kernel
def draw(kind: int, seed: int, index: int) -> float:
    """Draw a number of unit variance, uniform or else Gaussian."""
    return uniform(seed, index) if kind == UNIFORM else gaussian(seed, index)


@kernel
def jittered(alpha: float, noise: float, seed: int, cycle: int) -> float:
    """Draw the amplitude of a drive period, by its number; it stays in its range."""
    return min(max(alpha + noise * gaussian(seed, cycle), 0.0), ALPHA_MAXIMUM)
