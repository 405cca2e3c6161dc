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

"""The state of a page in its address, read back by the standard library."""

from urllib.parse import parse_qs

import pytest

from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.explorer.address import Shown
from gear_rattle_ros.explorer.view import LIFETIMES, View

HOME = Shown(View(), (4.0, -0.5))


@pytest.mark.parametrize('shown', [HOME, Shown(
    View(Parameters(0.4812345678901234, 0.11, -0.1, 0.85), -0.25,
         (-1.2345678901234567, -1.2345670000000001), (-0.1, 0.30000000000000004), LIFETIMES),
    (1e-17, -1.5), 0.2432027802, ('orbits', 'edge state'), 'gamma'), Shown(
    View(displacement=(-0.9, -0.1), phase=1.5, on='strobe'), (-0.25, 0.5)), Shown(
    View(phase=(1.0, 2.0), on='section'), (1.5, -0.5))])
def test_what_is_shown_comes_back_to_the_bit(shown: Shown) -> None:
    query = parse_qs(shown.query().encode())
    assert HOME.given({name.decode(): values for name, values in query.items()}) == shown


@pytest.mark.parametrize(('query', 'line'), [
    ('alpha=much', 'alpha=much in the address is not a number'),
    ('alpha=-1', 'alpha = -1.0 is outside'),
    ('beside=-1', 'alpha = -1.0 is outside'),
    ('beside=1.5&which=restitution', 'restitution = 1.5 is outside'),
    ('which=phase', 'which=phase is not one of alpha, beta'),
    ('phase=1', 'phase=1 in the address is not two numbers'),
    ('velocity=1,x', 'velocity=x in the address is not a number'),
    ('velocity=1,0', 'empty or reversed'),
    ('point=0,1e300', 'point=0,1e300 in the address is beyond 9000'),
    ('point=nan,0', 'point=nan,0 in the address is beyond 9000'),
    ('kind=colours', 'is not one of basins'),
    ('plane=colours', 'is not one of section'),
    ('plane=strobe&phase=1,2', 'phase=1,2 in the address is not a number'),
    ('plane=strobe&displacement=-0.5', 'displacement=-0.5 in the address is not two numbers'),
    ('plane=section&displacement=0', 'leave it out'),
    ('layers=orbits,moons', "layer 'moons' is not one of orbits, manifolds")])
def test_an_address_that_cannot_be_is_refused(query: str, line: str) -> None:
    words = {name: [value.encode() for value in values]
             for name, values in parse_qs(query).items()}
    with pytest.raises(ValueError, match=line):
        HOME.given(words)


def test_the_second_plane_has_another_value_of_one_parameter() -> None:
    """It is alpha where the address, as older ones, does not name another."""
    for query, expected in (({'beside': [b'0.57']}, Parameters(alpha=0.57)),
                            ({'beside': [b'0.2'], 'which': [b'gamma']}, Parameters(gamma=0.2))):
        assert HOME.given(query).second == View(expected)


def test_what_is_not_given_stays() -> None:
    shown = HOME.given({'alpha': [b'0.57'], 'unknown': [b'1']})
    assert shown == Shown(View(Parameters(alpha=0.57)), HOME.point)
