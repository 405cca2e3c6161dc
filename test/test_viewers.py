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

"""Layouts of other viewers: their files, and that what they name is there in a real run."""

from collections.abc import Callable
import json
import math
import re
from xml.etree import ElementTree

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
import pytest
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Image, JointState, PointCloud2
from visualization_msgs.msg import MarkerArray
import yaml

from gear_rattle_ros.places import config_folder
from gear_rattle_ros.qos import LATCHED, STREAM

RVIZ = config_folder('rviz') / 'gear_rattle.rviz'
PLOTJUGGLER = config_folder('plotjuggler') / 'gear_rattle.xml'
FOXGLOVE = config_folder('foxglove') / 'gear_rattle.json'
URDF = config_folder('urdf') / 'gears.urdf'
GEARS = config_folder('gears') / 'example.yaml'
TYPES = {
    '/impacts': PointCloud2, '/attractors': PointCloud2, '/basin': Image,
    '/joint_states': JointState, '/lyapunov': JointState, '/transient': DiagnosticArray,
    '/diagnostics': DiagnosticArray, '/last_impact': JointState, '/skeleton': MarkerArray,
    '/rattle': JointState,
}
# What RViz's displays show: their classes in rviz_default_plugins, and message types.
DISPLAYS = {'rviz_default_plugins/PointCloud2': PointCloud2, 'rviz_default_plugins/Image': Image,
            'rviz_default_plugins/MarkerArray': MarkerArray}
# Panels of Foxglove and its free sister Lichtblick.
PANELS = {'3D', 'Image', 'Plot', 'DiagnosticSummary', 'RawMessages', 'Parameters', 'CallService'}


def rviz() -> dict:
    """Return the RViz configuration."""
    return yaml.safe_load(RVIZ.read_text())['Visualization Manager']


def curves() -> set[str]:
    """Return the names of PlotJuggler's curves."""
    return {str(curve.get('name')) for curve in ElementTree.parse(PLOTJUGGLER).iter('curve')}


def foxglove_paths() -> dict[str, str]:
    """Return the message paths of Foxglove's plots and the labels they have."""
    panels = json.loads(FOXGLOVE.read_text())['configById']
    return {path['value']: path['label'] for name, panel in panels.items()
            if name.startswith('Plot!') for path in panel['paths'] if path['value'] != '0'}


def foxglove_topics() -> set[str]:
    """Return the topics that Foxglove's panels name."""
    panels = json.loads(FOXGLOVE.read_text())['configById']
    return {
        *panels['3D!section']['topics'], panels['Image!basin']['imageMode']['imageTopic'],
        panels['DiagnosticSummary!nodes']['topicToRender'],
        panels['RawMessages!transient']['topicPath'].split('.')[0],
        *(path.split('.')[0] for path in foxglove_paths())}


def leaves(node: object) -> list[str]:
    """Return the panels of a mosaic."""
    if isinstance(node, dict):
        return [*leaves(node['first']), *leaves(node['second'])]
    return [str(node)]


def test_gears_are_a_tree_of_the_joints_that_are_published() -> None:
    """One root, a joint for each gear of joint_states, every link reached once."""
    robot = ElementTree.parse(URDF).getroot()
    links = {link.get('name') for link in robot.iter('link')}
    joints = {joint.get('name'): joint for joint in robot.iter('joint')}
    assert joints.keys() == {'driver_gear', 'driven_gear'}
    children = [joint.find('child').get('link') for joint in joints.values()]
    parents = {joint.find('parent').get('link') for joint in joints.values()}
    assert len(set(children)) == len(children)
    assert links - set(children) == parents == {'gears'}
    materials = {material.get('name') for material in robot.findall('material')}
    assert {used.get('name') for used in robot.iter('material')} == materials


def test_gears_have_the_play_they_say() -> None:
    """At equal angles the flanks touch on the upper wall, and 0.2 rad are left at the lower."""
    robot = ElementTree.parse(URDF).getroot()
    teeth: dict[str, list[float]] = {}
    widths = []
    for name in ('driver', 'driven'):
        visuals = robot.find(f"link[@name='{name}']").findall('visual')
        angles = [float(each.find('origin').get('rpy').split()[2]) for each in visuals
                  if each.find('geometry/box') is not None]
        teeth[name] = sorted(a + half for a in angles for half in (0.0, math.pi))
        widths += [float(box.get('size').split()[1]) for box in robot.iter('box')]
    x = {joint.get('name'): float(joint.find('origin').get('xyz').split()[0])
         for joint in robot.iter('joint')}
    radius = (x['driven_gear'] - x['driver_gear']) / 2.0
    width = widths[0] / radius
    np.testing.assert_allclose(widths, widths[0])
    pitch = 2.0 * math.pi / len(teeth['driver'])
    for angles in teeth.values():
        np.testing.assert_allclose(np.diff(angles), pitch, atol=1e-5)
    # Height above the line of centres, over the radius, of the driven tooth next to it.
    nearest = min((a - math.pi for a in teeth['driven']), key=abs)
    assert -nearest == pytest.approx(-width, abs=1e-3)
    assert pitch - 2.0 * width == pytest.approx(0.2, abs=1e-3)


def test_rviz_shows_the_section_in_its_own_frame() -> None:
    """Fixed frame, displays and topics; a display of the gears."""
    manager = rviz()
    assert manager['Global Options']['Fixed Frame'] == 'section'
    assert manager['Views']['Current']['Target Frame'] == 'section'
    shown = {each['Topic']['Value']: DISPLAYS[each['Class']] for each in manager['Displays']
             if 'Topic' in each}
    assert shown == {name: TYPES[name] for name in (
        '/impacts', '/attractors', '/skeleton', '/basin')}
    gears = [each for each in manager['Displays'] if each['Class'].endswith('/RobotModel')]
    assert [each['Description Topic']['Value'] for each in gears] == ['/robot_description']


def test_foxglove_layout_is_whole() -> None:
    """Every panel is in the mosaic once, of a known kind."""
    layout = json.loads(FOXGLOVE.read_text())
    assert layout.keys() == {
        'configById', 'globalVariables', 'userNodes', 'playbackConfig', 'layout'}
    assert sorted(leaves(layout['layout'])) == sorted(layout['configById'])
    assert {name.split('!')[0] for name in layout['configById']} <= PANELS
    assert layout['configById']['3D!section']['followTf'] == 'section'


def test_plotjuggler_layout_is_whole() -> None:
    """Counts and shares of the splitters agree with what is in them."""
    root = ElementTree.parse(PLOTJUGGLER).getroot()
    assert root.tag == 'root' and root.find('tabbed_widget').get('parent') == 'main_window'
    for splitter in root.iter('DockSplitter'):
        sizes = [float(size) for size in splitter.get('sizes').split(';')]
        assert int(splitter.get('count')) == len(splitter) == len(sizes)
        assert sum(sizes) == pytest.approx(1.0)
    topics = root.find('Plugins/plugin/selected_topics').get('value').split(';')
    assert all(any(curve.startswith(f'{topic}/') for topic in topics) for curve in curves())


def quality(display: dict | None, topic: str) -> QoSProfile:
    """Return the quality of service that a display of RViz asks for."""
    if display is None:
        return LATCHED if topic in ('/basin', '/attractors', '/skeleton', '/transient') else STREAM
    said = display['Topic']
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST, depth=said['Depth'],
        reliability={'Best Effort': ReliabilityPolicy.BEST_EFFORT,
                     'Reliable': ReliabilityPolicy.RELIABLE}[said['Reliability Policy']],
        durability={'Volatile': DurabilityPolicy.VOLATILE,
                    'Transient Local': DurabilityPolicy.TRANSIENT_LOCAL}[
                        said['Durability Policy']])


@pytest.mark.long
def test_everything_named_is_there_in_a_real_run(
        start: Callable, rclpy_node, spin: Callable[..., None]) -> None:
    """Topics with their types and qualities, series, message paths, services, frames."""
    for name in ('simulator', 'lyapunov'):
        start(name)
    # What follows the finest picture would otherwise wait for 640,000 cells.
    start('basin', '--ros-args', '-p', 'size:=100', '-p', 'niceness:=1')
    start('transients', '--ros-args', '-p', f'gears:={GEARS}')
    displays = {each['Topic']['Value']: each for each in rviz()['Displays'] if 'Topic' in each}
    wanted = {*displays, *foxglove_topics(), *(f'/{curve.split("/")[1]}' for curve in curves())}
    assert wanted <= TYPES.keys()
    heard: dict[str, object] = {}
    series: set[str] = set()

    def take(topic: str, message: object) -> None:
        heard[topic] = message
        if isinstance(message, JointState):
            # As PlotJuggler names what is in the two types.
            series.update(f'{topic}/{name}/position' for name in message.name)
        elif isinstance(message, DiagnosticArray):
            series.update(
                f'{topic}/{status.hardware_id}/{status.name}/{item.key}'
                for status in message.status for item in status.values)

    for topic in sorted(wanted):
        rclpy_node.create_subscription(
            TYPES[topic], topic, lambda message, topic=topic: take(topic, message),
            quality(displays.get(topic), topic))
    spin(lambda: heard.keys() == wanted and curves() <= series, within=180.0)
    for path, label in foxglove_paths().items():
        topic, place = re.fullmatch(r'(/\w+)\.position\[(\d+)\]', path).groups()
        assert heard[topic].name[int(place)] == label
    assert heard['/transient'].status[0].message
    for topic in ('/impacts', '/attractors'):
        assert heard[topic].header.frame_id == 'section'
        assert [field.name for field in heard[topic].fields[:3]] == ['x', 'y', 'z']
    assert heard['/basin'].encoding == 'rgb8'
    services = dict(rclpy_node.get_service_names_and_types())
    panel = json.loads(FOXGLOVE.read_text())['configById']['CallService!reset']
    assert services[panel['serviceName']] == ['std_srvs/srv/Trigger']
