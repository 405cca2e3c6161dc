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

"""Basins: the same whatever the cuts, right against the scalar core, mirrored by symmetry."""

import dataclasses
import math

from grids import basin
import numpy as np
import pytest

from gear_rattle_ros.attractors.catalogue import Kind
from gear_rattle_ros.attractors.finding import find_attractors
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.core.flight.lanes import new_tiles
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.many.settling import (
    classify,
    FLOATING,
    RESTS_UPPER,
    RESULT,
    UNSETTLED,
)
from gear_rattle_ros.core.model import EventKind, Parameters, State
from gear_rattle_ros.core.stream.transients import Regime, TransientDetector
from gear_rattle_ros.figures.draw import draw
from gear_rattle_ros.palette import hue, rgb
from gear_rattle_ros.store.making import make_store
from gear_rattle_ros.store.store import open_dataset
from gear_rattle_ros.studies.grids.basins import basins, describe, magnifications

PLANE = Plane(phases=48, velocities=40)


@pytest.fixture(scope='module')
def reference(tmp_path_factory):
    """Compute one basin that others are compared with."""
    return basin(tmp_path_factory.mktemp('basins') / 'reference.zarr', PLANE)


@pytest.mark.parametrize(('tile', 'threads'), [(7, 2), (48, 1), (13, 3)])
def test_labels_do_not_depend_on_tiles_or_threads(tmp_path, reference, tile, threads):
    """An initial condition is followed alone, whatever else its tile holds."""
    _, label, lifetime, attractors = basin(tmp_path / 'a.zarr', PLANE, tile=tile, threads=threads)
    assert np.array_equal(label, reference[1])
    assert np.array_equal(lifetime, reference[2])
    assert [each.key for each in attractors] == [each.key for each in reference[3]]


def test_resume_gives_the_same_store(tmp_path, reference):
    """Tiles that are lost are computed again, the others are not touched."""
    path = tmp_path / 'a.zarr'
    store, label, _, _ = basin(path, PLANE, tile=10)
    for tile in (0, 7, 11):
        shape = store.read(tile, 'label').shape
        store.write(tile, {'label': np.full(shape, 99), 'lifetime': np.zeros(shape)})
        store.mark(tile, done=False)
    kept = store.path / 'label' / 'c.1.1'
    before = kept.stat().st_mtime_ns
    _, again, lifetime, _ = basin(path, PLANE, tile=10, resume=True)
    assert np.array_equal(again, label)
    assert np.array_equal(lifetime, reference[2])
    assert kept.stat().st_mtime_ns == before


@pytest.mark.parametrize('tile', [pytest.param(9, marks=pytest.mark.long), 24, 48])
def test_what_the_search_has_missed_is_found_in_the_grid(tmp_path, reference, tile):
    """With one random initial condition the tiles find the other attractor; labels agree."""
    search = {'initial_conditions': 1, 'cap': 1500, 'tile': tile}
    _, label, lifetime, attractors = basin(tmp_path / 'a', PLANE, **search)
    _, expected, lifetimes, known = reference
    assert len(attractors) == len(known) == 2
    assert [each.settled for each in attractors] == [1, 0]
    ours = np.array([each.key for each in attractors])[label]
    assert np.array_equal(ours, np.array([each.key for each in known])[expected])
    assert np.array_equal(lifetime, lifetimes)
    _, again, _, _ = basin(tmp_path / 'a', PLANE, resume=True, **search)
    assert np.array_equal(again, label)


def followed(state):
    """Follow an initial condition by the scalar simulation and the live detector."""
    simulation = Simulation(
        Parameters(*(float(state[name]) for name in ('alpha', 'beta', 'gamma', 'restitution'))),
        State(0, float(state['phase']), float(state['displacement']), float(state['velocity'])))
    detector, sticks = TransientDetector(), 0
    while detector.report.regime is Regime.TRANSIENT and simulation.impacts < 20_000:
        events = simulation.advance(simulation.moment[0] + 100, 0.0, 2000)
        sticks += int(np.sum(events['kind'] == EventKind.STICK))
        detector.update(events)
    return detector.report, sticks


def test_labels_and_lifetimes_are_those_of_the_live_detector(reference):
    """A sample, with those that chatter: the scalar core finds the same."""
    _, label, lifetime, attractors = reference
    initial = PLANE.cells(Parameters(), slice(0, PLANE.velocities), slice(0, PLANE.phases))
    label, lifetime = label.ravel(), lifetime.ravel()
    slow = np.flatnonzero(np.abs(initial['velocity']) < 0.06)
    sample = np.unique(np.concatenate([slow[::2], np.arange(0, len(initial), 29)]))
    chattered = short = same = 0
    for number in sample:
        report, sticks = followed(initial[number])
        attractor = attractors[label[number]]
        agrees = (report.period_impacts, report.period_drive) == (
            attractor.impacts, attractor.drive_periods)
        same += agrees
        # In a longer transient a difference in the last bit grows to decide where it ends; to
        # stick forgets it.
        if report.lifetime < 60 or sticks:
            assert agrees, initial[number]
            # A label asks for the flight time of the impact with which it begins alone.
            assert abs(report.lifetime - lifetime[number]) <= 4
            chattered += sticks > 0
            short += 1
    assert chattered >= 5
    assert short > 0.5 * len(sample)
    assert same > 0.9 * len(sample)


def test_the_symmetric_model_has_mirrored_basins(tmp_path):
    """With gamma = 0, s -> -1 - s, tau -> tau + pi maps trajectories to trajectories."""
    parameters = Parameters(alpha=0.5, gamma=0.0)
    upper = Plane(0.0, (0.0, 2.0 * math.pi), (-1.0, 1.0), 30, 30)
    lower = Plane(-1.0, (math.pi, 3.0 * math.pi), (-1.0, 1.0), 30, 30)
    found = []
    for name, plane in (('upper', upper), ('lower', lower)):
        _, label, lifetime, attractors = basin(tmp_path / name, plane, parameters)
        found.append((label, lifetime, {each.label: each.points() for each in attractors}))
    (label, lifetime, points), (mirrored, lifetime_2, points_2) = found
    mirrored, lifetime_2 = mirrored[::-1], lifetime_2[::-1]
    assert np.mean(lifetime == lifetime_2) > 0.98
    partner = {}
    for number, orbit in points.items():
        image = np.stack([1.0 - orbit[:, 0], (orbit[:, 1] + math.pi) % (2.0 * math.pi),
                          -orbit[:, 2]], axis=1)
        for other, there in points_2.items():
            if len(there) == len(image) and np.allclose(
                    image[np.lexsort(image.T)], there[np.lexsort(there[:, :3].T), :3], atol=1e-6):
                partner[number] = other
    assert sorted(partner) == sorted(points)
    assert np.mean(np.vectorize(partner.get)(label) == mirrored) > 0.98


def test_refilled_lanes_lose_and_repeat_nothing():
    """A thousand initial conditions through 64 lanes give what each gives alone."""
    parameters = Parameters(alpha=0.52)
    initial = PLANE.draw(parameters, 1000, 3)
    table = find_attractors(parameters, initial[:100], hold=3000).table
    tile = new_tiles(1)[0]

    def settled(some):
        results = np.zeros(len(some), RESULT)
        results['label'] = 99
        made = classify(tile, some, 400, table, results)
        return results, made

    together, made = settled(initial)
    assert made >= together['impacts'].sum() > 0
    for number in range(0, 1000, 9):
        alone, _ = settled(initial[number:number + 1])
        assert alone['label'][0] == together['label'][number]
        assert alone['lifetime'][0] == together['lifetime'][number]
    backwards, _ = settled(initial[::-1].copy())
    assert np.array_equal(backwards['label'][::-1], together['label'])
    assert np.array_equal(backwards['lifetime'][::-1], together['lifetime'])


def test_shares_converge_with_the_size_of_the_grid(tmp_path):
    """Grids and random initial conditions agree within the error of a share."""
    shares = []
    for size in (24, 96):
        _, label, _, attractors = basin(
            tmp_path / f'{size}', Plane(phases=size, velocities=size))
        shares.append((np.mean(label == 0), size))
    fine = shares[1][0]
    for share, size in shares:
        assert abs(share - fine) < 4.0 * math.sqrt(fine * (1.0 - fine)) / size
    assert abs(attractors[0].share - fine) < 4.0 * attractors[0].share_error


def test_a_chaotic_attractor_has_a_basin_of_its_own(tmp_path):
    """At alpha = 0.57 there are an orbit and chaos; nothing is left over."""
    _, label, lifetime, attractors = basin(
        tmp_path / 'a', Plane(phases=30, velocities=30), Parameters(alpha=0.57), hold=20_000)
    assert [each.kind for each in attractors] == [Kind.PERIODIC, Kind.CHAOTIC]
    assert set(np.unique(label)) == {0, 1}
    assert lifetime[label == 1].max() < 2000


def test_rest_and_floating_have_labels_of_their_own(tmp_path):
    """A load that always presses ends on the wall; without load and walls nothing is hit."""
    plane = Plane(phases=8, velocities=8)
    _, label, _, attractors = basin(tmp_path / 'rest', plane, Parameters(alpha=0.002))
    assert np.all(label == RESTS_UPPER)
    assert attractors[0].key == 'rest-upper'
    plane = Plane(-0.5, phases=8, velocities=8, velocity=(-0.01, 0.01))
    _, label, lifetime, _ = basin(
        tmp_path / 'float', plane, Parameters(alpha=0.01, beta=0.5, gamma=0.0))
    assert np.all(label == FLOATING)
    assert np.all(lifetime == 0)


def test_what_is_given_up_is_counted_not_guessed(tmp_path):
    """With a cap of a few impacts nearly nothing settles."""
    _, label, lifetime, _ = basin(tmp_path / 'a', PLANE, cap=12)
    assert np.mean(label == UNSETTLED) > 0.8
    assert np.all(lifetime[label == UNSETTLED] == 12)


def test_the_dataset_describes_itself(reference):
    """Coordinates have names and units; parameters and the table of attractors are there."""
    dataset = open_dataset(reference[0].path)
    assert dataset['label'].dims == ('velocity', 'phase')
    assert dataset['phase'].attrs['units'] == 'rad'
    assert dataset.attrs['alpha'] == 0.48
    assert dataset.attrs['displacement'] == 0.0
    assert list(dataset['attractor_key'].values) == [each.key for each in reference[3]]
    assert np.array_equal(dataset['phase'], PLANE.across_values())


@pytest.mark.parametrize('seed', [
    1, *(pytest.param(seed, marks=pytest.mark.long) for seed in (2, 3))])
def test_every_cell_is_in_the_table(seed):
    """Also what rests, where the one random initial condition has reached something else."""
    grid = basins(Parameters(alpha=0.09), Plane(phases=9, velocities=9), initial_conditions=1,
                  seed=seed, hold=2000, cap=2000)
    rows = describe(grid).splitlines()[1:-1]
    assert describe(grid) == describe(basins.compute(
        Parameters(alpha=0.09), Plane(phases=9, velocities=9), initial_conditions=1, seed=seed,
        hold=2000, cap=2000))
    labels, numbers = np.unique(grid['label'].values, return_counts=True)
    cells = {int(row.split()[0]): float(row.split()[3]) for row in rows}
    assert -2 in labels or -3 in labels
    for label, number in zip(labels.tolist(), numbers.tolist(), strict=True):
        assert cells[label] == pytest.approx(100.0 * number / 81.0, abs=6e-4)


def test_windows_magnify_about_a_point():
    """The point keeps its place in every window, each ten times smaller."""
    planes = magnifications(Plane(), 4, 2.0, 0.5, 10.0)
    for plane in planes:
        (p0, p1), (v0, v1) = plane.phase, plane.velocity
        assert (2.0 - p0) / (p1 - p0) == pytest.approx(2.0 / (2.0 * math.pi), rel=1e-9)
        assert (0.5 - v0) / (v1 - v0) == pytest.approx(0.625, rel=1e-9)
    assert planes[3].velocity[1] - planes[3].velocity[0] == pytest.approx(4e-3)
    with pytest.raises(ValueError, match='outside'):
        magnifications(Plane(), 2, 2.0, 5.0, 10.0)


def test_the_largest_grid_is_laid_out_at_once(tmp_path):
    """20,000 x 20,000 cells: nothing of the size of the grid is held or written up front."""
    from gear_rattle_ros.studies.grids.grid import fill_tile, grid_layout
    plane = Plane(phases=20_000, velocities=20_000)
    store = make_store(tmp_path / 'a', grid_layout(plane, {}, 'large', 1000), 'test')
    assert len(store.tiles) == 1600
    catalogue = find_attractors(Parameters(), plane.draw(Parameters(), 50, 1), hold=3000)
    part = dict(store.tiles[0])
    assert {edge.stop - edge.start for edge in part.values()} == {500}
    # A tile of it, made small.
    small = make_store(tmp_path / 'b', grid_layout(
        dataclasses.replace(plane, phases=40, velocities=40), {}, 'small', 1000, 20), 'test')
    few = dataclasses.replace(plane, phases=40, velocities=40)
    assert fill_tile(small, few, 1000, True, catalogue, 3)[0] > 400
    assert np.all(small.read(3, 'label') >= 0)
    assert [path.name for path in (small.path / 'label').glob('c*')] == ['c.1.1']


def test_the_picture_shows_every_attractor(reference, tmp_path):
    """As many colours as attractors, and the shares in words."""
    store, label, _, attractors = reference
    figure = draw(open_dataset(store.path))
    image = figure.axes[0].images[0]
    # A is the first colour, B the second.
    shares = [np.mean(np.all(image.get_array()[..., :3] == rgb(hue('AB'.index(each.letter))),
                             axis=-1)) for each in attractors]
    assert shares == [np.mean(label == each.label) for each in attractors]
    words = {text.get_text()[0]: text.get_text() for text in figure.legends[0].get_texts()}
    for share, each in zip(shares, attractors, strict=True):
        assert f'{100.0 * share:.2f} %' in words[each.letter]
    figure.savefig(tmp_path / 'a.png')
    assert (tmp_path / 'a.png').stat().st_size > 10_000
