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

"""The command `lifetimes`."""

from .. import options
from ..refusal import Parser
from ..run import Command
from ...core import defaults


def _add_options(parser: Parser) -> None:
    options.add_model(parser, alpha=1.244)
    options.add_grid(parser, defaults.LIFETIMES_CAP)
    options.add_search(parser, hold=defaults.LIFETIMES_HOLD,
                       initial_conditions=defaults.LIFETIMES_INITIAL_CONDITIONS)
    parser.add_argument('--tail', type=options.whole(0), metavar='N',
                        help='impacts from which lifetimes are exponential; a tenth of the cap by '
                             'default')
    parser.add_argument('--grey', action='store_const', const='paper', dest='colours',
                        help="the same as --colours paper: the paper's linear grey scale")


main = Command('lifetimes', 'Find how long every initial condition of a grid is transient. Chaos '
               'counts as transient: only an orbit or rest ends it.', _add_options)
