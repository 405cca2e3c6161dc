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

"""The client of a simulator: one that answers, none, two of one name, and one that refuses."""

from collections.abc import Iterator

import pytest

from gear_rattle_ros.nodes.base import client
from gear_rattle_ros.nodes.base.client import ClientError, RefusalError, Visitor


@pytest.fixture
def visitor(domain: int) -> Iterator[Visitor]:
    """Return a client of the simulator."""
    visitor = Visitor('visitor', '/simulator')
    yield visitor
    visitor.close()


def test_what_is_set_is_read_and_a_refusal_gives_up_what_waits(start, visitor) -> None:
    """All or none is set; the reason comes back, and nothing that was asked later is done."""
    start('simulator').wait_for('ready')
    found: dict[str, float] = {}
    said: list[str] = []
    visitor.put({'alpha': 0.25, 'seed': 7})
    visitor.pause(True, said.append)
    visitor.get(('alpha', 'beta'), found.update)
    visitor.wait()
    assert (found, said) == ({'alpha': 0.25, 'beta': 0.1}, ['paused'])
    visitor.put({'beta': 0.2, 'gamma': 1e9})
    visitor.pause(False, said.append)
    with pytest.raises(RefusalError, match='^/simulator refused: .*gamma'):
        visitor.wait()
    visitor.get(('beta', 'gamma'), found.update)
    visitor.wait()
    assert (found['beta'], found['gamma'], said) == (0.1, 0.1, ['paused'])
    visitor.get(('seed',), found.update)
    visitor.wait()
    assert found['seed'] == 7
    visitor.get(('alpha', 'frobs'), found.update)
    with pytest.raises(ClientError, match='is not a gear rattling simulator'):
        visitor.wait()
    visitor.get(('use_sim_time',), found.update)
    visitor.wait()
    assert found['use_sim_time'] is False


def test_two_simulators_of_one_name_are_not_steered(
        start, visitor, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both would take the request: neither is asked, in one line with the remedy."""
    running = [start('simulator'), start('simulator')]
    for simulator in running:
        simulator.wait_for('ready')
    visitor.pause(True)
    while visitor.count < 2:
        visitor._executor.spin_once(timeout_sec=0.1)
    monkeypatch.setattr(client, 'WITHIN', 0.5)
    with pytest.raises(ClientError, match=(
            '^2 simulators answer as /simulator; end all but one, or rename one with -r '
            '__node:=NAME$')):
        visitor.wait()
    assert not any('paused' in simulator.text() for simulator in running)
