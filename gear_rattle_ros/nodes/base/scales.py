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

"""Round limits of axes."""


def nice_limit(largest: float, present: float) -> float:
    """Return a round limit of an axis above a number; the present one stays while it fits."""
    steps = [factor * 10.0**power for power in range(-9, 5) for factor in (1.0, 1.5, 2.0, 3.0,
                                                                           5.0, 7.0)]

    def above(number: float) -> float:
        return next((step for step in steps if step >= number), steps[-1])

    if present >= largest and present > 0.0:
        return min(present, above(1.3 * largest))
    return above(1.05 * largest)
