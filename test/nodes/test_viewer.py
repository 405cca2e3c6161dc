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

"""The viewer: what it keeps of the stream, and the file a real process leaves."""

from collections.abc import Callable
import math
import os
from pathlib import Path
import signal
import socket
import urllib.request
import warnings

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
import pytest
from rclpy.node import Node
from rerun.chunk import Chunk, RrdReader
from rerun.error_utils import RerunWarning
from sensor_msgs.msg import JointState, PointCloud2
from visualization_msgs.msg import MarkerArray

from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EventArray, EventKind, Parameters, State
from gear_rattle_ros.messages import (
    cloud_from_events,
    diagnostic_array,
    markers_from_layers,
    named_values,
    stamp_from_nanoseconds,
)
from gear_rattle_ros.nodes.base.errors import UserError
from gear_rattle_ros.nodes.base.scales import nice_limit
from gear_rattle_ros.nodes.viewer.axes import colours_of, HALF_HEIGHT
from gear_rattle_ros.nodes.viewer.recent import Recent
from gear_rattle_ros.nodes.viewer.scene import exponent_row, EXPONENTS, SECTION_POINTS
from gear_rattle_ros.nodes.viewer.sinks import add_index, chosen_mode, file_recording
from gear_rattle_ros.parameters import VIEWER
from gear_rattle_ros.qos import LATCHED, STREAM

TWO_PI = 2.0 * math.pi
STAMP = stamp_from_nanoseconds(1_000_000_000)


def story(periods: int = 150) -> EventArray:
    """Return events with a change of alpha in the middle."""
    simulation = Simulation(Parameters(0.57), State(0, 0.0, 0.0, -0.5))
    return np.concatenate([
        simulation.advance(periods, 1.0, 10_000), simulation.retune(Parameters(1.244)),
        simulation.advance(2 * periods, 0.0, 10_000)])


@pytest.mark.parametrize('size', [1, 7, 100_000])
def test_recent_events_do_not_depend_on_the_cut(size: int) -> None:
    """The newest events, their numbers and drive times are the stream's own."""
    events = story()
    recent = Recent(200)
    for start in range(0, len(events), size):
        recent.take(events[start:start + size])
    rows = recent.impacts_after(0)
    expected = events[-200:]
    expected = expected[expected['kind'] <= EventKind.STICK]
    np.testing.assert_array_equal(rows['impact'], expected['index'])
    np.testing.assert_allclose(
        rows['drive_time'], expected['cycle'] + expected['phase'] / TWO_PI, rtol=1e-14)
    np.testing.assert_array_equal(rows['velocity'], expected['velocity'])
    np.testing.assert_array_equal(recent.whole(), events[-200:])
    assert recent.impacts == int((events['kind'] <= EventKind.STICK).sum())
    changes = recent.changes_after(0)
    assert list(changes['alpha']) == [0.57, 1.244]
    assert list(events['kind'][changes['seen'] - 1]) == [EventKind.RESET, EventKind.RETUNE]


def test_axes_go_on_over_holes_restarts_and_full_counters() -> None:
    """Impact number and drive time never go back; a flight is not drawn across a hole."""
    events = story()
    events['index'] += np.uint32(2**32 - 100)
    events['cycle'] += np.uint32(2**32 - 50)
    recent = Recent(10_000)
    recent.take(events[:300])
    recent.take(events[310:400])
    assert len(recent.whole()) == 90
    recent.take(story(20))
    rows = recent.impacts_after(0)
    assert (np.diff(rows['impact']) >= 1).all()
    assert (np.diff(rows['drive_time']) > 0).all()
    assert rows['impact'][-1] > 2**32
    assert recent.guard.gaps == 1 and recent.guard.restarts == 1
    assert recent.now is not None and recent.now.impact == rows['impact'][-1]
    assert recent.impact_number(int(recent.now.event['index']) - 3) == recent.now.impact - 3


def test_impacts_have_the_colour_of_the_attractor_visited_last() -> None:
    """Also those before it was recognised; a report replaces what is not before its impact."""
    recent = Recent(1000)
    events = story()
    recent.take(events)
    rows = recent.impacts_after(0)
    last = int(rows['impact'][-1])
    for first, colour in ((last - 300, '#111111'), (last - 50, '#222222'), (last - 100, '#333333'),
                          (last - 10, '#444444')):
        recent.visit(int(first), colour)
    painted = recent.colours_of(rows)
    wanted = np.select(
        [rows['impact'] >= last - 10, rows['impact'] >= last - 100, rows['impact'] >= last - 300],
        [0x444444FF, 0x333333FF, 0x111111FF], 0xB0B0B0FF)
    np.testing.assert_array_equal(painted, wanted)


def test_scales_and_colours() -> None:
    """Limits are round, hold their data and do not flicker; colours run from dark to bright."""
    assert nice_limit(0.97, 0.0) == 1.5 and nice_limit(0.94, 0.0) == 1.0
    assert nice_limit(0.97, 1.0) == 1.0 and nice_limit(0.2, 1.5) == pytest.approx(0.3)
    colours = colours_of(np.linspace(0.0, 1.0, 20))
    channels = np.stack([colours >> shift & 0xFF for shift in (24, 16, 8)]).astype(float)
    luminance = np.array([0.2126, 0.7152, 0.0722]) @ channels
    assert (np.diff(luminance) > 0).all()
    assert (colours & 0xFF == 0xFF).all()


def test_exponents_that_are_not_known_leave_a_gap() -> None:
    """The band is the exponent and its error; infinite values become gaps."""
    row = exponent_row({
        'lambda_1': 0.25, 'lambda_1_error': 0.125, 'lambda_2': -math.inf, 'sum': -math.inf,
        'exact_sum': -0.5, 'lambda_1_finite': math.nan})
    named = dict(zip((each[0] for each in EXPONENTS), row, strict=True))
    assert (named['λ1'], named['λ1 + error'], named['λ1 − error']) == (0.25, 0.375, 0.125)
    assert named['zero'] == 0.0 and named['exact sum'] == -0.5
    assert all(math.isnan(named[name]) for name in ('λ2', 'λ1 + λ2', 'λ1 finite-time'))
    # In a ramp every drive period is an epoch of its own: only the finite-time exponent crosses.
    row = exponent_row({'lambda_1': 0.25, 'lambda_1_error': math.nan, 'lambda_2': -0.5,
                        'sum': -0.25, 'exact_sum': -0.25, 'lambda_1_finite': 0.5, 'impacts': 2.0})
    named = dict(zip((each[0] for each in EXPONENTS), row, strict=True))
    assert named['λ1 finite-time'] == 0.5
    assert math.isnan(named['λ1']) and math.isnan(named['exact sum'])


def column(chunks: list[Chunk], path: str, name: str) -> list:
    """Return a column of an entity, row by row, in the order of the impact number."""
    batches = [chunk.to_record_batch() for chunk in chunks
               if chunk.entity_path == path and not chunk.is_static]
    rows = [row for batch in batches for row in zip(
        batch['impact'].to_pylist(), batch[name].to_pylist(), strict=True)]
    return [value for _, value in sorted(rows, key=lambda row: row[0])]


def listen(node: Node) -> list[dict[str, str]]:
    """Return a list that fills with the viewer's diagnostics."""
    reports: list[dict[str, str]] = []

    def keep(message: DiagnosticArray) -> None:
        reports.extend({item.key: item.value for item in status.values}
                       for status in message.status if status.name.startswith('viewer'))

    node.create_subscription(DiagnosticArray, '/diagnostics', keep, 10)
    return reports


def drawn(reports: list[dict[str, str]]) -> int:
    """Return how many impacts the viewer last reported as drawn."""
    return int(reports[-1]['impacts_drawn']) if reports else 0


def impacts_sent(events: EventArray) -> EventArray:
    """Return the impacts among the events."""
    return events[events['kind'] <= EventKind.STICK]


def test_file_holds_what_was_sent(start: Callable, rclpy_node: Node, spin: Callable,
                                  tmp_path: Path) -> None:
    """Rerun's own reader finds every impact, the section, s(tau), exponents and texts."""
    path = tmp_path / 'run.rrd'
    clouds = rclpy_node.create_publisher(PointCloud2, 'impacts', STREAM)
    estimates = rclpy_node.create_publisher(JointState, 'lyapunov', STREAM)
    transients = rclpy_node.create_publisher(DiagnosticArray, 'transient', LATCHED)
    skeletons = rclpy_node.create_publisher(MarkerArray, 'skeleton', LATCHED)
    layers = {'unstable_orbits': np.array([[1.0, 0.5], [2.0, -0.5]]),
              'stable_manifold': np.array([[[0.0, 0.5], [1.0, 1.0]], [[1.0, 1.0], [2.0, 1.0]],
                                           [[4.0, 0.0], [5.0, 0.5]]]),
              'smallest_kick': np.array([[[3.0, 0.5], [3.0, 0.75]]])}
    skeletons.publish(markers_from_layers(layers, STAMP))
    transients.publish(diagnostic_array('t', 't', 'ok', 'transient since impact 0', {}, STAMP))
    reports = listen(rclpy_node)
    viewer = start('viewer', '--ros-args', '-p', 'mode:=none', '-p', f'save:={path}')
    viewer.wait_for('ready')
    spin(lambda: all(each.get_subscription_count() for each in (clouds, estimates, skeletons)))
    events = story()
    half = len(events) // 2
    values = {'lambda_1': 0.25, 'lambda_2': -0.75, 'lambda_1_error': 0.125,
              'lambda_2_error': 0.125, 'sum': -0.5, 'exact_sum': -0.5, 'lambda_1_finite': 0.5,
              'window': 1000.0, 'epoch': 0.0, 'impacts': 500.0, 'index': 100.0}
    clouds.publish(cloud_from_events(events[:half], STAMP))
    spin(lambda: drawn(reports) == len(impacts_sent(events[:half])))
    skeletons.publish(markers_from_layers(
        {name: layers[name] for name in ('stable_manifold', 'smallest_kick')}, STAMP))
    estimates.publish(named_values(values, STAMP))
    clouds.publish(cloud_from_events(events[half:], STAMP))
    spin(lambda: drawn(reports) == len(impacts_sent(events)))
    assert reports[-1]['impacts_thinned_out'] == '0' and reports[-1]['gaps'] == '0'
    assert viewer.stop(signal.SIGINT) == 0, viewer.text()

    chunks = RrdReader(str(path)).stream().to_chunks()
    impacts = impacts_sent(events)
    assert [value for row in column(chunks, '/velocity', 'Scalars:scalars')
            for value in row] == list(impacts['velocity'])
    last = column(chunks, '/section/plane/impacts', 'Points2D:positions')[-1]
    assert len(last) == len(impacts) <= SECTION_POINTS
    np.testing.assert_array_equal(
        np.array(last, np.float32),
        np.stack([impacts['phase'], impacts['velocity']], axis=1).astype(np.float32))
    line = np.array(column(chunks, '/flight/plane/motion', 'LineStrips2D:strips')[-1][0])
    assert line[-1, 0] == pytest.approx(events['phase'][-1] / TWO_PI, abs=1e-6)
    assert line[-1, 1] == pytest.approx(events['displacement'][-1], abs=1e-6)
    assert line[:, 1].min() >= -1.000001 and line[:, 1].max() <= 0.000001
    (row,) = column(chunks, '/exponents', 'Scalars:scalars')
    assert row == exponent_row(values)
    alphas = [row[0] for row in column(chunks, '/alpha', 'Scalars:scalars')]
    assert set(alphas) == {0.57, 1.244} and alphas == sorted(alphas)
    assert column(chunks, '/log', 'TextLog:text') == [['transient since impact 0']]
    text = column(chunks, '/state', 'TextDocument:text')[-1][0]
    assert 'transient since impact 0' in text and '1.244' in text and '0.25000 ± 0.12500' in text
    below = '/section/plane/skeleton'
    # What has been deleted is gone.
    assert column(chunks, f'{below}/unstable_orbits', 'Points2D:positions') == [
        [[1.0, 0.5], [2.0, -0.5]], []]
    assert column(chunks, f'{below}/stable_manifold', 'LineStrips2D:strips')[-1] == [
        [[0.0, 0.5], [1.0, 1.0]], [[1.0, 1.0], [2.0, 1.0]], [[4.0, 0.0], [5.0, 0.5]]]
    assert column(chunks, f'{below}/unstable_manifold', 'LineStrips2D:strips')[-1] == []
    assert column(chunks, f'{below}/smallest_kick', 'Arrows2D:vectors')[-1] == [[0.0, 0.25]]
    scale = column(chunks, '/section/plane', 'Transform3D:scale')[-1][0]
    assert abs(scale[1]) * np.abs(impacts['velocity']).max() <= HALF_HEIGHT


def test_a_killed_viewer_leaves_a_file_that_can_be_read(
        start: Callable, rclpy_node: Node, spin: Callable, tmp_path: Path) -> None:
    """What was drawn before the kill is there."""
    path = tmp_path / 'run.rrd'
    clouds = rclpy_node.create_publisher(PointCloud2, 'impacts', STREAM)
    reports = listen(rclpy_node)
    viewer = start('viewer', '--ros-args', '-p', 'mode:=none', '-p', f'save:={path}')
    viewer.wait_for('ready')
    spin(clouds.get_subscription_count)
    events = story(100)
    clouds.publish(cloud_from_events(events, STAMP))
    spin(lambda: drawn(reports) == len(impacts_sent(events)))
    viewer.stop(signal.SIGKILL)
    with pytest.warns(RerunWarning, match='footer'):
        chunks = RrdReader(str(path)).stream().to_chunks()
    assert len(column(chunks, '/velocity', 'Scalars:scalars')) == len(impacts_sent(events))


@pytest.fixture
def port() -> int:
    """Return a port that nobody uses."""
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        return int(probe.getsockname()[1])


@pytest.mark.long
def test_a_viewer_that_is_closed_leaves_the_node_and_the_file(
        start: Callable, tmp_path: Path, port: int) -> None:
    """The node reports it once, goes on, and ends quietly with a whole file."""
    path = tmp_path / 'run.rrd'
    viewer = start('viewer', '--ros-args', '-p', 'mode:=web', '-p', f'web_port:={port}', '-p',
                   f'save:={path}')
    viewer.wait_for('ready')
    number = viewer.process.pid
    children = Path(f'/proc/{number}/task/{number}/children').read_text().split()
    os.kill(int(children[0]), signal.SIGTERM)
    viewer.wait_for('stopped drawing: the viewer has been closed')
    assert viewer.stop(signal.SIGTERM) == 0, viewer.text()
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        assert RrdReader(str(path)).stream().to_chunks()


def test_web_viewer_is_on_this_machine_alone(
        start: Callable, port: int, rclpy_node: Node, spin: Callable) -> None:
    """The page is served on 127.0.0.1 and no other address, and ends with the node."""
    pages = []
    rclpy_node.create_subscription(DiagnosticArray, '/diagnostics', lambda message: pages.extend(
        item.value for item in message.status[0].values if item.key == 'page'), 10)
    viewer = start('viewer', '--ros-args', '-p', 'mode:=web', '-p', f'web_port:={port}')
    viewer.wait_for('ready')
    # At the port alone rerun shows nothing: the whole address says where the data are.
    spin(lambda: pages)
    assert pages[0].startswith(f'http://127.0.0.1:{port}/?url=rerun%2Bhttp') and (
        pages[0] in viewer.text())
    with urllib.request.urlopen(f'http://127.0.0.1:{port}/') as page:
        assert b'rerun' in page.read().lower()
    listening = [line.split()[1] for line in Path('/proc/net/tcp').read_text().splitlines()
                 if line.split()[3] == '0A']
    assert [address for address in listening if address.endswith(f':{port:04X}')] == [
        f'0100007F:{port:04X}']
    assert viewer.stop(signal.SIGTERM) == 0, viewer.text()
    with socket.socket() as probe:
        assert probe.connect_ex(('127.0.0.1', port)) != 0


@pytest.mark.parametrize(('arguments', 'words'), [
    (['save:=/nowhere/run.rrd', 'mode:=none'],
     "save = '/nowhere/run.rrd' cannot be written: No such file or directory"),
    (['colour:=taste'], "colour = 'taste' is not one of age, alpha, attractor"),
])
def test_a_bad_start_is_one_line(start: Callable, arguments: list[str], words: str) -> None:
    """Exit status 2, and one line that names the value."""
    given = [part for argument in arguments for part in ('-p', argument)]
    viewer = start('viewer', '--ros-args', *given)
    assert viewer.process.wait(30) == 2
    assert viewer.text() == f'viewer: {words}\n'


def test_files_that_are_refused(tmp_path: Path) -> None:
    """A file that exists stays as it is, and another kind of file is not made."""
    path = tmp_path / 'run.rrd'
    path.write_text('precious')
    with pytest.raises(UserError, match='exists: name another file'):
        file_recording(str(path), 'age')
    assert path.read_text() == 'precious'
    with pytest.raises(UserError, match='must end in .rrd'):
        file_recording('run.png', 'age')


def test_a_file_that_gets_no_index_stays_as_it_is(tmp_path: Path) -> None:
    """Rerun's program refuses it: the reason is reported, and nothing is left beside it."""
    path = tmp_path / 'run.rrd'
    path.write_bytes(b'no recording')
    assert 'status' in add_index(str(path))
    assert path.read_bytes() == b'no recording' and list(tmp_path.iterdir()) == [path]


def test_modes(monkeypatch: pytest.MonkeyPatch) -> None:
    """What auto means with and without a display and a file; what is no mode."""
    monkeypatch.delenv('WAYLAND_DISPLAY', raising=False)
    monkeypatch.setenv('DISPLAY', ':0')
    assert chosen_mode('auto', 'run.rrd') == 'native'
    monkeypatch.delenv('DISPLAY')
    assert chosen_mode('auto', 'run.rrd') == 'none'
    assert chosen_mode('auto', '') == 'web'
    with pytest.raises(UserError, match='draws nothing: give save:=FILE.rrd'):
        chosen_mode('none', '')
    mode, = (each for each in VIEWER if each.name == 'mode')
    with pytest.raises(ValueError, match="mode = 'hologram' is not one of auto, native, web"):
        mode.check('hologram')
