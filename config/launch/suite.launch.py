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
The whole suite: simulator, analyses, basins, recorder and viewer.

    ros2 launch gear_rattle_ros suite.launch.py alpha:=1.23 output:=my_bag save:=my_run.rrd

The status is 1 where a node ends that the run cannot do without, or one refuses its parameters.
"""

import functools
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node

PACKAGE = 'gear_rattle_ros'
# Parameters of the simulator with arguments of the same names, and their types.
SIMULATOR = {
    'alpha': (float, 'Amplitude of the drive [1].'),
    'beta': (float, 'Damping [1].'),
    'gamma': (float, 'Constant load [1].'),
    'restitution': (float, 'Coefficient of restitution [1].'),
    'noise': (float, 'Standard deviation of a Gaussian kick at every impact [1].'),
    'seed': (int, 'Seed of the noise.'),
    'rate': (float, 'Drive periods per second; 0 = as fast as the readers keep up.'),
    'initial_phase': (float, 'Initial drive phase [rad].'),
    'initial_displacement': (float, 'Initial displacement [1], -1 to 0.'),
    'initial_velocity': (float, 'Initial velocity [1].'),
    'scene': (str, 'Situation of the paper to be played, such as hysteresis.'),
}
OTHERS = (
    ('parameters', '', 'Parameter file; empty = config/suite.yaml of the package, of which a '
     'scene replaces what it has for the simulator.', None),
    ('namespace', '', 'Namespace of all nodes; empty = none.', None),
    ('frame', '', 'Frame of the section; empty = section in the namespace.', None),
    ('use_sim_time', 'false', 'Whether the simulator publishes its time on /clock and all nodes '
     'follow it.', ['true', 'false']),
    ('output', '', 'Bag directory to create; empty = rosbag2_<date and time> in this folder.',
     None),
    ('basin', 'true', 'Whether the basins are computed.', ['true', 'false']),
    ('hold', '', 'Unstable orbit to hold: its key, a letter or its number of impacts; empty = '
     'none.', None),
    ('viewer', 'auto', 'Viewer: native, web (on 127.0.0.1), none, or auto.',
     ['auto', 'native', 'web', 'none']),
    ('save', '', 'Rerun file (.rrd) to write; empty = none.', None),
)
# Without them there is no run.
REQUIRED = ('simulator', 'recorder')
# What a node ends with when its user has to fix something.
REFUSED = 2


def ended(name, event, context):
    """End the launch with status 1, which it has where a handler raises an error."""
    if not context.is_shutdown and (name in REQUIRED or event.returncode == REFUSED):
        raise RuntimeError(f'{name} has ended with status {event.returncode}; all nodes are ended')


def typed(name, text):
    """Return the value of an argument that is a parameter of the simulator."""
    kind = SIMULATOR[name][0]
    try:
        return kind(text)
    except ValueError:
        wanted = 'a whole number' if kind is int else 'a number'
        raise RuntimeError(f'{name}:={text} is not {wanted}') from None


def nodes(context):
    """Return the nodes that the arguments ask for; the simulator waits for its readers."""
    given = context.launch_configurations
    file = Path(given['parameters'] or Path(
        get_package_share_directory(PACKAGE), 'config', 'suite.yaml'))
    if not file.is_file():
        raise RuntimeError(f'parameters:={file} is not a file')
    own = {'lyapunov': {}, 'transients': {}, 'recorder': {'output': given['output']}}
    if given['basin'] == 'true':
        own['basin'] = {'frame': given['frame']}
    if given['hold']:
        own['control'] = {'orbit': given['hold']}
    if given['viewer'] != 'none' or given['save']:
        own['viewer'] = {'mode': given['viewer'], 'save': given['save']}
    follows_clock = {'use_sim_time': given['use_sim_time'] == 'true'}
    own['simulator'] = {
        'wait_for_readers': len(own), 'publish_clock': follows_clock['use_sim_time'],
        'frame': given['frame'], **{name: typed(name, given[name]) for name in SIMULATOR
                                    if given[name]}}
    # The values of a scene take the place of our own file's.
    without_file = {'simulator'} if given['scene'] and not given['parameters'] else set()
    return [
        Node(package=PACKAGE, executable=name, name=name, namespace=given['namespace'],
             output='screen', on_exit=functools.partial(ended, name),
             parameters=[*([] if name in without_file else [str(file)]), values | follows_clock])
        for name, values in own.items()]


def generate_launch_description():
    """Declare the arguments, and start the nodes when their values are known."""
    return LaunchDescription([
        *(DeclareLaunchArgument(
            name, default_value='',
            description=f'{meaning} Empty = as in the parameter file or the scene.')
            for name, (_, meaning) in SIMULATOR.items()),
        *(DeclareLaunchArgument(name, default_value=default, description=meaning, choices=choices)
          for name, default, meaning, choices in OTHERS),
        OpaqueFunction(function=nodes)])
