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

"""Levels in slices and rounds against one pass, and orbits that no search has found."""

from collections.abc import Iterator
import dataclasses
import itertools
import time
import types

import numpy as np
import pytest

from gear_rattle_ros.attractors import refining
from gear_rattle_ros.attractors.catalogue import Catalogue
from gear_rattle_ros.attractors.finding import find_attractors
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.attractors.refining import late_orbits, Level, refine
from gear_rattle_ros.core.many.settling import UNSETTLED
from gear_rattle_ros.core.model import Parameters

EDGE, CAP = 40, 3000
PLANE = Plane(-0.25, phases=EDGE, velocities=EDGE)
CONSERVING = Parameters(0.1, 0.0, 0.0, 1.0)


def level_of(parameters: Parameters, **settings) -> Level:
    """Return a level of the plane."""
    initial = PLANE.cells(parameters, slice(0, EDGE), slice(0, EDGE))
    return Level(initial, (EDGE, EDGE), CAP, **settings)


@pytest.fixture(scope='module')
def catalogue() -> Catalogue:
    """Return an orbit and a chaotic attractor."""
    parameters = Parameters(0.57)
    found = find_attractors(parameters, PLANE.draw(parameters, 200, 1), hold=2000)
    assert found.orbits and found.chaotic
    return found


@pytest.mark.parametrize('is_mixed', [True, False])
@pytest.mark.parametrize('rounds', [(), (100, 300, 1000)])
def test_slices_and_rounds_change_nothing(
        catalogue: Catalogue, rounds: tuple[int, ...], is_mixed: bool) -> None:
    """One pass gives the labels; lifetimes too, unless a round ends on the way to an orbit."""
    # A slice takes longer than this by itself, so each is shown.
    level = level_of(catalogue.parameters, seconds=1e-3, is_mixed=is_mixed, slice_impacts=1000)
    shown = [each.left.size for each, _, _ in refine(
        [(level, catalogue)], rounds=rounds, threads=1)]
    assert len(shown) > 2 and shown == sorted(shown, reverse=True)
    whole = catalogue.label(level_of(catalogue.parameters).states, CAP)
    assert np.array_equal(level.labels.ravel(), whole['label'])
    later = level.lifetimes.ravel() - whole['lifetime']
    assert np.all(later >= 0) and np.mean(later == 0) > (0.8 if rounds else 0.999999)


def test_a_level_is_completed_where_others_have_the_processor(
        catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its time is over at the second look at the clock, but a slice is made each time."""
    looks = itertools.count()
    monkeypatch.setattr(refining, 'time', types.SimpleNamespace(monotonic=lambda: next(looks)))
    level = level_of(catalogue.parameters, seconds=1.5, slice_impacts=1000)
    shown = [each.left.size for each, _, _ in itertools.islice(
        refine([(level, catalogue)], threads=1), 100)]
    assert shown[-1] == 0 and len(shown) > 2


def test_what_was_not_looked_at_is_unsettled_or_as_it_was(catalogue: Catalogue) -> None:
    """Without time nothing is followed, and a coarser level stands in where there is one."""
    coarse = level_of(catalogue.parameters)
    coarse.follow(CAP, catalogue.table)
    for begun in (None, coarse):
        level = level_of(catalogue.parameters, begun=begun)
        level.follow(CAP, catalogue.table, until=time.monotonic() - 1.0)
        assert level.impacts == level.rounds == 0 and level.unsettled == 1.0
        assert np.array_equal(level.labels, coarse.labels if begun else np.full(
            (EDGE, EDGE), UNSETTLED))


def test_late_orbits_enter_all_later_levels() -> None:
    """A search that has found nothing: both orbits at 0.48 are found among what is left."""
    parameters = Parameters(0.48)
    keys = {orbit.key for orbit in find_attractors(parameters, chaotic=False).orbits}
    assert len(keys) == 2
    first, second, third = levels = [level_of(parameters) for _ in range(3)]
    nothing = Catalogue(parameters)
    found = [each for _, each, _ in refine((level, nothing) for level in levels)]
    # The first level has to be quick.
    assert [len(each.late) for each in found] == [0, 2, 2]
    assert {orbit.key for orbit in found[-1].late} == keys
    assert first.unsettled == second.unsettled == 1.0 and third.unsettled == 0.0
    known = dataclasses.replace(nothing, orbits=found[-1].late[1:])
    assert [each.key for each in late_orbits(known, second).late] == [found[-1].late[0].key]


def test_nothing_is_followed_where_areas_are_preserved() -> None:
    """There are no attractors to settle on."""
    level = level_of(CONSERVING)

    def levels() -> Iterator[tuple[Level, Catalogue]]:
        yield level, Catalogue(CONSERVING)
        yield level_of(CONSERVING), find_attractors(CONSERVING)

    shown = [(each.impacts, each.unsettled, is_done) for each, _, is_done in refine(levels())]
    assert shown == [(0, 1.0, True)] * 2 and np.all(level.labels == UNSETTLED)
