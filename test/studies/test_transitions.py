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

"""Cascades of maps with published constants; B's mergings against another program's counts."""

import itertools

import numpy as np
import pytest

from gear_rattle_ros.attractors.finding import find_attractors
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.cli.transitions.transitions import main
from gear_rattle_ros.core.many.recorded import record_impacts
from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.core.orbits.branches import Change, follow, leaving
from gear_rattle_ros.core.path import Path
from gear_rattle_ros.store.store import open_dataset
from gear_rattle_ros.studies.skeleton.tangency import touch
from gear_rattle_ros.studies.transitions.cascades import accumulate, DELTA
from gear_rattle_ros.studies.transitions.endings import spread_out
from gear_rattle_ros.studies.transitions.mergings import (
    bursts,
    find_growth,
    passages,
    Reshaping,
    shape_at,
)

# The logistic map r x (1 - x): where its doublings are and accumulate.
LOGISTIC = (3.0, 3.4494897428, 3.5440903596, 3.5644072661, 3.5687594195, 3.5696916098)
ACCUMULATES = 3.5699456719
ALPHA = Path.over(alpha=(0.4, 0.6))


def test_the_logistic_map_becomes_chaotic_where_it_is_published():
    end = accumulate(LOGISTIC, [1e-10] * 6)
    assert abs(end.value - ACCUMULATES) <= end.uncertainty < 1e-5
    assert end.ratios == pytest.approx([4.7514, 4.6562, 4.6683, 4.6686], abs=1e-3)


def test_an_exact_cascade_is_extrapolated_exactly_either_way():
    for sign in (1.0, -1.0):
        end = accumulate([1.0 - sign * DELTA**-k for k in range(5)], [0.0] * 5)
        assert end.value == pytest.approx(1.0, abs=1e-12) and end.uncertainty < 1e-12
        assert end.ratios == pytest.approx([DELTA] * 3)


def test_few_doublings_are_not_extrapolated():
    assert accumulate(LOGISTIC[:3], [1e-10] * 3) is None
    assert accumulate(LOGISTIC, [1e-10, 1e-10, 1e-2, 1e-10, 1e-10, 1e-10]) is None


def test_a_doubling_that_is_located_badly_ends_the_cascade():
    wrong = [*LOGISTIC[:5], LOGISTIC[5] + 3e-4]
    end = accumulate(wrong, [1e-10] * 5 + [4e-4])
    assert abs(end.value - ACCUMULATES) <= end.uncertainty < 2e-5
    assert end.ratios == pytest.approx([4.7514, 4.6562, 4.6683], abs=1e-3)


def on_b(alpha):
    """Return where a trajectory is on attractor B."""
    state = np.array([5.6, 0.0, -0.9 * 0.94])
    rows, _ = record_impacts(spread_out(Parameters(alpha=alpha), state), 4000, 2)
    last = rows[0][rows[0]['velocity'] > 0.0][-1]
    # A is slower there.
    assert 0.85 < last['velocity'] < 1.02
    return np.array([last['phase'], 0.0, -0.9 * last['velocity']])


def seen(watch, count):
    """Count what is seen in some rounds."""
    return sum(int(lanes.sum()) for lanes in itertools.islice(watch, count))


@pytest.mark.parametrize(('pieces', 'before', 'beyond'), [
    (2, 0.5674, 0.5676), pytest.param(4, 0.5660, 0.5661, marks=pytest.mark.long)])
def test_pieces_are_visited_in_turn_until_they_merge(pieces, before, beyond):
    """Counted on one wall by another program, they merge at 0.56604 and 0.56749."""
    for alpha, merged in ((before, False), (beyond, True)):
        parameters, state = Parameters(alpha=alpha), on_b(alpha)
        shape = shape_at(ALPHA, alpha, state)
        assert shape.pieces == (pieces // 2 if merged else pieces)
        # As another program has it, the least upper velocity.
        assert pieces > 2 or shape.edges[0] == pytest.approx(0.8836 if merged else 0.8907,
                                                             abs=2e-4)
        assert (seen(passages(parameters, state, pieces), 4) > 20) == merged


def test_b_bursts_beyond_its_edge_once_it_has_grown():
    for alpha, grown in ((0.5674, False), (0.5676, True)):
        assert (seen(bursts(Parameters(alpha=alpha), on_b(alpha), 0, 0.888), 3) > 0) == grown


@pytest.mark.long
def test_no_growth_is_found_where_an_attractor_changes_smoothly():
    inside, outside = (shape_at(ALPHA, alpha, on_b(alpha))
                       for alpha in (0.5665, 0.5670))
    assert find_growth(inside, outside, 1e-6, 2000) is None


def test_a_periodic_orbit_has_no_shape():
    assert shape_at(ALPHA, 0.5, on_b(0.5)) is None


@pytest.mark.long
@pytest.mark.parametrize(('alpha', 'pieces', 'impacts'), [
    (0.56506563, 8, 8), (0.566045816, 4, 4)])
def test_pieces_merge_where_manifolds_of_the_doubled_orbit_touch(alpha, pieces, impacts):
    """The passages know nothing of manifolds: none before the tangency, many beyond."""
    parameters = Parameters(alpha=0.48)
    orbit = next(one for one in find_attractors(
        parameters, Plane().draw(parameters, 64, 1), hold=5000, chaotic=False).orbits
        if one.impacts == 2)
    while orbit.impacts < impacts:
        turn, = (turn for turn in follow(orbit, ALPHA, 1.0, 0.4, 0.6).turns
                 if turn.change is Change.DOUBLING)
        orbit = next(one for one in leaving(ALPHA, turn) if one.is_stable)
    near = shape_at(ALPHA, alpha - 1e-6, on_b(alpha - 1e-6))
    tangency = touch(Reshaping(alpha, 2e-7, near, shape_at(
        ALPHA, alpha + 1e-6, near.state)), merging=orbit)
    assert tangency.contact.target.orbit.impacts == impacts
    for side, merged in ((-2e-7, False), (2e-7, True)):
        there = Parameters(alpha=tangency.value + side)
        assert (seen(passages(there, near.state, pieces), 20) > 0) == merged


@pytest.mark.long
def test_the_growth_at_which_two_pieces_merge_is_that_of_another_orbit():
    """The orbit that doubled has been crossed before; B collides with one of twelve impacts."""
    alpha = 0.567489627
    near = shape_at(ALPHA, alpha - 1e-6, on_b(alpha - 1e-6))
    tangency = touch(Reshaping(alpha, 5.8e-8, near, shape_at(
        ALPHA, alpha + 1e-6, near.state)))
    assert tangency.contact.target.orbit.impacts == 12 and tangency.contact.is_homoclinic
    for side, merged in ((-2e-7, False), (2e-6, True)):
        there = Parameters(alpha=tangency.value + side)
        assert (seen(passages(there, near.state, 2), 20) > 0) == merged


def table(tmp_path, words):
    """Run the tool; return its transitions, each with what is stored of it."""
    path = tmp_path / 't.zarr'
    assert main([*words.split(), '--output', str(path)]) == 0
    dataset = open_dataset(path)
    rows = []
    for window, k in np.argwhere(dataset['attractor'].values >= 0):
        rows.append({str(name): dataset[name].values[window, k] for name in dataset.data_vars
                     if dataset[name].dims[:2] == ('window', 'transition')})
    return rows


def places(rows, letter, *kinds):
    """Choose where something happens."""
    return [row['alpha'] for row in rows if row['letter'] == letter and row['kind'] in kinds]


def test_births_and_doublings_are_in_the_table_of_both_windows(tmp_path, capsys):
    """The orbit of one impact, in closed form; B's fold and doubling are elsewhere."""
    rows = table(tmp_path, '--alpha 0.10 0.101 --alpha 0.48 0.481 --columns 2 --trajectories 24 '
                           '--hold 1000')
    first = [row for row in rows if str(row['orbit']).startswith('orbit-1-1-')]
    assert [str(row['kind']) for row in first] == ['fold', 'doubling']
    assert first[0]['alpha'] == pytest.approx(0.0492189296698, abs=1e-9)
    assert first[1]['alpha'] == pytest.approx(0.1176514647984, abs=1e-9)
    assert places(rows, 'A', 'fold')[0] == pytest.approx(0.44228, abs=1e-5)
    assert places(rows, 'B', 'doubling')[0] == pytest.approx(0.52915, abs=1e-5)
    printed = capsys.readouterr().out
    assert 'alpha from 0.1 to 0.101' in printed and 'alpha from 0.48 to 0.481' in printed


@pytest.mark.parametrize(('words', 'named'), [
    (['--alpha', '0.6', '0.5'], 'alpha window'), (['--tolerance', '0'], '--tolerance'),
    (['--columns', '1'], 'from 2 on'), (['--cluster', 'tcp://127.0.0.1:1'], '--cluster')])
def test_bad_input_is_refused_in_one_line(words, named, capsys, tmp_path):
    try:
        status = main([*words, '--output', str(tmp_path / 't.zarr')])
    except SystemExit as end:
        status = end.code
    error = capsys.readouterr().err
    assert status == 2 and named in error and error.count('\n') == 1
