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


"""The command `stability`."""

import argparse
import dataclasses

from .. import options
from ..options import add, MODEL, number, whole
from ..refusal import Parser
from ..run import Command
from ...core.defaults import BASINS_CAP


def _jump(text: str) -> tuple[str, float]:
    name, _, value = text.rpartition('=')
    if (name or MODEL[0]) not in MODEL:
        raise argparse.ArgumentTypeError(f'{text!r} is not one of {", ".join(MODEL)} with a value')
    return name or MODEL[0], number(value)


def _add_options(parser: Parser) -> None:
    options.add_model(parser)
    options.add_grid(parser, BASINS_CAP, 200, 'impact')
    options.add_search(parser, initial_conditions=10_000)
    add(parser, 'reach', number, 2.0, 'largest kick that is tried [1]')
    parser.add_argument('--to', type=_jump, nargs='+', metavar='NAME=X',
                        help='parameters that jump, such as gamma=0.2, a number alone being of '
                        'alpha: where trajectories go then')
    parser.add_argument('--erosion', type=number, nargs=2, metavar=('A', 'B'),
                        help='window in which shares and smallest kicks are followed')
    options.add_along(parser, 'erosion')
    add(parser, 'columns', whole(2), 41, 'values in that window')
    add(parser, 'trajectories', whole(1), 2000, 'random initial conditions at each of them')
    parser.add_argument('--omega', type=number, metavar='X',
                        help='angular frequency of the drive [rad/s]: times are in seconds, too')


main = Command('stability', 'Find how far attractors are from being left: basin stability, '
               'settling times, smallest kicks, discs, erosion, tipping.', _add_options,
               keywords=lambda given: {
                   'erosion': options.path_along(given, given.erosion),
                   'to': dataclasses.replace(options.model_of(given), **dict(given.to))
                   if given.to else None})
