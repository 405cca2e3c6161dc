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

import argparse
from typing import Any

from . import options
from .options import add, number, whole
from .refusal import Parser
from .run import Command
from ..core import defaults


def _add_options(parser: Parser) -> None:
    group = parser.add_argument_group('model: two parameters with a window, alpha and gamma by '
                                      'default')
    for name, value, words in (
            ('alpha', (0.2, 1.8), 'amplitude of the drive'), ('beta', defaults.BETA, 'damping'),
            ('gamma', (0.0, 0.4), 'constant load'),
            ('restitution', defaults.RESTITUTION, 'coefficient of restitution')):
        shown = value if isinstance(value, float) else '{:g} {:g}'.format(*value)
        group.add_argument(f'--{name}', type=number, nargs='+', default=value, metavar='X',
                           help=f'{words} [1], a value or a window; {shown} by default')
    parser.add_argument('--size', type=whole(1), nargs='+', default=[400], metavar='N',
                        help='cells along both parameters, N or N M; 400 400 by default')
    add(parser, 'initial-conditions', whole(1), 4, 'initial conditions of every cell')
    add(parser, 'skip', whole(1), 1000, 'impacts passed over where nothing settles')
    add(parser, 'keep', whole(1024), 1024, 'impacts of each trajectory measured after that')
    options.add_plane(parser)
    options.add_seed(parser)


def _keywords(given: argparse.Namespace) -> dict[str, Any]:
    windows = {}
    for name in ('alpha', 'beta', 'gamma', 'restitution'):
        value = getattr(given, name)
        if not isinstance(value, float) and len(value) > 1:
            if len(value) > 2:
                raise ValueError(f'--{name} takes one or two numbers, not {len(value)}')
            windows[name] = tuple(value)
    return {'windows': windows}


main = Command('parameter_plane', 'Find what the gear does over two parameters: periods, the '
               'largest exponent, how many attractors, rest, which walls are in contact.',
               _add_options, keywords=_keywords)
