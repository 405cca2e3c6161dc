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

"""
The model and its analysis: numpy and numba only, no ROS, no files, no pictures.

Notation, here and in every room, as in de Souza & Caldas (2001); [1] marks a number without unit:

* ``tau`` is the dimensionless time, one drive period is ``2 pi`` of it; ``phase = tau mod 2 pi``
  [rad]; ``d`` is a time since take-off [1], ``p`` or ``sin_p``, ``cos_p`` the phase there.
* ``s`` is the displacement of the driven gear in units of the backlash [1], from -1 (lower wall)
  to 0 (upper wall); ``v = s'`` its velocity [1]; ``a(tau, v)`` its acceleration in flight [1].
* ``alpha``, ``beta``, ``gamma`` and ``r`` are drive, damping, load and restitution [1].
* ``v-`` and ``v+`` are the velocities just before and just after an impact; "velocity" of an
  impact is ``v-``. Time is counted in impacts: lifetimes in impacts, exponents per impact.
"""
