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

"""Layers: invariant under the map, across boundaries, given up at once, drawn in every turn."""

import functools
import math

from bokeh.plotting import figure
import numpy as np
import pytest

from gear_rattle_ros.attractors.catalogue import Catalogue
from gear_rattle_ros.attractors.finding import find_attractors
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.core.flight.lanes import make_initial_conditions
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import Parameters, State
from gear_rattle_ros.core.orbits.section import distances
from gear_rattle_ros.explorer.computing import skeleton
from gear_rattle_ros.explorer.computing.catalogues import Catalogues, GivenUp
from gear_rattle_ros.explorer.computing.skeleton import (
    Asked,
    EDGE,
    KICK,
    LAYERS,
    Layers,
    MANIFOLDS,
    ORBITS,
    places,
    Skeleton,
)
from gear_rattle_ros.explorer.figures.plane_figure import LayerGlyphs
from gear_rattle_ros.explorer.view import View

# B of figure 3 is clicked on the lower wall, where its smallest kick is.
LOWER = Asked(View(displacement=-1.0), (1.16, -0.53), LAYERS)


@pytest.fixture(scope='module')
def drawn() -> list[Layers]:
    """Return all layers at 0.48 as they grow."""
    return list(Skeleton(Catalogues()).layers(LOWER, lambda: None))


@functools.cache
def found() -> Catalogue:
    parameters = Parameters()
    return find_attractors(parameters, Plane().draw(parameters, 300, 4), chaotic=False)


def labels(points: np.ndarray) -> np.ndarray:
    """Label places of the plane at the lower wall by a search of its own."""
    parameters = Parameters()
    return np.asarray(found().label(make_initial_conditions(
        parameters, np.mod(points[:, 0], 2.0 * math.pi), -1.0, points[:, 1]), 20_000)['label'])


def around(points: np.ndarray, distance: float) -> np.ndarray:
    """Label points at a distance from others in several directions."""
    return np.stack([labels(points + distance * np.array([math.cos(angle), math.sin(angle)]))
                     for angle in np.linspace(0.1, 6.3, 32)])


def test_marks_of_orbits_come_back(drawn: list[Layers]) -> None:
    """The simulation comes back to each mark after as many impacts, also from just after it."""
    view = LOWER.view
    for orbit in drawn[-1].orbits:
        before, after = places(view, orbit.walls, orbit.points)
        assert np.array_equal(np.isnan(before[:, 0]), orbit.walls == 0)
        k = int(np.argmax(orbit.walls))
        for state, first in ((before[k], 0), (after[k], -1)):
            events = Simulation(view.parameters, State(
                0, state[0], -1.0, state[1])).advance(100, 0.0, orbit.impacts + 2)
            impacts = events[events['kind'] == 0]
            assert impacts['phase'][orbit.impacts + first] == pytest.approx(before[k, 0], abs=1e-6)


def test_the_stable_manifold_leads_to_the_saddle(drawn: list[Layers]) -> None:
    """The simulation comes near to it from points of the line."""
    saddle = next(each for each in drawn[-1].orbits if each.name in drawn[-1].words[MANIFOLDS])
    line = drawn[-1].stable[np.isfinite(drawn[-1].stable[:, 0])][::150]
    assert len(line) > 20
    for phase, velocity in line.tolist():
        impacts = Simulation(LOWER.view.parameters, State(0, phase, -1.0, velocity)).advance(
            100, 0.0, 40)[1:]
        assert min(np.min(distances(impacts['velocity'], impacts['phase'], *point[::-1]))
                   for point in saddle.points) < 1e-3


def test_the_arrow_leads_into_another_basin(drawn: list[Layers]) -> None:
    """Its tip does, its tail and all but a thousandth of it do not."""
    (x, y, to_x, to_y), = drawn[-1].kick
    ends = np.array([[x, y], [x, y + 0.999 * (to_y - y)], [to_x, to_y]])
    assert x == to_x
    same, near, other = labels(ends)
    assert same == near != other
    assert 'smallest kick from B to A' in drawn[-1].words[KICK]


def test_edge_state_lies_on_the_boundary(drawn: list[Layers]) -> None:
    """Both attractors are reached from within 1e-6 of it."""
    edge = drawn[-1].edge
    assert len(edge) > 50
    kinds = around(edge, 1e-6)
    assert np.mean(kinds.min(axis=0) != kinds.max(axis=0)) > 0.9
    assert drawn[-1].words[EDGE] == 'the boundary holds a chaotic saddle'


def test_layers_come_one_after_the_other_and_are_kept(drawn: list[Layers]) -> None:
    """Orbits of few impacts are first; after another click they are there at once."""
    first = next(each for each in drawn if each.words)
    assert list(first.words) == [ORBITS]
    assert max(orbit.impacts for orbit in first.orbits) == 3
    assert max(orbit.impacts for orbit in drawn[-1].orbits) == 6
    assert list(drawn[-1].words) == list(LAYERS)
    kept, looks = Skeleton(Catalogues()), []
    for point in ((4.0, -0.5), (1.0, 0.5)):
        looks.append(list(kept.layers(Asked(View(), point, (ORBITS,)), lambda: None)))
    assert len(looks[1]) == 2
    assert [each.key for each in looks[1][1].orbits] == [each.key for each in looks[0][-1].orbits]


def test_what_is_given_up_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each layer asks whether it is still wanted, and what it has found is no layer."""
    monkeypatch.setattr(skeleton, 'SETTLED_AFTER', 0.0)
    for name in LAYERS:
        asked = []

        def check(asked: list[int] = asked) -> None:
            asked.append(1)
            if len(asked) > 5:
                raise GivenUp

        with pytest.raises(GivenUp):
            for _ in Skeleton(Catalogues()).layers(
                    Asked(View(Parameters(alpha=0.57)), (4.0, -0.5), (name,)), check):
                pass


def test_between_the_walls_one_line_says_why_there_is_nothing() -> None:
    layers = list(Skeleton(Catalogues()).layers(
        Asked(View(displacement=-0.5), (4.0, -0.5), LAYERS), lambda: None))
    assert len(layers) == 1 and layers[0].words.keys() == {''}
    assert 'set s₀ to 0 or to −1' in layers[0].words['']


def test_impacts_lie_on_their_planes_and_not_on_the_strobe() -> None:
    """Before them or after them, of both walls; the kick leads to the same state after it."""
    walls, points = np.array([0, 1]), np.array([[1.0, 0.5], [7.0, -0.25]])
    expected = np.array([[1.0, 0.5], [7.0 - 2.0 * math.pi, -0.25]])
    before, none = places(View(on='impact'), walls, points)
    assert np.allclose(before, expected) and np.isnan(none).all()
    none, after = places(View(on='section'), walls, points)
    assert np.allclose(after, expected * (1.0, -0.9)) and np.isnan(none).all()
    assert all(np.isnan(each).all() for each in places(View(on='strobe'), walls, points))
    skeleton = Skeleton(Catalogues())
    view = LOWER.view
    x, v = LOWER.point
    drawn = [list(skeleton.layers(Asked(each, point, (KICK,)), lambda: None))[-1].kick
             for each, point in ((view, (x, v)), (View(on='impact'), (x, v)),
                                 (View(on='section'), (x, -0.9 * v)))]
    (x, after, _, to), (same, before, _, other) = drawn[0][0], drawn[1][0]
    assert x == pytest.approx(same)
    assert np.allclose([after, to], -0.9 * np.array([before, other]), atol=1e-6)
    assert np.allclose(drawn[2], drawn[0], atol=1e-6)


def test_what_cannot_be_drawn_is_put_in_words() -> None:
    """Without an inverse there is no stable manifold; one attractor has no boundary."""
    *_, last = Skeleton(Catalogues()).layers(Asked(
        View(Parameters(restitution=0.0)), (4.0, -0.5), (MANIFOLDS, EDGE)), lambda: None)
    assert last.words.keys() == {MANIFOLDS, EDGE}
    assert last.words[EDGE] == 'no boundary of basins'
    assert 'no W<sup>s</sup>' in last.words[MANIFOLDS]
    assert len(last.stable) == len(last.edge) == 0


def test_every_turn_of_phase_in_the_window_is_drawn(drawn: list[Layers]) -> None:
    """A window across phase 0 has each mark twice, a turn apart; lines stay apart."""
    plot = figure()
    glyphs = LayerGlyphs(plot, '')
    glyphs.show(drawn[-1], (0.0, 6.0))
    sources = {each.name: each.data for each in plot.references() if hasattr(each, 'data')}
    once = {name: dict(data) for name, data in sources.items()}
    glyphs.show(drawn[-1], (-1.0, 5.0))
    twice = {each.name: each.data for each in plot.references() if hasattr(each, 'data')}
    for name in ('orbits', 'stable', 'kick'):
        assert len(twice[name]['x']) == 2 * len(once[name]['x'])
        np.testing.assert_allclose(twice[name]['x'][:len(once[name]['x'])],
                                   once[name]['x'] - 2.0 * math.pi)
    steps = np.abs(np.diff(twice['stable']['x']))
    assert np.nanmax(steps) < 1.0
