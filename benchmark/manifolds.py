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
Seconds for manifolds of a hundred thousand points and more on one core.

Beside them are the seconds of mapping the same points from the segment, each by itself, when it is
known already which they are. Fails above 5 s for 100,000 points.
Run: python benchmark/manifolds.py
"""

import sys
import time

from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.core.orbits.curves import Curve, grow, impact_map, Map, Segment, segments_of
from gear_rattle_ros.core.orbits.manifolds import saddle_of
from gear_rattle_ros.studies.skeleton.manifolds import find_saddle

POINTS = 100_000
LIMIT = 5.0
# Saddles beside B and A at 0.48, the sides that are fractal, and lengths for so many points.
SIDES = (('orbit-2-1-U5.1744+0.8226', 'unstable -', 1750.0),
         ('orbit-2-1-U5.1744+0.8226', 'stable +', 1900.0),
         ('orbit-3-1-U0.6505+0.3167', 'stable -', 1500.0))


def by_itself(segment: Segment, curve: Curve, map_on: Map) -> float:
    """Return the seconds of mapping every point of a curve from the segment."""
    begin = time.process_time()
    for n in range(int(curve.impacts.max()) + 1):
        map_on(*segment.at(curve.places[curve.impacts == n]), n)
    return time.process_time() - begin


def main() -> int:
    """Print a line for each side; return 1 where one takes longer than the limit."""
    parameters, status = Parameters(0.48), 0
    print(f'{"saddle":26} {"side":11} {"points":>8} {"length":>7} {"s":>6} '
          f'{"by itself":>9}')
    for key, side, length in SIDES:
        saddle = saddle_of(find_saddle(parameters, key))
        segment, backwards = next((each, back) for name, each, back in segments_of(saddle)
                                  if name == side)
        map_on = impact_map(parameters.model, backwards=backwards, fastest=6.0)
        grow(segment, map_on, length=1.0)
        begin = time.process_time()
        curve = grow(segment, map_on, length=length)
        seconds = time.process_time() - begin
        print(f'{key:26} {side:11} {len(curve.walls):8,} {curve.length:7.0f} {seconds:6.2f} '
              f'{by_itself(segment, curve, map_on):9.2f}', flush=True)
        scaled = seconds * POINTS / max(len(curve.walls), 1)
        status |= int(scaled > LIMIT)
    return status


if __name__ == '__main__':
    sys.exit(main())
