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


"""The command `orbits`."""

from .. import options
from ..options import add, whole
from ..refusal import Parser
from ..run import Command
from ...core.defaults import BASINS_CAP


def _add_options(parser: Parser) -> None:
    options.add_model(parser)
    add(parser, 'impacts', whole(1), 8, 'impacts of the longest orbits')
    add(parser, 'points', whole(1), 16_384, 'points of the section from which orbits are sought, '
        'at the most')
    options.add_grid(parser, BASINS_CAP)
    options.add_search(parser)


main = Command('orbits', 'Find all periodic orbits up to a number of impacts, stable or not.',
               _add_options)
