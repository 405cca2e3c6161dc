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

"""The command `motion`."""

from .. import options
from ..options import add, whole
from ..refusal import Parser
from ..run import Command


def _add_options(parser: Parser) -> None:
    options.add_model(parser)
    parser.add_argument('--attractor', default='', metavar='NAME', help='its key, or its letter '
                        'in the paper; the one that is reached most often by default')
    options.add_initial(parser)
    add(parser, 'skip', whole(0), 0, 'impacts passed over')
    add(parser, 'periods', whole(1), 8, 'drive periods that follow')
    options.add_plane(parser)
    options.add_search(parser)


main = Command('motion', 'Sample the motion of an attractor, or from an initial condition, '
               'between the walls.', _add_options)
