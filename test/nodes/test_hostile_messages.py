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

"""Messages of others on the topics that are shown: left out in one line, and never the end."""

from collections.abc import Iterator
import math
import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point
from hypothesis import given, settings, strategies as st
import numpy as np
import pytest
from rclpy.parameter import Parameter
from rclpy.utilities import try_shutdown
from rich.console import Console
from sensor_msgs.msg import Image, JointState, PointCloud2, PointField
from visualization_msgs.msg import Marker, MarkerArray

from gear_rattle_ros.core.flight.law import Law
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EVENT, Parameters, State
from gear_rattle_ros.messages import cloud_from_events, stamp_from_nanoseconds
from gear_rattle_ros.nodes.base.process import begin
from gear_rattle_ros.nodes.control import Control
from gear_rattle_ros.nodes.suite.display import render, Status
from gear_rattle_ros.nodes.suite.node import Monitor
from gear_rattle_ros.nodes.viewer.basin import points_of
from gear_rattle_ros.nodes.viewer.node import SHOWN, Viewer

WORDS = st.sampled_from(['', 'x', '[/]', '[red]', 'nan', '-1', '1e999', 'gaps', 'alpha', 'size',
                         'lost_impacts', 'multiplier', 'velocity_low', 'velocity_high', '3', '\n'])
NAMES = st.sampled_from(['', 'simulator: simulator', 'lyapunov: x', '[/]', 'recorder'])
ESTIMATES = st.builds(
    lambda names, values: JointState(name=names, position=values),
    st.one_of(st.just([*SHOWN, 'window']), st.lists(st.sampled_from(SHOWN), max_size=9)),
    st.lists(st.one_of(st.floats(), st.integers(0, 99).map(float)), min_size=7, max_size=9))
STATUSES = st.lists(st.builds(
    lambda name, message, values: DiagnosticStatus(
        name=name, message=message, values=[KeyValue(key=k, value=v) for k, v in values.items()]),
    NAMES, WORDS, st.dictionaries(WORDS, WORDS, max_size=5)), max_size=2)
REPORTS = st.builds(lambda status: DiagnosticArray(status=status), STATUSES)
IMAGES = st.builds(
    lambda size, height, encoding, data: Image(
        width=size, height=height, encoding=encoding, data=data),
    st.sampled_from([0, 3, 2**32 - 1]), st.sampled_from([0, 3, 2**32 - 1]),
    st.sampled_from(['rgb8', 'mono8', '']), st.sampled_from([b'', bytes(27), bytes(5)]))
CLOUDS = st.builds(
    lambda names, offset, datatype, count, step, data: PointCloud2(
        fields=[PointField(name=name, offset=offset, datatype=datatype, count=count)
                for name in names], point_step=step, data=data),
    st.lists(st.sampled_from(['x', 'y', 'rgb']), max_size=4), st.sampled_from([0, 4, 2**32 - 1]),
    st.sampled_from([7, 8, 0, 255]), st.sampled_from([1, 0]),
    st.sampled_from([12, 0, 4, 2**32 - 1]), st.sampled_from([b'', bytes(24), bytes(7)]))
MARKERS = st.builds(lambda markers: MarkerArray(markers=markers), st.lists(st.builds(
    lambda name, kind, points: Marker(ns=name, type=kind, points=[
        Point(x=x, y=y) for x, y in points]),
    st.sampled_from(['', 'unstable_orbits', 'stable_manifold', 'smallest_kick']),
    st.sampled_from([Marker.ARROW, Marker.LINE_LIST, 99]),
    st.lists(st.tuples(st.floats(), st.floats(-1e300, 1e300)), max_size=5)), max_size=3))
ANSWERS = st.one_of(st.floats(), st.integers(), st.sampled_from(['', 'x', '{}', '[1]']),
                    st.floats(0.01, 1.0))
ORBITS = st.one_of(st.text(max_size=9), st.sampled_from(
    ['orbit-', 'orbit-2-1-U', '<', '<1', '-1', '99', '1e9', 'A', '٣', '<65']))
MESSAGES = {'lyapunov': ESTIMATES, 'transient': REPORTS, 'diagnostics': REPORTS, 'basin': IMAGES,
            'attractors': CLOUDS, 'basin_state': REPORTS, 'skeleton': MARKERS}


@pytest.fixture
def ros(domain: int, tmp_path) -> Iterator[None]:
    """Begin ROS in this process."""
    begin(['--ros-args', '-p', 'mode:=none', '-p', f'save:={tmp_path}/run.rrd'])
    yield
    try_shutdown()


def callbacks(node) -> dict:
    """Return what a node does with the messages of each topic."""
    found = {one.topic_name.split('/')[-1]: one.callback for one in node.subscriptions}
    return {name: found[name] for name in MESSAGES if name in found}


def test_the_suite_goes_on_and_shows_numbers(ros) -> None:
    """Whatever comes in, its display is drawn, and what it knew before stays."""
    status = Status()
    monitor = Monitor(status)
    take = callbacks(monitor)
    assert set(take) == {'lyapunov', 'transient', 'diagnostics'}

    @settings(max_examples=150, deadline=None)
    @given(st.data())
    def holds(data: st.DataObject) -> None:
        topic = data.draw(st.sampled_from(sorted(take)))
        take[topic](data.draw(MESSAGES[topic]))
        assert isinstance(status.impacts, int)
        status.line()
        with Console(quiet=True).capture():
            Console(width=80, file=None, quiet=True).print(render(status))

    holds()
    good = JointState(name=['index', 'lambda_1'], position=[7.0, 0.25])
    take['lyapunov'](good)
    for bad in (JointState(name=['index'], position=[]), JointState(name=['x'], position=[1.0]),
                JointState(name=['index'], position=[math.nan])):
        take['lyapunov'](bad)
        assert (status.impacts, status.exponents['lambda_1']) == (7, 0.25)
    monitor.destroy_node()


def test_the_viewer_goes_on(ros, capfd) -> None:
    """Estimates, reports and pictures that are none are left out, and it draws the rest."""
    viewer = Viewer()
    viewer._take(Simulation(Parameters(1.2), State(velocity=-0.5)).advance(10**6, 0.0, 50))
    take = callbacks(viewer)
    assert set(take) == set(MESSAGES) - {'diagnostics'}

    @settings(max_examples=150, deadline=None)
    @given(st.data())
    def holds(data: st.DataObject) -> None:
        topic = data.draw(st.sampled_from(sorted(take)))
        take[topic](data.draw(MESSAGES[topic]))
        for scene in viewer._scenes:
            scene.draw(viewer._recent, viewer._document(), time.monotonic())

    holds()
    take['lyapunov'](JointState(name=list(SHOWN), position=[0.5] * len(SHOWN)))
    take['lyapunov'](JointState(name=list(SHOWN), position=[math.nan] * len(SHOWN)))
    assert 'λ1 = 0.50000' in viewer._document()
    said = capfd.readouterr().err
    assert "refused a message on lyapunov: ValueError('impacts = nan')" in said
    assert 'Traceback' not in said
    viewer.close()
    viewer.destroy_node()


def test_the_control_node_goes_on(ros: None, capfd: pytest.CaptureFixture[str]) -> None:
    """Whatever answers for a simulator or is asked for, it holds an orbit in the end."""
    node = Control()
    put: list[dict[str, str]] = []
    node.simulator.put = lambda values, then=bool: (put.append(values), then(''))
    take, = (one.callback for one in node.subscriptions if one.topic_name == '/impacts')
    good = {'alpha': 0.57, 'beta': 0.1, 'gamma': 0.1, 'restitution': 0.9, 'control': ''}
    events = Simulation(Parameters(0.57), State(velocity=-1.0)).advance(10**6, 0.0, 3000)

    def look(values: dict[str, object]) -> None:
        node.simulator.tick = lambda: node._look(values)
        node._turn()

    @settings(max_examples=150, deadline=None)
    @given(st.fixed_dictionaries(dict.fromkeys(good, ANSWERS)), st.one_of(ORBITS, st.none()),
           CLOUDS)
    def holds(values: dict[str, object], orbit: str | None, cloud: PointCloud2) -> None:
        take(cloud)
        if orbit is not None:
            result, = node.set_parameters([Parameter('orbit', value=orbit)])
            assert result.successful
        look(values)
        node._publish()
        assert node.report()[0] in ('ok', 'warn')

    holds()
    node.set_parameters([Parameter('orbit', value='B')])
    take(cloud_from_events(events, stamp_from_nanoseconds(0)))
    deadline = time.monotonic() + 60.0
    while node._hold is None and time.monotonic() < deadline:
        look(good | {'control': put[-1]['control'] if put else ''})
        time.sleep(0.01)
    assert Law.of_text(put[-1]['control']) is not None
    assert 'Traceback' not in capfd.readouterr().err
    node.destroy_node()


def test_a_cloud_of_events_is_no_cloud_of_attractors() -> None:
    """Its fields have the right names, but not the right types: no number is read from it."""
    cloud = cloud_from_events(np.zeros(3, EVENT), stamp_from_nanoseconds(0))
    with pytest.raises(ValueError, match='not a cloud of little-endian float32'):
        points_of(cloud)
