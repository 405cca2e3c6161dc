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

"""Launch files, run with stand-ins for launch and launch_ros that record what is asked of them."""

from collections.abc import Callable, Iterator
from pathlib import Path
import runpy
import sys
from types import ModuleType, SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml

from gear_rattle_ros.parameters import TABLES
from gear_rattle_ros.places import config_folder
from gear_rattle_ros.scenes import load_scenes
from gear_rattle_ros.start import EXECUTABLES

LAUNCH = config_folder('launch')
# They belong to launch itself, to no node.
OF_LAUNCH = {'parameters', 'namespace', 'use_sim_time', 'basin'}


class Record(SimpleNamespace):
    """An action: what it was made of."""

    def __init__(self, *words: Any, **options: Any) -> None:
        """Keep everything."""
        super().__init__(words=words, **options)


@pytest.fixture
def describe(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], list[Record]]]:
    """Return what makes the list of entities of a launch file."""
    for name, names in {
            'launch': ['LaunchDescription'], 'launch_ros': [], 'launch_ros.actions': ['Node'],
            'launch.actions': ['DeclareLaunchArgument', 'OpaqueFunction']}.items():
        module = ModuleType(name)
        for each in names:
            setattr(module, each, type(each, (Record,), {}))
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setattr('ament_index_python.packages.get_package_share_directory',
                        lambda package: str(LAUNCH.parents[1]))
    yield lambda name: runpy.run_path(
        str(LAUNCH / name))['generate_launch_description']().words[0]


def launched(entities: list[Record], **given: str) -> tuple[dict[str, Record], Any]:
    """Return the nodes that some arguments start, by executable, and the context."""
    *arguments, last = entities
    assert all(type(each).__name__ == 'DeclareLaunchArgument' and each.description.endswith('.')
               for each in arguments)
    values = {each.words[0]: each.default_value for each in arguments}
    assert given.keys() <= values.keys()
    for each in arguments:
        choices = getattr(each, 'choices', None)
        assert choices is None or values[each.words[0]] in choices
    context = SimpleNamespace(launch_configurations=values | given, is_shutdown=False)
    return {node.executable: node for node in last.function(context)}, context


def own(nodes: dict[str, Record], name: str) -> dict[str, object]:
    """Return the parameters that a node gets beside its file."""
    return dict(nodes[name].parameters[-1])


def test_every_argument_reaches_a_parameter_that_exists(describe: Callable) -> None:
    """Each has another value than its default; what the nodes get is declared and of its type."""
    given = {'alpha': '1', 'beta': '.2', 'gamma': '0.3', 'restitution': '0.8', 'noise': '0.01',
             'seed': '7', 'rate': '0', 'initial_phase': '1', 'initial_displacement': '-0.5',
             'initial_velocity': '-2', 'scene': 'hysteresis', 'frame': 'map', 'output': '2026',
             'save': 'run.rrd', 'viewer': 'web', 'hold': 'B'}
    entities = describe('suite.launch.py')
    arguments = {each.words[0] for each in entities[:-1]}
    assert arguments == given.keys() | OF_LAUNCH
    nodes, _ = launched(entities, **given, namespace='left', use_sim_time='true')
    assert nodes.keys() == TABLES.keys() - {'replay', 'teleop'}
    reached: dict[str, object] = {}
    for name, node in nodes.items():
        assert name in EXECUTABLES and node.package == 'gear_rattle_ros'
        assert (node.name, node.namespace) == (name, 'left')
        table = {each.name: each for each in TABLES[name]}
        values = own(nodes, name)
        assert values.pop('use_sim_time') is True
        for parameter, value in values.items():
            assert type(table[parameter].check(value)) is type(value)
        reached |= values
    assert reached.pop('wait_for_readers') == 6 and reached.pop('publish_clock') is True
    reached['viewer'], reached['hold'] = reached.pop('mode'), reached.pop('orbit')
    assert {name: str(value).rstrip('0').rstrip('.') if isinstance(value, float) else str(value)
            for name, value in reached.items()} == {
        name: str(float(text)).rstrip('0').rstrip('.') if name not in ('seed', 'output') and (
            text.strip('-.')[0].isdigit()) else text for name, text in given.items()}
    assert given['scene'] in load_scenes()


def test_only_readers_that_are_started_are_awaited(describe: Callable) -> None:
    """Without a window or a file there is no viewer; the basins can be left out."""
    entities = describe('suite.launch.py')
    for given, count in (({}, 5), ({'viewer': 'none'}, 4), ({'viewer': 'none', 'save': 'a'}, 5),
                         ({'viewer': 'none', 'basin': 'false'}, 3)):
        nodes, _ = launched(entities, **given)
        assert own(nodes, 'simulator')['wait_for_readers'] == count == len(nodes) - 1
        assert own(nodes, 'simulator').keys() >= {'wait_for_readers', 'frame'}
        assert 'alpha' not in own(nodes, 'simulator')


def test_a_scene_takes_the_place_of_our_parameters_not_of_the_users(
        describe: Callable, tmp_path: Path) -> None:
    """A value of a file would override the scene's."""
    entities = describe('suite.launch.py')
    file = tmp_path / 'mine.yaml'
    file.write_text('')
    for given, expected in (
            ({}, [str(LAUNCH.parent / 'suite.yaml')]), ({'scene': 'hops'}, []),
            ({'scene': 'hops', 'parameters': str(file)}, [str(file)])):
        nodes, _ = launched(entities, **given)
        assert nodes['simulator'].parameters[:-1] == expected
        assert nodes['lyapunov'].parameters[:-1] != []


def test_bad_arguments_are_named(describe: Callable) -> None:
    """One line, which launch prints; its status is then 1."""
    entities = describe('suite.launch.py')
    for given, words in (({'alpha': 'much'}, 'alpha:=much is not a number'),
                         ({'seed': '1.5'}, 'seed:=1.5 is not a whole number'),
                         ({'parameters': '/nowhere'}, 'parameters:=/nowhere is not a file')):
        with pytest.raises(RuntimeError, match=words):
            launched(entities, **given)


@pytest.mark.parametrize('name, status, is_over', [
    ('simulator', 0, True), ('simulator', 1, True), ('recorder', 2, True), ('viewer', 2, True),
    ('viewer', 1, False), ('basin', 0, False)])
def test_what_ends_the_launch(describe: Callable, name: str, status: int, is_over: bool) -> None:
    """An error in a handler makes launch end the others and return 1; not while it ends."""
    nodes, context = launched(describe('suite.launch.py'))
    event = SimpleNamespace(returncode=status)
    if is_over:
        with pytest.raises(RuntimeError, match=f'^{name} has ended with status {status}'):
            nodes[name].on_exit(event, context)
    else:
        assert nodes[name].on_exit(event, context) is None
    context.is_shutdown = True
    assert nodes[name].on_exit(event, context) is None


@pytest.mark.parametrize('given, frame, prefix, topic', [
    ({}, 'section', '', '/impacts'),
    ({'namespace': 'left'}, 'left/section', 'left/', '/left/impacts'),
    ({'namespace': '/left', 'frame': 'map'}, 'map', 'left/', '/left/impacts')])
def test_rviz_agrees_with_the_frames(
        describe: Callable, given: dict, frame: str, prefix: str, topic: str) -> None:
    """Its configuration, the transform and the links of the gears, in any namespace."""
    nodes, _ = launched(describe('rviz.launch.py'), **given)
    assert nodes.keys() == {'robot_state_publisher', 'static_transform_publisher', 'rviz2'}
    words = nodes['static_transform_publisher'].arguments
    assert words[words.index('--frame-id') + 1] == frame
    assert words[words.index('--child-frame-id') + 1] == f'{prefix}gears'
    robot = nodes['robot_state_publisher'].parameters[0]
    assert robot['frame_prefix'] == prefix
    assert ElementTree.fromstring(robot['robot_description']).get('name') == 'gear_rattle'
    file = Path(nodes['rviz2'].arguments[1])
    manager = yaml.safe_load(file.read_text())['Visualization Manager']
    file.unlink()
    assert manager['Global Options']['Fixed Frame'] == frame
    assert manager['Views']['Current']['Target Frame'] == frame
    assert topic in [each['Topic']['Value'] for each in manager['Displays'] if 'Topic' in each]
    gears, = (each for each in manager['Displays'] if each['Class'].endswith('/RobotModel'))
    assert gears['TF Prefix'] == prefix.rstrip('/')


def test_yaml_files_lead_to_the_same() -> None:
    """Their names remain, and the arguments are where the nodes are."""
    for path in LAUNCH.glob('*.yaml'):
        include, = yaml.safe_load(path.read_text())['launch']
        assert include['include']['file'].endswith(f'/launch/{path.stem}.py')
        assert (LAUNCH / f'{path.stem}.py').is_file()
