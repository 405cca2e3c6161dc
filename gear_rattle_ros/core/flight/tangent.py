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

"""Flight and impact matrices of the tangent map at fixed time, (ds, dv)."""

from .closed_form import acceleration
from .elementary import logarithm, relaxation, sine_cosine
from ..compiled import kernel
from ..model import Model


@kernel
def flight_matrix(d: float, beta: float) -> tuple[float, float]:
    """Return B and E of the tangent of a flight, ``F = [[1, B], [0, E]]``, ``det F = E``."""
    decay, integral, _ = relaxation(d, beta)
    return integral, decay


@kernel
def impact_matrix(phase: float, velocity: float, velocity_after: float,
                  model: Model) -> tuple[float, float, float]:
    """Return S11, S21, S22 of the saltation matrix ``S = [[v+/v-, 0], [(r a- + a+)/v-, -r]]``."""
    # A neighbouring trajectory meets the wall ``-ds/v-`` later; both are compared at the same
    # time. Without a kick ``det S = r^2``. A contact without speed changes nothing.
    if velocity == 0.0:
        return 1.0, 0.0, 1.0
    sin_p, cos_p = sine_cosine(phase)
    before = acceleration(sin_p, cos_p, velocity, model)
    after = acceleration(sin_p, cos_p, velocity_after, model)
    r = model.restitution
    return velocity_after / velocity, (r * before + after) / velocity, -r


@kernel
def log_determinant(velocity: float, velocity_after: float, restitution: float,
                    contraction: float) -> float:
    """Return ``ln |det S| = 2 ln r``, or ``ln(r |v+/v-|)`` where a kick has changed v+."""
    if velocity == 0.0:
        return 0.0
    if velocity_after == -restitution * velocity:
        return contraction
    return logarithm(abs(restitution * velocity_after / velocity))
