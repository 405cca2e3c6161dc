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

"""The suite as its user runs it: real processes, real DDS, a real bag."""

from collections.abc import Callable, Iterator
import functools
from pathlib import Path
import subprocess
import time

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
from PIL import Image
from prepared import NodeProcess
import pytest
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from gear_rattle_ros.bags import Bag
from gear_rattle_ros.bags.verify import verify
from gear_rattle_ros.core.flight.fingerprint import fingerprint
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EVENT, EventKind, Parameters, State
from gear_rattle_ros.core.stream.guard import StreamGuard
from gear_rattle_ros.core.stream.lyapunov import RunningLyapunov
from gear_rattle_ros.core.stream.report_values import texts, transient_values
from gear_rattle_ros.core.stream.transients import TransientDetector
from gear_rattle_ros.qos import LATCHED, STREAM


@pytest.fixture
def suite(start: Callable[..., NodeProcess]) -> Callable[..., NodeProcess]:
    """Start the suite without a window."""
    return functools.partial(start, 'suite', '--viewer', 'none')


def left_behind(folder: Path) -> list[str]:
    """Return the nodes of a run that are still alive."""
    return subprocess.run(
        ['pgrep', '-af', str(folder)], stdout=subprocess.PIPE, text=True).stdout.splitlines()


@pytest.fixture(scope='module')
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, str]]:
    """Run the suite once: both stories in eight seconds."""
    folder = tmp_path_factory.mktemp('suite') / 'run'
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('ROS_DOMAIN_ID', '101')
        suite = NodeProcess('suite', ['--viewer', 'none', '--duration', '8', '--output',
                                      str(folder)], folder.with_name('log'))
        assert suite.process.wait(240) == 0, suite.text()
    yield folder, suite.text()
    assert not left_behind(folder)


def recorded(bag: Bag, topic: str, kind: type) -> list:
    """Return the messages of a topic."""
    return [deserialize_message(message.data, kind) for message in bag.messages([topic])]


def values_of(message: DiagnosticArray) -> dict[str, str]:
    """Return the keys and values of a report."""
    return {item.key: item.value for item in message.status[0].values}


def events_of(bag: Bag) -> np.ndarray:
    """Return all events of a bag."""
    return np.concatenate([np.zeros(0, EVENT), *bag.events()])


def test_leaves_what_it_promises(run):
    """Bag, rerun file and picture, and the commands that open them."""
    folder, output = run
    for name in ('bag/bag_0.mcap', 'bag/metadata.yaml', 'run.rrd', 'summary.png'):
        assert (folder / name).stat().st_size > 1000
    for words in ('bag', 'viewer', 'summary', 'bag_0.mcap', 'run.rrd', 'summary.png'):
        assert words in output
    with Image.open(folder / 'summary.png') as picture:
        grey = np.asarray(picture.convert('L'))
    assert grey.shape[1] >= 1200 and len(np.unique(grey)) > 20


def test_bag_holds_the_whole_stream(run):
    """Every impact from the first on, and both stories: the core's own trajectory, to the bit."""
    events = events_of(Bag(run[0] / 'bag'))
    assert len(StreamGuard().split(events)) == 1 and len(events) > 10_000
    assert events[0]['kind'] == EventKind.RESET and events[0]['index'] == 0
    simulation = Simulation(Parameters(alpha=0.57), State(velocity=-1.0))
    at = int(np.flatnonzero(events['kind'] == EventKind.RETUNE)[0])
    head = simulation.advance(int(events['cycle'][at]), float(events['phase'][at]), 10**7)
    tail = simulation.retune(Parameters(alpha=1.244))
    rest = simulation.advance(10**9, 0.0, len(events) - at - 1)
    assert np.concatenate([head, tail, rest]).tobytes() == events.tobytes()


def test_recorded_exponents_follow_from_the_recorded_events(run):
    """Every estimate on the bag is that of the events up to its index, bit for bit."""
    bag = Bag(run[0] / 'bag')
    events = events_of(bag)
    running, done = RunningLyapunov(), 0
    estimates = recorded(bag, '/lyapunov', JointState)
    assert len(estimates) > 20
    for estimate in estimates:
        values = dict(zip(estimate.name, estimate.position, strict=True))
        upto = int(np.flatnonzero(
            (events['index'] == values['index']) & (events['epoch'] == values['epoch']))[-1]) + 1
        running.update(events[done:upto])
        done = upto
        report = running.report
        assert report.impacts == values['impacts']
        for name in ('lambda_1', 'lambda_2', 'lambda_1_error', 'exact_sum', 'lambda_1_finite'):
            np.testing.assert_array_equal(values[name], getattr(report, name))


def test_recorded_transients_follow_from_the_recorded_events(run):
    """The reports on the bag are those of the detector fed with the recorded events."""
    bag = Bag(run[0] / 'bag')
    changes = TransientDetector().update(events_of(bag))
    wanted = [texts(transient_values(change) | {'tolerance': 1e-3}) for change in changes]
    found = [values_of(message) for message in recorded(bag, '/transient', DiagnosticArray)]
    # Latched with depth one: reports that were overtaken before they left may be missing.
    assert found and found[-1] == wanted[-1]
    assert all(report in wanted for report in found)


def test_the_bag_verifies(run):
    """Every flight is rebuilt, every estimate and report reproduced; by the same kernels."""
    verdict = verify(run[0] / 'bag')
    assert verdict.is_verified, verdict
    assert verdict.flights == verdict.events - 1
    assert (verdict.exponents, verdict.beyond) == (Bag(run[0] / 'bag').counts['/lyapunov'], 0)
    assert verdict.transients == Bag(run[0] / 'bag').counts['/transient']
    assert verdict.kernels <= {fingerprint()}


def test_replay_gives_the_same_exponents_and_transients(run, start, rclpy_node, spin):
    """Live and replayed are one code path: the last estimates agree bit for bit."""
    bag = Bag(run[0] / 'bag')
    live = recorded(bag, '/lyapunov', JointState)[-1]
    live_transient = recorded(bag, '/transient', DiagnosticArray)[-1]
    exponents, transients = [], []
    rclpy_node.create_subscription(JointState, 'lyapunov', exponents.append, STREAM)
    rclpy_node.create_subscription(DiagnosticArray, 'transient', transients.append, LATCHED)
    for name in ('lyapunov', 'transients'):
        start(name).wait_for('ready')
    replay = start('replay', str(run[0] / 'bag'), '--speed', '0', '--topics', 'impacts',
                   '--wait-for-readers', '2')
    index = live.name.index('index')
    spin(lambda: exponents and exponents[-1].position[index] == live.position[index], 60.0)
    assert replay.process.wait(20) == 0, replay.text()
    assert exponents[-1].name == live.name
    assert exponents[-1].position.tobytes() == live.position.tobytes()
    spin(lambda: transients and values_of(transients[-1]) == values_of(live_transient))


@pytest.mark.parametrize('after', [
    0.0, *(pytest.param(after, marks=pytest.mark.long) for after in (0.4, 1.5, 2.5, 5.0))])
def test_ctrl_c_at_any_time_ends_it(suite, tmp_path, after):
    """Status 0, nothing left running; what was recorded is kept."""
    running = suite('--duration', '0', '--alpha', '1.23', '--output', str(tmp_path / 'run'))
    # Before its folder is there, python itself may not be.
    while not (tmp_path / 'run').exists():
        time.sleep(0.01)
    time.sleep(after)
    began = time.monotonic()
    assert running.stop() == 0, running.text()
    assert 'Traceback' not in running.text()
    # 3 s on a machine of its own; the tests share theirs.
    assert time.monotonic() - began < 10.0
    assert not left_behind(tmp_path)


def test_folder_that_is_not_empty_is_refused(suite, tmp_path):
    """One line, status 2, nothing touched."""
    folder = tmp_path / 'run'
    folder.mkdir()
    (folder / 'mine').write_text('keep')
    refused = suite('--output', str(folder))
    assert refused.process.wait(60) == 2
    assert refused.text().splitlines() == [
        f'suite: {folder} is not empty; name a new folder with --output']
    assert [path.name for path in folder.iterdir()] == ['mine']


def test_node_that_cannot_start_ends_the_suite(suite, tmp_path):
    """Its reason is the suite's reason."""
    ended = suite('--alpha', '-1', '--output', str(tmp_path / 'run'))
    assert ended.process.wait(60) == 2
    assert 'alpha = -1.0 is outside [0, 1000]' in ended.text()
    assert not left_behind(tmp_path)


@pytest.mark.long
def test_scene_is_played_to_its_end(suite, tmp_path):
    """Both steps are in the bag: each from its own initial condition, onto its own attractor."""
    played = suite('--scene', 'two-attractors', '--output', str(tmp_path / 'run'))
    assert played.process.wait(240) == 0, played.text()
    events = events_of(Bag(tmp_path / 'run' / 'bag'))
    resets = np.flatnonzero(events['kind'] == EventKind.RESET)
    assert list(events['velocity_after'][resets]) == [-0.5, -1.0]
    assert (events['alpha'] == 0.48).all()
    for stretch, impacts in zip(np.split(events, resets[1:]), (3, 2), strict=True):
        detector = TransientDetector()
        detector.update(stretch)
        assert detector.report.period_impacts == impacts


@pytest.mark.parametrize(('arguments', 'words'), [
    (['--scene', 'chaos'], "suite: no scene 'chaos'; there are hysteresis, two-attractors"),
    (['--scene', 'chaotic-b', '--then', '1'], 'suite: --then and --scene exclude each other'),
    (['--rate', '-1'], 'suite: rate = -1.0 is outside [0, 1e+07]')])
def test_bad_arguments_are_one_line_and_status_2(suite, arguments, words):
    """The answer has all names, or the remedy, before anything is started."""
    refused = suite(*arguments)
    assert refused.process.wait(60) == 2
    assert refused.text().startswith(words) and len(refused.text().splitlines()) == 1
