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

"""Colours are told apart, by the colour-blind too, and are the same from picture to picture."""

import itertools

import numpy as np
import pytest

from gear_rattle_ros.attractors.finding import find_attractors
from gear_rattle_ros.attractors.letters import numbers_of
from gear_rattle_ros.attractors.matching import recognise
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.core.many.settling import UNSETTLED
from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.figures.draw import draw
from gear_rattle_ros.palette import colours_of, ENDS, HUES, rgb, rgba
from gear_rattle_ros.studies.attractors import attractors as dataset_of
from gear_rattle_ros.studies.grids.basins import basins

# Machado, Oliveira & Fernandes (2009), severity 1, on linear red, green and blue.
VISION = {
    'normal': np.eye(3),
    'protanopia': np.array([[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                            [-0.003882, -0.048116, 1.051998]]),
    'deuteranopia': np.array([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                              [-0.011820, 0.042940, 0.968881]]),
    'tritanopia': np.array([[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
                            [0.004733, 0.691367, 0.303900]])}
XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def lab(colour: str, seen: np.ndarray) -> np.ndarray:
    """Return CIE L*a*b* of a colour of sRGB as it is seen."""
    part = np.array(rgb(colour)) / 255.0
    linear = np.where(part <= 0.04045, part / 12.92, ((part + 0.055) / 1.055) ** 2.4)
    x, y, z = np.cbrt(np.clip(XYZ @ seen @ linear / XYZ.sum(axis=1), 0.0, None))
    return np.array([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)])


@pytest.mark.parametrize('vision', VISION)
@pytest.mark.parametrize(('colours', 'least'), [
    ((*HUES[:6], ENDS[UNSETTLED], '#ffffff'), 28.1), ((*HUES, *ENDS.values(), '#ffffff'), 20.2)])
def test_attractors_are_told_apart(colours, least, vision):
    """Six of them, what has not settled, and the paper; then all: 2 is just seen."""
    seen = [lab(colour, VISION[vision]) for colour in colours]
    assert min(np.linalg.norm(a - b) for a, b in itertools.combinations(seen, 2)) > least


def test_the_first_attractors_are_told_apart_in_grey_print():
    """By lightness alone; and none of the first six is too faint on white."""
    lightness = sorted(lab(colour, VISION['normal'])[0] for colour in HUES[:4])
    assert min(np.diff(lightness)) > 10.4
    assert max(lab(colour, VISION['normal'])[0] for colour in HUES[:6]) < 72.0


def test_lab_is_that_of_the_books():
    """Red and blue of sRGB, as Lindbloom tabulates them for D65."""
    assert lab('#ff0000', VISION['normal']) == pytest.approx([53.24, 80.09, 67.20], abs=0.1)
    assert lab('#0000ff', VISION['normal']) == pytest.approx([32.30, 79.19, -107.86], abs=0.1)


def test_an_attractor_has_one_colour_in_all_pictures():
    """By its letter in the paper; explorer and basin node begin with it, too."""
    parameters = Parameters(alpha=0.5)
    catalogue = find_attractors(parameters, Plane().draw(parameters, 100, 1), hold=2000)
    attractors = catalogue.attractors
    assert [each.label for each in attractors] == list(range(len(attractors))) != [0]
    numbers = numbers_of(range(len(attractors)), catalogue.letters)
    assert {each.letter: numbers[each.label] for each in attractors} == {'A': 0, 'B': 1, 'C': 2}
    colours = colours_of(list(numbers.values()))
    assert colours_of(recognise((), catalogue)[1]) == colours
    plane = Plane(phases=20, velocities=20)
    grid = basins(parameters, plane, initial_conditions=100, hold=2000, cap=300)
    picture = draw(grid).axes[0].images[0].get_array()
    for label, shown in zip(grid['label'].values.ravel(), picture.reshape(-1, 4), strict=True):
        assert tuple(shown[:3]) == rgb(ENDS[UNSETTLED] if label == UNSETTLED else colours[label])
    section = draw(dataset_of(parameters, initial_conditions=100, hold=2000))
    for collection in section.axes[0].collections:
        letter = collection.get_label().split()[0]
        label = next(each.label for each in attractors if each.letter == letter)
        assert np.allclose(collection.get_facecolor()[0, :3] * 255.0, rgb(colours[label]))


def test_rerun_takes_the_same_colours():
    """Red first, and opaque unless something else is said."""
    assert rgba('#0072b2') == 0x0072B2FF and rgba('#0072b2', 0x80) == 0x0072B280
