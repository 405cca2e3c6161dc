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

"""The command `crisis`."""

from .. import options
from ..options import add, number, whole
from ..refusal import Parser
from ..run import Command


def _add_options(parser: Parser) -> None:
    options.add_model(parser, windows=((1.24, 1.25),), words=', on both sides of the crisis')
    parser.add_argument('--attractor', default='', metavar='KEY', help='the chaotic attractor '
                        'that ends, as `attractors` prints it; by default the first that does')
    add(parser, 'beyond', number, (4e-6, 4e-4),
        'distances from the crisis at which escapes are timed [1]', shown='4e-6 4e-4')
    add(parser, 'rates', whole(4), 20, 'number of places at which they are')
    add(parser, 'escapes', whole(16), 80, 'escapes timed at each')
    add(parser, 'skip', whole(0), 300, 'escapes before this do not count [impacts]')
    add(parser, 'limit', whole(1000), 50_000_000, 'impacts after which a trajectory is given up',
        shown='5e7')
    # Off the walls hardly a trajectory sticks: those that do all go on as one.
    options.add_plane(parser, displacement=-0.5)
    options.add_seed(parser)


main = Command('crisis', 'Locate the crisis of a chaotic attractor, by the tangency of manifolds '
               'and by escape rates; name the orbit that it collides with.', _add_options)
