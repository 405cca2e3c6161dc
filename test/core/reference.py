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

"""The paper's formulas in mpmath, written independently of the package."""

from collections.abc import Callable, Iterator
import dataclasses

import mpmath as mp

from gear_rattle_ros.core.model import Model

DIGITS = 50


@dataclasses.dataclass(frozen=True)
class Flight:
    """Equations (4)-(5) for one flight, all in mpmath; limits at beta = 0 are taken by hand."""

    phase: float
    displacement: float
    velocity: float
    alpha: float
    beta: float
    gamma: float

    @property
    def model(self) -> Model:
        """Return the parameters as kernels take them; a flight knows no restitution."""
        return Model(self.alpha, self.beta, self.gamma, 1.0)

    def displacement_at(self, d: mp.mpf) -> mp.mpf:
        """Return s(tau0 + d)."""
        p, v, a, b, g = (mp.mpf(x) for x in (
            self.phase, self.velocity, self.alpha, self.beta, self.gamma))
        drive = a * (mp.sin(p + d) - mp.sin(p))
        w = v - a * mp.cos(p)
        if b == 0:
            return mp.mpf(self.displacement) + drive + w * d + g * d * d / 2
        fall = -mp.expm1(-b * d) / b
        return mp.mpf(self.displacement) + drive + g / b * d + fall * (w - g / b)

    def velocity_at(self, d: mp.mpf) -> mp.mpf:
        """Return s'(tau0 + d)."""
        p, v, a, b, g = (mp.mpf(x) for x in (
            self.phase, self.velocity, self.alpha, self.beta, self.gamma))
        w = v - a * mp.cos(p)
        if b == 0:
            return a * mp.cos(p + d) + w + g * d
        return a * mp.cos(p + d) + (w - g / b) * mp.exp(-b * d) + g / b

    def acceleration_at(self, d: mp.mpf) -> mp.mpf:
        """Return s''(tau0 + d) by the differential equation."""
        tau = mp.mpf(self.phase) + d
        a, b = mp.mpf(self.alpha), mp.mpf(self.beta)
        return -a * mp.sin(tau) + a * b * mp.cos(tau) + self.gamma - b * self.velocity_at(d)


def roots(function: Callable[[mp.mpf], mp.mpf], times: list[float]) -> Iterator[mp.mpf]:
    """Yield the roots between times at which the function changes sign, in order."""
    values = [function(mp.mpf(t)) for t in times]
    for t0, t1, f0, f1 in zip(times[:-1], times[1:], values[:-1], values[1:], strict=True):
        if f0 * f1 < 0:
            yield mp.findroot(lambda t: function(t), (t0, t1), solver='anderson',
                              tol=mp.mpf(10)**(-80), verify=False)
