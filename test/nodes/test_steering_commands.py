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

"""The commands that steer a simulator: set, get, reset, pause and resume."""

import pytest
from rcl_interfaces.srv import GetParameters

from gear_rattle_ros.nodes.base import client
from gear_rattle_ros.nodes.steering import main

TOTAL = ('alpha', 'beta', 'gamma', 'restitution', 'noise', 'noise_kind', 'control', 'rate',
         'alpha_target', 'alpha_rate', 'initial_phase', 'initial_displacement',
         'initial_velocity', 'seed')


def test_a_running_simulator_is_steered(start, rclpy_node, spin, capsys) -> None:
    """Every command does what it says, in one line, as another client sees it."""
    def steer(*words: str) -> tuple[int, str, str]:
        capsys.readouterr()
        return (main(list(words)), *capsys.readouterr())

    simulator = start('simulator')
    simulator.wait_for('ready')
    asking = rclpy_node.create_client(GetParameters, '/simulator/get_parameters')
    spin(asking.service_is_ready)
    # As a process of its own.
    done = start('set', 'alpha', '1.244')
    assert (done.process.wait(60), done.text()) == (0, 'alpha = 1.244\n')
    assert steer('set', 'gamma', '-1e-3', 'seed', '7.0') == (0, 'gamma = -0.001\nseed = 7\n', '')
    future = asking.call_async(GetParameters.Request(names=['alpha', 'gamma', 'seed']))
    spin(future.done)
    assert [value.double_value or value.integer_value for value in future.result().values] == [
        1.244, -1e-3, 7]
    assert steer('set', 'noise_kind', 'uniform', 'noise', '1e-3', 'control', '') == (
        0, "noise_kind = 'uniform'\nnoise = 0.001\ncontrol = ''\n", '')
    assert steer('get', 'publish_clock', 'omega') == (
        0, 'publish_clock = False\nomega = 6.283185307179586\n', '')
    assert steer('get', 'beta') == (0, 'beta = 0.1\n', '')
    status, said, _ = steer('get')
    assert (status, tuple(line.split(' = ')[0] for line in said.splitlines())) == (0, TOTAL)
    for word, answer in (('pause', 'paused\n'), ('resume', 'running\n')):
        assert steer(word) == (0, answer, '')
    status, said, errors = steer('reset')
    assert (status, len(said.splitlines()), errors) == (0, 1, '')
    assert 'reset' in simulator.text()


def test_control_is_steered_beside_the_simulator(start, rclpy_node, capsys) -> None:
    """A number is the name of an orbit, too; parameters of both go to their nodes."""
    for name in ('simulator', 'control'):
        start(name, '--ros-args', '-r', '__ns:=/lab', '-p', 'alpha:=0.57').wait_for('ready')
    at = ('--simulator', '/lab/simulator')
    assert main(['set', 'orbit', '4', 'alpha', '0.56', 'limit', '1e-3', *at]) == 0
    assert main(['get', 'limit', 'acts', 'alpha', *at]) == 0
    assert capsys.readouterr().out.splitlines() == [
        'alpha = 0.56', "orbit = '4'", 'limit = 0.001', 'alpha = 0.56', 'limit = 0.001',
        "acts = 'drive'"]
    assert main(['set', 'orbit', '', *at]) == 0
    assert main(['set', 'limit', '1']) == 2
    assert capsys.readouterr().err.startswith('set: no control answers as /control; start one')


@pytest.mark.parametrize(('words', 'line'), [
    ('set noise_kind loud', "set: noise_kind = 'loud' is not one of gaussian, uniform, jitter"),
    ('set orbit', 'set: orbit needs a value'),
    ('set limit x', "set: limit needs a number, not 'x'"),
    ('set simulator x', "set: 'simulator' is not one of alpha"),
    ('set alhpa 1', "set: 'alhpa' is not one of alpha, beta"),
    ('set alpha', "set: alpha needs a number, not 'nothing'"),
    ('set alpha x', "set: alpha needs a number, not 'x'"),
    ('set seed 1e400', 'set: seed = inf'),
    ('set seed 1.5', 'set: seed = 1.5 is not of type integer'),
    ('set alpha nan', 'set: alpha = nan is not a number'),
    ('set alpha -1', 'set: alpha = -1.0 is outside [0, 1000]'),
    ('set', 'set: the following arguments are required'),
    ('get alpha frobs', "get: 'frobs' is not one of alpha, "),
    ('pause now', 'pause: unrecognized arguments: now'),
    ('get alpha --simulator a//b', 'get: Invalid service name'),
])
def test_what_cannot_be_done_is_one_line(
        domain: int, words: str, line: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Before a simulator is asked, with the value and the remedy, and status 2."""
    assert main(words.split()) == 2
    said = capsys.readouterr()
    assert (said.out, len(said.err.splitlines())) == ('', 1)
    assert said.err.startswith(line)


def test_without_a_simulator_it_gives_up(
        domain: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client, 'WITHIN', 0.5)
    assert main(['set', 'alpha', '1', '--simulator', '/lab/simulator']) == 2
    assert capsys.readouterr().err.startswith(
        'set: no simulator answers as /lab/simulator; start one with: ')
