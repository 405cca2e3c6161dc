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

"""The command `manifolds`."""

from .. import options
from ..options import add, number, whole
from ..refusal import Parser
from ..run import Command
from ...core.defaults import BASINS_CAP


def _add_options(parser: Parser) -> None:
    options.add_model(parser)
    add(parser, 'length', number, 200.0, 'length of each side of a manifold [1]')
    add(parser, 'precision', number, 1e-3, 'distance between neighbours times the angle between '
        'them at most [1]')
    parser.add_argument('--orbit', metavar='KEY', help='key of the saddle, such as '
                        'orbit-2-1-U5.1744+0.8226; of a stable orbit, that of the saddle that was '
                        'born with it')
    parser.add_argument('--point', type=number, nargs=3, metavar=('WALL', 'PHASE', 'VELOCITY'),
                        help='an impact near the saddle: wall 0 (upper) or 1 (lower), drive phase '
                        '[rad], velocity before it [1]')
    parser.add_argument('--period', type=whole(1), metavar='N',
                        help='impacts of a period of the orbit near the --point; that of the '
                        'nearest one by default')
    parser.add_argument('--touch', type=number, nargs=2, metavar=('A', 'B'),
                        help='find the value between these at which the manifolds first touch, '
                        'where the boundary becomes fractal')
    options.add_along(parser, 'touch')
    options.add_grid(parser, BASINS_CAP)
    options.add_search(parser)


main = Command('manifolds', 'Draw the stable and unstable manifolds of a saddle over the basins.',
               _add_options,
               keywords=lambda given: {'touch': options.path_along(given, given.touch)})
