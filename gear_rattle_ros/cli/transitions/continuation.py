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

"""The command `continuation`."""

from .. import options
from ..options import add, number, whole
from ..refusal import Parser
from ..run import Command
from ...core.defaults import HOLD


def _add_options(parser: Parser) -> None:
    options.add_model(parser, windows=((0.47, 0.60),))
    add(parser, 'columns', whole(2), 131, 'values, evenly spaced')
    add(parser, 'trajectories', whole(1), 256, 'trajectories at each value')
    add(parser, 'skip', whole(1), 4000, 'fewest impacts passed over where nothing settles')
    add(parser, 'keep', whole(1), 512, 'impacts kept after that')
    add(parser, 'tolerance', number, 1e-7, 'accuracy of the ends of chaos [1]')
    add(parser, 'hold', whole(256), HOLD,
        'a chaotic attractor lasts where trajectories stay for this number of impacts')
    parser.add_argument('--boundary', action='store_true', help='measure the boundary between the '
                        'basins at each value, too: about a second each')
    parser.add_argument('--kicks', action='store_true',
                        help='carry the smallest kick that changes each attractor along')
    options.add_plane(parser)
    options.add_seed(parser)


main = Command('continuation', 'Follow attractors and their shares against a parameter; locate '
               'where they are born, double and end.', _add_options,
               keywords=options.hold_of)
