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

"""The command `parameter_plane`."""

from .. import options
from ..options import add, whole
from ..refusal import Parser
from ..run import Command


def _add_options(parser: Parser) -> None:
    options.add_model(parser, windows=((0.2, 1.8),), about='Two options take a window, by default '
                      '--alpha 0.2 1.8 --gamma 0 0.4; the others a value.')
    parser.set_defaults(gamma=((0.0, 0.4),))
    parser.add_argument('--size', type=whole(1), nargs='+', default=[400], metavar='N',
                        help='cells along both parameters, N or N M; 400 400 by default')
    add(parser, 'initial-conditions', whole(1), 4, 'initial conditions of every cell')
    add(parser, 'skip', whole(1), 1000, 'impacts passed over where nothing settles')
    add(parser, 'keep', whole(1024), 1024, 'impacts of each trajectory measured after that')
    add(parser, 'curves', whole(0), 0, 'orbits, those of most cells, whose folds, doublings and '
        'grazings are followed through the plane')
    options.add_plane(parser)
    options.add_seed(parser)


main = Command('parameter_plane', 'Find what the gear does over two parameters: periods, the '
               'largest exponent, how many attractors, rest, which walls are in contact; and the '
               'curves on which orbits change.', _add_options)
