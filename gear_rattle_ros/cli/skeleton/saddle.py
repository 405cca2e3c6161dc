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

"""The command `saddle`."""

from .. import options
from ..options import add, whole
from ..refusal import Parser
from ..run import Command
from ...core import defaults


def _add_options(parser: Parser) -> None:
    options.add_model(parser)
    parser.add_argument('--transient', action='store_true', help='follow the chaotic saddle of '
                        'a transient, by lifetimes; by default the boundary of all basins, by '
                        'labels')
    add(parser, 'straddled', whole(100), 2000, 'impacts of the straddle trajectories')
    add(parser, 'sprinkled', whole(100), 20_000, 'initial conditions sprinkled about them')
    options.add_initial(parser)
    options.add_plane(parser)
    options.add_search(parser, hold=defaults.LIFETIMES_HOLD)


main = Command('saddle', 'Follow the edge state on the boundary of basins, or the chaotic saddle '
               'of a transient; find its escape rate, exponents, dimensions and orbits.',
               _add_options)
