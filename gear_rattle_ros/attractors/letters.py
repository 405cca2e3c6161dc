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

"""The letters of the attractors that were found, and the numbers of their colours."""

from collections.abc import Iterable, Mapping
import dataclasses

import numpy as np

from .catalogue import Catalogue
from ..core.many.recorded import initial_after
from ..core.orbits.letters import followed_to, leaving_points, LETTERS, MOST, SAME
from ..core.orbits.orbit import Orbit, same_orbit


def with_letters(catalogue: Catalogue) -> Catalogue:
    """Return a catalogue that knows the letters of its attractors."""
    followed = followed_to(catalogue.parameters)
    found: dict[int, str] = {}
    for letter, orbit in followed.items():
        if orbit.is_stable:
            found |= {each.label: letter for each in catalogue.attractors
                      if each.orbit and same_orbit(each.orbit, orbit, SAME)}
    left = {each.label for each in catalogue.attractors if each.label >= 0} - set(found)
    for letter, orbit in followed.items():
        label = _descendant(orbit, catalogue) if left else None
        if label in left:
            found[label] = letter
            left.remove(label)
    return dataclasses.replace(catalogue, letters=found)


def numbers_of(labels: Iterable[int], letters: Mapping[int, str]) -> dict[int, int]:
    """Return the number of each attractor, which is that of its colour, by label."""
    # Without a letter it has a number that no letter has.
    first = len(LETTERS) if any(letters.values()) else 0
    numbers, others = {}, 0
    for label in labels:
        if letters.get(label):
            numbers[label] = LETTERS.index(letters[label])
        elif label >= 0:
            numbers[label] = first + others
            others += 1
    return numbers


def _descendant(orbit: Orbit, catalogue: Catalogue) -> int | None:
    points = leaving_points(orbit)
    if not len(points):
        return None
    labels = catalogue.label(initial_after(orbit.parameters, *points.T), threads=1)['label']
    found, counts = np.unique(labels, return_counts=True)
    return int(found[np.argmax(counts)]) if np.max(counts) > MOST * len(labels) else None
