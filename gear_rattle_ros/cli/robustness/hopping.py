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


"""The command `hopping`."""

from .. import options
from ..options import add, number, whole
from ..refusal import Parser
from ..run import Command


def _add_options(parser: Parser) -> None:
    options.add_model(parser)
    parser.add_argument('--noise', type=number, nargs='+', metavar='X',
                        default=[0.01, 0.015, 0.02, 0.03],
                        help='standard deviations of the noise [1]; 0.01 0.015 0.02 0.03 by '
                        'default')
    add_kind(parser)
    add(parser, 'impacts', whole(1), 200_000, 'impacts of a trajectory at the most')
    add(parser, 'trajectories', whole(1), 64, 'trajectories at each strength')
    add(parser, 'stays', whole(1), 200, 'stays with which a trajectory ends')
    add(parser, 'smallest', whole(0), 0, 'look for the smallest strength that makes a '
        'trajectory hop within this number of impacts; 0 = do not')
    options.add_plane(parser)
    options.add_search(parser)


def add_kind(parser: Parser) -> None:
    parser.add_argument('--kind', choices=('gaussian', 'uniform', 'jitter'), default='gaussian',
                        help='kicks at impacts, Gaussian or uniform, or jitter of alpha from one '
                        'drive period to the next; gaussian by default')


main = Command(
    'hopping', 'Count the hops between attractors by noise, and measure how long trajectories '
    'stay on each.', _add_options)
