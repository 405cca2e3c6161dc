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


"""The command `drift`."""

from .. import options
from ..options import add, number, whole
from ..refusal import Parser
from ..run import Command


def _add_options(parser: Parser) -> None:
    options.add_model(parser, alpha=0.51)
    add(parser, 'to', number, 0.56, 'amplitude of the drive at which the ramps end [1]')
    parser.add_argument('--rates', type=number, nargs='+', metavar='X',
                        default=[1e-4, 3e-5, 1e-5, 3e-6],
                        help='changes of alpha in a drive period [1]; 1e-4 3e-5 1e-5 3e-6 by '
                        'default')
    parser.add_argument('--attractor', default='', metavar='KEY',
                        help='key or letter of the attractor from which they begin; by default '
                        'the one that most initial conditions reach')
    add(parser, 'window', whole(1), 200, 'impacts of a finite-time exponent')
    options.add_plane(parser)
    options.add_search(parser)


main = Command('drift', 'Ramp alpha at some rates: exponents along the ramps, and how late '
               'orbits change.', _add_options)
