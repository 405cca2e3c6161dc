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


"""The command `probability_basins`."""

from .hopping import add_kind
from .. import options
from ..options import add, number, whole
from ..refusal import Parser
from ..run import Command


def _add_options(parser: Parser) -> None:
    options.add_model(parser)
    add(parser, 'noise', number, 0.01, 'standard deviation of the noise [1]')
    add_kind(parser)
    add(parser, 'impacts', whole(1), 100, 'impacts of every trajectory')
    add(parser, 'trajectories', whole(1), 20, 'trajectories of every cell')
    options.add_plane(parser, size=200)
    options.add_search(parser)


main = Command(
    'probability_basins',
    'Find with which probability noise brings every initial condition to each attractor.',
    _add_options)
