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

"""Manifolds as curves: known ones, the Henon map, and the labels beside them."""

import functools
import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from gear_rattle_ros.attractors.finding import find_attractors
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.core.flight.closed_form import NO_WALL
from gear_rattle_ros.core.flight.lanes import make_initial_conditions
from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.core.orbits.cells import find_cells, first_crossing
from gear_rattle_ros.core.orbits.curves import (
    Curve,
    grow,
    impact_map,
    Map,
    Segment,
    segments_of,
)
from gear_rattle_ros.core.orbits.manifolds import Saddle, saddle_of
from gear_rattle_ros.core.orbits.orbit import close_orbit

Array = npt.NDArray[np.float64]
SEED = 1e-6
# Seeds of the saddles of A and B, walls and points.
SADDLES = {
    'A': ((0, 0, 1), ((4.0369, 0.7044), (0.3603, 0.3718), (2.3367, -0.7455))),
    'B': ((0, 1), ((5.1744, 0.8226), (1.5616, -0.4919))),
}


def saddle_at(alpha: float, walls: tuple[int, ...], points: tuple[tuple[float, float], ...]
              ) -> Saddle:
    """Return a saddle near some points."""
    orbit = close_orbit(np.array(walls), np.array(points), Parameters(alpha))
    assert orbit is not None
    return saddle_of(orbit)


def of_plane(one: 'functools.partial[tuple[Array, Array]]') -> Map:
    """Make a map of points from one of two coordinates."""
    def map_on(walls: npt.NDArray[np.int64], points: Array, times: int
               ) -> tuple[npt.NDArray[np.int64], Array]:
        x, y = points.T
        for _ in range(times):
            x, y = one(x, y)
        return walls, np.column_stack([x, y])

    return map_on


def bent(x: Array, y: Array, grows: float, shrinks: float) -> tuple[Array, Array]:
    """Map so that y = x^2 is the unstable manifold of the origin, and x = 0 the stable one."""
    return grows * x, shrinks * y + (grows * grows - shrinks) * x * x


@pytest.mark.parametrize('grows, shrinks', [(2.0, 0.3), (-1.7, -0.2)])
def test_a_known_manifold(grows: float, shrinks: float) -> None:
    """All points lie on the parabola; its length is that of the closed form, on both sides."""
    impacts = 2 if grows < 0.0 else 1
    segment = Segment(0, np.zeros(2), np.array([1.0, 0.0]), grows**impacts, impacts)
    one = functools.partial(bent, grows=grows, shrinks=shrinks)
    curve = grow(segment, of_plane(one), impacts=20, tolerance=1e-4)
    x, y = curve.points.T
    assert np.max(np.abs(y - x * x)) < 1e-11
    # One side for each number of impacts modulo their period.
    expected = sum(0.5 * e * math.hypot(1.0, 2.0 * e) + 0.25 * math.asinh(2.0 * e) for e in (
        SEED * abs(grows)**(n + impacts) for n in range(20, 20 - impacts, -1)))
    assert curve.length == pytest.approx(expected, rel=1e-4)
    assert curve.begins.sum() == impacts
    assert not curve.grazes.any()
    assert (x.min() < 0.0) == (grows < 0.0)


def henon(x: Array, y: Array, a: float) -> tuple[Array, Array]:
    return a - x * x + 0.3 * y, x


def before_henon(x: Array, y: Array, a: float) -> tuple[Array, Array]:
    return y, (x - a + y * y) / 0.3


@pytest.mark.parametrize('a, crosses', [(1.420, False), (1.433, True)])
def test_boundary_crisis_of_the_henon_map(a: float, crosses: bool) -> None:
    """The attractor is its unstable manifold; it meets the boundary from a = 1.42692 on."""
    # Grebogi, Ott & Yorke, Physica D 7, 181 (1983): a_c = 1.426 at b = 0.3.
    def fixed(sign: float) -> float:
        return 0.5 * (-0.7 + sign * math.sqrt(0.49 + 4.0 * a))

    def multipliers(x: float) -> tuple[float, float]:
        root = math.sqrt(x * x + 0.3)
        return (-x - root, -x + root) if x > 0.0 else (-x + root, -x - root)

    def within(map_on: Map) -> Map:
        def limited(walls: npt.NDArray[np.int64], points: Array, times: int
                    ) -> tuple[npt.NDArray[np.int64], Array]:
            for _ in range(times):
                _, points = map_on(walls, points, 1)
                walls = np.where(np.max(np.abs(points), axis=1) < 3.0, walls, -1)
                points = np.clip(points, -3.0, 3.0)
            return walls, points
        return limited

    right, left = fixed(1.0), fixed(-1.0)
    out, (_, into) = multipliers(right)[0], multipliers(left)
    # Eigenvectors of [[-2 x, 0.3], [1, 0]] are (multiplier, 1).
    attractor = grow(Segment(0, np.array([right, right]), np.array([out, 1.0]), out * out, 2),
                     within(of_plane(functools.partial(henon, a=a))), impacts=24)
    for side in (1.0, -1.0):
        boundary = grow(Segment(0, np.array([left, left]), side * np.array([into, 1.0]),
                                1.0 / into**2, 2),
                        within(of_plane(functools.partial(before_henon, a=a))), impacts=16)
        met = first_crossing(attractor, boundary) is not None
        assert not met or crosses
        if met:
            return
    assert not crosses


def curves_at(alpha: float, name: str, backwards: bool, **how: Any
              ) -> list[tuple[Segment, Curve]]:
    """Return both sides of a manifold of a saddle."""
    saddle = saddle_at(alpha, *SADDLES[name])
    map_on = impact_map(Parameters(alpha).model, backwards=backwards, fastest=6.0)
    return [(side, grow(side, map_on, **how)) for _, side, back in segments_of(saddle)
            if back == backwards]


def test_halving_the_tolerance_changes_the_length_by_less_than_one_per_cent() -> None:
    """Of the manifolds of the saddle beside B."""
    for backwards, impacts in ((False, 30), (True, 15)):
        lengths = []
        for tolerance in (1e-3, 5e-4):
            curves = [curve for _, curve in curves_at(0.48, 'B', backwards, impacts=impacts,
                                                      tolerance=tolerance)]
            lengths.append(sum(curve.length for curve in curves))
        assert lengths[0] == pytest.approx(lengths[1], rel=0.01)
        assert lengths[0] > 20.0


@pytest.mark.parametrize('alpha, name', [(0.445, 'A'), (0.48, 'B')])
@pytest.mark.parametrize('backwards', [False, True])
def test_points_return_to_the_segment_they_come_from(alpha: float, name: str, backwards: bool
                                                     ) -> None:
    """The inverse of the map that has made a curve takes all of it back to the saddle."""
    back = impact_map(Parameters(alpha).model, backwards=not backwards)
    for segment, curve in curves_at(alpha, name, backwards, impacts=9):
        for n in range(1, 10):
            mine = curve.impacts == n
            walls, points = back(curve.walls[mine], curve.points[mine], n)
            begun, expected = segment.at(curve.places[mine])
            assert np.array_equal(walls, begun)
            assert np.max(np.abs(points - expected)) < 1e-9


def test_pieces_begin_and_end_where_the_flight_grazes() -> None:
    """One of the neighbours on both sides of a cut has hardly touched a wall."""
    grazing = [curve.points[curve.grazes, 1] for _, curve in curves_at(
        0.48, 'B', False, impacts=28)]
    speeds = np.abs(np.concatenate(grazing))
    # The other has met the next wall.
    assert len(speeds) >= 10
    assert np.count_nonzero(speeds < 2e-3) == len(speeds) // 2


def test_labels_on_both_sides_of_a_smooth_boundary() -> None:
    """Just above the birth of A the stable manifold of its partner bounds its basin."""
    parameters = Parameters(0.445)
    catalogue = find_attractors(parameters, Plane().draw(parameters, 30, 1), chaotic=False)
    rng = np.random.default_rng(1)
    for _, curve in curves_at(0.445, 'A', True, impacts=20):
        steps = curve.steps
        size = np.hypot(*steps.T)
        drawn = rng.choice(np.flatnonzero(size > 1e-6), 500)
        aside = 1e-8 * np.column_stack([-steps[drawn, 1], steps[drawn, 0]]) / size[drawn, None]
        here, there = (catalogue.label(make_initial_conditions(
            parameters, np.mod(points[:, 0], 2.0 * math.pi), -1.0 * curve.walls[drawn],
            points[:, 1]), 2000, threads=1)['label']
            for points in (curve.points[drawn] + aside, curve.points[drawn] - aside))
        assert np.mean(here != there) >= 0.999
        assert set(here.tolist()) | set(there.tolist()) == {0, -1}


def test_a_polygon_that_manifolds_bound_is_a_basin_cell_if_its_image_lies_in_it() -> None:
    """A quarter of a disc: two sides, one map that halves it, and one that moves it out."""
    angle = np.linspace(0.0, 0.6 * np.pi, 400)
    out = np.concatenate([np.column_stack([np.linspace(0.0, 1.0, 50)[1:-1], np.zeros(48)]),
                          np.column_stack([np.cos(angle), np.sin(angle)])])
    back = np.column_stack([np.zeros(99), np.linspace(0.0, 2.0, 100)[1:]])
    unstable, stable = (Curve(
        np.zeros(len(points), np.int64), points, np.zeros(len(points), np.int64),
        np.linspace(0.0, 1.0, len(points)), np.arange(len(points)) == 0,
        np.zeros(len(points), np.bool_)) for points in (out, back))

    def shrink(walls: npt.NDArray[np.int64], points: Array, times: int
               ) -> tuple[npt.NDArray[np.int64], Array]:
        return walls, 0.1 + 0.5 * points

    cells = find_cells(np.zeros((1, 2)), unstable, stable, shrink)
    assert [cell.sides for cell in cells] == [2]
    x, y = cells[0].outline.T
    assert 0.5 * abs(np.sum(x * np.roll(y, 1) - y * np.roll(x, 1))) == pytest.approx(
        math.pi / 4.0, rel=1e-4)
    turned = 0.5 - 2.0 * math.pi
    inside = np.array([[0.5, 0.5], [0.8, 0.8], [0.5, turned], [turned, 0.5]])
    assert cells[0].contains(np.zeros(4, np.int64), inside).tolist() == [True, False, False, True]
    assert not cells[0].contains(np.ones(4, np.int64), inside).any()
    assert not find_cells(np.zeros((1, 2)), unstable, stable, lambda walls, points, times: (
        walls, points + 1.0))


@pytest.mark.parametrize('alpha, times', [(0.48, 1), (0.48, 12), (1.244, 5)])
def test_many_points_are_mapped_as_each_by_itself(alpha: float, times: int) -> None:
    """To the bit, also where a gear sticks or is too fast."""
    random = np.random.default_rng(1)
    walls, speeds = random.integers(-1, 2, 1000), 2.0 * 10.0**random.uniform(-5.0, 0.0, 1000)
    points = np.column_stack(
        [random.uniform(-0.1, 2.0 * math.pi, 1000), (1.0 - 2.0 * walls) * speeds])
    map_on = impact_map(Parameters(alpha).model, fastest=1.0)
    images, there = map_on(walls, points, times)
    alone = [map_on(walls[k:k + 1], points[k:k + 1], times) for k in range(1000)]
    assert np.array_equal(images, np.concatenate([each for each, _ in alone]))
    assert np.array_equal(there, np.concatenate([each for _, each in alone]))
    assert 50 < np.sum(images == NO_WALL) < 950
