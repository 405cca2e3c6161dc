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

"""Straight paths through the parameters, along which sweeps and branches of orbits go."""

import dataclasses
import functools
import math
from typing import Final

import numpy as np

from .arrays import FloatArray
from .model import Model, Parameters

# The coordinate along a path on which several parameters change.
SEVERAL: Final = 'path'
EMPTY: Final = '{} window {:g} to {:g} is empty or reversed; give the lower end first'


@dataclasses.dataclass(frozen=True)
class Path:
    """
    A window of one parameter, or the straight path from one point to another.

    Its coordinate is that parameter, or goes from 0 to 1. ValueError where nothing changes, or a
    window is reversed.
    """

    first: Parameters
    last: Parameters

    def __post_init__(self) -> None:
        if not self.varied:
            raise ValueError('the path ends where it begins; give a parameter a window')
        if self.ends[0] > self.ends[1]:
            raise ValueError(EMPTY.format(self.name, *self.ends))

    @classmethod
    def over(cls, parameters: Parameters | None = None, /, **windows: tuple[float, float]
             ) -> 'Path':
        """Return the path on which parameters go through windows, all together."""
        for name, (low, high) in windows.items():
            if low == high:
                raise ValueError(EMPTY.format(name, low, high))
        first, last = (dataclasses.replace(parameters or Parameters(), **{
            name: window[end] for name, window in windows.items()}) for end in (0, 1))
        return cls(first, last)

    @functools.cached_property
    def varied(self) -> tuple[str, ...]:
        """Names of the parameters that change."""
        return tuple(name for name, a, b in zip(
            Model._fields, self.first.model, self.last.model, strict=True) if a != b)

    @functools.cached_property
    def name(self) -> str:
        """Name of the coordinate."""
        return self.varied[0] if len(self.varied) == 1 else SEVERAL

    @functools.cached_property
    def ends(self) -> tuple[float, float]:
        """Return the coordinate of both ends [1]."""
        return (0.0, 1.0) if self.name == SEVERAL else (
            getattr(self.first, self.name), getattr(self.last, self.name))

    @functools.cached_property
    def direction(self) -> FloatArray:
        """Return the derivatives of alpha, beta, gamma, restitution by the coordinate [1]."""
        if self.name != SEVERAL:
            return np.array([float(name == self.name) for name in Model._fields])
        return np.subtract(self.last.model, self.first.model)

    @functools.cached_property
    def unit(self) -> float:
        """How far the coordinate goes where the parameters go a distance of one [1]."""
        return 1.0 / float(np.linalg.norm(self.direction))

    def at(self, value: float) -> Parameters:
        """Return the parameters at a coordinate, beyond the ends, too; ValueError out of range."""
        return Parameters(*(value if name == self.name else a + (b - a) * value for name, a, b in
                            zip(Model._fields, self.first.model, self.last.model, strict=True)))

    def of(self, parameters: Parameters) -> float:
        """Return the coordinate of a point on the path."""
        if self.name != SEVERAL:
            return float(getattr(parameters, self.name))
        way = np.subtract(parameters.model, self.first.model)
        return float(way @ self.direction * self.unit**2)

    def values(self, count: int) -> FloatArray:
        """Return equally spaced coordinates, both ends included."""
        return np.linspace(*self.ends, count)
