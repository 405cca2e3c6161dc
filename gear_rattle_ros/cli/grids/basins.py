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

"""The command `basins`."""

import argparse
from typing import TYPE_CHECKING

from .. import options
from ..options import add, number, whole
from ..refusal import Parser
from ..run import Command
from ...core.defaults import BASINS_CAP

if TYPE_CHECKING:
    from ...attractors.plane import Plane


def _add_options(parser: Parser) -> None:
    options.add_model(parser)
    options.add_grid(parser, BASINS_CAP)
    options.add_search(parser)
    add(parser, 'zoom-levels', whole(1), 1, 'successive magnifications, each a store of its own')
    parser.add_argument('--zoom-at', type=number, nargs=2, default=[None, None],
                        metavar=('PHASE', 'VELOCITY'), help='point that stays where it is; on a '
                        'strobe its displacement and velocity')
    add(parser, 'zoom-factor', number, 10.0, 'how many times smaller each window is')


def _planes(given: argparse.Namespace) -> 'list[Plane]':
    from ...studies.grids.basins import magnifications
    across, velocity = given.zoom_at
    return magnifications(options.plane_of(given), given.zoom_levels, across, velocity,
                          given.zoom_factor)


main = Command('basins', 'Find on which attractor every initial condition of a grid settles.',
               _add_options, planes=_planes)
