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

"""An attractor has the letter of the paper at every alpha, and nothing else has it."""

import numpy as np
import pytest

from gear_rattle_ros.attractors.catalogue import Catalogue, Kind
from gear_rattle_ros.attractors.finding import find_attractors
from gear_rattle_ros.attractors.letters import numbers_of, with_letters
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.core.orbits.branches import follow
from gear_rattle_ros.core.orbits.letters import letter_of
from gear_rattle_ros.core.orbits.orbit import close_orbit, same_orbit
from gear_rattle_ros.core.path import Path
from gear_rattle_ros.studies.sweeps.orbit_diagram import orbit_diagram


def search(alpha: float, **others: float) -> Catalogue:
    """Find the attractors at one alpha."""
    parameters = Parameters(alpha, **others)
    return find_attractors(parameters, Plane().draw(parameters, 200, 1), hold=4000)


def letters_at(alpha: float, **others: float) -> dict[str, tuple[str, int, int]]:
    """Return kind and period of what has a letter."""
    return {each.letter: (each.kind.value, each.impacts, each.drive_periods)
            for each in search(alpha, **others).attractors if each.letter}


@pytest.mark.parametrize(('alpha', 'expected'), [
    pytest.param(0.47, {'A': ('periodic', 3, 1), 'B': ('periodic', 2, 1)}, marks=pytest.mark.long),
    (0.4938, {'A': ('periodic', 3, 1), 'B': ('periodic', 2, 1)}),
    (0.494, {'A': ('periodic', 3, 1), 'B': ('periodic', 2, 1), 'C': ('periodic', 3, 1)}),
    (0.512, {'A': ('periodic', 3, 1), 'B': ('periodic', 2, 1), 'C': ('periodic', 6, 2)}),
    pytest.param(0.54, {'A': ('periodic', 3, 1), 'B': ('periodic', 4, 2)}, marks=pytest.mark.long),
    # A small attractor of 12 impacts in 6 drive periods lies in the folds of B.
    (0.5635, {'A': ('periodic', 3, 1), 'B': ('periodic', 16, 8)}),
    (0.567, {'A': ('periodic', 3, 1), 'B': ('chaotic', 0, 0)}),
    pytest.param(0.57, {'A': ('periodic', 3, 1), 'B': ('chaotic', 0, 0)}, marks=pytest.mark.long),
    (0.59, {'A': ('periodic', 3, 1)}), (1.244, {}),
    pytest.param(0.45, {'A': ('periodic', 3, 1)}, marks=pytest.mark.long)])
def test_letters_are_those_of_the_paper(alpha: float, expected: dict) -> None:
    """A in the whole range; B until it ends at 0.57229; C from 0.49392 to 0.51601."""
    found = letters_at(alpha)
    assert {letter: what for letter, what in found.items() if letter in 'ABC'} == expected


@pytest.mark.parametrize('alpha', [0.48, 0.512, 0.54, 0.5635])
def test_an_orbit_alone_has_the_letter_that_the_search_gives_it(alpha: float) -> None:
    found = [each for each in search(alpha).attractors if each.orbit]
    assert [letter_of(each.orbit) for each in found] == [each.letter for each in found]
    assert {each.letter for each in found} >= {'A', 'B'}


def test_other_parameters_have_no_letters() -> None:
    assert letters_at(0.48, beta=0.11) == {}


def test_a_letter_goes_along_the_branch() -> None:
    """Orbits that are followed by arclength from one alpha have its letter at others."""
    for each in search(0.5).attractors:
        path = Path.over(alpha=(0.48, 0.52))
        for branch in (follow(each.orbit, path, sign, *path.ends) for sign in (-1.0, 1.0)):
            for orbit in branch.orbits[4::6]:
                if not orbit.is_stable:
                    continue
                there = with_letters(Catalogue(orbit.parameters, orbits=(orbit,)))
                assert there.letters == {0: each.letter}, orbit.parameters


def test_the_chaotic_b_has_the_orbit_in_it_that_b_was() -> None:
    """The unstable orbit of two impacts, followed from 0.48 past all doublings."""
    before = next(each.orbit for each in search(0.48).attractors if each.letter == 'B')
    path = Path.over(alpha=(0.48, 0.57))
    branch = follow(before, path, 1.0, *path.ends)
    parameters = Parameters(alpha=0.57)
    unstable = close_orbit(branch.orbits[-1].walls, branch.orbits[-1].points, parameters)
    chaos = next(each for each in search(0.57).attractors if each.kind is Kind.CHAOTIC)
    assert chaos.letter == 'B' and chaos.key == f'chaotic-{unstable.name}'
    assert not unstable.is_stable and not same_orbit(unstable, before, 1e-3)


def test_what_has_no_letter_has_no_number_of_one() -> None:
    assert numbers_of([0, 1, 2, -1], {0: 'B', 2: 'A'}) == {0: 1, 1: 6, 2: 0}
    assert numbers_of([0, 1, -1], {}) == {0: 0, 1: 1}


def test_a_diagram_numbers_attractors_by_their_letters() -> None:
    """B doubles to chaos between these columns, and C lives at the first only."""
    table = orbit_diagram(Path.over(alpha=(0.5, 0.57)), columns=3, trajectories=64, keep=256,
                          hold=2000, bins=20, sweeps=('random',))
    seen = {(str(letter), int(number), column) for (_, column, slot), number in np.ndenumerate(
        table['attractor'].values) for letter in [table['letter'].values[0, column, slot]]
        if number >= 0}
    assert seen == {('A', 0, 0), ('A', 0, 1), ('A', 0, 2), ('B', 1, 0), ('B', 1, 1), ('B', 1, 2),
                    ('C', 2, 0)}
    assert len(set(table['key'].values[table['letter'].values == 'B'])) == 3
