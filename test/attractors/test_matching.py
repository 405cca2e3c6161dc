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

"""Attractors keep their colours while a parameter moves."""

import numpy as np

from gear_rattle_ros.attractors.finding import Catalogue, find_attractors
from gear_rattle_ros.attractors.matching import follow, points_of
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.attractors.tracks import track
from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.core.orbits.letters import LETTERS
from gear_rattle_ros.palette import colours_of, HUES, painted


def search(alpha: float) -> Catalogue:
    """Find the periodic attractors at one alpha."""
    parameters = Parameters(alpha=alpha)
    return find_attractors(parameters, Plane().draw(parameters, 200, 1), hold=2000,
                           chaotic=False)


def test_attractors_keep_their_colours_through_births_and_doublings() -> None:
    """A, B and C of the paper: A over the whole range, B and C past their doublings."""
    known, colours = (), {'A': set(), 'B': set(), 'C': set()}
    shapes = {'A': set(), 'B': set(), 'C': set()}
    for alpha in np.arange(0.47, 0.5301, 0.005):
        catalogue = search(float(alpha))
        known, hues = follow(known, points_of(catalogue))
        for orbit, hue in zip(catalogue.orbits, hues, strict=True):
            impacts, periods = orbit.impacts, orbit.drive_periods
            name = 'B' if impacts == 2 * periods else 'A' if orbit.phases[0] < 4.5 else 'C'
            colours[name].add(hue)
            shapes[name].add((impacts, periods))
    assert colours == {'A': {1}, 'B': {0}, 'C': {2}}
    assert shapes == {'A': {(3, 1)}, 'B': {(2, 1), (4, 2)}, 'C': {(3, 1), (6, 2)}}


def test_a_vanished_attractor_leaves_its_colour_free() -> None:
    """A new one takes the lowest free colour; without a complete search chaos keeps its own."""
    near, far = np.array([[0.0, 1.0, 0.5]]), np.array([[1.0, 4.0, -0.7]])
    moved, fresh = near + [0.0, 0.05, 0.02], np.array([[0.0, 5.5, 2.0]])
    known, hues = follow((), [(near, False), (far, True)])
    assert hues == (0, 1)
    assert follow(known, [(fresh, False), (moved, False)])[1] == (1, 0)
    later, hues = follow(known, [(fresh, False), (moved, False)], is_complete=False)
    assert hues == (2, 0)
    assert follow(later, [(far, True)])[1] == (1,)


def test_a_letter_goes_on_to_the_next_alpha_alone() -> None:
    """Without a letter chaos is another attractor, unless its letter was there just before."""
    letters = np.array(['D', 'D', '', '', '', ''])[None, :, None]
    here = letters[0, :, 0] != ''
    for missing, is_new in ((np.array([0, 0, 0, 0, 1, 1]), True),
                            (np.array([0, 0, 1, 1, 1, 1]), False)):
        there = (here | (missing > 0))[None, :, None]
        keys = np.where(there, 'chaotic-6-3', '')
        points = np.where(there[..., None, None], [[[[[0.0, 5.3, 0.84]]]]], np.nan)
        numbers = track(keys, points, there, there, letters)[0, :, 0]
        assert np.all(numbers[here] == LETTERS.index('D'))
        assert np.all((numbers[missing > 0] >= len(LETTERS)) == is_new)


def test_phase_is_a_circle() -> None:
    """An orbit that crosses phase 0 stays the same."""
    before, after = np.array([[0.0, 6.28, 0.5]]), np.array([[0.0, 0.01, 0.5]])
    known, _ = follow((), [(np.array([[0.0, 3.0, 0.5]]), False), (before, False)])
    assert follow(known, [(after, False)])[1] == (1,)


def test_every_label_is_painted() -> None:
    """Pixels are the colours of their labels, ends of trajectories included."""
    colours = colours_of((3, 0))
    picture = painted(np.array([[0, 1], [-1, -3]], np.int16), colours)
    assert bytes(picture[0, 1, :3]).hex() == HUES[0][1:]
    assert bytes(picture[0, 0, :3]).hex() == HUES[3][1:]
    assert len({bytes(pixel) for row in picture for pixel in row}) == 4
    assert np.all(picture[..., 3] == 255)
