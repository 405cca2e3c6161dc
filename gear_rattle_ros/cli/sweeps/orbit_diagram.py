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

"""The command `orbit_diagram`."""

from .. import options
from ..options import add, number, whole
from ..refusal import Parser
from ..run import Command

SWEEPS = ('random', 'up', 'down')


def _add_options(parser: Parser) -> None:
    options.add_model(parser, windows=((0.47, 0.60),))
    add(parser, 'columns', whole(2), 780, 'number of values, evenly spaced')
    add(parser, 'bins', whole(1), 900, 'bins of the velocity')
    add(parser, 'bin-window', number, (-1.5, 1.5), 'velocities counted [1]')
    add(parser, 'hold', whole(1000), 10_000, 'impacts after which a trajectory is unsettled; in '
        '32 times as many nothing may leave a chaotic attractor')
    add(parser, 'skip', whole(1), 5000, 'fewest impacts passed over where nothing settles')
    add(parser, 'keep', whole(1), 2048, 'impacts of each trajectory counted after that')
    add(parser, 'trajectories', whole(1), 32, 'trajectories at each value')
    # The random ones were called starts.
    parser.add_argument('--sweep', dest='sweeps', nargs='+', choices=SWEEPS, default=SWEEPS,
                        type=lambda text: 'random' if text == 'starts' else text,
                        help='random initial conditions at each value, or followed up and down; '
                        'all by default')
    options.add_plane(parser)
    options.add_seed(parser)


main = Command('orbit_diagram', 'Count impact velocities against a parameter, from many initial '
               'conditions and followed up and down, with the largest exponent.',
               _add_options, keywords=options.hold_of)
