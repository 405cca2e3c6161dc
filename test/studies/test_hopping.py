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


"""Hops against the simulator, and mean stays against the matrix of the noisy map on cells."""

import itertools

import numpy as np
import pytest
import scipy.sparse
import scipy.stats

from gear_rattle_ros import (
    find_attractors,
    hopping,
    Parameters,
    probability_basins,
    Simulation,
    State,
)
from gear_rattle_ros.attractors.cores import cores_of, find_jumps
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.core.flight.lanes import make_initial_conditions
from gear_rattle_ros.core.flight.noise import BOUND, gaussian, Noise, uniform
from gear_rattle_ros.core.many.hopping import cores_along, hop_from, STAY
from gear_rattle_ros.core.many.recorded import record_impacts
from gear_rattle_ros.core.many.residence import evenness, residence_on, slopes
from gear_rattle_ros.studies.robustness.hopping import describe, stays_of

P = Parameters(alpha=0.48)
SIGMA = 0.05
# Cells along an edge, the greatest speed, trajectories of a cell.
CELLS, FASTEST, DRAWN = 160, 1.6, 16


@pytest.fixture(scope='module')
def known():
    """Find the attractors B, label 0, and A, label 1, of the paper."""
    return find_attractors(P)


@pytest.fixture(scope='module')
def cores(known):
    return cores_of(known)


@pytest.mark.parametrize('kind', Noise)
def test_stays_are_those_of_the_simulator_bit_for_bit(kind, known, cores):
    """As its stream has them, whatever is random; each trajectory has the seed of its number."""
    first = known.states[[0, 1, 2]]
    stays, visitors = hop_from(first, 0.08, kind, np.arange(7, 10), 3000, cores, 500)
    for k, initial in enumerate(first):
        state = State(0, *(float(initial[name]) for name in (
            'phase', 'displacement', 'velocity')))
        simulation = Simulation(P, state, noise=0.08, seed=7 + k, kind=kind)
        parts = []
        for cycle in range(1, 3000):
            parts.append(simulation.advance(cycle, 0.0, 1000))
            if kind is Noise.JITTER:
                alpha = 0.48 + 0.08 * gaussian(7 + k, cycle)
                parts.append(simulation.retune(Parameters(alpha=alpha)))
        events = np.concatenate(parts)
        impacts = events[events['kind'] <= 1][:3000]
        last = find_jumps(known, impacts['phase'], impacts['velocity']).last
        lengths = [(label, len(list(run))) for label, run in itertools.groupby(last)]
        lengths = lengths[int(lengths[0][0] == -1):]
        mine = stays[k][:visitors['stays'][k]]
        assert mine['label'].tolist() == [label for label, _ in lengths]
        # The last is cut off at the last impact, which begins none.
        assert mine['impacts'][:-1].tolist() == [length for _, length in lengths][:-1]
        assert mine['following'][-1] == -1 and len(mine) > 5


def test_draws_have_unit_variance_and_their_bounds():
    """Against the distributions of scipy."""
    drawn = np.array([uniform(3, k) for k in range(20_000)])
    assert np.max(np.abs(drawn)) <= BOUND
    assert scipy.stats.kstest(drawn, scipy.stats.uniform(-BOUND, 2.0 * BOUND).cdf).pvalue > 1e-3
    drawn = [gaussian(3, k) for k in range(20_000)]
    assert scipy.stats.kstest(drawn, 'norm').pvalue > 1e-3


@pytest.mark.long
def test_mean_stays_are_those_of_the_noisy_map_on_cells(known, cores):
    """Within 5 %: the stationary flux between the cores, by the matrix of transitions."""
    random = np.random.default_rng(1)
    cells = 2 * CELLS * CELLS
    cell = np.repeat(np.arange(cells), DRAWN)
    wall, rest = np.divmod(cell, CELLS * CELLS)
    row, column = np.divmod(rest, CELLS)
    phases = (column + random.random(len(cell))) * 2.0 * np.pi / CELLS
    before = np.where(wall, -1.0, 1.0) * (row + random.random(len(cell))) * FASTEST / CELLS
    after = -P.restitution * before + SIGMA * random.standard_normal(len(cell))
    rows, counts = record_impacts(make_initial_conditions(
        P, phases, -wall, -np.copysign(after, before)), 0, 1)
    assert np.all(counts == 1)
    rows = rows[:, 0]
    speed = np.minimum(np.abs(rows['velocity']) * CELLS / FASTEST, CELLS - 1).astype(int)
    image = (np.signbit(rows['velocity']) * CELLS + speed) * CELLS + np.minimum(
        rows['phase'] * CELLS / (2.0 * np.pi), CELLS - 1).astype(int)
    core = cores_along(cores, *(np.ascontiguousarray(rows[name]) for name in (
        'phase', 'velocity')))
    none, into_b, into_a = (scipy.sparse.csr_matrix(
        (np.full(np.sum(core == label), 1.0 / DRAWN), (image[core == label], cell[core == label])),
        shape=(cells, cells)) for label in (-1, 0, 1))
    on_b = on_a = np.full(cells, 0.5 / cells)
    for _ in range(600):
        both = on_a + on_b
        on_b, on_a = none @ on_b + into_b @ both, none @ on_a + into_a @ both
    exact = (np.sum(on_b) / np.sum(into_a @ on_b), np.sum(on_a) / np.sum(into_b @ on_a))
    dataset = hopping(P, noise=[SIGMA], impacts=20_000, trajectories=64, stays=1000)
    stays = stays_of(dataset, 0)
    for label, mean in enumerate(exact):
        found = residence_on(stays, label, [0, 1])
        assert found.mean == pytest.approx(mean, rel=0.05)
        assert found.mean_error < 0.015 * mean
    assert 'hops to' in describe(dataset)


def stays_with(lengths, censored=()):
    stays = np.zeros(len(lengths) + len(censored), STAY)
    stays['impacts'] = [*lengths, *censored]
    stays['following'] = [1] * len(lengths) + [-1] * len(censored)
    return stays


def test_censored_stays_count_and_none_seen_gives_a_bound():
    """Exponential stays cut off at random keep their mean within its error."""
    random = np.random.default_rng(5)
    full, cut = random.exponential(1000.0, 4000), random.uniform(0.0, 1500.0, 4000)
    seen = full < cut
    found = residence_on(stays_with(full[seen], cut[~seen]), 0, [0, 1])
    assert found.mean == pytest.approx(1000.0, abs=3.0 * found.mean_error)
    assert found.jumps.tolist() == [0, np.sum(seen)]
    none = residence_on(stays_with([], [600.0, 400.0]), 0, [0, 1])
    assert none.mean == pytest.approx(1000.0 / -np.log(0.05)) and np.isnan(none.mean_error)


def test_the_test_of_exponentiality_has_its_level():
    """Its p is uniform for exponential lengths, small for Pareto's and for equal ones."""
    random = np.random.default_rng(6)
    p = [evenness(random.exponential(1e4, 40)) for _ in range(2000)]
    assert scipy.stats.kstest(p, 'uniform').pvalue > 1e-3
    assert evenness(random.pareto(1.2, 200) + 0.01) < 1e-6
    assert evenness(random.gamma(5.0, 1.0, 200)) < 1e-6


def test_local_slopes_are_those_of_the_law():
    """Where ln T is c/sigma^2, from counts that are exact."""
    noise = np.array([0.01, 0.02, 0.04])
    found = [residence_on(stays_with(np.full(50, 1000.0 * np.exp(2e-4 / sigma**2))), 0, [1])
             for sigma in noise]
    local, errors = slopes(noise, found)
    assert local == pytest.approx(2e-4, rel=1e-3) and np.all(errors > 0.0)


def test_noise_that_is_faint_leaves_the_basins_as_they_are(known):
    """Shares are 0 or 1, as `Catalogue.label` has them; strong noise forgets where it began."""
    plane = Plane(phases=12, velocities=12)
    faint = probability_basins(P, plane, noise=1e-12, impacts=3000, trajectories=2)
    settled = known.label(plane.cells(P, slice(0, 12), slice(0, 12))).reshape(12, 12)
    # Longer transients on the fractal boundary make even this noise as large as a core.
    soon = settled['lifetime'] < 40
    shares = faint['probability'].sel(attractor=0).values
    assert np.array_equal(shares[soon], settled['label'][soon] == 0) and np.mean(soon) > 0.4
    strong = probability_basins(P, plane, noise=0.1, impacts=500, trajectories=50)
    assert float(strong['probability'].sum('attractor').mean()) > 0.99
    assert float(strong['probability'].std(('velocity', 'phase')).max()) < 0.1


@pytest.mark.long
def test_the_smallest_noise_that_leaves_is_bracketed():
    """At its upper end the simulator of that seed leaves in time; B is left before A."""
    dataset = hopping(P, noise=[0.03], impacts=100, trajectories=16, stays=1, smallest=400)
    low, high = (dataset[f'smallest_{end}'].values for end in ('low', 'high'))
    assert np.all(high / low < 1.021) and high[0] < high[1]
