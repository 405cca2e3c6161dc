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

"""Computing a view: the same labels as the tools, given up at once, remembered by parameters."""

from collections.abc import Iterator
import functools
import threading

import numpy as np
import pytest

from gear_rattle_ros.attractors.finding import CONSERVES, find_attractors
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.many.settling import UNSETTLED
from gear_rattle_ros.core.model import Parameters, State
from gear_rattle_ros.explorer.computing.catalogues import Catalogues
from gear_rattle_ros.explorer.computing.computing import Picture, pictures
from gear_rattle_ros.explorer.computing.trajectory import follow
from gear_rattle_ros.explorer.computing.worker import Worker
from gear_rattle_ros.explorer.figures.painting import Colours, legend, paint
from gear_rattle_ros.explorer.view import CAP, EXPONENTS, KINDS, SPAN, View
from gear_rattle_ros.studies.grids.exponents import finite_time_exponents


def until(view: View, cells: int) -> Picture:
    """Compute a view up to a level."""
    for picture in pictures(Catalogues(), view, lambda: None):
        if picture.cells >= cells and picture.done == 1.0:
            return picture
    raise AssertionError('it has ended before')


def keys(picture: Picture) -> np.ndarray:
    """Name the attractor of every cell."""
    colours = Colours().followed(picture.known)
    return np.array([[colours.names[int(label)] for label in row] for row in picture.labels])


@pytest.mark.parametrize(('alpha', 'displacement'), [(0.48, 0.0), (0.57, -0.4)])
def test_labels_are_those_of_a_search_of_its_own(alpha: float, displacement: float) -> None:
    """Cell by cell on 50 x 50, chaotic attractors included."""
    parameters, plane = Parameters(alpha=alpha), Plane(displacement, phases=50, velocities=50)
    for picture in pictures(Catalogues(), View(parameters, displacement), lambda: None):
        if picture.cells == 50 and picture.known.is_complete:
            break
    catalogue = find_attractors(
        parameters, plane.draw(parameters, 300, 8), hold=20_000)
    theirs = catalogue.label(plane.cells(parameters, slice(0, 50), slice(0, 50)), CAP)
    names = [each.title if each.orbit else 'chaos' for each in catalogue.attractors
             if each.label >= 0]
    periodic = [name for name in names if name != 'chaos']
    expected = np.array([names[label] if label >= 0 else 'none' for label in theirs['label']])
    ours = np.array([name if name in periodic else 'chaos' for name in keys(picture).ravel()])
    assert np.mean(ours == expected) > 0.999
    is_orbit = np.isin(expected, periodic) & (ours == expected)
    assert np.array_equal(picture.lifetimes.ravel()[is_orbit], theirs['lifetime'][is_orbit])


def test_a_level_stands_in_for_the_next() -> None:
    """At a deep window whose cells agree, finer levels have the label of the coarse one."""
    picture = until(View(phase=(1.0, 1.0 + 1e-9), velocity=(0.5, 0.5 + 1e-9)), 200)
    assert len(np.unique(picture.labels)) == 1


def test_what_is_given_up_stops_between_strips() -> None:
    """The check is called before anything long begins, and its exception comes through."""
    class Enough(Exception):
        pass

    asked = []

    def check() -> None:
        asked.append(1)
        if len(asked) > 6:
            raise Enough

    with pytest.raises(Enough):
        for _ in pictures(Catalogues(), View(Parameters(alpha=1.0)), check):
            pass


def test_worker_shows_the_last_view_and_ends() -> None:
    """Of many views in a row the last is computed to the end; a stopped thread ends."""
    shown: list[Picture] = []
    fine = threading.Event()

    def show(picture: Picture) -> None:
        shown.append(picture)
        if picture.view.displacement == -0.5 and picture.cells >= 100:
            fine.set()

    worker = Worker(functools.partial(pictures, Catalogues()), show, lambda: True)
    for displacement in np.linspace(0.0, -0.5, 11):
        worker.ask(View(displacement=float(displacement)))
    assert fine.wait(60.0)
    worker.stop()
    assert worker.join(10.0)
    assert shown[-1].view.displacement == -0.5
    assert sum(picture.cells >= 100 for picture in shown
               if picture.view.displacement != -0.5) == 0


def test_worker_does_nothing_for_a_page_that_has_gone() -> None:
    """A tab that is closed gets no pictures."""
    shown: list[Picture] = []
    worker = Worker(functools.partial(pictures, Catalogues()), shown.append, lambda: False)
    worker.ask(View())
    worker.stop()
    assert worker.join(60.0)
    assert shown == []


@pytest.fixture(scope='module')
def resting() -> Iterator[Picture]:
    """Return a picture whose cells all come to rest on the upper wall."""
    yield until(View(Parameters(alpha=0.05, gamma=0.2)), 50)


def test_rest_has_colour_and_words(resting: Picture) -> None:
    """Where nothing but rest is left there is one colour, and the legend names it."""
    colours = Colours().followed(resting.known)
    assert len(np.unique(resting.labels)) == 1
    assert UNSETTLED not in resting.labels
    assert 'at rest, upper wall' in legend(resting, colours)
    assert '100.0 %' in legend(resting, colours)
    assert paint(resting, colours).shape == (50, 50, 4)


@pytest.mark.parametrize('kind', KINDS)
def test_where_areas_are_preserved_all_is_unsettled_and_explained(kind: str) -> None:
    """Up to the finest level, in seconds; exponents do not need attractors."""
    view = View(Parameters(alpha=0.1, beta=0.0, gamma=0.0, restitution=1.0), kind=kind)
    picture = until(view, 400 if kind != EXPONENTS else 100)
    assert np.all(picture.labels == UNSETTLED) and not np.any(picture.lifetimes)
    words = legend(picture, Colours().followed(picture.known))
    if kind == EXPONENTS:
        assert picture.exponents is not None and np.any(picture.exponents)
    else:
        assert f'unsettled: {CONSERVES}' in words and '100.0' in words


def test_exponents_are_those_of_the_cells() -> None:
    """Of all cells, whatever was shown before they were computed."""
    view = View(Parameters(alpha=0.57), kind=EXPONENTS)
    picture = until(view, 100)
    initial = view.plane(picture.cells).cells(
        view.parameters, slice(0, picture.cells), slice(0, picture.cells))
    expected = finite_time_exponents(initial, SPAN).astype(np.float32)
    assert picture.exponents is not None
    np.testing.assert_array_equal(picture.exponents.ravel(), expected)


def test_a_deep_window_ends() -> None:
    """Where float64 cannot resolve finer cells, the coarse picture is the last."""
    *_, last = pictures(Catalogues(), View(phase=(1.0, 1.0 + 1.2e-13), velocity=(
        0.5, 0.5 + 1.2e-13)), lambda: None)
    assert last.is_last and last.cells < 100


def test_trajectory_is_that_of_the_simulation() -> None:
    """Impacts of a clicked point are those of the live simulator, to the bit; walls hold."""
    parameters = Parameters(alpha=1.244)
    trajectory = follow(parameters, 3.0 - 20.0 * np.pi, -0.25, 0.7)
    events = Simulation(parameters, State(0, (3.0 - 20.0 * np.pi) % (2.0 * np.pi), -0.25,
                                          0.7)).advance(10_000, 0.0, 401)
    assert np.array_equal(trajectory.velocities, events['velocity'][1:][:len(
        trajectory.velocities)])
    assert np.all((trajectory.displacement >= -1.0 - 1e-12) & (trajectory.displacement <= 1e-12))
    assert trajectory.periods[0] == pytest.approx(3.0 / (2.0 * np.pi))
    assert np.all(np.diff(trajectory.periods) >= -1e-12)
