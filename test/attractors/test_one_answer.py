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

"""All tools give one answer to the question which attractors there are."""

import dataclasses
import math
import sys

from grids import basin
import numpy as np
import pytest

from gear_rattle_ros.attractors.catalogue import Catalogue, HOLD, Kind
from gear_rattle_ros.attractors.columns import find_branches, Window
from gear_rattle_ros.attractors.finding import CONSERVES, find_attractors
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.attractors.refining import Level
from gear_rattle_ros.cli import attractors
from gear_rattle_ros.cli.grids import basins, lifetimes
from gear_rattle_ros.cli.transitions import continuation
from gear_rattle_ros.core.flight.lanes import IMPACT
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.many.chaotic_sets import BRIEF, count_pieces, SWEEP, THOROUGH
from gear_rattle_ros.core.many.recorded import record_impacts
from gear_rattle_ros.core.many.settling import UNSETTLED
from gear_rattle_ros.core.model import Parameters, State
from gear_rattle_ros.core.orbits.section import shortest_recurrence
from gear_rattle_ros.core.stream.transients import Regime, TransientDetector
from gear_rattle_ros.store.store import open_dataset, Store

# (alpha, beta, gamma, restitution): the paper's ranges, near bifurcations, thin basins, far away.
PAPERS = [(alpha, 0.1, 0.1, 0.9) for alpha in (
    0.002, 0.05, 0.09, 0.2, 0.3, 0.47, 0.48, 0.4942, 0.505, 0.5158, 0.523, 0.529, 0.53, 0.545,
    0.56476, 0.5655, 0.567, 0.57, 0.5717, 0.574, 0.598, 0.9, 1.0, 1.1, 1.138, 1.15, 1.205, 1.22,
    1.23, 1.2434, 1.244, 1.26, 1.3654, 1.481, 1.56, 1.7)]
OTHERS = [
    (0.1, 0.0, 0.0, 1.0), (1.0, 0.0, 0.3, 1.0), (0.1165, 0.0, 0.16, 0.8), (0.15, 0.1, 0.1, 0.3),
    (0.3, 0.0, 0.0, 0.5), (0.384, 0.0, 0.0, 0.5), (0.39, 0.0, 0.0, 0.5), (0.5, 0.1, 0.1, 0.0),
    (5.0, 0.0159, 2.533, 0.9), (5.0, 0.0159, 2.533, 0.7), (1.0, 0.5, 0.05, 0.6),
    (2.0, 0.02, 0.5, 0.8), (0.3, 0.1, 0.0, 0.9), (20.0, 0.3, 0.1, 0.9), (1.0, 0.1, 0.1, 1.0)]
FAST = [*((alpha, 0.1, 0.1, 0.9) for alpha in (0.505, 0.57)), OTHERS[0], OTHERS[2], OTHERS[3]]


def named(values: tuple[float, ...]) -> str:
    """Name a set in the output of pytest."""
    return '-'.join(map(str, values))


@pytest.fixture(scope='module', ids=named, params=[
    *FAST, *(pytest.param(values, marks=pytest.mark.long) for values in (*PAPERS, *OTHERS)
             if values not in FAST)])
def first(request):
    """Search as the basin node does; tests of the same set follow each other."""
    parameters = Parameters(*request.param)
    return find_attractors(parameters, Plane().draw(parameters, 300, 1), hold=20_000,
                           effort=BRIEF)


# Largest difference, in standard errors, among some hundred comparisons.
APART = 4.5


def known(catalogue: Catalogue) -> dict[str, float]:
    """Shares of what is found, by key."""
    return {each.key: each.share for each in catalogue.attractors}


def assert_one_answer(some: dict[str, float], others: dict[str, float], count: int,
                      other: int) -> None:
    """Shares agree within the errors of both; what is missing has a share of nothing."""
    for key in some.keys() | others.keys():
        a, b = some.get(key, 0.0), others.get(key, 0.0)
        # As if one more had settled there and one elsewhere.
        share = (a * count + b * other + 1.0) / (count + other + 2.0)
        error = math.sqrt(share * (1.0 - share) * (1.0 / count + 1.0 / other))
        assert abs(a - b) < APART * error + 1.0 / count, (key, some, others)


def test_every_tool_finds_the_same(first, tmp_path):
    """Other initial conditions, orbit diagrams and grids give the same keys and shares."""
    parameters = first.parameters
    keys = [each.key for each in first.attractors]
    assert len(set(keys)) == len(keys)
    assert sum(each.share for each in first.attractors) == pytest.approx(1.0)
    catalogue, branches = find_branches(parameters, Plane().draw(parameters, 96, 3),
                                        Window(keep=64, bins=10, hold=20_000))
    assert known(catalogue) == {
        one.attractor.key: one.attractor.share for one in branches}
    assert_one_answer(known(first), known(catalogue), 300, 96)
    plane = Plane(phases=20, velocities=20)
    _, labels, _, attractors = basin(tmp_path / 'a', plane, parameters, cap=20_000,
                                     initial_conditions=100, seed=4, hold=20_000)
    assert_one_answer(known(first), {
        each.key: each.share for each in attractors if each.settled}, 300, 100)
    of = {each.label: each.key for each in attractors} | {UNSETTLED: 'unsettled'}
    shares = {of[label]: float(np.mean(labels == label)) for label in np.unique(labels).tolist()}
    assert_one_answer(known(first), shares, 300, 400)


@pytest.mark.parametrize('first', [
    pytest.param(values, marks=() if values in (FAST[0], OTHERS[2]) else pytest.mark.long)
    for values in (*PAPERS, *OTHERS)], ids=named, indirect=True)
def test_continuation_agrees(first, tmp_path):
    """In the middle of a narrow window it sees the same keys and shares."""
    parameters = first.parameters
    words = [f'--{name}={value!r}' for name, value in dataclasses.asdict(parameters).items()
             if name != 'alpha']
    alphas = [repr(parameters.alpha * (1.0 + step)) for step in (-1e-7, 1e-7)]
    path = tmp_path / 'k.zarr'
    assert continuation.main([*words, '--alpha', *alphas, '--columns', '3', '--trajectories', '96',
                              '--hold', '20000', '--tolerance', '1e-3',
                              '--output', str(path)]) == 0
    middle = open_dataset(path).isel(sweep=0, alpha=1)
    shares = {key: share for key, share in zip(
        middle.key.values.tolist(), middle.share.values.tolist(), strict=True) if key}
    assert len(shares) == np.count_nonzero(middle.key.values != '')
    # What is beyond the last slot is counted with it.
    if len(first.attractors) <= len(middle.slot):
        assert_one_answer(known(first), shares, 300, 96)


def test_the_live_detector_agrees(first):
    """What the detector sees in the stream of one initial condition is its label."""
    initial = Plane().draw(first.parameters, 300, 1)[:6]
    for origin, result in zip(initial, first.label(initial), strict=True):
        detector = TransientDetector()
        simulation = Simulation(first.parameters, State(
            0, float(origin['phase']), float(origin['displacement']), float(origin['velocity'])))
        attractor = {each.label: each for each in first.attractors}.get(int(result['label']))
        kind = attractor.kind if attractor else Kind.UNSETTLED
        # An orbit is reported when it has recurred for long.
        more = 6000 if kind is Kind.PERIODIC else 0
        periods = 0
        while simulation.impacts < result['impacts'] + more and periods < 20_000:
            periods += 100
            detector.update(simulation.advance(periods, 0.0, 200_000))
        report = detector.report
        if kind is Kind.PERIODIC:
            if max(map(abs, attractor.multipliers)) > 0.99:
                # On its way to the orbit for longer than this.
                continue
            assert report.regime is Regime.ORBIT
            assert report.key == attractor.key
        elif kind is Kind.RESTING:
            assert report.regime is Regime.REST
        elif kind in (Kind.CHAOTIC, Kind.UNSETTLED, Kind.FLOATING):
            assert report.regime is Regime.TRANSIENT


@pytest.mark.long
@pytest.mark.parametrize('values', [*PAPERS, *OTHERS], ids=named)
def test_a_plain_simulation_of_a_million_impacts_agrees(values):
    """What is chaotic stays so for a million impacts from 32 states; orbits recur to the end."""
    parameters = Parameters(*values)
    catalogue = find_attractors(parameters, Plane().draw(parameters, 300, 1))
    for each in catalogue.attractors:
        if each.kind not in (Kind.CHAOTIC, Kind.PERIODIC):
            continue
        states = catalogue.states[catalogue.labels == each.label]
        states = states[np.arange(32) % len(states)].copy()
        states['velocity'] *= 1.0 + 1e-9 * np.arange(32)
        impacts = 1_000_000 if each.kind is Kind.CHAOTIC else 20_000
        rows, counts = record_impacts(states, impacts - 600, 600)
        assert np.all(counts == 600)
        for row in rows:
            q = int(shortest_recurrence(row, 256, 1e-3))
            if each.kind is Kind.CHAOTIC:
                assert q == 0
            elif each.impacts <= 256 and each.orbit.sticks < 0:
                assert q == each.impacts


@pytest.mark.parametrize(('values', 'hold', 'shares'), [
    ((0.09,), 20_000, {'orbit-1-1-U0.9922+0.3307': 0.51, 'unsettled': 0.0}),
    pytest.param((0.56476,), HOLD, {'orbit-128-64-U5.3984+0.8932': 0.241},
                 marks=pytest.mark.long),
    pytest.param((5.0, 0.0159, 2.533), HOLD, {'orbit-250-3-U0.0398+0.2344': 1.0},
                 marks=pytest.mark.long),
])
def test_published_shares(values, hold, shares):
    """Every initial condition is labelled, however fast its orbit and however late it settles."""
    parameters = Parameters(*values)
    catalogue = find_attractors(parameters, Plane().draw(parameters, 300, 1), hold=hold)
    for key, share in shares.items():
        found = known(catalogue).get(key, 0.0)
        error = max(math.sqrt(share * (1.0 - share) / 300), 1e-9)
        assert abs(found - share) < 4.0 * error


@pytest.mark.long
@pytest.mark.parametrize('count', [300, 1000, 3000])
def test_the_share_of_b_does_not_depend_on_how_many_are_followed(count):
    """An orbit of 128 impacts, seen at the end of long transients: 24.1 %."""
    parameters = Parameters(alpha=0.56476)
    catalogue = find_attractors(parameters, Plane().draw(parameters, count, 1))
    assert len(catalogue.attractors) == 2
    longest = max(catalogue.attractors, key=lambda each: each.impacts)
    assert longest.impacts == 128
    assert abs(longest.share - 0.241) < 4.0 * longest.share_error


@pytest.mark.parametrize(('alpha', 'pieces'), [
    (0.5655, 4), *(pytest.param(*one, marks=pytest.mark.long) for one in ((0.567, 2), (0.57, 1)))])
def test_pieces_of_b(alpha, pieces):
    """Its bands merge, 4 to 2 at 0.56604 and 2 to 1 at 0.56749: counted in turn on one wall."""
    parameters = Parameters(alpha=alpha)
    catalogue = find_attractors(parameters, Plane().draw(parameters, 60, 1), hold=10_000)
    chaos, = (each for each in catalogue.attractors if each.kind is Kind.CHAOTIC)
    assert chaos.pieces == pieces
    # What returns to where it was has been in every piece equally often.
    assert np.count_nonzero(chaos.chaos.origin['displacement'] == 0.0) % pieces == 0


@pytest.mark.long
@pytest.mark.parametrize('values', [
    (0.2,), (0.5655,), (0.5675,), (0.9,), (1.22,), (1.58,), (1.7,), (20.0, 0.3)], ids=named)
def test_the_name_of_chaos_depends_on_neither_seed_nor_number_nor_effort(values):
    """Nor does the number of its pieces, where an orbit in it is seldom come near to."""
    found = set()
    for seed, count, hold, effort in (
            (1, 300, 20_000, BRIEF), (5, 60, 20_000, BRIEF), (4, 100, 20_000, THOROUGH),
            (2, 96, 5_000, SWEEP), (3, 200, 3_000, SWEEP), (4, 100, 2_000, BRIEF)):
        parameters = Parameters(*values)
        catalogue = find_attractors(parameters, Plane().draw(parameters, count, seed),
                                    hold=hold, effort=effort)
        found |= {(each.key, each.pieces) for each in catalogue.attractors
                  if each.kind is Kind.CHAOTIC}
    assert len(found) == 1


@pytest.mark.parametrize('pieces', [1, 2, 3, 12])
def test_pieces_are_counted_across_trajectories(pieces):
    """Points are drawn from known pieces in turn; each trajectory begins in one of its own."""
    random = np.random.default_rng(7)
    rows = np.zeros((8, 800), IMPACT)
    turns = np.arange(400) + random.integers(100, size=(8, 1))
    rows['velocity'][:, ::2] = 0.5
    rows['phase'][:, ::2] = 0.4 * (turns % pieces) + 0.01 * random.random((8, 400))
    # Impacts on the other wall do not count.
    rows['velocity'][:, 1::2] = -0.5
    assert count_pieces(rows) == pieces


@pytest.mark.parametrize('tool', [attractors, basins, lifetimes],
                         ids=lambda tool: tool.main.name)
def test_what_preserves_areas_has_no_attractors(tool, tmp_path, monkeypatch, capsys):
    """With r = 1 and beta = 0 the determinant is 1: one line reports it; nothing is followed."""
    parameters, path = Parameters(0.1, 0.0, 0.0, 1.0), tmp_path / 'a.zarr'
    only, = find_attractors(parameters).attractors
    assert (only.kind, only.share) == (Kind.UNSETTLED, 1.0)
    is_grid = tool is not attractors
    for one in (Catalogue, Level):
        monkeypatch.setattr(sys.modules[one.__module__], 'follow_here', None)
    assert tool.main([
        *(f'--{name}={value}' for name, value in dataclasses.asdict(parameters).items()),
        *(['--size=40', '--cap=900'] if is_grid else []), f'--output={path}']) == 0
    assert capsys.readouterr().out.splitlines() == [CONSERVES, str(path)]
    if is_grid:
        store = Store(path)
        assert np.all(store.read_all('label') == UNSETTLED)
        assert np.all(store.read_all('lifetime') == 900)
        assert tool is basins or store.attrs['escape_mean'] == 'inf'


@pytest.mark.long
@pytest.mark.parametrize('alpha', [0.48, 0.505, 0.57])
def test_shares_scatter_as_their_errors_say(alpha):
    """Over 20 seeds the deviations from the mean have the chi-squared distribution."""
    parameters = Parameters(alpha=alpha)
    found = [find_attractors(parameters, Plane().draw(parameters, 200, seed), hold=10_000)
             for seed in range(20)]
    for key in {key for catalogue in found for key in known(catalogue)}:
        each = [next((one for one in catalogue.attractors if one.key == key), None)
                for catalogue in found]
        shares = np.array([one.share if one else 0.0 for one in each])
        if np.min(shares) * 200 < 5:
            continue
        errors = np.array([one.share_error for one in each if one])
        chi_squared = float(np.sum(((shares - shares.mean()) / errors)**2))
        # Quantiles 0.001 and 0.999 for 19 degrees of freedom.
        assert 5.41 < chi_squared < 43.82


def test_labels_of_the_catalogue_are_those_of_its_search():
    """Following the same initial conditions once more gives the same labels."""
    parameters = Parameters(alpha=0.505)
    initial = Plane().draw(parameters, 200, 6)
    catalogue = find_attractors(parameters, initial, hold=10_000)
    assert np.array_equal(catalogue.label(initial)['label'], catalogue.labels)
    # An orbit that is added later gets the last label.
    orbit = catalogue.orbits[0]
    fewer = dataclasses.replace(catalogue, orbits=catalogue.orbits[1:])
    assert fewer.with_orbits((orbit,)).attractors[len(catalogue.orbits) - 1].key == orbit.key
