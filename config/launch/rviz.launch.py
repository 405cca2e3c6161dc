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

"""
RViz beside a running simulator: section, basin and gears.

    ros2 launch gear_rattle_ros rviz.launch.py namespace:=left

It needs the packages robot_state_publisher, rviz2 and tf2_ros of the ROS installation.
"""

from pathlib import Path
import re
import tempfile

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node

CONFIG = Path(get_package_share_directory('gear_rattle_ros'), 'config')


def named(text, namespace, frame):
    """Return a configuration of RViz with its topics and frames in a namespace."""
    text = re.sub(r'(Fixed Frame|Target Frame): section\b', rf'\1: {frame}', text)
    text = re.sub(r'Value: /', f'Value: {namespace}/', text)
    return text.replace('TF Prefix: ""', f'TF Prefix: "{namespace[1:]}"')


def nodes(context):
    """Return RViz and what gives it the gears, all in one namespace."""
    given = context.launch_configurations
    namespace = '/' + given['namespace'].strip('/') if given['namespace'].strip('/') else ''
    frame = given['frame'] or f'{namespace}/section'[1:]
    prefix = f'{namespace}/'[1:]
    config = given['config']
    if not config:
        with tempfile.NamedTemporaryFile('w', suffix='.rviz', delete=False) as file:
            own = (CONFIG / 'rviz' / 'gear_rattle.rviz').read_text(encoding='utf-8')
            file.write(named(own, namespace, frame))
        config = file.name
    gears = (CONFIG / 'urdf' / 'gears.urdf').read_text(encoding='utf-8')
    return [
        Node(package='robot_state_publisher', executable='robot_state_publisher',
             namespace=namespace,
             # It counts in simulated time, which may be slow.
             parameters=[{'robot_description': gears, 'frame_prefix': prefix,
                          'publish_frequency': 1000.0}]),
        # The gears stand above the section, in whose plane x is the phase and y the velocity.
        Node(package='tf2_ros', executable='static_transform_publisher', namespace=namespace,
             arguments=['--x', '3.1416', '--y', '3.2', '--frame-id', frame,
                        '--child-frame-id', f'{prefix}gears']),
        Node(package='rviz2', executable='rviz2', namespace=namespace,
             arguments=['-d', config])]


def generate_launch_description():
    """Declare the arguments, and start the nodes when their values are known."""
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value='', description=meaning) for name, meaning in (
            ('namespace', 'Namespace of the simulator; empty = none.'),
            ('frame', 'Frame of the section; empty = section in the namespace.'),
            ('config', 'RViz configuration; empty = that of the package.'))),
        OpaqueFunction(function=nodes)])
