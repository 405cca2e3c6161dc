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

"""Basins coarse to fine, against trajectories of the scalar simulation."""

import dataclasses
import threading

import numpy as np
import pytest

from gear_rattle_ros.attractors.plane import Plane, PLANES
from gear_rattle_ros.attractors.watching import Basins, Dropped, glance, sizes_up_to, watch
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.many.settling import UNSETTLED
from gear_rattle_ros.core.model import EventKind, Parameters, State
from gear_rattle_ros.core.stream.transients import Regime, TransientDetector

TWO_ATTRACTORS = Parameters(0.48)
NO_HINTS = np.zeros((0, 3))


def pictures(parameters: Parameters, sizes: tuple[int, ...], *, kind: str = 'impact',
             cap: int = 2000) -> list[Basins]:
    """Return all pictures of the plane."""
    planes = [Plane(-0.25 if kind == 'displacement' else None, phases=size, velocities=size,
                    kind=kind) for size in sizes]
    return list(watch(glance(parameters, NO_HINTS)[0], planes, cap=cap, threads=1,
                      is_dropped=lambda: False))


def followed(state: State) -> tuple[int, int]:
    """Return the period [impacts] and the lifetime that the live detector finds."""
    detector = TransientDetector()
    detector.update(Simulation(TWO_ATTRACTORS, state).advance(10_000, 0.0, 3000))
    report = detector.report
    assert report.regime is Regime.ORBIT and report.lifetime is not None
    return int(report.period_impacts or 0), report.lifetime


@pytest.mark.parametrize('kind', PLANES)
def test_initial_conditions_end_where_the_simulation_ends(kind: str) -> None:
    """A sample of cells, just after and before impacts, at one displacement and at one phase."""
    last = pictures(TWO_ATTRACTORS, (50, 60), kind=kind)[-1]
    periods = [orbit.impacts for orbit in last.catalogue.orbits]
    assert sorted(periods) == [2, 3] and not last.catalogue.late
    assert not np.any(last.labels == UNSETTLED)
    compared = 0
    for row, column in np.random.default_rng(3).integers(0, 60, (40, 2)):
        velocity = float(last.plane.velocity_values()[row])
        across = float(last.plane.across_values()[column])
        state = State(0, *{'section': (across, -1.0 if velocity > 0.0 else 0.0),
                           'impact': (across, -1.0 if velocity < 0.0 else 0.0),
                           'displacement': (across, -0.25), 'strobe': (0.0, across)}[kind],
                      velocity)
        period, lifetime = followed(state)
        # In a longer transient a difference in the last bit decides where it ends.
        if lifetime < 60:
            compared += 1
            assert period == periods[last.labels[row, column]]
    assert compared > 15


def test_impacts_lie_in_the_basin_of_their_attractor() -> None:
    """On the section, but for cells that the boundary goes through."""
    last = pictures(TWO_ATTRACTORS, (50, 200))[-1]
    periods = [orbit.impacts for orbit in last.catalogue.orbits]
    same = []
    for phase in np.linspace(0.1, 6.1, 30):
        simulation = Simulation(TWO_ATTRACTORS, State(0, float(phase), 0.0, -1.2))
        events = simulation.advance(10_000, 0.0, 1000)
        impacts = events[events['kind'] == EventKind.IMPACT][:40]
        impacts = impacts[np.abs(impacts['velocity']) < 2.0]
        rows = ((impacts['velocity'] + 2.0) * 50.0).astype(int)
        columns = (impacts['phase'] * (200.0 / (2.0 * np.pi))).astype(int)
        period, _ = followed(State(0, float(phase), 0.0, -1.2))
        same.extend(np.array(periods)[last.labels[rows, columns]] == period)
    assert len(same) > 1000 and np.mean(same) > 0.8


def test_chaos_is_grey_at_first_and_found_then() -> None:
    """At 0.57 the coarse picture knows A alone, a finer one the chaotic attractor B as well."""
    coarse, *_, fine = pictures(Parameters(0.57), (50, 60))
    assert not coarse.is_complete and coarse.share(UNSETTLED) > 0.1
    assert fine.is_complete and fine.share(UNSETTLED) < 0.01
    assert len(fine.catalogue.chaotic) == 1
    assert fine.share(len(fine.catalogue.orbits)) == pytest.approx(
        coarse.share(UNSETTLED), abs=0.05)


def test_a_long_transient_stays_unsettled_without_being_waited_for() -> None:
    """Beyond the crisis, where the mean lifetime is thousands of impacts."""
    last = pictures(Parameters(1.244), (50, 60), cap=400)[-1]
    assert not last.catalogue.chaotic and 0.5 < last.share(UNSETTLED) < 0.98


def test_work_is_dropped() -> None:
    """The next slice raises."""
    dropped = threading.Event()
    planes = [Plane(phases=size, velocities=size, kind='impact') for size in (50, 400, 800)]
    work = watch(glance(TWO_ATTRACTORS, NO_HINTS)[0], planes, cap=20_000,
                 threads=2, is_dropped=dropped.is_set)
    next(work)
    dropped.set()
    with pytest.raises(Dropped):
        next(work)


def test_hints_are_followed() -> None:
    """A point of an orbit leads to it, whatever the random initial conditions do."""
    seen, _ = glance(TWO_ATTRACTORS, NO_HINTS)
    orbit = seen.orbits[0]
    hint = np.array([[orbit.walls[0], orbit.phases[0], orbit.velocities[0]]])
    again, _ = glance(Parameters(0.4801), hint)
    assert any(other.impacts == orbit.impacts and np.allclose(
        other.velocities, orbit.velocities, atol=0.01) for other in again.orbits)
    assert again.labels.size == seen.labels.size + 1


@pytest.mark.parametrize(('largest', 'sizes'), [
    (30, (30, 30)), (50, (50, 50)), (60, (50, 60)), (100, (50, 100)),
    (800, (50, 100, 200, 400, 800))])
def test_sizes_double(largest: int, sizes: tuple[int, ...]) -> None:
    """From 50 to the largest; a second level knows chaos, however small it is."""
    assert sizes_up_to(largest) == sizes


@pytest.mark.long
@pytest.mark.parametrize('alpha', [0.57, 1.0, 1.1, 1.7])
def test_chaos_reported_early_is_chaos(alpha: float) -> None:
    """All of 400 x 400 initial conditions against stays of 1024 impacts in the boxes."""
    fine, *_ = [picture for picture in reversed(pictures(Parameters(alpha), (50, 400, 401)))
                if picture.plane.phases == 400]
    catalogue = fine.catalogue
    assert catalogue.stay < 128 and fine.share(UNSETTLED) < 0.001
    initial = fine.plane.cells(catalogue.parameters, slice(0, 400), slice(0, 400))
    initial['displacement'] = np.where(initial['velocity'] < 0.0, -1.0, 0.0)
    certain = dataclasses.replace(catalogue, stay=1024).label(
        initial, 20_000)['label'].reshape(400, 400)
    compared = (certain != UNSETTLED) & (fine.labels != UNSETTLED)
    assert compared.mean() > 0.99
    assert np.array_equal(fine.labels[compared], certain[compared])
